/* The page of `apsm fit`: every new shape beside the mean, how it differs and how sure that is. All
 * figures come from the fits' own files. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "apsm/report.h"
#include "files/files.h"
#include "geometry/affine.h"
#include "report/pack.h"
#include "report/page.h"

enum { DATA_VERSION = 1, MOST_SHOWN = 150, MOST_LISTED = 400 };

/* How much a shape wants to be looked at; of those alike the first come first. */
enum { TO_REVIEW, GOOD, FAILED, REFUSED, VERDICTS };
static const char *const verdict_names[VERDICTS] = { "needs review", "good", "failed", "refused" };
static const double position_levels = 16383;

typedef struct fits {
    const char *folder;
    json_t *root;    /* fit.json without its shapes */
    json_t *table;   /* those of them that are on the page, in their order */
    size_t n, shown; /* shapes; those with a surface on the page */
    size_t count[VERDICTS];
    size_t room[VERDICTS]; /* how many more of these the table takes */
    size_t *which;         /* shown: numbers of shapes in the table */
    json_t **detail;       /* shown: shapes/NAME.json */
    apsm_mesh mean;        /* world frame */
    apsm_mesh *mesh;       /* shown: world frame, the mean's faces */
    size_t J;
    double lo[3], step, largest_deviation;
    pack bytes;
} fits;

static void fits_free(fits *f)
{
    for (size_t k = 0; k < f->shown; k++) {
        if (f->detail) json_decref(f->detail[k]);
        if (f->mesh) apsm_mesh_free(&f->mesh[k]);
    }
    free(f->which);
    free(f->detail);
    free(f->mesh);
    apsm_mesh_free(&f->mean);
    json_decref(f->root);
    json_decref(f->table);
    pack_free(&f->bytes);
}

/* ---- reading ---- */

static const char *text_of(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));
    return text ? text : "";
}

static char *path_of(const fits *f, const char *part, const char *name, const char *rest)
{
    char relative[512];
    if (snprintf(relative, sizeof relative, "%s/%s%s", part, name, rest) >= (int)sizeof relative)
        return NULL;
    return apsm_path_join(f->folder, relative);
}

static size_t verdict_of(const json_t *shape)
{
    size_t v = 0;
    while (v + 1 < VERDICTS && strcmp(text_of(shape, "verdict"), verdict_names[v]) != 0) v++;
    return v;
}

static apsm_status count_shape(apsm_context *ctx, size_t i, const json_t *shape, void *user)
{
    fits *f = user;
    if (!json_is_object(shape))
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s/fit.json: value %zu of 'shapes' is no shape; fit again", f->folder,
                         i + 1);
    f->count[verdict_of(shape)]++;
    f->n++;
    return APSM_OK;
}

/* As many of each verdict as the table has room for. */
static void share_out(fits *f)
{
    size_t left = MOST_LISTED;
    for (size_t v = 0; v < VERDICTS; v++) {
        f->room[v] = f->count[v] < left ? f->count[v] : left;
        left -= f->room[v];
    }
}

/* A copy for the page, without paths: who gets it need not know our disks. */
static apsm_status list_shape(apsm_context *ctx, size_t i, const json_t *shape, void *user)
{
    fits *f = user;
    (void)ctx, (void)i;
    size_t *room = &f->room[verdict_of(shape)];
    if (*room == 0) return APSM_OK;
    --*room;
    json_t *copy = json_deep_copy(shape);
    json_t *name = json_string(apsm_path_last(text_of(shape, "input")));
    const bool bad = !copy || json_object_set_new(copy, "input", name);
    if (copy) json_object_del(copy, "to_world");
    if (bad) json_decref(copy);
    return bad || json_array_append_new(f->table, copy) ? APSM_ERR_MEMORY : APSM_OK;
}

/* fit.json, a shape at a time, twice. */
static apsm_status read_table(apsm_context *ctx, const char *path, fits *f)
{
    json_t *again = NULL;
    f->table = json_array();
    if (!f->table) return APSM_ERR_MEMORY;
    APSM_TRY(apsm_json_read_list(ctx, path, "shapes", &f->root, count_shape, f));
    APSM_TRY(apsm_json_check(ctx, path, f->root, "apsm-fit", 1));
    share_out(f);
    const apsm_status status = apsm_json_read_list(ctx, path, "shapes", &again, list_shape, f);
    json_decref(again);
    return status;
}

/* Those that need a look first, then the others, as they come; in the order of the table. */
static apsm_status choose_shown(fits *f)
{
    const size_t n = json_array_size(f->table);
    bool *take = calloc(n + 1, sizeof *take);
    f->which = malloc((n + 1) * sizeof *f->which);
    if (!take || !f->which) {
        free(take);
        return APSM_ERR_MEMORY;
    }
    size_t left = MOST_SHOWN;
    for (size_t v = TO_REVIEW; v <= GOOD; v++)
        for (size_t i = 0; i < n && left > 0; i++)
            if (verdict_of(json_array_get(f->table, i)) == v) take[i] = true, left--;
    for (size_t i = 0; i < n; i++)
        if (take[i]) f->which[f->shown++] = i;
    free(take);
    f->detail = calloc(f->shown + 1, sizeof *f->detail);
    f->mesh = calloc(f->shown + 1, sizeof *f->mesh);
    return f->detail && f->mesh ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status damaged(apsm_context *ctx, const fits *f, const char *what)
{
    return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: %s is not as apsm fit writes it; fit again",
                     f->folder, what);
}

static apsm_status read_mesh(apsm_context *ctx, fits *f, size_t k, const char *name)
{
    double M[16];
    const json_t *fit = json_object_get(f->detail[k], "fit");
    char *path = path_of(f, "meshes", name, "_fit.ply");
    const apsm_status status = path ? apsm_read_mesh(ctx, path, &f->mesh[k]) : APSM_ERR_MEMORY;
    free(path);
    APSM_TRY(status);
    const bool ok = f->mesh[k].nv == f->mean.nv && f->mesh[k].nf == f->mean.nf &&
                    apsm_json_get_matrix(json_object_get(fit, "to_world"), 16, 0, M);
    if (!ok) return damaged(ctx, f, name);
    apsm_affine_apply(M, f->mesh[k].nv, f->mesh[k].V, f->mesh[k].V);
    return APSM_OK;
}

static apsm_status read_one(apsm_context *ctx, fits *f, size_t k)
{
    const char *name = text_of(json_array_get(f->table, f->which[k]), "name");
    char *path = path_of(f, "shapes", name, ".json");
    const apsm_status status = path ? apsm_json_read(ctx, path, &f->detail[k]) : APSM_ERR_MEMORY;
    free(path);
    APSM_TRY(status);
    return read_mesh(ctx, f, k, name);
}

static apsm_status read_fits(apsm_context *ctx, fits *f)
{
    char *path = apsm_path_join(f->folder, "fit.json");
    apsm_status status = path ? read_table(ctx, path, f) : APSM_ERR_MEMORY;
    free(path);
    APSM_TRY(status);
    f->J =
        (size_t)json_integer_value(json_object_get(json_object_get(f->root, "model"), "particles"));
    char *mean = apsm_path_join(f->folder, "meshes/mean.ply");
    status = mean ? apsm_read_mesh(ctx, mean, &f->mean) : APSM_ERR_MEMORY;
    free(mean);
    APSM_TRY(status);
    APSM_TRY(choose_shown(f));
    for (size_t k = 0; k < f->shown; k++) APSM_TRY(read_one(ctx, f, k));
    return APSM_OK;
}

/* ---- numbers ---- */

static void widen(double lo[3], double hi[3], const apsm_mesh *mesh)
{
    double a[3], b[3];
    apsm_mesh_bounds(mesh, a, b);
    for (int c = 0; c < 3; c++) {
        lo[c] = fmin(lo[c], a[c]);
        hi[c] = fmax(hi[c], b[c]);
    }
}

static void choose_steps(fits *f)
{
    double hi[3], most = 0;
    apsm_mesh_bounds(&f->mean, f->lo, hi);
    for (size_t k = 0; k < f->shown; k++) {
        size_t j;
        json_t *x;
        widen(f->lo, hi, &f->mesh[k]);
        json_array_foreach(json_object_get(f->detail[k], "deviation_normal"), j, x)
        {
            most = fmax(most, json_number_value(x));
        }
    }
    for (int c = 0; c < 3; c++) most = fmax(most, 0), f->step = fmax(f->step, hi[c] - f->lo[c]);
    f->step = f->step > 0 ? f->step / position_levels : 1;
    f->largest_deviation = most > 0 ? most : 1;
}

/* ---- one shape ---- */

/* Deviations and flags of its J particles as packed arrays. */
static json_t *json_particles(fits *f, size_t k, double *x, uint32_t *seen)
{
    const json_t *d = f->detail[k], *flags = json_object_get(d, "observed");
    if (!apsm_json_get_matrix(json_object_get(d, "deviation_normal"), f->J, 0, x)) return NULL;
    if (json_array_size(flags) != f->J) return NULL;
    for (size_t j = 0; j < f->J; j++) seen[j] = json_is_true(json_array_get(flags, j));
    return json_pack("{s:o, s:o}", "deviation",
                     pack_distances(&f->bytes, f->J, f->largest_deviation, x), "observed",
                     pack_integers(&f->bytes, f->J, 1, 1, seen));
}

static json_t *json_shown(fits *f, size_t k, double *x, uint32_t *seen)
{
    json_t *o = json_particles(f, k, x, seen);
    const json_t *d = f->detail[k];
    if (!o) return NULL;
    json_object_set_new(o, "shape", json_integer((json_int_t)f->which[k]));
    json_object_set(o, "scores", json_object_get(d, "scores"));
    json_object_set(o, "variances", json_object_get(d, "variances"));
    json_object_set_new(
        o, "vertices", pack_points(&f->bytes, f->mean.nv, f->lo, f->step, f->mean.V, f->mesh[k].V));
    if (apsm_json_get_matrix(json_object_get(d, "world"), f->J, 3, x))
        json_object_set_new(o, "particles", pack_points(&f->bytes, f->J, f->lo, f->step, NULL, x));
    return o;
}

static json_t *json_model(const fits *f)
{
    json_t *copy = json_deep_copy(json_object_get(f->root, "model"));
    json_object_set_new(copy, "path", json_string(apsm_path_last(text_of(copy, "path"))));
    return copy;
}

static json_t *json_all_shown(fits *f)
{
    double *x = malloc((3 * f->J + 1) * sizeof *x);
    uint32_t *seen = malloc((f->J + 1) * sizeof *seen);
    json_t *all = x && seen ? json_array() : NULL;
    for (size_t k = 0; all && k < f->shown; k++)
        if (json_array_append_new(all, json_shown(f, k, x, seen))) {
            json_decref(all);
            all = NULL;
        }
    free(x);
    free(seen);
    return all;
}

/* Of all shapes, also those beyond the table. */
static json_t *json_counts(const fits *f)
{
    json_t *counts = json_object();
    for (size_t v = 0; v < VERDICTS; v++)
        json_object_set_new(counts, verdict_names[v], json_integer((json_int_t)f->count[v]));
    return counts;
}

static json_t *compose(fits *f, const char *title)
{
    choose_steps(f);
    return json_pack(
        "{s:s, s:i, s:s, s:s, s:o, s:[f, f, f], s:f, s:f, s:{s:o, s:o}, s:O, s:o, s:o}", "format",
        "apsm-fits", "version", DATA_VERSION, "apsm", text_of(f->root, "apsm"), "title", title,
        "model", json_model(f), "origin", f->lo[0], f->lo[1], f->lo[2], "step", f->step,
        "largest_distance", f->largest_deviation, "mean", "vertices",
        pack_points(&f->bytes, f->mean.nv, f->lo, f->step, NULL, f->mean.V), "faces",
        pack_integers(&f->bytes, 3 * f->mean.nf, 3, f->mean.nv > 65535 ? 4 : 2, f->mean.F), "table",
        f->table, "counts", json_counts(f), "shown", json_all_shown(f));
}

static apsm_status write_report(apsm_context *ctx, fits *f)
{
    char *title = page_title(f->folder), *path = apsm_path_join(f->folder, "report.html");
    apsm_status status = APSM_ERR_MEMORY;
    if (title && path) {
        json_t *root = compose(f, title);
        status = root ? page_write(ctx, path, root, &f->bytes) : damaged(ctx, f, "shapes/");
        json_decref(root);
    }
    free(title);
    free(path);
    return status;
}

apsm_status apsm_fit_report_write(apsm_context *ctx, const char *folder)
{
    if (!folder) return apsm_fail(ctx, APSM_ERR_ARG, "apsm_fit_report_write: no folder");
    fits f = { .folder = folder };
    apsm_status status = read_fits(ctx, &f);
    if (status == APSM_OK) status = write_report(ctx, &f);
    fits_free(&f);
    return status;
}
