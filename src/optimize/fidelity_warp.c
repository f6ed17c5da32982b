/* The warp of the template by near particles alone.
 *
 *   w      a vertex's row of the whole warp; the particles T, its place x
 *   near   those with |w_j| > LEAST max |w|: some thirty of a thousand, all within about 3 h
 *   w'     w on near + d,   sum_near w'_j = 1,   sum_near w'_j T_j = x
 *
 * Weights fall off as exp(-2 r / h), so that what is left out moves no vertex by more than
 * thousandths of the particles' own moves; but particles that move as one affine map would be
 * missed by the sum of all that is left out.  So w' reproduces affine maps again, with the least
 * d, entries taken relative to |w|:  d_j = |w_j| b_j' l,  b_j = (1, (T_j - x) / h),
 * (sum_near |w_j| b_j b_j' + r 1) l = (1, 0) - sum_near w_j b_j, where r keeps l small in a
 * direction that a flat or single near set does not know. */
#include "optimize/fidelity_warp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/kernel.h"
#include "linalg/linalg.h"

static const double LEAST = 1e-3, RIDGE = 1e-4;

static double largest(size_t J, const double *w)
{
    double most = 0;
    for (size_t j = 0; j < J; j++) most = fmax(most, fabs(w[j]));
    return most;
}

/* The near particles of row w, in rising order; their number. */
static size_t find_near(size_t J, const double *w, uint32_t *near)
{
    const double least = LEAST * largest(J, w);
    size_t n = 0;
    for (size_t j = 0; j < J; j++)
        if (fabs(w[j]) > least) near[n++] = (uint32_t)j;
    return n;
}

/* b_j of the head. */
static void make_terms(const double x[3], const double *T, uint32_t j, double h, double b[4])
{
    b[0] = 1;
    for (size_t c = 0; c < 3; c++) b[1 + c] = (T[3 * (size_t)j + c] - x[c]) / h;
}

/* l of the head, from row w; 0 where there is none. */
static void find_correction(const double *w, const double x[3], const double *T, double h, size_t n,
                            const uint32_t *near, double l[4])
{
    double A[16] = { 0 }, trace = 0;
    for (size_t a = 0; a < 4; a++) l[a] = a == 0;
    for (size_t k = 0; k < n; k++) {
        double b[4];
        make_terms(x, T, near[k], h, b);
        for (size_t a = 0; a < 4; a++) {
            l[a] -= w[near[k]] * b[a];
            for (size_t c = 0; c <= a; c++) A[4 * a + c] += fabs(w[near[k]]) * b[a] * b[c];
        }
    }
    for (size_t a = 0; a < 4; a++) trace += A[5 * a];
    for (size_t a = 0; a < 4; a++) A[5 * a] += RIDGE * trace;
    if (apsm_cholesky(4, A) == APSM_OK)
        apsm_cholesky_solve(4, A, 1, l);
    else
        memset(l, 0, 4 * sizeof *l);
}

static void make_row(const double *w, const double x[3], const double *T, double h, size_t n,
                     const uint32_t *near, double *weight)
{
    double l[4];
    find_correction(w, x, T, h, n, near, l);
    for (size_t k = 0; k < n; k++) {
        double b[4], d = 0;
        make_terms(x, T, near[k], h, b);
        for (size_t a = 0; a < 4; a++) d += b[a] * l[a];
        weight[k] = w[near[k]] + fabs(w[near[k]]) * d;
    }
}

/* start, and room for the rows; near (J) is scratch. */
static apsm_status measure_rows(const apsm_warp *whole, uint32_t *near, fidelity_warp *warp)
{
    warp->start = malloc((warp->nv + 1) * sizeof *warp->start);
    if (!warp->start) return APSM_ERR_MEMORY;
    warp->start[0] = 0;
    for (size_t v = 0; v < warp->nv; v++) {
        const size_t n = find_near(whole->J, whole->W + v * whole->J, near);
        warp->start[v + 1] = warp->start[v] + n;
        if (n > warp->most) warp->most = n;
    }
    warp->index = malloc((warp->start[warp->nv] + 1) * sizeof *warp->index);
    warp->weight = malloc((warp->start[warp->nv] + 1) * sizeof *warp->weight);
    return warp->index && warp->weight ? APSM_OK : APSM_ERR_MEMORY;
}

apsm_status fidelity_warp_build(const apsm_warp *whole, const double *X, const double *T, double h,
                                fidelity_warp *warp)
{
    const size_t J = whole->J;
    *warp = (fidelity_warp){ .nv = whole->nv };
    uint32_t *near = malloc(J * sizeof *near);
    const apsm_status status = near ? measure_rows(whole, near, warp) : APSM_ERR_MEMORY;
    free(near);
    for (size_t v = 0; status == APSM_OK && v < warp->nv; v++) {
        uint32_t *index = warp->index + warp->start[v];
        const double *w = whole->W + v * J;
        const size_t n = find_near(J, w, index);
        make_row(w, X + 3 * v, T, h, n, index, warp->weight + warp->start[v]);
    }
    if (status != APSM_OK) fidelity_warp_free(warp);
    return status;
}

void fidelity_warp_free(fidelity_warp *warp)
{
    free(warp->start);
    free(warp->index);
    free(warp->weight);
    *warp = (fidelity_warp){ 0 };
}

APSM_KERNEL void fidelity_warp_displace(const fidelity_warp *warp, const double *X, const double *D,
                                        double *Y)
{
    for (size_t v = 0; v < warp->nv; v++) {
        double sum[4] = { 0 };
        for (size_t k = warp->start[v]; k < warp->start[v + 1]; k++)
            for (size_t c = 0; c < 4; c++)
                sum[c] += warp->weight[k] * D[4 * (size_t)warp->index[k] + c];
        for (size_t c = 0; c < 3; c++) Y[3 * v + c] = X[3 * v + c] + sum[c];
    }
}
