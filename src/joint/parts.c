/* Alignment of subjects with several parts: one Procrustes alignment over the particles of all
 * parts, of one part, or one for each part. */
#include "joint/parts.h"

#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"
#include "model/procrustes.h"

void apsm_parts_take(const apsm_parts *parts, size_t d, size_t I, const double *P, double *X)
{
    const size_t J = parts->first[parts->n], first = parts->first[d];
    const size_t n = 3 * (parts->first[d + 1] - first);
    for (size_t i = 0; i < I; i++) memcpy(X + i * n, P + 3 * (i * J + first), n * sizeof *X);
}

static apsm_procrustes_options procrustes_of(const apsm_joint_align_options *options)
{
    apsm_procrustes_options opt = apsm_procrustes_defaults();
    opt.scale = options->scale;
    opt.reference = options->reference;
    return opt;
}

/* One map a subject from particles X (I x J x 3), given to all parts. */
static apsm_status together(apsm_context *ctx, size_t I, size_t n, size_t J, const double *X,
                            const apsm_procrustes_options *opt, double *M)
{
    double *one = malloc(I * 16 * sizeof *one);
    if (!one) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_procrustes(ctx, I, J, X, opt, one, NULL);
    for (size_t k = 0; status == APSM_OK && k < I * n; k++)
        memcpy(M + 16 * k, one + 16 * (k / n), 16 * sizeof *M);
    free(one);
    return status;
}

/* The maps of part d alone, into M's places of that part. */
static apsm_status apart(apsm_context *ctx, size_t I, const apsm_parts *parts, size_t d,
                         const double *X, const apsm_procrustes_options *opt, double *M)
{
    double *one = malloc(I * 16 * sizeof *one);
    if (!one) return APSM_ERR_MEMORY;
    const size_t J = parts->first[d + 1] - parts->first[d];
    const apsm_status status = apsm_procrustes(ctx, I, J, X, opt, one, NULL);
    for (size_t i = 0; status == APSM_OK && i < I; i++)
        memcpy(M + 16 * (i * parts->n + d), one + 16 * i, 16 * sizeof *M);
    free(one);
    return status;
}

static apsm_status align(apsm_context *ctx, size_t I, const apsm_parts *parts, const double *P,
                         const apsm_joint_align_options *options, double *X, double *M)
{
    const apsm_procrustes_options opt = procrustes_of(options);
    const size_t by = options->by, *first = parts->first;
    if (options->alignment == APSM_JOINT_GLOBAL)
        return together(ctx, I, parts->n, first[parts->n], P, &opt, M);
    if (options->alignment == APSM_JOINT_BY) {
        apsm_parts_take(parts, by, I, P, X);
        return together(ctx, I, parts->n, first[by + 1] - first[by], X, &opt, M);
    }
    for (size_t d = 0; d < parts->n; d++) {
        apsm_parts_take(parts, d, I, P, X);
        APSM_TRY(apart(ctx, I, parts, d, X, &opt, M));
    }
    return APSM_OK;
}

static apsm_status check(apsm_context *ctx, size_t I, const apsm_parts *parts,
                         const apsm_joint_align_options *options)
{
    if (I == 0 || parts->n == 0 || parts->first[0] != 0)
        return apsm_fail(ctx, APSM_ERR_ARG, "a joint needs a subject and a part");
    for (size_t d = 0; d < parts->n; d++)
        if (parts->first[d + 1] < parts->first[d] + 3)
            return apsm_fail(ctx, APSM_ERR_ARG, "part %zu has fewer than 3 particles", d + 1);
    if (options->alignment == APSM_JOINT_BY && options->by >= parts->n)
        return apsm_fail(ctx, APSM_ERR_ARG, "there is no part %zu to align by", options->by + 1);
    return APSM_OK;
}

apsm_status apsm_joint_align(apsm_context *ctx, size_t I, const apsm_parts *parts, const double *P,
                             const apsm_joint_align_options *options, double *M, double *Q)
{
    APSM_TRY(check(ctx, I, parts, options));
    const size_t n = parts->n, J = parts->first[n];
    double *X = malloc(I * J * 3 * sizeof *X);
    if (!X) return APSM_ERR_MEMORY;
    const apsm_status status = align(ctx, I, parts, P, options, X, M);
    free(X);
    APSM_TRY(status);
    for (size_t k = 0; k < I * n; k++) {
        const size_t d = k % n, at = 3 * (k / n * J + parts->first[d]);
        apsm_affine_apply(M + 16 * k, parts->first[d + 1] - parts->first[d], P + at, Q + at);
    }
    return APSM_OK;
}
