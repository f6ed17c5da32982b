#include "joint/pose_shape.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"
#include "joint/se3.h"
#include "model/procrustes.h"

static size_t count(const apsm_parts *parts, size_t d)
{
    return parts->first[d + 1] - parts->first[d];
}

static apsm_status allocate(size_t I, const apsm_parts *parts, apsm_pose_shape *r)
{
    const size_t n = parts->n, J = parts->first[n];
    *r = (apsm_pose_shape){ .I = I, .n = n, .J = J };
    r->mean_pose = malloc(n * 16 * sizeof(double));
    r->pose = malloc(I * n * 6 * sizeof(double));
    r->shape = malloc(I * J * 3 * sizeof(double));
    r->gyration = malloc(n * 9 * sizeof(double));
    return r->mean_pose && r->pose && r->shape && r->gyration ? APSM_OK : APSM_ERR_MEMORY;
}

void apsm_pose_shape_free(apsm_pose_shape *r)
{
    free(r->mean_pose);
    free(r->pose);
    free(r->shape);
    free(r->gyration);
    apsm_shape_model_free(&r->poses);
    apsm_shape_model_free(&r->shapes);
    apsm_shape_model_free(&r->both);
    *r = (apsm_pose_shape){ 0 };
}

/* The part's mean shape has its centroid in the origin of the part's own frame: Procrustes leaves
 * it where the parts lie, and it is moved from there by -c. */
static void centre_part(size_t I, size_t J, double *S, double *M)
{
    double c[3] = { 0 };
    for (size_t k = 0; k < I * J * 3; k++) c[k % 3] += S[k] / (double)(I * J);
    for (size_t k = 0; k < I * J * 3; k++) S[k] -= c[k % 3];
    for (size_t k = 0; k < I; k++)
        for (size_t a = 0; a < 3; a++) M[16 * k + 4 * a + 3] -= c[a];
}

/* The square root of sum_j (|x_j|^2 I - x_j x_j^T) over the mean part. */
static void second_moments(size_t I, size_t J, const double *S, double root[9])
{
    double A[9] = { 0 }, U[9], s[3], V[9];
    for (size_t j = 0; j < J; j++) {
        double x[3] = { 0 };
        for (size_t k = 0; k < 3 * I; k++) x[k % 3] += S[3 * (k / 3 * J + j) + k % 3] / (double)I;
        const double x2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
        for (size_t k = 0; k < 9; k++) A[k] += (k % 4 == 0) * x2 - x[k / 3] * x[k % 3];
    }
    apsm_svd3(A, U, s, V);
    for (size_t k = 0; k < 9; k++) {
        root[k] = 0;
        for (size_t m = 0; m < 3; m++)
            root[k] += U[3 * (k / 3) + m] * sqrt(s[m]) * U[3 * (k % 3) + m];
    }
}

/* pose_i = M_i^-1 takes the part's own frame to where it lies; their mean, and logarithms about it.
 */
static apsm_status poses_of_part(size_t I, size_t n, double *M, double *mean, double *xi)
{
    double back[16];
    for (size_t i = 0; i < I; i++) APSM_TRY(apsm_affine_invert(M + 16 * i, M + 16 * i));
    apsm_se3_mean(I, M, mean);
    APSM_TRY(apsm_affine_invert(mean, back));
    for (size_t i = 0; i < I; i++) {
        double D[16];
        apsm_affine_multiply(back, M + 16 * i, D);
        apsm_se3_log(D, xi + 6 * i * n);
    }
    return APSM_OK;
}

static apsm_status separate_part(apsm_context *ctx, const apsm_parts *parts, size_t d,
                                 const double *Q, double *X, apsm_pose_shape *r)
{
    const size_t I = r->I, J = count(parts, d);
    const apsm_procrustes_options opt = apsm_procrustes_defaults();
    double *M = malloc(I * 16 * sizeof *M);
    if (!M) return APSM_ERR_MEMORY;
    apsm_parts_take(parts, d, I, Q, X);
    apsm_status status = apsm_procrustes(ctx, I, J, X, &opt, M, X);
    if (status == APSM_OK) {
        centre_part(I, J, X, M);
        second_moments(I, J, X, r->gyration + 9 * d);
        for (size_t i = 0; i < I; i++)
            memcpy(r->shape + 3 * (i * r->J + parts->first[d]), X + 3 * i * J, 3 * J * sizeof *X);
        status = poses_of_part(I, r->n, M, r->mean_pose + 16 * d, r->pose + 6 * d);
    }
    free(M);
    return status;
}

/* z of (1): 2n triples a subject, with `stride` triples from one subject to the next. */
static void weigh_poses(const apsm_parts *parts, const apsm_pose_shape *r, size_t stride, double *z)
{
    for (size_t k = 0; k < r->I * r->n; k++) {
        const size_t i = k / r->n, d = k % r->n;
        const double *xi = r->pose + 6 * k, *S = r->gyration + 9 * d;
        const double root = sqrt((double)count(parts, d));
        double *to = z + 3 * (i * stride + 2 * d);
        for (size_t a = 0; a < 3; a++) {
            to[a] = S[3 * a] * xi[0] + S[3 * a + 1] * xi[1] + S[3 * a + 2] * xi[2];
            to[3 + a] = root * xi[3 + a];
        }
    }
}

static double total(const apsm_shape_model *m)
{
    double sum = 0;
    for (size_t k = 0; k < m->modes; k++) sum += m->variance[k];
    return sum;
}

/* Of n numbers a subject, over I subjects; divisor I - 1. */
static double variance(size_t I, size_t n, const double *x)
{
    double sum = 0;
    for (size_t k = 0; k < n; k++) {
        double mean = 0;
        for (size_t i = 0; i < I; i++) mean += x[i * n + k] / (double)I;
        for (size_t i = 0; i < I; i++) sum += (x[i * n + k] - mean) * (x[i * n + k] - mean);
    }
    return I > 1 ? sum / (double)(I - 1) : 0;
}

static apsm_status make_models(apsm_context *ctx, const apsm_parts *parts, const double *Q,
                               apsm_pose_shape *r)
{
    const size_t I = r->I, Z = 2 * r->n, all = Z + r->J;
    double *z = malloc(I * all * 3 * sizeof *z);
    if (!z) return APSM_ERR_MEMORY;
    weigh_poses(parts, r, Z, z);
    apsm_status status = apsm_shape_model_fit(ctx, I, Z, z, &r->poses);
    if (status == APSM_OK) status = apsm_shape_model_fit(ctx, I, r->J, r->shape, &r->shapes);
    if (status == APSM_OK) {
        weigh_poses(parts, r, all, z);
        for (size_t i = 0; i < I; i++)
            memcpy(z + 3 * (i * all + Z), r->shape + 3 * i * r->J, 3 * r->J * sizeof *z);
        status = apsm_shape_model_fit(ctx, I, all, z, &r->both);
    }
    const double whole = variance(I, 3 * r->J, Q);
    r->leak = whole > 0 ? 1 - (total(&r->poses) + total(&r->shapes)) / whole : 0;
    free(z);
    return status;
}

apsm_status apsm_pose_shape_separate(apsm_context *ctx, size_t I, const apsm_parts *parts,
                                     const double *Q, apsm_pose_shape *result)
{
    apsm_status status = allocate(I, parts, result);
    double *X = malloc(I * result->J * 3 * sizeof *X);
    if (!X) status = APSM_ERR_MEMORY;
    for (size_t d = 0; status == APSM_OK && d < parts->n; d++)
        status = separate_part(ctx, parts, d, Q, X, result);
    if (status == APSM_OK) status = make_models(ctx, parts, Q, result);
    free(X);
    if (status != APSM_OK) apsm_pose_shape_free(result);
    return status;
}

void apsm_pose_shape_compose(const apsm_pose_shape *ps, const apsm_parts *parts, const double *xi,
                             const double *s, double *x)
{
    for (size_t d = 0; d < ps->n; d++) {
        double M[16];
        memcpy(M, ps->mean_pose + 16 * d, sizeof M);
        if (xi) {
            double turn[16];
            apsm_se3_exp(xi + 6 * d, turn);
            apsm_affine_multiply(M, turn, M);
        }
        apsm_affine_apply(M, count(parts, d), s + 3 * parts->first[d], x + 3 * parts->first[d]);
    }
}

apsm_status apsm_pose_shape_pose(const apsm_pose_shape *ps, const apsm_parts *parts, double b,
                                 const double *z, double *xi)
{
    for (size_t d = 0; d < ps->n; d++) {
        const double *S = ps->gyration + 9 * d, root = sqrt((double)count(parts, d));
        double M[16], back[16];
        apsm_affine_identity(M);
        for (size_t k = 0; k < 9; k++) M[4 * (k / 3) + k % 3] = S[k];
        APSM_TRY(apsm_affine_invert(M, back));
        for (size_t a = 0; a < 3; a++) {
            const double *y = z + 6 * d;
            xi[6 * d + a] =
                b * (back[4 * a] * y[0] + back[4 * a + 1] * y[1] + back[4 * a + 2] * y[2]);
            xi[6 * d + 3 + a] = b * y[3 + a] / root;
        }
    }
    return APSM_OK;
}
