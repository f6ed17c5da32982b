/* Principal components of corresponding particles by the method of snapshots (Sirovich, Quart.
 * Appl. Math. 45, 1987): with the deviations Y (I x 3J) from the mean,
 *   G = Y Y^T = Q diag(s^2) Q^T   (I x I)
 *   mode_k = s_k^-1 (row k of Q^T) Y,   variance_k = s_k^2 / (I - 1),   score_ik = s_k Q_ik
 * so the 3J x 3J covariance is never made; where that is the smaller of the two,
 *   C = Y^T Y = V^T diag(s^2) V   (3J x 3J),   modes the rows of V,   score_i = V y_i
 * and Y is never made either: its rows come in blocks, in their order. */
#include "model/shape_model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/linalg.h"
#include "model/mode_sign.h"

static apsm_status check_finite(apsm_context *ctx, size_t I, size_t J, const double *P)
{
    for (size_t k = 0; k < 3 * I * J; k++)
        if (!isfinite(P[k]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE,
                             "particle %zu of shape %zu is not finite: repair the particles first",
                             k / 3 % J, k / (3 * J));
    return APSM_OK;
}

/* Sums differences to shape 0, which keeps digits when the cohort lies far from the origin and
 * makes the deviations of equal shapes exactly zero: mean <- mean of the differences. */
static void mean_difference(size_t I, size_t n, const double *P, double *mean)
{
    memset(mean, 0, n * sizeof *mean);
    for (size_t i = 0; i < I; i++)
        for (size_t k = 0; k < n; k++) mean[k] += P[i * n + k] - P[k];
    for (size_t k = 0; k < n; k++) mean[k] /= (double)I;
}

/* Y (rows x n) <- deviations of the shapes from `first` on. */
static void deviations(size_t first, size_t rows, size_t n, const double *P, const double *mean,
                       double *Y)
{
    for (size_t i = 0; i < rows; i++)
        for (size_t k = 0; k < n; k++) Y[i * n + k] = (P[(first + i) * n + k] - P[k]) - mean[k];
}

/* Of n eigenvalues w of I shapes. */
static size_t count_modes(size_t I, size_t n, const double *w)
{
    size_t r = 0;
    while (r + 1 < I && r < n && w[r] > 0.0 && w[r] > APSM_ZERO_VARIANCE * w[0]) r++;
    return r;
}

/* Makes row x (n) a unit vector. */
static void make_unit(size_t n, double *x)
{
    double norm2 = 0.0;
    for (size_t k = 0; k < n; k++) norm2 += x[k] * x[k];
    const double factor = 1.0 / sqrt(norm2);
    for (size_t k = 0; k < n; k++) x[k] *= factor;
}

/* -1 if the largest entry is negative, else 1: of a mode that says nothing else. */
static double sign_of_largest(size_t n, const double *x)
{
    double largest = 0.0;
    for (size_t k = 0; k < n; k++)
        if (fabs(x[k]) > fabs(largest)) largest = x[k];
    return largest < 0.0 ? -1.0 : 1.0;
}

/* Turns mode k of a model whose mean and scores are there so that plus is what mode_sign.h says. */
static void set_sign(apsm_shape_model *model, size_t k)
{
    const size_t n = 3 * model->J;
    double *v = model->mode + k * n, *score = model->score + k, change[APSM_MODE_CHANGES];
    apsm_mode_changes(model->J, model->mean, v, 1e-6 * sqrt(model->variance[0]), change);
    double sign = apsm_mode_sign(change, model->I, model->modes, score);
    if (sign == 0.0) sign = sign_of_largest(n, v);
    if (sign > 0.0) return;
    for (size_t c = 0; c < n; c++) v[c] = -v[c];
    for (size_t i = 0; i < model->I; i++) score[i * model->modes] = -score[i * model->modes];
}

static apsm_status alloc_modes(apsm_shape_model *model, size_t r)
{
    model->modes = r;
    if (r == 0) return APSM_OK;
    model->mode = malloc(r * 3 * model->J * sizeof *model->mode);
    model->variance = malloc(r * sizeof *model->variance);
    model->score = malloc(model->I * r * sizeof *model->score);
    return model->mode && model->variance && model->score ? APSM_OK : APSM_ERR_MEMORY;
}

/* Y: deviations; G: their Gram matrix, destroyed; w (I) and Q (I x I): scratch. */
static apsm_status fit_modes(apsm_shape_model *model, const double *Y, double *G, double *w,
                             double *Q)
{
    const size_t I = model->I, n = 3 * model->J;
    APSM_TRY(apsm_symmetric_eigen(I, G, w, Q));
    const size_t r = count_modes(I, I, w);
    APSM_TRY(alloc_modes(model, r));
    if (r == 0) return APSM_OK;
    apsm_gemm(0, 0, r, n, I, 1.0, Q, I, Y, n, 0.0, model->mode, n);
    for (size_t k = 0; k < r; k++) {
        const double s = sqrt(w[k]);
        make_unit(n, model->mode + k * n);
        model->variance[k] = w[k] / (double)(I - 1);
        for (size_t i = 0; i < I; i++) model->score[i * r + k] = s * Q[k * I + i];
    }
    return APSM_OK;
}

/* model->mean: of the differences to shape 0. */
static apsm_status fit_by_shapes(apsm_shape_model *model, const double *P)
{
    const size_t I = model->I, n = 3 * model->J;
    double *Y = malloc(I * n * sizeof *Y), *G = malloc(I * I * sizeof *G);
    double *Q = malloc(I * I * sizeof *Q), *w = malloc(I * sizeof *w);
    apsm_status status = APSM_ERR_MEMORY;
    if (Y && G && Q && w) {
        deviations(0, I, n, P, model->mean, Y);
        apsm_gram(I, n, 1.0, Y, G);
        status = fit_modes(model, Y, G, w, Q);
    }
    free(Y);
    free(G);
    free(Q);
    free(w);
    return status;
}

/* ---- the side of the particles ---- */

enum { BLOCK = 64 }; /* shapes at a time */

static size_t block_size(size_t I, size_t first)
{
    return I - first < BLOCK ? I - first : BLOCK;
}

/* C (n x n, lower triangle) <- Y^T Y; Y: BLOCK x n. */
static void covariance(const apsm_shape_model *model, const double *P, double *Y, double *C)
{
    const size_t I = model->I, n = 3 * model->J;
    for (size_t first = 0; first < I; first += BLOCK) {
        const size_t rows = block_size(I, first);
        deviations(first, rows, n, P, model->mean, Y);
        apsm_syrk(n, rows, Y, first > 0 ? 1.0 : 0.0, C);
    }
}

static void find_scores(apsm_shape_model *model, const double *P, double *Y)
{
    const size_t I = model->I, n = 3 * model->J, r = model->modes;
    for (size_t first = 0; first < I; first += BLOCK) {
        const size_t rows = block_size(I, first);
        deviations(first, rows, n, P, model->mean, Y);
        apsm_gemm(0, 1, rows, r, n, 1.0, Y, n, model->mode, n, 0.0, model->score + first * r, r);
    }
}

/* C: the covariance, destroyed; w (n), Q (n x n), Y (BLOCK x n): scratch. */
static apsm_status fit_covariance(apsm_shape_model *model, const double *P, double *C, double *w,
                                  double *Q, double *Y)
{
    const size_t I = model->I, n = 3 * model->J;
    covariance(model, P, Y, C);
    APSM_TRY(apsm_symmetric_eigen(n, C, w, Q));
    const size_t r = count_modes(I, n, w);
    APSM_TRY(alloc_modes(model, r));
    if (r == 0) return APSM_OK;
    memcpy(model->mode, Q, r * n * sizeof *Q);
    for (size_t k = 0; k < r; k++) {
        make_unit(n, model->mode + k * n);
        model->variance[k] = w[k] / (double)(I - 1);
    }
    find_scores(model, P, Y);
    return APSM_OK;
}

static apsm_status fit_by_particles(apsm_shape_model *model, const double *P)
{
    const size_t n = 3 * model->J;
    double *C = malloc(n * n * sizeof *C), *Q = malloc(n * n * sizeof *Q);
    double *w = malloc(n * sizeof *w), *Y = malloc(BLOCK * n * sizeof *Y);
    const apsm_status status =
        C && Q && w && Y ? fit_covariance(model, P, C, w, Q, Y) : APSM_ERR_MEMORY;
    free(C);
    free(Q);
    free(w);
    free(Y);
    return status;
}

apsm_status apsm_shape_model_fit_side(apsm_context *ctx, apsm_model_side side, size_t I, size_t J,
                                      const double *P, apsm_shape_model *model)
{
    *model = (apsm_shape_model){ .I = I, .J = J };
    if (I == 0 || J == 0 || !P)
        return apsm_fail(ctx, APSM_ERR_ARG, "a shape model needs at least one shape and particle");
    APSM_TRY(check_finite(ctx, I, J, P));
    const size_t n = 3 * J;
    if (side == APSM_SIDE_SMALLER) side = I <= n ? APSM_SIDE_SHAPES : APSM_SIDE_PARTICLES;
    apsm_status status = APSM_ERR_MEMORY;
    model->mean = malloc(n * sizeof *model->mean);
    if (model->mean) {
        mean_difference(I, n, P, model->mean);
        status = side == APSM_SIDE_SHAPES ? fit_by_shapes(model, P) : fit_by_particles(model, P);
        for (size_t k = 0; k < n; k++) model->mean[k] += P[k];
    }
    for (size_t k = 0; k < model->modes && status == APSM_OK; k++) set_sign(model, k);
    if (status == APSM_OK) return APSM_OK;
    apsm_shape_model_free(model);
    return apsm_fail(ctx, status, "shape model of %zu shapes with %zu particles: %s", I, J,
                     apsm_status_text(status));
}

apsm_status apsm_shape_model_fit(apsm_context *ctx, size_t I, size_t J, const double *P,
                                 apsm_shape_model *model)
{
    return apsm_shape_model_fit_side(ctx, APSM_SIDE_SMALLER, I, J, P, model);
}

void apsm_shape_model_free(apsm_shape_model *model)
{
    free(model->mean);
    free(model->mode);
    free(model->variance);
    free(model->score);
    *model = (apsm_shape_model){ 0 };
}

void apsm_shape_model_scores(const apsm_shape_model *model, const double *p, double *b)
{
    const size_t n = 3 * model->J;
    for (size_t k = 0; k < model->modes; k++) {
        const double *mode = model->mode + k * n;
        b[k] = 0.0;
        for (size_t c = 0; c < n; c++) b[k] += mode[c] * (p[c] - model->mean[c]);
    }
}

void apsm_shape_model_synthesize(const apsm_shape_model *model, size_t m, const double *b,
                                 double *x)
{
    const size_t n = 3 * model->J;
    memcpy(x, model->mean, n * sizeof *x);
    for (size_t k = 0; k < m; k++)
        for (size_t c = 0; c < n; c++) x[c] += b[k] * model->mode[k * n + c];
}
