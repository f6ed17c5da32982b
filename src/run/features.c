#include "run/features.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "folder/features_csv.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "geometry/volume.h"
#include "initialize/features.h"
#include "run/source.h"

enum { MOST_FEATURES = 16, NAME_ROOM = 64 };

/* ---- the option ---- */

typedef struct feature_words {
    size_t n;
    char name[MOST_FEATURES][NAME_ROOM];
    double weight[MOST_FEATURES];
} feature_words;

static apsm_status take_word(apsm_context *ctx, const char *at, size_t length, feature_words *w)
{
    const char *colon = memchr(at, ':', length);
    const size_t name = colon ? (size_t)(colon - at) : length;
    double weight = 1;
    if (name == 0 || name >= NAME_ROOM || w->n == MOST_FEATURES)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "features: '%.*s': give NAME or NAME:WEIGHT, with commas between, at most "
                         "%d",
                         (int)length, at, MOST_FEATURES);
    if (colon &&
        (!apsm_parse_number(colon + 1, length - name - 1, &weight) || weight < 0 || weight > 1e3))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "features: '%.*s': a weight is a number from 0 (only sampled) to 1000",
                         (int)length, at);
    memcpy(w->name[w->n], at, name);
    w->name[w->n][name] = 0;
    for (size_t k = 0; k < w->n; k++)
        if (strcmp(w->name[k], w->name[w->n]) == 0)
            return apsm_fail(ctx, APSM_ERR_ARG, "features: '%s' is named twice", w->name[k]);
    w->weight[w->n++] = weight;
    return APSM_OK;
}

static apsm_status parse(apsm_context *ctx, const char *text, feature_words *w)
{
    *w = (feature_words){ 0 };
    for (const char *at = text; *at;) {
        const size_t length = strcspn(at, ",");
        APSM_TRY(take_word(ctx, at, length, w));
        at += length + (at[length] == ',');
    }
    return APSM_OK;
}

apsm_status features_check_text(apsm_context *ctx, const char *text)
{
    feature_words w;
    return parse(ctx, text, &w);
}

static bool is_normals(const char *name)
{
    return strcmp(name, "normals") == 0;
}

static bool is_named(const feature_words *w, const char *name, size_t length)
{
    for (size_t k = 0; k < w->n; k++)
        if (strlen(w->name[k]) == length && strncmp(w->name[k], name, length) == 0) return true;
    return false;
}

/* Whether option features names it. */
static bool is_asked(const apsm_run *run, const char *name)
{
    feature_words w;
    return parse(run->ctx, apsm_run_text(run, "features"), &w) == APSM_OK &&
           is_named(&w, name, strlen(name));
}

/* Fields that the project wants to correspond count as much as one another; option features says
 * it better. */
static apsm_status add_fields(apsm_context *ctx, const apsm_project *p, feature_words *w)
{
    const char *name;
    size_t length;
    for (size_t k = 0; (name = source_field(p, k, &length)); k++)
        if (!is_named(w, name, length)) APSM_TRY(take_word(ctx, name, length, w));
    return APSM_OK;
}

/* What option features says, and the fields and normals that a project asks for. */
static apsm_status settle(apsm_context *ctx, const apsm_run *run, const apsm_project *p,
                          feature_words *w)
{
    APSM_TRY(parse(ctx, apsm_run_text(run, "features"), w));
    if (p->root && !source_ignores(run, "fields")) APSM_TRY(add_fields(ctx, p, w));
    const bool ignored = source_ignores(run, "normals");
    const double normals = p->root && !ignored ? source_normals(p) : 0;
    for (size_t k = 0; k < w->n; k++)
        if (is_normals(w->name[k])) return APSM_OK;
    if (normals > 0 && w->n < MOST_FEATURES) {
        snprintf(w->name[w->n], NAME_ROOM, "normals");
        w->weight[w->n++] = normals;
    }
    return APSM_OK;
}

static apsm_status refuse_psm(apsm_run *run, const feature_words *w)
{
    for (size_t k = 0; k < w->n; k++)
        if (w->weight[k] > 0 && run->options.optimize.method == APSM_METHOD_PSM)
            return apsm_fail(run->ctx, APSM_ERR_UNSUPPORTED,
                             "method psm has no features; drop '%s' (--ignore normals,fields, if a "
                             "project asks for it), or sample it with weight 0",
                             w->name[k]);
    return APSM_OK;
}

/* ---- from the inputs ---- */

/* The project that is groomed. */
static const apsm_project *source_of(const apsm_run *run, const groom_inputs *in)
{
    return in->own_source ? &run->project : &in->source;
}

/* The image that a column of the project names for this feature: malloc'ed, or NULL. */
static char *image_of(const apsm_run *run, const groom_inputs *in, size_t i, const char *name)
{
    static const char *const prefixes[] = { "image_", "feature_" };
    const apsm_project *p = source_of(run, in);
    const size_t s = p->root ? apsm_project_find(p, in->list.cases[i].name) : 0;
    for (size_t k = 0; k < 2 && p->root && s < p->n; k++) {
        char key[NAME_ROOM + 16];
        snprintf(key, sizeof key, "%s%s", prefixes[k], name);
        const char *stored = apsm_subject_column(&p->subjects[s], key);
        if (stored && *stored) return apsm_project_path(p, stored);
    }
    return NULL;
}

static double voxel(const apsm_volume *v, size_t i, size_t j, size_t k)
{
    const size_t at = i + v->n[0] * (j + v->n[1] * k);
    return v->value ? (double)v->value[at] : (double)volume_label(v, at);
}

/* Trilinear; beyond the image the value at its border. */
static double sample(const apsm_volume *v, const double to_index[16], const double x[3])
{
    double at[3], t[3], sum = 0;
    size_t lo[3];
    apsm_affine_apply(to_index, 1, x, at);
    for (size_t c = 0; c < 3; c++) {
        const double most = (double)(v->n[c] - 1), u = fmin(fmax(at[c], 0), most);
        lo[c] = (size_t)fmin(floor(u), fmax(most - 1, 0));
        t[c] = u - (double)lo[c];
    }
    for (size_t k = 0; k < 8; k++) {
        double w = 1;
        size_t q[3];
        for (size_t c = 0; c < 3; c++) {
            const bool up = (k >> c) & 1;
            q[c] = lo[c] + up < v->n[c] ? lo[c] + up : lo[c];
            w *= up ? t[c] : 1 - t[c];
        }
        if (w > 0) sum += w * voxel(v, q[0], q[1], q[2]);
    }
    return sum;
}

static apsm_status sample_image(apsm_context *ctx, const char *path, size_t n, const double *X,
                                double *value)
{
    apsm_volume v = { 0 };
    double M[16], to_index[16];
    APSM_TRY(apsm_read_volume(ctx, path, &v));
    apsm_volume_index_to_lps(&v, M);
    apsm_status status = apsm_affine_invert(M, to_index);
    for (size_t k = 0; k < n && status == APSM_OK; k++) value[k] = sample(&v, to_index, X + 3 * k);
    apsm_volume_free(&v);
    return status;
}

/* Of the raw mesh, at its points that are closest to X. */
static apsm_status interpolate(apsm_context *ctx, const char *path, const char *name, size_t n,
                               const double *X, double *value)
{
    apsm_mesh raw = { 0 };
    apsm_bvh *bvh = NULL;
    APSM_TRY(apsm_read_mesh(ctx, path, &raw));
    double *field = malloc((raw.nv + 1) * sizeof *field);
    apsm_status status = field ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_read_mesh_field(ctx, path, name, raw.nv, field);
    if (status == APSM_OK && n > 0) status = apsm_bvh_build_unsigned(&raw, &bvh);
    for (size_t k = 0; k < n && status == APSM_OK; k++) {
        apsm_closest at;
        apsm_bvh_closest(bvh, X + 3 * k, INFINITY, &at);
        const uint32_t *corner = raw.F + 3 * (size_t)at.on.face;
        value[k] = 0;
        for (size_t c = 0; c < 3; c++) value[k] += at.on.weight[c] * field[corner[c]];
    }
    apsm_bvh_free(bvh);
    free(field);
    apsm_mesh_free(&raw);
    return status;
}

/* value (n, out) <- the field at points X (n x 3) of the input's frame; n 0: only looked for. */
static apsm_status take_field(apsm_context *ctx, const apsm_run *run, const groom_inputs *in,
                              size_t i, const char *name, size_t n, const double *X, double *value)
{
    const apsm_input_case *c = &in->list.cases[i];
    char *image = image_of(run, in, i, name);
    apsm_status status;
    if (image)
        status = sample_image(ctx, image, n, X, value);
    else if (c->kind == APSM_INPUT_MESH)
        status = interpolate(ctx, c->path, name, n, X, value);
    else
        status =
            apsm_fail(ctx, APSM_ERR_ARG,
                      "%s: is a segmentation and has no field '%s'; a project's column image_%s "
                      "can name an image to sample",
                      c->path, name, name);
    free(image);
    return status;
}

/* The fields of a project that option features does not name. */
static apsm_status tell_fields(const apsm_run *run, const apsm_project *p)
{
    feature_words w;
    const char *name;
    char fields[256] = "";
    size_t length, used = 0;
    APSM_TRY(parse(run->ctx, apsm_run_text(run, "features"), &w));
    for (size_t k = 0; (name = source_field(p, k, &length)) && used < sizeof fields; k++)
        if (!is_named(&w, name, length))
            used += (size_t)snprintf(fields + used, sizeof fields - used, "%s%.*s", used ? " " : "",
                                     (int)length, name);
    if (used > 0)
        apsm_log(run->ctx, APSM_LOG_INFO,
                 "the project's field_attributes (%s) must correspond, each with weight 1 (weights "
                 "here have no unit); --features NAME:WEIGHT sets others",
                 fields);
    return APSM_OK;
}

apsm_status features_check(apsm_run *run, const groom_inputs *in)
{
    feature_words w;
    if (!in->own_source && in->source.root && !source_ignores(run, "fields"))
        APSM_TRY(tell_fields(run, &in->source));
    APSM_TRY(settle(run->ctx, run, source_of(run, in), &w));
    APSM_TRY(refuse_psm(run, &w));
    if (w.n > 0 && run_is_in_memory(run))
        return apsm_fail(run->ctx, APSM_ERR_UNSUPPORTED, "a job in memory has no features");
    for (size_t k = 0; k < w.n; k++)
        for (size_t i = 0; i < in->list.n && !is_normals(w.name[k]); i++)
            APSM_TRY(take_field(run->ctx, run, in, i, w.name[k], 0, NULL, NULL));
    return APSM_OK;
}

apsm_status features_check_added(apsm_run *run, const groom_inputs *in)
{
    feature_words w;
    APSM_TRY(settle(run->ctx, run, &run->project, &w));
    for (size_t k = 0; k < w.n; k++)
        if (w.weight[k] > 0 && !is_normals(w.name[k]))
            return apsm_fail(
                run->ctx, APSM_ERR_UNSUPPORTED,
                "%s: its shapes correspond by '%s', too, and shapes are added by their "
                "form alone; make the model anew with all of them",
                run_place(run), w.name[k]);
    return features_check(run, in);
}

static apsm_status take_fields(apsm_context *ctx, const apsm_run *run, const groom_inputs *in,
                               size_t i, const feature_words *w, double *value,
                               apsm_mesh_field *fields, size_t *S)
{
    const apsm_mesh *m = &in->mesh[i];
    double back[16], *X = malloc(3 * m->nv * sizeof *X);
    if (!X) return APSM_ERR_MEMORY;
    apsm_status status = apsm_affine_invert(in->reflection[i], back);
    if (status == APSM_OK) apsm_affine_apply(back, m->nv, m->V, X);
    *S = 0;
    for (size_t k = 0; k < w->n && status == APSM_OK; k++) {
        if (is_normals(w->name[k])) continue;
        fields[*S] = (apsm_mesh_field){ w->name[k], value + *S * m->nv };
        status = take_field(ctx, run, in, i, w->name[k], m->nv, X, value + *S * m->nv);
        ++*S;
    }
    free(X);
    return status;
}

apsm_status features_write_mesh(apsm_context *ctx, const apsm_run *run, const groom_inputs *in,
                                size_t i, const char *path)
{
    feature_words w;
    apsm_mesh_field fields[MOST_FEATURES];
    size_t S = 0;
    APSM_TRY(settle(ctx, run, source_of(run, in), &w));
    if (w.n == 0) return apsm_write_mesh(ctx, path, &in->mesh[i]);
    double *value = malloc((w.n * in->mesh[i].nv + 1) * sizeof *value);
    if (!value) return APSM_ERR_MEMORY;
    apsm_status status = take_fields(ctx, run, in, i, &w, value, fields, &S);
    if (status == APSM_OK)
        status = S > 0 ? apsm_write_mesh_fields(ctx, path, &in->mesh[i], S, fields)
                       : apsm_write_mesh(ctx, path, &in->mesh[i]);
    free(value);
    return status;
}

/* ---- from the groomed meshes ---- */

void features_free(run_features *f)
{
    for (size_t s = 0; s < f->S; s++) free(f->name[s]);
    for (size_t i = 0; f->value && i < f->I; i++) free(f->value[i]);
    free(f->name);
    free(f->weight);
    free(f->value);
    *f = (run_features){ 0 };
}

static apsm_status take_names(apsm_run *run, const feature_words *w)
{
    run_features *f = &run->features;
    *f = (run_features){ .I = run->project.n };
    f->name = calloc(w->n + 1, sizeof *f->name);
    f->weight = calloc(w->n + 1, sizeof *f->weight);
    f->value = calloc(f->I + 1, sizeof *f->value);
    if (!f->name || !f->weight || !f->value) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < w->n; k++) {
        if (is_normals(w->name[k])) {
            f->normals = w->weight[k];
            continue;
        }
        f->name[f->S] = strdup(w->name[k]);
        f->weight[f->S] = w->weight[k];
        if (!f->name[f->S++]) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

/* Grooming once left alone what a project says of fields. */
static apsm_status lacks_field(apsm_run *run, const char *path, const char *name)
{
    if (is_asked(run, name)) return APSM_ERR_FORMAT; /* said by the reader */
    return apsm_fail(run->ctx, APSM_ERR_FORMAT,
                     "%s: has no field '%s', which the project's field_attributes ask for: it was "
                     "groomed before fields were followed; groom again, or --ignore fields",
                     path, name);
}

static apsm_status read_shape(apsm_run *run, size_t i)
{
    run_features *f = &run->features;
    const size_t nv = run->cohort.shape[i].mesh.nv;
    f->value[i] = malloc((f->S * nv + 1) * sizeof **f->value);
    char *path = apsm_project_path(&run->project, run->project.subjects[i].groomed);
    apsm_status status = path && f->value[i] ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t s = 0; s < f->S && status == APSM_OK; s++) {
        status = apsm_read_mesh_field(run->ctx, path, f->name[s], nv, f->value[i] + s * nv);
        if (status == APSM_ERR_FORMAT) status = lacks_field(run, path, f->name[s]);
    }
    free(path);
    return status;
}

/* Those that take part, of all that are sampled: scalars with a weight come first. */
static apsm_status give_to_cohort(apsm_run *run)
{
    const run_features *f = &run->features;
    size_t flat = 0;
    bool any = f->normals > 0;
    for (size_t s = 0; s < f->S; s++) any = any || f->weight[s] > 0;
    if (!any) return APSM_OK;
    const apsm_status status = apsm_cohort_features(
        &run->cohort, f->S, (const double *const *)f->value, f->weight, f->normals, &flat);
    if (status != APSM_ERR_GEOMETRY) return status;
    return apsm_fail(run->ctx, status,
                     "features: '%s' is the same everywhere; nothing can correspond by it",
                     f->name[flat]);
}

apsm_status features_load(apsm_run *run)
{
    feature_words w;
    features_free(&run->features);
    APSM_TRY(settle(run->ctx, run, &run->project, &w));
    if (w.n == 0) return APSM_OK;
    APSM_TRY(take_names(run, &w));
    for (size_t i = 0; i < run->cohort.I; i++) APSM_TRY(read_shape(run, i));
    return give_to_cohort(run);
}

/* ---- results ---- */

/* f (S, out): at a point of shape i's surface. */
static void fields_at(const apsm_run *run, size_t i, const apsm_surface_point *on, double *f)
{
    const apsm_mesh *m = &run->cohort.shape[i].mesh;
    const uint32_t *corner = m->F + 3 * (size_t)on->face;
    for (size_t s = 0; s < run->features.S; s++) {
        const double *value = run->features.value[i] + s * m->nv;
        f[s] = 0;
        for (size_t c = 0; c < 3; c++) f[s] += on->weight[c] * value[corner[c]];
    }
}

apsm_status features_write_table(apsm_run *run, size_t J, const double *P)
{
    const size_t I = run->cohort.I, S = run->features.S;
    if (run_is_in_memory(run)) return APSM_OK;
    if (S == 0) return run_remove(run, run_path(run, FOLDER_FEATURES));
    const sampled_fields fields = { I, J, S, run->features.name,
                                    malloc(I * J * S * sizeof(double)) };
    const char **names = malloc((I + 1) * sizeof *names);
    char *path = run_path(run, FOLDER_FEATURES);
    apsm_status status = fields.value && names && path ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t k = 0; status == APSM_OK && k < I * J; k++) {
        apsm_surface_point on;
        names[k / J] = run->project.subjects[k / J].name;
        apsm_shape_look_up(&run->cohort.shape[k / J], 1, P + 3 * k, &on, NULL, NULL);
        fields_at(run, k / J, &on, fields.value + k * S);
    }
    if (status == APSM_OK) status = features_csv_write(run->ctx, path, names, &fields);
    free(path);
    free(names);
    free(fields.value);
    return status;
}

apsm_status features_mean(apsm_run *run, const apsm_warp *warp, size_t J, const double *P,
                          double **mean)
{
    const size_t S = run->features.S, nv = warp->nv, I = run->cohort.I;
    *mean = NULL;
    if (S == 0) return APSM_OK;
    *mean = calloc(S * nv, sizeof **mean);
    double *Y = malloc((3 * nv + S) * sizeof *Y), *f = Y + 3 * nv;
    apsm_status status = *mean && Y ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; i < I && status == APSM_OK; i++) {
        apsm_warp_apply(warp, P + 3 * i * J, Y);
        for (size_t v = 0; v < nv; v++) {
            apsm_surface_point on;
            apsm_shape_look_up(&run->cohort.shape[i], 1, Y + 3 * v, &on, NULL, NULL);
            fields_at(run, i, &on, f);
            for (size_t s = 0; s < S; s++) (*mean)[s * nv + v] += f[s] / (double)I;
        }
    }
    free(Y);
    return status;
}
