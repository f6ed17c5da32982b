#include "run/regions.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "align/cut_region.h"
#include "files/constraints_file.h"
#include "files/project_columns.h"
#include "geometry/affine.h"

/* Carried constraints do not fit if the region misses the surface by more than this, in radii ...
 */
static const double most_miss = 0.05;
/* ... or its share of the surface is another by this factor. */
static const double most_growth = 1.5;

/* ---- whose they are ---- */

/* Takes over path. */
static apsm_status take(apsm_run *run, groom_inputs *in, size_t i, char *path)
{
    if (!path) return APSM_ERR_MEMORY;
    free(in->limits[i]);
    in->limits[i] = path;
    apsm_region_free(&in->region[i]);
    return apsm_constraints_read(run->ctx, path, &in->region[i]);
}

/* Constraints that stand in the column, which the project that is written names by a file. */
static apsm_status take_text(apsm_run *run, groom_inputs *in, size_t i, const char *key,
                             const char *text)
{
    char stored[APSM_CONSTRAINTS_NAME];
    apsm_constraints_name(in->list.cases[i].name, key, stored);
    free(in->limits[i]);
    in->limits[i] = strdup(stored);
    if (!in->limits[i]) return APSM_ERR_MEMORY;
    return apsm_constraints_parse(run->ctx, stored, text, &in->region[i]);
}

static apsm_status take_columns(apsm_run *run, groom_inputs *in, const apsm_project *source)
{
    char key[APSM_KEY_LENGTH];
    apsm_project_key(source, "constraints_", key);
    for (size_t i = 0; i < in->list.n; i++) {
        const size_t k = apsm_project_find(source, in->list.cases[i].name);
        const char *text = k < source->n ? apsm_subject_column(&source->subjects[k], key) : NULL;
        if (apsm_constraints_are_here(text))
            APSM_TRY(take_text(run, in, i, key, text));
        else if (text && *text)
            APSM_TRY(take(run, in, i, apsm_project_path(source, text)));
    }
    return APSM_OK;
}

static apsm_status take_folder(apsm_run *run, groom_inputs *in, const char *folder)
{
    size_t taken = 0;
    for (size_t i = 0; i < in->list.n; i++) {
        char name[256];
        snprintf(name, sizeof name, "%s.json", in->list.cases[i].name);
        char *path = apsm_path_join(folder, name);
        if (!path) return APSM_ERR_MEMORY;
        if (!apsm_file_exists(path)) {
            free(path);
            continue;
        }
        APSM_TRY(take(run, in, i, path));
        taken++;
    }
    if (taken > 0) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_ARG,
                     "--constraints %s: holds no file that is called like a shape, such as %s.json",
                     folder, in->list.cases[0].name);
}

/* A file is of the shape that it is called like, or of the template. */
static apsm_status take_file(apsm_run *run, groom_inputs *in, const char *path)
{
    size_t owner;
    if (!apsm_file_exists(path))
        return apsm_fail(run->ctx, APSM_ERR_IO,
                         "--constraints %s: cannot be read: no such file or folder; check the name",
                         path);
    char *stem = apsm_path_stem(path), *own = stem ? strdup(path) : NULL;
    apsm_status status = own ? groom_inputs_template(run, in, &owner) : APSM_ERR_MEMORY;
    for (size_t i = 0; i < in->list.n && status == APSM_OK; i++)
        if (strcmp(in->list.cases[i].name, stem) == 0) owner = i;
    if (status == APSM_OK && owner >= in->list.n)
        status = apsm_fail(run->ctx, APSM_ERR_ARG,
                           "--constraints %s: is called like none of the %zu shapes; name the one "
                           "that it was made on with --template, or call the file like it",
                           path, in->list.n);
    free(stem);
    if (status == APSM_OK) return take(run, in, owner, own);
    free(own);
    return status;
}

static bool has_limits(const groom_inputs *in, size_t i)
{
    return in->limits && in->limits[i];
}

static size_t count_limits(const groom_inputs *in)
{
    size_t n = 0;
    for (size_t i = 0; i < in->list.n; i++) n += has_limits(in, i);
    return n;
}

apsm_status regions_list(apsm_run *run, groom_inputs *in, const apsm_project *source)
{
    const char *given = apsm_run_text(run, "constraints");
    in->limits = calloc(in->list.n, sizeof *in->limits);
    in->region = calloc(in->list.n, sizeof *in->region);
    if (!in->limits || !in->region) return APSM_ERR_MEMORY;
    if (source) APSM_TRY(take_columns(run, in, source));
    if (!*given) return APSM_OK;
    return apsm_is_folder(given) ? take_folder(run, in, given) : take_file(run, in, given);
}

/* ---- cutting ---- */

typedef struct cutting {
    apsm_run *run;
    const groom_inputs *in;
    const apsm_alignment *alignment;
    size_t from;         /* whose constraints are carried */
    apsm_mesh from_mesh; /* its whole surface in the world, and ... */
    double *from_field;  /* ... where its constraints leave it */
    apsm_mesh *part;
    double *share;
    double *miss; /* of carried ones */
} cutting;

static apsm_status copy_in_world(const cutting *c, size_t i, apsm_mesh *mesh)
{
    APSM_TRY(apsm_mesh_copy(&c->in->mesh[i], mesh));
    apsm_mesh_transform(mesh, c->alignment->sized + 16 * i);
    return APSM_OK;
}

/* Constraints lie in the frame of the input. */
static apsm_status own_field(apsm_context *ctx, const cutting *c, size_t i, double *field)
{
    apsm_mesh mesh;
    double back[16];
    APSM_TRY(apsm_affine_invert(c->in->reflection[i], back));
    APSM_TRY(apsm_mesh_copy(&c->in->mesh[i], &mesh));
    apsm_mesh_transform(&mesh, back);
    const apsm_status status = apsm_region_field(&c->in->region[i], &mesh, field);
    apsm_mesh_free(&mesh);
    if (status != APSM_ERR_GEOMETRY) return status;
    return apsm_fail(ctx, status,
                     "%s: its boundaries do not part the surface of %s; they have to be closed and "
                     "to lie on it",
                     c->in->limits[i], c->in->list.cases[i].name);
}

static apsm_status carried_field(const cutting *c, size_t i, double *field)
{
    apsm_mesh mesh;
    apsm_carried carried = { 0 };
    APSM_TRY(copy_in_world(c, i, &mesh));
    const apsm_status status =
        apsm_carry_field(&c->from_mesh, c->from_field, &mesh, field, &carried);
    apsm_mesh_free(&mesh);
    c->miss[i] = carried.miss;
    return status;
}

static apsm_status cut_task(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const cutting *c = user;
    const groom_inputs *in = c->in;
    const apsm_mesh *whole = &in->mesh[i];
    double *field = malloc(whole->nv * sizeof *field + 1);
    if (!field) return APSM_ERR_MEMORY;
    apsm_status status =
        has_limits(in, i) ? own_field(ctx, c, i, field) : carried_field(c, i, field);
    if (status == APSM_OK)
        status = apsm_cut_region(ctx, in->list.cases[i].path, whole, field, &in->options,
                                 &c->part[i], &c->share[i], &in->report[i]);
    free(field);
    return status;
}

/* The first that has some, or the template that was named. */
static apsm_status begin_carrying(cutting *c)
{
    const groom_inputs *in = c->in;
    size_t named;
    APSM_TRY(groom_inputs_template(c->run, in, &named));
    while (!has_limits(in, c->from)) c->from++;
    if (named < in->list.n && has_limits(in, named)) c->from = named;
    const size_t lacking = in->list.n - count_limits(in);
    if (lacking == 0) return APSM_OK;
    apsm_log(c->run->ctx, APSM_LOG_INFO,
             "%zu of %zu shapes have no constraints: those of %s are carried to them by "
             "registration",
             lacking, in->list.n, in->list.cases[c->from].name);
    c->from_field = malloc(in->mesh[c->from].nv * sizeof *c->from_field);
    if (!c->from_field) return APSM_ERR_MEMORY;
    APSM_TRY(own_field(c->run->ctx, c, c->from, c->from_field));
    return copy_in_world(c, c->from, &c->from_mesh);
}

/* The parts take the places of the whole surfaces. */
static apsm_status hand_over(cutting *c, groom_inputs *in)
{
    in->whole = calloc(in->list.n, sizeof *in->whole);
    in->kept = calloc(in->list.n, sizeof *in->kept);
    if (!in->whole || !in->kept) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < in->list.n; i++) {
        APSM_TRY(groom_inputs_store(c->run->ctx, in, &c->part[i]));
        in->whole[i] = in->mesh[i];
        in->mesh[i] = c->part[i];
        c->part[i] = (apsm_mesh){ 0 };
        in->kept[i] = c->share[i];
    }
    return APSM_OK;
}

static void tell(const cutting *c)
{
    const groom_inputs *in = c->in;
    const double usual = c->share[c->from];
    double sum = 0.0;
    for (size_t i = 0; i < in->list.n; i++) {
        const double growth = c->share[i] / usual;
        sum += c->share[i];
        if (has_limits(in, i)) continue;
        if (c->miss[i] > most_miss || growth > most_growth || growth < 1.0 / most_growth)
            apsm_log(c->run->ctx, APSM_LOG_WARNING,
                     "%s: the constraints of %s do not fit it (they miss its surface by %.2g radii "
                     "and leave %.2g of it instead of %.2g); give it some of its own",
                     in->list.cases[i].name, in->list.cases[c->from].name, c->miss[i], c->share[i],
                     usual);
    }
    apsm_log(c->run->ctx, APSM_LOG_INFO,
             "constraints leave %.0f %% of the surfaces on average; only that counts from here on",
             100.0 * sum / (double)in->list.n);
}

apsm_status groom_cut_regions(apsm_run *run, groom_inputs *in, const apsm_alignment *alignment,
                              bool *cut)
{
    const size_t n = in->list.n;
    *cut = in->limits && count_limits(in) > 0;
    if (!*cut) return APSM_OK;
    cutting c = { .run = run, .in = in, .alignment = alignment };
    c.part = calloc(n, sizeof *c.part);
    c.share = calloc(n, sizeof *c.share);
    c.miss = calloc(n, sizeof *c.miss);
    apsm_status status = c.part && c.share && c.miss ? begin_carrying(&c) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_parallel_for(run->ctx, n, cut_task, &c, NULL);
    if (status == APSM_OK) status = hand_over(&c, in);
    if (status == APSM_OK) tell(&c);
    for (size_t i = 0; c.part && i < n; i++) apsm_mesh_free(&c.part[i]);
    apsm_mesh_free(&c.from_mesh);
    free(c.from_field);
    free(c.part);
    free(c.share);
    free(c.miss);
    return status;
}
