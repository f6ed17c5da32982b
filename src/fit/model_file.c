/* A model in one file: sections of a checkpoint file (files/checkpoint_file.h), which is whole or
 * refused.  Everything read is checked before it is used: the sum tells damage, not intent. */
#include "fit/model_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/checkpoint_file.h"
#include "files/files.h"
#include "fit/calibration_file.h"

enum { VERSION = 1, SIZES = 6 };
static const char kind[16] = "apsm-fit-model";
static const uint64_t most_count = 1u << 28, most_bytes = 1ull << 32;

typedef struct sizes {
    uint64_t version, I, J, modes, nv, nf;
} sizes;

/* ---- writing ---- */

/* "name=value\n" for every option. */
static char *options_text(const apsm_options *options)
{
    size_t n, used = 0;
    const apsm_option_info *table = apsm_options_table(&n);
    char *text = malloc(n * 160 + 1);
    if (!text) return NULL;
    text[0] = 0;
    for (size_t k = 0; k < n; k++) {
        char value[64];
        if (apsm_options_get(options, table[k].name, value) != APSM_OK) continue;
        used += (size_t)snprintf(text + used, 160, "%s=%s\n", table[k].name, value);
    }
    return text;
}

static void add_numbers(apsm_checkpoint_writer *w, const char *name, size_t n, const double *x)
{
    apsm_checkpoint_add(w, name, x, n * sizeof *x);
}

static void add_model(apsm_checkpoint_writer *w, const apsm_fit_model *m, const char *options)
{
    const apsm_shape_model *s = &m->model;
    const apsm_mesh *mesh = &m->cohort.shape[0].mesh;
    const size_t D = 3 * s->J;
    const sizes n = { VERSION, s->I, s->J, s->modes, mesh->nv, mesh->nf };
    double orientation[10] = { m->oriented };
    memcpy(orientation + 1, m->common, sizeof m->common);
    apsm_checkpoint_add(w, "kind", kind, sizeof kind);
    apsm_checkpoint_add(w, "sizes", &n, sizeof n);
    apsm_checkpoint_add(w, "options", options, strlen(options));
    add_numbers(w, "mean", D, s->mean);
    add_numbers(w, "modes", s->modes * D, s->mode);
    add_numbers(w, "variances", s->modes, s->variance);
    add_numbers(w, "scores", s->I * s->modes, s->score);
    add_numbers(w, "template", D, m->T);
    add_numbers(w, "vertices", 3 * mesh->nv, mesh->V);
    apsm_checkpoint_add(w, "faces", mesh->F, 3 * mesh->nf * sizeof *mesh->F);
    apsm_checkpoint_add(w, "calibration", &m->calibration, sizeof m->calibration);
    add_numbers(w, "orientation", 10, orientation);
    if (m->labels) apsm_checkpoint_add(w, "labels", m->labels, strlen(m->labels));
    if (m->unit) apsm_checkpoint_add(w, "unit", m->unit, strlen(m->unit));
    if (m->cropped > 0) add_numbers(w, "cropped", 1, &m->cropped);
}

apsm_status apsm_fit_model_write(apsm_context *ctx, const apsm_fit_model *m, const char *path)
{
    apsm_checkpoint_writer *w = NULL;
    if (!m || !path)
        return apsm_fail(ctx, APSM_ERR_ARG, "apsm_fit_model_write: an argument is NULL");
    char *options = options_text(&m->options);
    if (!options) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    apsm_status status = apsm_checkpoint_open(ctx, path, &w);
    if (status == APSM_OK) {
        add_model(w, m, options);
        status = apsm_checkpoint_commit(w);
    }
    free(options);
    return status;
}

/* ---- reading ---- */

static apsm_status refuse(apsm_context *ctx, const apsm_fit_model *m, const char *why)
{
    return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: %s; export the model again", m->path, why);
}

static apsm_status check_beginning(apsm_context *ctx, const apsm_fit_model *m)
{
    long long bytes;
    APSM_TRY(apsm_file_size(ctx, m->path, &bytes));
    if (bytes < 16 || (uint64_t)bytes > most_bytes)
        return refuse(ctx, m, "is no model folder and no model file of `apsm export`");
    return APSM_OK;
}

static apsm_status get_sizes(apsm_context *ctx, const apsm_fit_model *m, const apsm_checkpoint *c,
                             sizes *n)
{
    size_t size;
    const char *found = apsm_checkpoint_find(c, "kind", &size);
    if (!found || size != sizeof kind || memcmp(found, kind, sizeof kind) != 0)
        return refuse(ctx, m, "is a file of apsm, but no model");
    const void *counts = apsm_checkpoint_find(c, "sizes", &size);
    if (!counts || size != sizeof *n) return refuse(ctx, m, "says not how large it is");
    memcpy(n, counts, sizeof *n);
    if (n->version != VERSION) return refuse(ctx, m, "is of another version of apsm");
    const bool fit = n->I >= 3 && n->I < most_count && n->J >= 7 && n->J < most_count &&
                     n->modes >= 1 && n->modes < n->I && n->nv >= 4 && n->nv < most_count &&
                     n->nf >= 4 && n->nf < most_count && n->modes < most_count / n->J &&
                     n->I < most_count / n->modes;
    return fit ? APSM_OK : refuse(ctx, m, "has sizes that no model has");
}

/* *x (malloc'ed) <- n finite numbers, whose products stay finite. */
static apsm_status get_numbers(apsm_context *ctx, const apsm_fit_model *m, const apsm_checkpoint *c,
                               const char *name, size_t n, double **x)
{
    static const double largest = 1e100;
    *x = malloc(n * sizeof **x);
    if (!*x) return APSM_ERR_MEMORY;
    APSM_TRY(apsm_checkpoint_get(ctx, c, name, *x, n * sizeof **x));
    for (size_t k = 0; k < n; k++)
        if (!(fabs((*x)[k]) < largest))
            return refuse(ctx, m, "holds numbers that no model has, or that are not finite");
    return APSM_OK;
}

static apsm_status get_options(apsm_context *ctx, apsm_fit_model *m, const apsm_checkpoint *c)
{
    size_t size;
    const char *text = apsm_checkpoint_find(c, "options", &size);
    m->options = apsm_options_defaults();
    for (size_t at = 0; text && at < size;) {
        const char *line = text + at, *end = memchr(line, '\n', size - at);
        const char *equals = memchr(line, '=', size - at);
        char key[64], value[64];
        if (!end || !equals || equals > end || equals - line >= 64 || end - equals - 1 >= 64)
            return refuse(ctx, m, "has options that cannot be read");
        snprintf(key, sizeof key, "%.*s", (int)(equals - line), line);
        snprintf(value, sizeof value, "%.*s", (int)(end - equals - 1), equals + 1);
        APSM_TRY(apsm_options_set(ctx, &m->options, key, value));
        at = (size_t)(end + 1 - text);
    }
    return APSM_OK;
}

/* A text that may not be there: files of before, or nothing to say. */
static apsm_status get_text(apsm_context *ctx, apsm_fit_model *m, const apsm_checkpoint *c,
                            const char *name, char **text)
{
    size_t size;
    const char *found = apsm_checkpoint_find(c, name, &size);
    if (!found) return APSM_OK;
    for (size_t k = 0; k < size; k++)
        if ((unsigned char)found[k] < ' ') return refuse(ctx, m, "holds a text of control codes");
    *text = strndup(found, size);
    return *text ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status get_mesh(apsm_context *ctx, apsm_fit_model *m, const apsm_checkpoint *c,
                            const sizes *n)
{
    apsm_mesh mesh = { .nv = (size_t)n->nv, .nf = (size_t)n->nf };
    apsm_status status = get_numbers(ctx, m, c, "vertices", 3 * mesh.nv, &mesh.V);
    mesh.F = malloc(3 * mesh.nf * sizeof *mesh.F);
    if (status == APSM_OK && !mesh.F) status = APSM_ERR_MEMORY;
    if (status == APSM_OK)
        status = apsm_checkpoint_get(ctx, c, "faces", mesh.F, 3 * mesh.nf * sizeof *mesh.F);
    for (size_t k = 0; status == APSM_OK && k < 3 * mesh.nf; k++)
        if (mesh.F[k] >= mesh.nv)
            status = refuse(ctx, m, "has faces of vertices that are not there");
    if (status == APSM_OK) return fit_model_take_mesh(ctx, &mesh, m);
    apsm_mesh_free(&mesh);
    return status;
}

static apsm_status get_shape_model(apsm_context *ctx, apsm_fit_model *m, const apsm_checkpoint *c,
                                   const sizes *n)
{
    apsm_shape_model *s = &m->model;
    s->I = (size_t)n->I;
    s->J = (size_t)n->J;
    s->modes = (size_t)n->modes;
    const size_t D = 3 * s->J;
    APSM_TRY(get_numbers(ctx, m, c, "mean", D, &s->mean));
    APSM_TRY(get_numbers(ctx, m, c, "modes", s->modes * D, &s->mode));
    APSM_TRY(get_numbers(ctx, m, c, "variances", s->modes, &s->variance));
    APSM_TRY(get_numbers(ctx, m, c, "scores", s->I * s->modes, &s->score));
    for (size_t k = 0; k < s->modes; k++)
        if (!(s->variance[k] > 0) || (k > 0 && s->variance[k] > s->variance[k - 1]))
            return refuse(ctx, m, "has variances that are not positive and descending");
    return get_numbers(ctx, m, c, "template", D, &m->T);
}

static apsm_status get_calibration(apsm_context *ctx, apsm_fit_model *m, const apsm_checkpoint *c)
{
    double *x = NULL, *o = NULL;
    apsm_status status = get_numbers(ctx, m, c, "calibration", FIT_CALIBRATION, &x);
    if (status == APSM_OK) status = get_numbers(ctx, m, c, "orientation", 10, &o);
    if (status == APSM_OK) {
        memcpy(&m->calibration, x, sizeof m->calibration);
        m->oriented = o[0];
        memcpy(m->common, o + 1, sizeof m->common);
        if (!fit_calibration_makes_sense(&m->calibration) ||
            m->calibration.modes > (double)m->model.modes)
            status = refuse(ctx, m, "has a calibration that makes no sense");
    }
    free(x);
    free(o);
    return status;
}

apsm_status fit_model_read_file(apsm_context *ctx, apsm_fit_model *m)
{
    apsm_checkpoint *c = NULL;
    size_t size;
    sizes n;
    APSM_TRY(check_beginning(ctx, m));
    apsm_status status = apsm_checkpoint_read(ctx, m->path, &c);
    if (status == APSM_ERR_FORMAT)
        return refuse(ctx, m, "is no model folder and no file of `apsm export`, or damaged");
    if (status == APSM_OK) status = get_sizes(ctx, m, c, &n);
    if (status == APSM_OK) status = get_options(ctx, m, c);
    if (status == APSM_OK) status = get_text(ctx, m, c, "labels", &m->labels);
    if (status == APSM_OK) status = get_text(ctx, m, c, "unit", &m->unit);
    if (status == APSM_OK) status = get_shape_model(ctx, m, c, &n);
    if (status == APSM_OK) status = get_mesh(ctx, m, c, &n);
    if (status == APSM_OK) status = get_calibration(ctx, m, c);
    m->cropped = status == APSM_OK && apsm_checkpoint_find(c, "cropped", &size) ? 1 : 0;
    apsm_checkpoint_free(c);
    return status;
}
