#include "run/crop_ends.h"

#include <stdlib.h>
#include <string.h>

#include "align/common_ends.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "session/manifest.h"

/* More than this share of its surface no shape gives away. */
static const double most_loss = 0.7;

typedef struct cropping {
    apsm_run *run;
    const groom_inputs *in;
    const apsm_alignment *alignment;
    const apsm_common_ends *ends;
    apsm_mesh *mesh;     /* the cropped ones */
    apsm_status *status; /* of each */
    char **problem;      /* the line of a failure, or NULL */
} cropping;

static const char *name_of(const groom_inputs *in, size_t i)
{
    return in->list.cases[i].name;
}

static apsm_status crop_task(apsm_context *ctx, size_t i, int worker, void *user)
{
    const cropping *c = user;
    double plane[APSM_MOST_ENDS][4];
    (void)worker;
    apsm_common_ends_planes(c->ends, c->alignment->sized + 16 * i, plane);
    c->status[i] = apsm_crop_mesh(ctx, c->in->list.cases[i].path, &c->in->mesh[i], c->ends->n,
                                  (const double(*)[4])plane, &c->in->options, &c->mesh[i]);
    if (c->status[i] == APSM_OK) return APSM_OK;
    if (c->status[i] == APSM_ERR_MEMORY || c->status[i] == APSM_ERR_INTERRUPTED)
        return c->status[i];
    return apsm_text_set(&c->problem[i], apsm_error_text(ctx));
}

static apsm_status store_task(apsm_context *ctx, size_t i, int worker, void *user)
{
    const cropping *c = user;
    (void)worker;
    return groom_inputs_replace(ctx, c->in, i, &c->mesh[i]);
}

/* ---- what is told ---- */

static apsm_status remember(apsm_run *run, const groom_inputs *in, const apsm_common_ends *ends)
{
    json_t *list = json_array();
    for (size_t k = 0; k < ends->n; k++) {
        const apsm_common_end *e = &ends->end[k];
        json_array_append_new(list,
                              json_pack("{s:I, s:s, s:f}", "cut", (json_int_t)e->cut, "shortest",
                                        name_of(in, e->shortest), "apart", e->apart));
    }
    return manifest_set_cropped(run, json_pack("{s:o, s:f, s:f, s:f, s:s}", "ends", list,
                                               "mean_loss", ends->mean_loss, "next_loss",
                                               ends->next_loss, "most_loss", ends->most_loss,
                                               "loser", name_of(in, ends->loser)));
}

static void tell(apsm_run *run, const groom_inputs *in, const apsm_common_ends *ends)
{
    for (size_t k = 0; k < ends->n; k++)
        apsm_log(
            run->ctx, APSM_LOG_WARNING,
            "%zu of %zu shapes were cut off at one end, by the edge of an image perhaps; all are "
            "cropped there to what %s, the shortest, holds, and lose %.0f %% of their surface "
            "on average, %s %.0f %% (without the shortest: %.0f %% on average); leave short ones "
            "out with --exclude, or keep ends as they are with --cuts keep",
            ends->end[k].cut, in->list.n, name_of(in, ends->end[k].shortest),
            100.0 * ends->mean_loss, name_of(in, ends->loser), 100.0 * ends->most_loss,
            100.0 * ends->next_loss);
}

/* Few shapes are worth leaving out, but not what all others hold; and one end may be blunt. */
static void say_few(apsm_run *run, const groom_inputs *in, const apsm_common_ends *ends,
                    size_t enough)
{
    for (size_t k = 0; k < ends->n; k++)
        if (ends->end[k].cut < enough)
            apsm_log(run->ctx, APSM_LOG_WARNING,
                     "only %zu of %zu shapes, %s the shortest, look cut off at one end: nothing is "
                     "cropped there; if so, leave them out with --exclude, or crop all with --cuts "
                     "crop",
                     ends->end[k].cut, in->list.n, name_of(in, ends->end[k].shortest));
}

static apsm_status say_none(apsm_run *run)
{
    if (run->options.cuts.cuts == APSM_CUTS_CROP)
        apsm_log(run->ctx, APSM_LOG_WARNING,
                 "no end looks cut off: nothing is cropped, although --cuts crop asks for it");
    return APSM_OK;
}

/* ---- all shapes ---- */

static apsm_status keep(apsm_run *run, const groom_inputs *in, const apsm_common_ends *ends,
                        const char *why)
{
    apsm_log(run->ctx, APSM_LOG_WARNING,
             "shapes were cut off at different places (the shortest is %s) and are not cropped to "
             "what all of them hold, because %s; leave short ones out with --exclude",
             name_of(in, ends->end[0].shortest), why);
    return APSM_OK;
}

static apsm_status crop_all(cropping *c, bool *cropped)
{
    const size_t n = c->in->list.n;
    APSM_TRY(apsm_parallel_for(c->run->ctx, n, crop_task, c, NULL));
    for (size_t i = 0; i < n; i++)
        if (c->problem[i]) return keep(c->run, c->in, c->ends, c->problem[i]);
    for (size_t i = 0; i < n; i++)
        c->in->cropped[i] =
            apsm_common_ends_loss(&c->in->mesh[i], c->alignment->sized + 16 * i, c->ends);
    APSM_TRY(apsm_parallel_for(c->run->ctx, n, store_task, c, NULL));
    *cropped = true;
    tell(c->run, c->in, c->ends);
    return remember(c->run, c->in, c->ends);
}

static apsm_status crop(apsm_run *run, groom_inputs *in, const apsm_alignment *alignment,
                        const apsm_common_ends *ends, bool *cropped)
{
    const size_t n = in->list.n;
    cropping c = { .run = run, .in = in, .alignment = alignment, .ends = ends };
    c.mesh = calloc(n, sizeof *c.mesh);
    c.status = calloc(n, sizeof *c.status);
    c.problem = calloc(n, sizeof *c.problem);
    const apsm_status status =
        c.mesh && c.status && c.problem ? crop_all(&c, cropped) : APSM_ERR_MEMORY;
    for (size_t i = 0; c.mesh && i < n; i++) apsm_mesh_free(&c.mesh[i]);
    for (size_t i = 0; c.problem && i < n; i++) free(c.problem[i]);
    free(c.mesh);
    free(c.status);
    free(c.problem);
    return status;
}

apsm_status groom_crop_ends(apsm_run *run, groom_inputs *in, const apsm_alignment *alignment,
                            bool *cropped)
{
    apsm_common_ends ends;
    const size_t n = in->list.n;
    *cropped = false;
    APSM_TRY(manifest_set_cropped(run, NULL));
    if (run->options.cuts.cuts == APSM_CUTS_KEEP) return APSM_OK;
    if (alignment->cuts == 0) return say_none(run);
    for (size_t i = 0; i < n; i++)
        if (in->report[i].openings > 0) return APSM_OK; /* open ends are ends, not lids */
    const apsm_mesh **meshes = calloc(n, sizeof *meshes);
    if (!meshes) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < n; i++) meshes[i] = &in->mesh[i];
    const size_t fifth = (n + 4) / 5, enough = fifth > 2 ? fifth : 2;
    apsm_find_common_ends(n, meshes, alignment, 1, &ends);
    if (ends.n > 0 && run->options.cuts.cuts == APSM_CUTS_AUTO) {
        const apsm_common_ends any = ends;
        apsm_find_common_ends(n, meshes, alignment, enough, &ends);
        if (ends.n < any.n) say_few(run, in, &any, enough);
    }
    free(meshes);
    if (ends.n == 0) return say_none(run);
    if (ends.most_loss > most_loss) return keep(run, in, &ends, "too little would be left");
    return crop(run, in, alignment, &ends, cropped);
}
