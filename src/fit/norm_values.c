/* What `apsm norm` says of single numbers: the size of every shape, and columns of the table. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "files/files.h"
#include "fit/norm_job.h"
#include "fit/tail.h"
#include "geometry/bvh.h"
#include "geometry/vec3.h"

double norm_student(double t, double nu)
{
    const double beyond = fit_tail_f(t * t, 1, nu) / 2;
    return t > 0 ? 1 - beyond : beyond;
}

/* ---- normals ---- */

static apsm_status read_mean(norm_job *w, size_t d, apsm_mesh *mesh)
{
    char name[300] = "meshes/mean.ply";
    if (w->m.parts > 1) snprintf(name, sizeof name, "meshes/mean_%.250s.ply", w->m.part[d].name);
    char *path = model_folder_path(&w->m, name);
    apsm_status status = path ? APSM_OK : APSM_ERR_MEMORY;
    *mesh = (apsm_mesh){ 0 };
    if (status == APSM_OK && apsm_file_exists(path)) status = apsm_read_mesh(w->ctx, path, mesh);
    free(path);
    return status;
}

/* Of the particles of a part, at the closest points of the mean's surface. */
static apsm_status look_up(const norm_job *w, const apsm_mesh *mesh, size_t d)
{
    const model_part *part = &w->m.part[d];
    apsm_bvh *bvh = NULL;
    double *VN = malloc(3 * mesh->nv * sizeof *VN);
    apsm_status status = VN ? apsm_bvh_build_unsigned(mesh, &bvh) : APSM_ERR_MEMORY;
    if (status == APSM_OK) apsm_mesh_vertex_normals(mesh, VN);
    for (size_t j = part->first; status == APSM_OK && j < part->first + part->J; j++) {
        apsm_closest c;
        apsm_bvh_closest(bvh, w->m.model.mean + 3 * j, INFINITY, &c);
        apsm_surface_normal(mesh, VN, &c.on, w->normal + 3 * j);
    }
    apsm_bvh_free(bvh);
    free(VN);
    return status;
}

apsm_status norm_find_normals(norm_job *w)
{
    bool found = true;
    w->normal = calloc(3 * w->m.J, sizeof *w->normal);
    if (!w->normal) return APSM_ERR_MEMORY;
    for (size_t d = 0; d < w->m.parts && found; d++) {
        apsm_mesh mesh;
        APSM_TRY(read_mean(w, d, &mesh));
        found = mesh.nv > 0;
        const apsm_status status = found ? look_up(w, &mesh, d) : APSM_OK;
        apsm_mesh_free(&mesh);
        APSM_TRY(status);
    }
    if (found) return APSM_OK;
    free(w->normal);
    w->normal = NULL;
    return norm_note(w, "the model has no mean surface (meshes/), so shapes are judged in every "
                        "direction, not along its normals: fitted ones then look more unusual "
                        "than they are; run apsm evaluate on the model first");
}

/* ---- numbers ---- */

static double size_of(size_t J, const double *P)
{
    double c[3] = { 0 }, sum = 0;
    for (size_t j = 0; j < J; j++) vec3_add_scaled(c, 1 / (double)J, P + 3 * j);
    for (size_t j = 0; j < J; j++) sum += vec3_distance2(P + 3 * j, c);
    return sqrt(sum);
}

bool norm_allows_for(const norm_job *w, const apsm_column *c)
{
    for (size_t t = 0; t < w->formula.n; t++)
        for (size_t f = 0; f < w->formula.term[t].factors; f++)
            if (w->formula.term[t].factor[f] == c) return true;
    return false;
}

/* Rows of X and y of those that have the number, then the new rows; returns how many have it. */
static size_t gather(const norm_job *w, const double *all, double *X, double *y, double *y0)
{
    const size_t q = w->q;
    size_t N = 0;
    for (size_t i = 0; i < w->N; i++) {
        if (isnan(all[i])) continue;
        memcpy(X + N * q, w->X + i * q, q * sizeof *X);
        y[N++] = all[i];
    }
    memcpy(X + N * q, w->X + w->N * q, w->n * q * sizeof *X);
    for (size_t k = 0; k < w->n; k++) y0[k] = isnan(all[w->N + k]) ? 0 : all[w->N + k];
    return N;
}

static bool value_alloc(const norm_job *w, const char *name, norm_value *v)
{
    *v = (norm_value){ .name = name, .value = malloc((4 * w->n + 1) * sizeof *v->value) };
    if (!v->value) return false;
    v->expected = v->value + w->n;
    v->t = v->expected + w->n;
    v->nu = v->t + w->n;
    for (size_t k = 0; k < 4 * w->n; k++) v->value[k] = NAN;
    return true;
}

static void set_value(const norm_job *w, const norm_model *m, const double *all, const double *y0,
                      norm_value *v)
{
    for (size_t k = 0; k < w->n; k++) {
        if (isnan(all[w->N + k])) continue;
        v->value[k] = y0[k];
        v->expected[k] = y0[k] - m->E0[k];
        v->t[k] = norm_t(m, k, 0);
        v->nu[k] = (double)(v->N - w->q);
    }
}

/* Whether the formula leaves anything of the N numbers y but rounding. */
static bool varies(const norm_model *m, const double *y)
{
    static const double rounding = 1e-10;
    double most = 0, left = 0;
    for (size_t i = 0; i < m->N; i++) {
        most = fmax(most, fabs(y[i]));
        left = fmax(left, fabs(m->E[i]));
    }
    return left > rounding * most;
}

/* all: N + n numbers, in the order of the design; those that are NAN are left out.  Where too few
 * have it, nothing is said. */
static apsm_status judge_value(norm_job *w, const char *name, const double *all)
{
    enum { LEAST_FREEDOM = 5 };
    norm_value *v = &w->value[w->values];
    norm_model m = { 0 };
    double *X = malloc(((w->N + w->n) * w->q + w->N + w->n + 1) * sizeof *X);
    apsm_status status = X && value_alloc(w, name, v) ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        double *y = X + (w->N + w->n) * w->q, *y0 = y + w->N;
        w->values++;
        v->N = gather(w, all, X, y, y0);
        if (v->N > w->q + LEAST_FREEDOM)
            status = norm_model_make(
                w->ctx, &(norm_data){ v->N, w->n, w->q, 1, 1, .X = X, .Y = y, .Y0 = y0 }, &m);
        const bool judged = status == APSM_OK && m.E0;
        if (judged && varies(&m, y)) set_value(w, &m, all, y0, v);
        if (judged && !varies(&m, y))
            status = norm_note(w, "'%s' is not judged: the norm's shapes do not differ in it%s",
                               name, w->s->formula ? ", given the formula" : "");
    }
    norm_model_free(&m);
    free(X);
    return status == APSM_ERR_ARG ? APSM_OK : status; /* a level is missing among those */
}

static apsm_status judge_size(norm_job *w, double *all)
{
    const size_t V = 3 * w->m.J;
    for (size_t i = 0; i < w->N; i++) all[i] = size_of(w->m.J, w->Y + i * V);
    for (size_t k = 0; k < w->n; k++) all[w->N + k] = size_of(w->m.J, w->files.P + k * V);
    return judge_value(w, "centroid size", all);
}

apsm_status norm_judge_values(norm_job *w)
{
    double *all = malloc((w->N + w->n + 1) * sizeof *all);
    w->value = calloc(w->table.n + 1, sizeof *w->value);
    apsm_status status = all && w->value ? judge_size(w, all) : APSM_ERR_MEMORY;
    for (size_t c = 0; c < w->table.n && status == APSM_OK; c++) {
        const apsm_column *column = &w->table.column[c];
        bool known = false;
        if (apsm_column_spoilt_by(column))
            status = norm_note(w, "column '%s' is not judged: '%s' is no number", column->name,
                               apsm_column_spoilt_by(column));
        if (status != APSM_OK || column->category || norm_allows_for(w, column)) continue;
        for (size_t i = 0; i < w->N + w->n; i++) all[i] = column->value[w->row[i]];
        for (size_t k = 0; k < w->n; k++) known |= !isnan(all[w->N + k]);
        if (known) status = judge_value(w, column->name, all);
    }
    free(all);
    return status;
}

void norm_values_free(norm_job *w)
{
    for (size_t k = 0; k < w->values; k++) free(w->value[k].value);
    free(w->value);
}
