/* A statistical model of Scalismo or Statismo (HDF5) becomes shapes of which it is the model: a
 * mesh and particles each, all in the model's frame. x_i = mean + sum_k sqrt(variance_k) s_ik
 * mode_k With the scores s that a model of shapes keeps they are its shapes.  Without there are as
 * many as modes and one more, with random scores that are centred, uncorrelated and of variance 1,
 * so that mean and covariance of the shapes are those of the model, and each lies as far from the
 * mean as shapes do. */
#include "apsm/exchange.h"

#include <stdlib.h>

#include "core/sized.h"

#ifndef APSM_HDF5
apsm_status apsm_read_statismo_sized(apsm_context *ctx, const char *path, size_t J,
                                     apsm_foreign_model *model, size_t size)
{
    (void)J, (void)model, (void)size;
    return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                     "%s: this build has no HDF5; install libhdf5-dev and configure with "
                     "-DAPSM_HDF5=ON",
                     path);
}
#else
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/random.h"
#include "exchange/hdf5_file.h"
#include "geometry/vec3.h"

enum { SHAPES_MOST = 256, VERTICES_MOST = 10000000 };

typedef struct dense_basis {
    apsm_mesh mean;
    size_t modes, shapes;             /* shapes: columns of the scores; 0: it has none */
    double *basis, *variance, *score; /* 3 nv x modes, modes, modes x shapes */
    double noise;
} dense_basis;

static void basis_free(dense_basis *b)
{
    apsm_mesh_free(&b->mean);
    free(b->basis);
    free(b->variance);
    free(b->score);
}

static apsm_status damaged(apsm_context *ctx, const char *path, const char *what)
{
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: has no readable %s; a model file of Scalismo or Statismo (.h5) is wanted",
                     path, what);
}

/* Coordinates and cells are stored axis by axis. */
static apsm_status read_mesh(apsm_context *ctx, const char *path, hid_t file, apsm_mesh *mesh)
{
    size_t axes, nv, corners, nf = 0;
    double *cell = NULL, *x = NULL;
    apsm_status status = APSM_OK;
    if (!h5_get(file, "/representer/points", &axes, &nv, &x) || axes != 3 || nv < 4 ||
        nv > VERTICES_MOST)
        status = damaged(ctx, path, "/representer/points");
    else if (!h5_get(file, "/representer/cells", &corners, &nf, &cell) || corners != 3 || nf < 4)
        status = damaged(ctx, path, "/representer/cells of triangles");
    if (status == APSM_OK) status = apsm_mesh_alloc(mesh, nv, nf);
    for (size_t k = 0; k < 3 * nf && status == APSM_OK; k++) {
        const double v = cell[k % 3 * nf + k / 3];
        if (!(v >= 0 && v < (double)nv)) status = damaged(ctx, path, "/representer/cells");
        if (status == APSM_OK) mesh->F[k] = (uint32_t)v;
    }
    free(cell);
    free(x);
    return status;
}

/* The basis is orthonormal, or (before version 0.9) each column has the length of its standard
 * deviation. */
static apsm_status normalise(apsm_context *ctx, const char *path, size_t n, dense_basis *b)
{
    for (size_t k = 0; k < b->modes; k++) {
        double square = 0;
        for (size_t v = 0; v < n; v++)
            square += b->basis[v * b->modes + k] * b->basis[v * b->modes + k];
        const bool unit = fabs(square - 1) < 1e-3,
                   scaled = fabs(square - b->variance[k]) < 1e-3 * b->variance[k];
        if (!(b->variance[k] > 0) || !(square > 0) || !(unit || scaled))
            return damaged(ctx, path,
                           "/model/pcaBasis: its columns are neither of length 1 nor of that of "
                           "/model/pcaVariance");
        for (size_t v = 0; v < n; v++) b->basis[v * b->modes + k] /= sqrt(square);
    }
    return APSM_OK;
}

static apsm_status read_model(apsm_context *ctx, const char *path, hid_t file, dense_basis *b)
{
    const size_t n = 3 * b->mean.nv;
    size_t rows, columns, modes;
    double *mean = NULL, *noise = NULL;
    apsm_status status = APSM_OK;
    if (!h5_get(file, "/model/mean", &rows, &columns, &mean) || rows * columns != n)
        status = damaged(ctx, path, "/model/mean of the mesh's points");
    else if (!h5_get(file, "/model/pcaVariance", &rows, &columns, &b->variance) ||
             (b->modes = rows * columns) < 2)
        status = damaged(ctx, path, "/model/pcaVariance of two modes or more");
    else if (!h5_get(file, "/model/pcaBasis", &rows, &modes, &b->basis) || rows != n ||
             modes != b->modes)
        status = damaged(ctx, path, "/model/pcaBasis of all points and modes");
    for (size_t k = 0; k < n && status == APSM_OK; k++) {
        b->mean.V[k] = mean[k];
        if (!isfinite(mean[k])) status = damaged(ctx, path, "/model/mean");
    }
    if (status == APSM_OK && h5_get(file, "/model/noiseVariance", &rows, &columns, &noise))
        b->noise = noise[0];
    free(mean);
    free(noise);
    return status == APSM_OK ? normalise(ctx, path, n, b) : status;
}

/* Scores, if there are any that are scores: centred and of variance 1. */
static void read_scores(hid_t file, dense_basis *b)
{
    size_t rows, columns;
    if (!h5_get(file, "/modelinfo/scores", &rows, &columns, &b->score)) return;
    bool good = rows == b->modes && columns >= 3 && columns <= SHAPES_MOST;
    for (size_t k = 0; k < b->modes && good; k++) {
        double sum = 0, square = 0;
        for (size_t i = 0; i < columns; i++) sum += b->score[k * columns + i] / (double)columns;
        for (size_t i = 0; i < columns; i++)
            square += b->score[k * columns + i] * b->score[k * columns + i] / (double)(columns - 1);
        good = fabs(sum) < 1e-2 && fabs(square - 1) < 0.1;
    }
    b->shapes = good ? columns : 0;
}

/* One of the columns of `scores` (N x K) at a time: normal numbers, centred, without those before.
 */
static void draw_scores(size_t N, size_t K, double *scores)
{
    apsm_random rng = apsm_random_stream(0, APSM_STREAM_BOOTSTRAP, 0, 4);
    for (size_t k = 0; k < K; k++) {
        double length = 0;
        for (size_t i = 0; i < N; i++) scores[i * K + k] = apsm_random_normal(&rng);
        for (int pass = 0; pass < 2; pass++) {
            double mean = 0;
            for (size_t i = 0; i < N; i++) mean += scores[i * K + k] / (double)N;
            for (size_t i = 0; i < N; i++) scores[i * K + k] -= mean;
            for (size_t m = 0; m < k; m++) {
                double dot = 0;
                for (size_t i = 0; i < N; i++) dot += scores[i * K + m] * scores[i * K + k];
                for (size_t i = 0; i < N; i++)
                    scores[i * K + k] -= dot / (double)(N - 1) * scores[i * K + m];
            }
        }
        for (size_t i = 0; i < N; i++) length += scores[i * K + k] * scores[i * K + k];
        for (size_t i = 0; i < N; i++) scores[i * K + k] *= sqrt((double)(N - 1) / length);
    }
}

/* vertex (J, out): far from each other on the mean, one after the other the farthest from all
 * before. */
static apsm_status spread_vertices(const apsm_mesh *mesh, size_t J, size_t *vertex)
{
    double centre[3] = { 0 }, *d = malloc(mesh->nv * sizeof *d);
    if (!d) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < 3 * mesh->nv; k++) centre[k % 3] += mesh->V[k] / (double)mesh->nv;
    for (size_t v = 0; v < mesh->nv; v++) d[v] = INFINITY;
    const double *from = centre;
    for (size_t j = 0; j < J; j++) {
        size_t far = 0;
        double most = -1;
        for (size_t v = 0; v < mesh->nv; v++) {
            const double to_last = vec3_distance2(mesh->V + 3 * v, from);
            if (j > 1 ? to_last < d[v] : true) d[v] = to_last;
            if (d[v] > most) most = d[v], far = v;
        }
        vertex[j] = far;
        from = mesh->V + 3 * far;
    }
    free(d);
    return APSM_OK;
}

static apsm_status make_shape(const dense_basis *b, const double *scores, size_t K,
                              const size_t *vertex, size_t J, apsm_mesh *mesh, double *P)
{
    APSM_TRY(apsm_mesh_copy(&b->mean, mesh));
    for (size_t v = 0; v < 3 * mesh->nv; v++)
        for (size_t k = 0; k < K; k++)
            mesh->V[v] += sqrt(b->variance[k]) * scores[k] * b->basis[v * b->modes + k];
    for (size_t j = 0; j < J; j++) memcpy(P + 3 * j, mesh->V + 3 * vertex[j], 3 * sizeof *P);
    return APSM_OK;
}

static apsm_status make_shapes(const dense_basis *b, const double *scores, size_t K,
                               apsm_foreign_model *m)
{
    size_t *vertex = malloc(m->J * sizeof *vertex);
    apsm_status status = vertex ? spread_vertices(&b->mean, m->J, vertex) : APSM_ERR_MEMORY;
    for (size_t i = 0; i < m->I && status == APSM_OK; i++) {
        snprintf(m->names[i], sizeof m->names[i], "%s_%03zu", m->of_shapes ? "shape" : "drawn",
                 i + 1);
        status = make_shape(b, scores + i * K, K, vertex, m->J, &m->meshes[i], m->P + i * m->J * 3);
    }
    free(vertex);
    return status;
}

static apsm_status fill(const dense_basis *b, size_t J, apsm_foreign_model *m)
{
    const size_t most = SHAPES_MOST - 1, K = b->shapes || b->modes < most ? b->modes : most;
    m->I = b->shapes ? b->shapes : K + 1;
    m->J = J < b->mean.nv ? J : b->mean.nv;
    m->of_shapes = b->shapes > 0;
    m->left_out = b->modes - K;
    m->names = calloc(m->I, sizeof *m->names);
    m->meshes = calloc(m->I, sizeof *m->meshes);
    m->P = malloc(m->I * m->J * 3 * sizeof *m->P);
    double *scores = malloc(m->I * K * sizeof *scores);
    apsm_status status = m->names && m->meshes && m->P && scores ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK && !m->of_shapes) draw_scores(m->I, K, scores);
    for (size_t k = 0; status == APSM_OK && m->of_shapes && k < m->I * K; k++)
        scores[k] = b->score[k % K * m->I + k / K];
    if (status == APSM_OK) status = make_shapes(b, scores, K, m);
    free(scores);
    return status;
}

static void tell(apsm_context *ctx, const char *path, const dense_basis *b,
                 const apsm_foreign_model *m)
{
    if (!m->of_shapes)
        apsm_log(ctx, APSM_LOG_WARNING,
                 "%s: keeps no scores of its shapes: the %zu shapes of the model folder are drawn "
                 "from it, and have its mean and covariance",
                 path, m->I);
    if (m->left_out > 0)
        apsm_log(ctx, APSM_LOG_WARNING, "%s: the last %zu of %zu modes are left out", path,
                 m->left_out, b->modes);
    if (b->noise > 0)
        apsm_log(ctx, APSM_LOG_WARNING, "%s: its noise variance of %g is left out", path, b->noise);
}

apsm_status apsm_read_statismo_sized(apsm_context *ctx, const char *path, size_t J,
                                     apsm_foreign_model *out, size_t size)
{
    dense_basis b = { 0 };
    apsm_foreign_model known = { 0 }, *const model = &known;
    apsm_give_sized(&known, sizeof known, out, size);
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL); /* failures are told by us */
    const hid_t file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    if (file < 0)
        return apsm_fail(ctx, APSM_ERR_IO, "%s: cannot be read as HDF5; is it there?", path);
    apsm_status status = read_mesh(ctx, path, file, &b.mean);
    if (status == APSM_OK) status = read_model(ctx, path, file, &b);
    if (status == APSM_OK) {
        read_scores(file, &b);
        status = fill(&b, J, model);
    }
    H5Fclose(file);
    if (status == APSM_OK) tell(ctx, path, &b, model);
    basis_free(&b);
    if (status != APSM_OK) apsm_foreign_model_free(model);
    apsm_give_sized(&known, sizeof known, out, size);
    return status;
}
#endif

void apsm_foreign_model_free_sized(apsm_foreign_model *model, size_t size)
{
    apsm_foreign_model m = { 0 };
    if (!apsm_take_sized(model, size, &m, sizeof m)) return;
    for (size_t i = 0; m.meshes && i < m.I; i++) apsm_mesh_free(&m.meshes[i]);
    free(m.meshes);
    free(m.names);
    free(m.P);
    memset(model, 0, size);
}
