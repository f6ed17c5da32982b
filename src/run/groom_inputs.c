#include "run/groom_inputs.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "core/deal.h"
#include "files/stored.h"
#include "geometry/affine.h"
#include "geometry/stored.h"
#include "groom/handles.h"
#include "run/fixed.h"
#include "run/input_check.h"
#include "run/memory.h"
#include "run/regions.h"
#include "run/source.h"
#include "session/kept.h"

/* ---- which inputs ---- */

static apsm_status refuse_labels_of_meshes(const apsm_run *run, const groom_inputs *in)
{
    if (in->labels.n == 0 && in->labels.names == 0 && !in->labels.side) return APSM_OK;
    for (size_t i = 0; i < in->list.n; i++)
        if (in->list.cases[i].kind != APSM_INPUT_MESH) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_ARG,
                     "--label %s: all %zu inputs are meshes, which have no labels; drop the option",
                     apsm_run_text(run, "labels"), in->list.n);
}

static apsm_status list_files(apsm_run *run, apsm_input_list *list)
{
    const apsm_input_choice choice = { .n = run->n_inputs,
                                       .inputs = (const char *const *)run->inputs,
                                       .exclude = apsm_run_text(run, "exclude"),
                                       .reflect_match = apsm_run_text(run, "reflect_match"),
                                       .pattern = apsm_run_text(run, "pattern") };
    return apsm_input_choose(run->ctx, &choice, list);
}

apsm_status groom_inputs_list(apsm_run *run, groom_inputs *in)
{
    if (run_is_in_memory(run)) return memory_list(run, in);
    APSM_TRY(apsm_labels_parse(run->ctx, apsm_run_text(run, "labels"), &in->labels));
    APSM_TRY(source_read(run, &in->source, &in->own_source));
    const apsm_project *source = in->own_source ? &run->project : &in->source;
    if (source->root) {
        APSM_TRY(source_check(run, source, &in->ignored));
        APSM_TRY(source_list(run, source, &in->list));
    } else {
        APSM_TRY(list_files(run, &in->list));
    }
    APSM_TRY(apsm_input_check_stored(run->ctx, run->folder, &in->list));
    APSM_TRY(
        regions_list(run, in, source->root && !source_ignores(run, "constraints") ? source : NULL));
    APSM_TRY(fixed_find(run, in, source->root ? source : NULL, source_ignores(run, "fixed")));
    return refuse_labels_of_meshes(run, in);
}

apsm_status groom_inputs_template(apsm_run *run, const groom_inputs *in, size_t *index)
{
    const char *name = apsm_run_text(run, "template");
    *index = APSM_TEMPLATE_AUTO;
    if (!*name || strcmp(name, "auto") == 0) return APSM_OK;
    for (size_t i = 0; i < in->list.n; i++)
        if (strcmp(in->list.cases[i].name, name) == 0) return *index = i, APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_ARG,
                     "template '%s' is none of the %zu shapes; the first is called '%s'", name,
                     in->list.n, in->list.cases[0].name);
}

apsm_status groom_inputs_compare(apsm_run *run)
{
    if (run->n_inputs == 0) return input_check_resume(run, NULL);
    groom_inputs in = { 0 };
    apsm_status status = groom_inputs_list(run, &in);
    bool same = in.list.n == run->project.n;
    for (size_t i = 0; i < in.list.n && same; i++)
        same = apsm_project_find(&run->project, in.list.cases[i].name) < run->project.n;
    if (status == APSM_OK && !same)
        status = apsm_fail(run->ctx, APSM_ERR_STATE,
                           "%s: the run that --resume continues has other shapes (%zu) than these "
                           "inputs (%zu); name no inputs, or start anew with --overwrite",
                           run->folder, run->project.n, in.list.n);
    if (status == APSM_OK) status = input_check_resume(run, &in.list);
    groom_inputs_free(&in);
    return status;
}

/* ---- one shape ---- */

/* The texts move over. */
static void keep_texts(groom_inputs *in, size_t i, apsm_volume *v)
{
    free(in->notes[i]);
    free(in->picked[i]);
    in->notes[i] = v->notes;
    in->picked[i] = v->picked;
    v->notes = v->picked = NULL;
}

/* Groomed meshes are kept in single precision, as PLY has it: so far from the origin that its steps
 * show in the form, a shape would lose it. */
static apsm_status refuse_far(apsm_context *ctx, const char *path, const apsm_mesh *mesh)
{
    static const double most_step = 1e-4; /* of the diagonal */
    double lo[3], hi[3], size2 = 0, far = 0;
    apsm_mesh_bounds(mesh, lo, hi);
    for (int c = 0; c < 3; c++) {
        size2 += (hi[c] - lo[c]) * (hi[c] - lo[c]);
        far = fmax(far, fmax(fabs(lo[c]), fabs(hi[c])));
    }
    const double size = sqrt(size2);
    if (!isfinite(size) || !(size > 0) || far * (double)FLT_EPSILON <= most_step * size)
        return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                     "%s: is %.3g long and lies %.3g from the origin of its coordinates, too far "
                     "for single precision; move it nearer",
                     path, size, far);
}

/* Whatever the order of the axes in the file: the spacing that is unlike the other two, over their
 * mean; of 1, 2, 4 the largest. */
static double slice_gap(const double spacing[3])
{
    double least = INFINITY, most = 0, product = 1;
    for (int c = 0; c < 3; c++) {
        const double s = fabs(spacing[c]);
        least = fmin(least, s);
        most = fmax(most, s);
        product *= s;
    }
    const double middle = product / (least * most);
    return middle * middle > 1.001 * least * most ? least / sqrt(middle * most)
                                                  : most / sqrt(least * middle);
}

static apsm_status read_and_groom(apsm_context *ctx, const apsm_run *run, groom_inputs *in,
                                  size_t i)
{
    const apsm_input_case *c = &in->list.cases[i];
    apsm_mesh *out = &in->mesh[i];
    apsm_groom_report *r = &in->report[i];
    apsm_input_shape shape = { 0 };
    apsm_status status = run_is_in_memory(run) ? memory_read(ctx, run, i, &in->labels, &shape)
                                               : apsm_input_read(ctx, c, &in->labels, &shape);
    keep_texts(in, i, &shape.volume);
    if (status == APSM_OK)
        status = shape.is_mesh
                     ? apsm_groom_mesh(ctx, c->path, &shape.mesh, &in->options, out, r)
                     : groom_taken_segmentation(ctx, c->path, &shape.volume, &in->options, out, r);
    if (status == APSM_OK) status = refuse_far(ctx, c->path, out);
    in->is_mask[i] = !shape.is_mesh;
    const double *s = shape.volume.spacing;
    in->voxel[i] = shape.is_mesh ? 0 : cbrt(fabs(s[0] * s[1] * s[2]));
    in->slices[i] = shape.is_mesh ? 0 : slice_gap(s);
    apsm_input_shape_free(&shape);
    return status;
}

static void reflect(apsm_mesh *mesh, double M[16])
{
    apsm_reflect(mesh, M);
    for (size_t x = 0; x < 3 * mesh->nv; x++) mesh->V[x] = (double)(float)mesh->V[x];
}

apsm_status groom_inputs_store(apsm_context *ctx, const groom_inputs *in, apsm_mesh *mesh)
{
    array_list arrays = { 0 };
    mesh_arrays(mesh, &arrays);
    return in->store ? store_put(ctx, in->store, &arrays) : APSM_OK;
}

/* In the store a mesh can only be read, not changed. */
apsm_status groom_inputs_replace(apsm_context *ctx, const groom_inputs *in, size_t i,
                                 apsm_mesh *mesh)
{
    APSM_TRY(groom_inputs_store(ctx, in, mesh));
    run_free_mesh(&in->mesh[i], in->store != NULL);
    in->mesh[i] = *mesh;
    *mesh = (apsm_mesh){ 0 };
    return APSM_OK;
}

apsm_status groom_inputs_reflect(apsm_context *ctx, groom_inputs *in, size_t i)
{
    apsm_mesh mesh;
    APSM_TRY(apsm_mesh_copy(&in->mesh[i], &mesh));
    reflect(&mesh, in->reflection[i]);
    const apsm_status status = groom_inputs_replace(ctx, in, i, &mesh);
    apsm_mesh_free(&mesh);
    if (status == APSM_OK) in->reflected[i] = true;
    return status;
}

/* What groom_case needs. */
typedef struct groom_task {
    const apsm_run *run;
    groom_inputs *in;
} groom_task;

/* What the pieces of shape i are kept by: its content and, if it is groomed another time, how. */
static void content_key(const groom_inputs *in, size_t i, char key[65])
{
    char closing[APSM_NUMBER_LENGTH];
    unsigned char digest[32];
    apsm_sha256 sha;
    memcpy(key, in->sha256[i], 65);
    if (!in->again) return;
    apsm_format_number(in->options.closing, closing);
    apsm_sha256_begin(&sha);
    apsm_sha256_add(&sha, key, 64);
    apsm_sha256_add_text(&sha, closing);
    apsm_sha256_end(&sha, digest);
    apsm_sha256_hex(digest, key);
}

/* The mesh of shape i: kept from before an interruption, or made now and kept. */
static apsm_status take_or_groom(apsm_context *ctx, const groom_task *t, size_t i,
                                 apsm_status *lost)
{
    groom_inputs *in = t->in;
    const apsm_input_case *c = &in->list.cases[i];
    if (run_is_in_memory(t->run)) return read_and_groom(ctx, t->run, in, i);
    char key[65];
    if (!in->again) APSM_TRY(apsm_input_hash(ctx, c->path, in->sha256[i]));
    kept_groomed groomed = { 0 };
    content_key(in, i, key);
    *lost = kept_find_mesh(ctx, t->run, c, key, &in->mesh[i], &groomed);
    in->recalled[i] = in->mesh[i].V != NULL;
    in->report[i] = groomed.report;
    in->is_mask[i] = groomed.is_mask;
    in->voxel[i] = groomed.voxel;
    in->slices[i] = groomed.slices;
    free(in->notes[i]);
    free(in->picked[i]);
    in->notes[i] = groomed.notes;
    in->picked[i] = groomed.picked;
    if (*lost != APSM_OK || in->recalled[i]) return *lost;
    APSM_TRY(read_and_groom(ctx, t->run, in, i));
    groomed = (kept_groomed){ in->report[i], in->is_mask[i], in->voxel[i],
                              in->slices[i], in->notes[i],   in->picked[i] };
    return *lost = kept_add_mesh(ctx, t->run, c, key, &in->mesh[i], &groomed);
}

static apsm_status groom_case(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const groom_task *t = user;
    groom_inputs *in = t->in;
    apsm_status lost = APSM_OK; /* a failure that is not the shape's */
    const apsm_input_case *c = &in->list.cases[i];
    if (in->again && !in->again[i]) return APSM_OK;
    run_free_mesh(&in->mesh[i], in->store != NULL);
    apsm_affine_identity(in->reflection[i]);
    in->status[i] = take_or_groom(ctx, t, i, &lost);
    if (in->status[i] == APSM_OK && c->reflect) {
        reflect(&in->mesh[i], in->reflection[i]);
        in->reflected[i] = true;
    }
    if (in->status[i] == APSM_OK) in->status[i] = groom_inputs_store(ctx, in, &in->mesh[i]);
    if (in->status[i] == APSM_OK) return APSM_OK;
    apsm_mesh_free(&in->mesh[i]);
    if (lost != APSM_OK) return lost;
    const char *line = apsm_error_text(ctx);
    return apsm_text_set(&in->problem[i], *line ? line : apsm_status_text(in->status[i]));
}

/* Whether a label is the same thing in all shapes. */
static apsm_status compare_picked(apsm_run *run, const groom_inputs *in)
{
    const char **names = malloc(in->list.n * sizeof *names);
    if (!names) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < in->list.n; i++) names[i] = in->list.cases[i].name;
    apsm_labels_compare(run->ctx, in->list.n, names, (const char *const *)in->picked);
    free(names);
    return APSM_OK;
}

/* ---- handles, as the cohort sees them ---- */

/* Before they were mended. */
static long handles_of(const apsm_groom_report *r)
{
    return r->closing > 0.0 ? r->handles_before : r->genus;
}

/* Those of masks, before they were mended and after, into before and after; how many masks. */
static size_t list_handles(const groom_inputs *in, long *before, long *after)
{
    size_t n = 0;
    for (size_t i = 0; i < in->list.n; i++) {
        const apsm_groom_report *r = &in->report[i];
        if (in->status[i] != APSM_OK || !in->is_mask[i]) continue;
        before[n] = handles_of(r);
        after[n++] = r->genus;
    }
    return n;
}

static void tell_handles(const apsm_run *run, handles_kind kind, long common, size_t again)
{
    if (kind == HANDLES_ANATOMY)
        apsm_log(
            run->ctx, APSM_LOG_WARNING,
            "most masks have %ld handle%s: taken for anatomy and kept; the %zu where %s narrow "
            "and mended, as said above, get %s back",
            common, common == 1 ? "" : "s", again, common == 1 ? "it was" : "they were",
            common == 1 ? "it" : "them");
    else
        apsm_log(run->ctx, APSM_LOG_WARNING,
                 "masks have many handles, all narrow and from shape to shape others, as a "
                 "branched sinus has: all are closed by %g of their size; --closing 0 keeps the "
                 "handles, --closing with a number says how far to close",
                 handles_sinus_closing);
}

/* Which masks the cohort has groomed another time: those whose anatomy was mended away, or all. */
static size_t choose_again(groom_inputs *in, handles_kind kind, long common)
{
    size_t n = 0;
    for (size_t i = 0; i < in->list.n; i++) {
        const apsm_groom_report *r = &in->report[i];
        const bool mended = r->closed_voxels + r->cut_voxels > 0;
        const bool is_mask = in->status[i] == APSM_OK && in->is_mask[i];
        in->again[i] =
            is_mask && (kind == HANDLES_SINUS || (mended && r->handles_before == common));
        n += in->again[i];
    }
    return n;
}

/* With the closing that the cohort asks for instead of handles mended one by one. */
static apsm_status groom_again(apsm_run *run, groom_inputs *in, handles_kind kind, long common)
{
    groom_task t = { run, in };
    const size_t n = in->list.n;
    long *const had = malloc((n + 1) * sizeof *had);
    in->again = calloc(n + 1, sizeof *in->again);
    const size_t count = had && in->again ? choose_again(in, kind, common) : 0;
    apsm_status status = had && in->again ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; i < n && count > 0; i++) had[i] = handles_of(&in->report[i]);
    if (count > 0) {
        tell_handles(run, kind, common, count);
        in->options.closing = kind == HANDLES_SINUS ? handles_sinus_closing : 0.0;
        status = apsm_dealt_for(run->ctx, n, groom_case, &t, "groom");
        if (kind != HANDLES_SINUS) in->options.closing = run->options.groom.closing;
    }
    for (size_t i = 0; i < n && count > 0; i++) in->report[i].handles_before = had[i];
    free(had);
    return status;
}

static apsm_status judge_handles(apsm_run *run, groom_inputs *in)
{
    long *const before = malloc((4 * in->list.n + 1) * sizeof *before), common;
    if (!before) return APSM_ERR_MEMORY;
    long *const after = before + in->list.n;
    const size_t n = list_handles(in, before, after);
    const handles_kind kind = handles_judge(n, before, after, &common, after + in->list.n);
    free(before);
    return kind == HANDLES_DEBRIS ? APSM_OK : groom_again(run, in, kind, common);
}

apsm_status groom_inputs_read(apsm_run *run, groom_inputs *in)
{
    const size_t n = in->list.n;
    in->options = run->options.groom;
    in->mesh = calloc(n, sizeof *in->mesh);
    in->reflection = calloc(n, sizeof *in->reflection);
    in->reflected = calloc(n, sizeof *in->reflected);
    in->sha256 = calloc(n, sizeof *in->sha256);
    in->status = calloc(n, sizeof *in->status);
    in->problem = calloc(n, sizeof *in->problem);
    in->notes = calloc(n, sizeof *in->notes);
    in->picked = calloc(n, sizeof *in->picked);
    in->recalled = calloc(n, sizeof *in->recalled);
    in->voxel = calloc(n, sizeof *in->voxel);
    in->slices = calloc(n, sizeof *in->slices);
    in->report = calloc(n, sizeof *in->report);
    in->is_mask = calloc(n, sizeof *in->is_mask);
    in->cropped = calloc(n, sizeof *in->cropped);
    if (!in->mesh || !in->reflection || !in->reflected || !in->sha256 || !in->status ||
        !in->problem || !in->notes || !in->picked || !in->recalled || !in->voxel || !in->slices ||
        !in->report || !in->is_mask || !in->cropped)
        return APSM_ERR_MEMORY;
    groom_task t = { run, in };
    apsm_status status = apsm_dealt_for(run->ctx, n, groom_case, &t, "groom");
    if (status == APSM_OK && in->options.closing < 0.0 && !(in->options.closing_length > 0.0))
        status = judge_handles(run, in);
    return status == APSM_OK ? compare_picked(run, in) : status;
}

static apsm_status try_case(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const groom_task *t = user;
    groom_inputs *in = t->in;
    apsm_input_shape shape = { 0 };
    in->status[i] = apsm_input_read(ctx, &in->list.cases[i], &in->labels, &shape);
    apsm_input_shape_free(&shape);
    if (in->status[i] == APSM_OK) return APSM_OK;
    return apsm_text_set(&in->problem[i], apsm_error_text(ctx));
}

apsm_status groom_inputs_try(apsm_run *run, groom_inputs *in)
{
    const size_t n = in->list.n;
    in->status = calloc(n, sizeof *in->status);
    in->problem = calloc(n, sizeof *in->problem);
    if (!in->status || !in->problem) return APSM_ERR_MEMORY;
    groom_task t = { run, in };
    APSM_TRY(apsm_parallel_for(run->ctx, n, try_case, &t, NULL));
    return groom_inputs_refuse_bad(run, in);
}

apsm_status groom_inputs_refuse_bad(apsm_run *run, const groom_inputs *in)
{
    enum { MOST_TOLD = 10 };
    size_t bad = 0, first = 0;
    for (size_t i = 0; i < in->list.n; i++) {
        if (in->status[i] == APSM_OK) continue;
        if (in->status[i] == APSM_ERR_INTERRUPTED) return APSM_ERR_INTERRUPTED;
        if (bad++ == 0) first = i;
    }
    if (bad == 0) return APSM_OK;
    for (size_t i = 0, told = 0; bad > 1 && i < in->list.n && told < MOST_TOLD; i++)
        if (in->status[i] != APSM_OK) {
            apsm_log(run->ctx, APSM_LOG_WARNING, "%s", in->problem[i]);
            told++;
        }
    if (bad == 1) return apsm_fail(run->ctx, in->status[first], "%s", in->problem[first]);
    return apsm_fail(run->ctx, in->status[first],
                     "%zu of %zu shapes cannot be used (`apsm check` tells all): %s", bad,
                     in->list.n, in->problem[first]);
}

void groom_inputs_free(groom_inputs *in)
{
    for (size_t i = 0; in->mesh && i < in->list.n; i++)
        run_free_mesh(&in->mesh[i], in->store != NULL);
    for (size_t i = 0; in->problem && i < in->list.n; i++) free(in->problem[i]);
    for (size_t i = 0; in->notes && i < in->list.n; i++) free(in->notes[i]);
    for (size_t i = 0; in->picked && i < in->list.n; i++) free(in->picked[i]);
    free(in->notes);
    free(in->picked);
    free(in->mesh);
    free(in->reflection);
    free(in->reflected);
    free(in->sha256);
    free(in->status);
    free(in->problem);
    free(in->recalled);
    free(in->again);
    free(in->voxel);
    free(in->slices);
    free(in->report);
    free(in->is_mask);
    free(in->cropped);
    for (size_t i = 0; in->limits && i < in->list.n; i++) free(in->limits[i]);
    for (size_t i = 0; in->region && i < in->list.n; i++) apsm_region_free(&in->region[i]);
    for (size_t i = 0; in->whole && i < in->list.n; i++)
        run_free_mesh(&in->whole[i], in->store != NULL);
    free(in->limits);
    free(in->turn);
    free(in->region);
    free(in->whole);
    free(in->kept);
    apsm_labels_free(&in->labels);
    apsm_input_list_free(&in->list);
    apsm_project_free(&in->source);
    fixed_free(in->fixed);
    free(in->ignored);
    *in = (groom_inputs){ 0 };
}
