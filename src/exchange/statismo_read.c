/* A statistical model of Scalismo or Statismo (HDF5) becomes shapes of which it is the model: a
 * mesh and particles each, all in the model's frame. x_i = mean + sum_k sqrt(variance_k) s_ik
 * mode_k With the scores s that a model of shapes keeps they are its shapes.  Without there are as
 * many as modes and one more, with random scores that are centred, uncorrelated and of variance 1,
 * so that mean and covariance of the shapes are those of the model, and each lies as far from the
 * mean as shapes do. */
#include "apsm/exchange.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"
#include "core/sized.h"
#include "exchange/hdf5.h"
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

static apsm_status damaged(const h5_in *in, const char *what)
{
    return apsm_fail(in->ctx, APSM_ERR_FORMAT,
                     "%s: has no readable %s; a model file of Scalismo or Statismo (.h5) is wanted",
                     in->path, what);
}

static apsm_status take_cells(const h5_in *in, size_t nv, const double *cell, apsm_mesh *mesh)
{
    for (size_t k = 0; k < 3 * mesh->nf; k++) {
        const double v = cell[k % 3 * mesh->nf + k / 3];
        if (!(v >= 0 && v < (double)nv)) return damaged(in, "/representer/cells");
        mesh->F[k] = (uint32_t)v;
    }
    return APSM_OK;
}

/* Coordinates and cells are stored axis by axis. */
static apsm_status read_mesh(const h5_in *in, apsm_mesh *mesh)
{
    size_t axes, nv, corners, nf;
    double *cell = NULL, *x = NULL;
    apsm_status status = h5_read(in, "/representer/points", &axes, &nv, &x);
    if (status == APSM_OK && (axes != 3 || nv < 4 || nv > VERTICES_MOST))
        status = damaged(in, "/representer/points");
    if (status == APSM_OK) status = h5_read(in, "/representer/cells", &corners, &nf, &cell);
    if (status == APSM_OK && (corners != 3 || nf < 4))
        status = damaged(in, "/representer/cells of triangles");
    if (status == APSM_OK) status = apsm_mesh_alloc(mesh, nv, nf);
    if (status == APSM_OK) status = take_cells(in, nv, cell, mesh);
    free(cell);
    free(x);
    return status;
}

/* The basis is orthonormal, or (before version 0.9) each column has the length of its standard
 * deviation. */
static apsm_status normalise(const h5_in *in, size_t n, dense_basis *b)
{
    for (size_t k = 0; k < b->modes; k++) {
        double square = 0;
        for (size_t v = 0; v < n; v++)
            square += b->basis[v * b->modes + k] * b->basis[v * b->modes + k];
        const bool unit = fabs(square - 1) < 1e-3,
                   scaled = fabs(square - b->variance[k]) < 1e-3 * b->variance[k];
        if (!(b->variance[k] > 0) || !(square > 0) || !(unit || scaled))
            return damaged(in, "/model/pcaBasis: its columns are neither of length 1 nor of that "
                               "of /model/pcaVariance");
        for (size_t v = 0; v < n; v++) b->basis[v * b->modes + k] /= sqrt(square);
    }
    return APSM_OK;
}

static apsm_status read_mean(const h5_in *in, apsm_mesh *mesh)
{
    size_t rows, columns;
    double *mean;
    APSM_TRY(h5_read(in, "/model/mean", &rows, &columns, &mean));
    apsm_status status =
        rows * columns == 3 * mesh->nv ? APSM_OK : damaged(in, "/model/mean of the mesh's points");
    for (size_t k = 0; k < 3 * mesh->nv && status == APSM_OK; k++) {
        mesh->V[k] = mean[k];
        if (!isfinite(mean[k])) status = damaged(in, "/model/mean");
    }
    free(mean);
    return status;
}

/* *x <- NULL where the file has no such thing. */
static apsm_status read_if_there(const h5_in *in, const char *name, size_t *rows, size_t *columns,
                                 double **x)
{
    bool there;
    *x = NULL;
    APSM_TRY(h5_has(in, name, &there));
    return there ? h5_read(in, name, rows, columns, x) : APSM_OK;
}

static apsm_status read_model(const h5_in *in, dense_basis *b)
{
    const size_t n = 3 * b->mean.nv;
    size_t rows, columns, modes;
    double *noise;
    APSM_TRY(read_mean(in, &b->mean));
    APSM_TRY(h5_read(in, "/model/pcaVariance", &rows, &columns, &b->variance));
    b->modes = rows * columns;
    if (b->modes < 2) return damaged(in, "/model/pcaVariance of two modes or more");
    APSM_TRY(h5_read(in, "/model/pcaBasis", &rows, &modes, &b->basis));
    if (rows != n || modes != b->modes)
        return damaged(in, "/model/pcaBasis of all points and modes");
    APSM_TRY(read_if_there(in, "/model/noiseVariance", &rows, &columns, &noise));
    if (noise) b->noise = noise[0];
    free(noise);
    return normalise(in, n, b);
}

/* Scores, if there are any that are scores: centred and of variance 1. */
static apsm_status read_scores(const h5_in *in, dense_basis *b)
{
    size_t rows, columns;
    APSM_TRY(read_if_there(in, "/modelinfo/scores", &rows, &columns, &b->score));
    if (!b->score) return APSM_OK;
    bool good = rows == b->modes && columns >= 3 && columns <= SHAPES_MOST;
    for (size_t k = 0; k < b->modes && good; k++) {
        double sum = 0, square = 0;
        for (size_t i = 0; i < columns; i++) sum += b->score[k * columns + i] / (double)columns;
        for (size_t i = 0; i < columns; i++)
            square += b->score[k * columns + i] * b->score[k * columns + i] / (double)(columns - 1);
        good = fabs(sum) < 1e-2 && fabs(square - 1) < 0.1;
    }
    b->shapes = good ? columns : 0;
    return APSM_OK;
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

static apsm_status read_basis(const h5_in *in, dense_basis *b)
{
    APSM_TRY(read_mesh(in, &b->mean));
    APSM_TRY(read_model(in, b));
    return read_scores(in, b);
}

apsm_status apsm_read_statismo_sized(apsm_context *ctx, const char *path, size_t J,
                                     apsm_foreign_model *out, size_t size)
{
    dense_basis b = { 0 };
    h5_in in;
    apsm_foreign_model known = { 0 }, *const model = &known;
    apsm_give_sized(&known, sizeof known, out, size);
    APSM_TRY(h5_open(ctx, path, &in));
    apsm_status status = read_basis(&in, &b);
    h5_close(&in);
    if (status == APSM_OK) status = fill(&b, J, model);
    if (status == APSM_OK) tell(ctx, path, &b, model);
    basis_free(&b);
    if (status != APSM_OK) apsm_foreign_model_free(model);
    apsm_give_sized(&known, sizeof known, out, size);
    return status;
}

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
