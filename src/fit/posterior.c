/* Conditioning of (40) on (41), [Tipping and Bishop 1999; Albrecht et al. 2013].  With G = A U,
 * e = y - A mean and N = noise A A' + R:
 *
 *   B = (variance^-1 + G' N^-1 G)^-1,   b = B G' N^-1 e                                      (42)
 *   E x = mean + U b + K (e - G b),     K = noise A' N^-1                                    (43)
 *   cov x = (U - K G) B (U - K G)' + noise (I - K A)                                         (44)
 *   y's Mahalanobis distance^2 = e' N^-1 e - (G' N^-1 e)' b,
 *   log det cov y = log det N + log det variance - log det B
 *
 * Where particles are measured themselves N and K are diagonal. */
#include "fit/posterior.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "linalg/linalg.h"

static const double two_pi = 6.283185307179586;

/* From g = G' N^-1 e in b, the precision in B (lower), e' N^-1 e and log det N to the scores. */
static apsm_status solve_scores(const posterior_model *m, size_t n, double eNe, double logdet,
                                posterior_scores *s, double *work)
{
    const size_t M = m->M;
    double *L = work, *g = L + M * M;
    for (size_t k = 0; k < M; k++) s->B[k * M + k] += 1 / m->variance[k];
    memcpy(L, s->B, M * M * sizeof *L);
    APSM_TRY(apsm_cholesky(M, L));
    memcpy(g, s->b, M * sizeof *g);
    apsm_cholesky_solve(M, L, 1, s->b);
    memset(s->B, 0, M * M * sizeof *s->B);
    for (size_t k = 0; k < M; k++) s->B[k * M + k] = 1;
    apsm_cholesky_solve(M, L, M, s->B);
    logdet += M > 0 ? apsm_cholesky_logdet(M, L) : 0;
    for (size_t k = 0; k < M; k++) {
        logdet += log(m->variance[k]);
        eNe -= g[k] * s->b[k];
    }
    s->mahalanobis2 = fmax(eNe, 0);
    s->log_likelihood = -0.5 * ((double)n * log(two_pi) + logdet + s->mahalanobis2);
    return APSM_OK;
}

/* ---- any measurements ---- */

size_t posterior_work_size(const posterior_model *m, size_t n)
{
    return n * n + 2 * n * m->M + n * m->D + 2 * n + m->M * m->M + m->M + 2 * m->D * m->M;
}

/* The parts of the scratch. */
typedef struct seen_work {
    double *L;  /* n x n: factor of N */
    double *G;  /* n x M */
    double *NG; /* n x M: N^-1 G */
    double *NA; /* n x D: N^-1 A */
    double *e;  /* n */
    double *Ne; /* n: N^-1 e */
    double *solve;
    double *V;  /* D x M: U - K G */
    double *VB; /* D x M */
} seen_work;

static seen_work seen_work_in(const posterior_model *m, size_t n, double *work)
{
    seen_work w = { .L = work };
    w.G = w.L + n * n;
    w.NG = w.G + n * m->M;
    w.NA = w.NG + n * m->M;
    w.e = w.NA + n * m->D;
    w.Ne = w.e + n;
    w.V = w.Ne + n;
    w.VB = w.V + m->D * m->M;
    w.solve = w.VB + m->D * m->M;
    return w;
}

/* (43); e is overwritten by N^-1 (e - G b). */
static void mean_of_all(const posterior_model *m, const posterior_seen *seen,
                        const posterior_scores *s, seen_work *w, double *x)
{
    const size_t n = seen->n;
    memcpy(x, m->mean, m->D * sizeof *x);
    for (size_t k = 0; k < m->M; k++)
        for (size_t d = 0; d < m->D; d++) x[d] += s->b[k] * m->mode[k * m->D + d];
    for (size_t a = 0; a < n; a++)
        for (size_t k = 0; k < m->M; k++) w->e[a] -= w->G[a * m->M + k] * s->b[k];
    for (size_t a = 0; a < n; a++)
        for (size_t d = 0; d < m->D; d++) x[d] += m->noise * w->NA[a * m->D + d] * w->e[a];
}

/* (44) */
static void covariance_of_all(const posterior_model *m, const posterior_seen *seen,
                              const posterior_scores *s, seen_work *w, double *C)
{
    const size_t n = seen->n, D = m->D, M = m->M;
    for (size_t d = 0; d < D; d++)
        for (size_t k = 0; k < M; k++) w->V[d * M + k] = m->mode[k * D + d];
    apsm_gemm(1, 0, D, M, n, -m->noise, w->NA, D, w->G, M, 1, w->V, M);
    apsm_gemm(0, 0, D, M, M, 1, w->V, M, s->B, M, 0, w->VB, M);
    apsm_gemm(1, 0, D, D, n, -m->noise * m->noise, w->NA, D, seen->A, D, 0, C, D);
    for (size_t d = 0; d < D; d++) C[d * D + d] += m->noise;
    apsm_gemm(0, 1, D, D, M, 1, w->VB, M, w->V, M, 1, C, D);
}

apsm_status posterior_of(const posterior_model *m, const posterior_seen *seen, posterior_scores *s,
                         double *x, double *C, double *work)
{
    const size_t n = seen->n, D = m->D, M = m->M;
    seen_work w = seen_work_in(m, n, work);
    apsm_gemm(0, 1, n, M, D, 1, seen->A, D, m->mode, D, 0, w.G, M);
    apsm_gemm(0, 1, n, n, D, m->noise, seen->A, D, seen->A, D, 0, w.L, n);
    for (size_t a = 0; a < n; a++)
        for (size_t b = 0; b <= a; b++) w.L[a * n + b] += seen->R[a * n + b];
    APSM_TRY(apsm_cholesky(n, w.L));
    apsm_gemv(n, D, seen->A, m->mean, w.e);
    for (size_t a = 0; a < n; a++) w.e[a] = seen->y[a] - w.e[a];
    memcpy(w.Ne, w.e, n * sizeof *w.Ne);
    apsm_cholesky_solve(n, w.L, 1, w.Ne);
    memcpy(w.NG, w.G, n * M * sizeof *w.NG);
    apsm_cholesky_solve(n, w.L, M, w.NG);
    double eNe = 0;
    for (size_t a = 0; a < n; a++) eNe += w.e[a] * w.Ne[a];
    apsm_gemm(1, 0, M, M, n, 1, w.G, M, w.NG, M, 0, s->B, M);
    apsm_gemm(1, 0, M, 1, n, 1, w.G, M, w.Ne, 1, 0, s->b, 1);
    APSM_TRY(solve_scores(m, n, eNe, n > 0 ? apsm_cholesky_logdet(n, w.L) : 0, s, w.solve));
    if (!x && !C) return APSM_OK;
    memcpy(w.NA, seen->A, n * D * sizeof *w.NA);
    apsm_cholesky_solve(n, w.L, D, w.NA);
    if (x) mean_of_all(m, seen, s, &w, x);
    if (C) covariance_of_all(m, seen, s, &w, C);
    return APSM_OK;
}

/* ---- left-out measurements ---- */

size_t posterior_left_out_size(const posterior_model *m, size_t n)
{
    return 2 * n * n + n * m->M + n;
}

/* S (lower) = cov y; V: n x M */
static void covariance_of_seen(const posterior_model *m, const posterior_seen *seen, double *S,
                               double *V)
{
    const size_t n = seen->n, D = m->D, M = m->M;
    apsm_gemm(0, 1, n, M, D, 1, seen->A, D, m->mode, D, 0, V, M);
    for (size_t a = 0; a < n; a++)
        for (size_t k = 0; k < M; k++) V[a * M + k] *= sqrt(m->variance[k]);
    apsm_gemm(0, 1, n, n, D, m->noise, seen->A, D, seen->A, D, 0, S, n);
    apsm_gemm(0, 1, n, n, M, 1, V, M, V, M, 1, S, n);
    for (size_t a = 0; a < n; a++)
        for (size_t b = 0; b <= a; b++) S[a * n + b] += seen->R[a * n + b];
}

/* With S the covariance of y and u = S^-1 (y - A mean), y less what the other measurements say is
 * (S^-1)_kk^-1 u_k, and its covariance (S^-1)_kk^-1. */
apsm_status posterior_left_out(const posterior_model *m, const posterior_seen *seen, double *miss,
                               double *z2, double *work)
{
    const size_t n = seen->n;
    double *S = work, *inverse = S + n * n, *u = inverse + n * n, *V = u + n;
    covariance_of_seen(m, seen, S, V);
    APSM_TRY(apsm_cholesky(n, S));
    apsm_gemv(n, m->D, seen->A, m->mean, u);
    for (size_t a = 0; a < n; a++) u[a] = seen->y[a] - u[a];
    apsm_cholesky_solve(n, S, 1, u);
    memset(inverse, 0, n * n * sizeof *inverse);
    for (size_t a = 0; a < n; a++) inverse[a * n + a] = 1;
    apsm_cholesky_solve(n, S, n, inverse);
    for (size_t k = 0; k + 2 < n; k += 3) {
        double block[9], *r = miss + k;
        for (size_t a = 0; a < 9; a++) block[a] = inverse[(k + a / 3) * n + k + a % 3];
        memcpy(r, u + k, 3 * sizeof *r);
        APSM_TRY(apsm_cholesky(3, block));
        apsm_cholesky_solve(3, block, 1, r);
        z2[k / 3] = r[0] * u[k] + r[1] * u[k + 1] + r[2] * u[k + 2];
    }
    return APSM_OK;
}

/* ---- particles themselves ---- */

size_t posterior_particles_work_size(const posterior_model *m)
{
    return m->M * m->M + m->M + m->D * m->M + m->D + 6 * m->M;
}

/* (43) of particle j: its measurement pulls by noise / (noise + error). */
static double pull_of(const posterior_model *m, double error)
{
    return isinf(error) ? 0 : m->noise / (m->noise + error);
}

/* Block j of (44).  work: 6 M. */
static void block_of(const posterior_model *m, const posterior_scores *s, size_t j, double pull,
                     double block[9], double *work)
{
    const size_t D = m->D, M = m->M;
    double *U = work, *BU = work + 3 * M; /* 3 x M: rows of U of the particle */
    for (size_t k = 0; k < M; k++)
        for (size_t a = 0; a < 3; a++) U[a * M + k] = (1 - pull) * m->mode[k * D + 3 * j + a];
    apsm_gemm(0, 0, 3, M, M, 1, U, M, s->B, M, 0, BU, M);
    apsm_gemm(0, 1, 3, 3, M, 1, BU, M, U, M, 0, block, 3);
    for (size_t a = 0; a < 3; a++) block[4 * a] += m->noise * (1 - pull);
}

static void particles_of_scores(const posterior_model *m, const double *y, const double *error,
                                const posterior_scores *s, double *x)
{
    memcpy(x, m->mean, m->D * sizeof *x);
    for (size_t k = 0; k < m->M; k++)
        for (size_t d = 0; d < m->D; d++) x[d] += s->b[k] * m->mode[k * m->D + d];
    for (size_t d = 0; d < m->D; d++) {
        const double pull = pull_of(m, error[d / 3]);
        if (pull > 0) x[d] += pull * (y[d] - x[d]);
    }
}

apsm_status posterior_of_particles(const posterior_model *m, const double *y, const double *error,
                                   posterior_scores *s, double *x, double *block, double *work)
{
    const size_t D = m->D, M = m->M;
    double *W = work, *e = W + D * M + 6 * M, *solve = e + D, eNe = 0, logdet = 0;
    size_t n = 0;
    for (size_t d = 0; d < D; d++) { /* N^-1/2 e and N^-1/2 U, zero where nothing is seen */
        const bool seen = !isinf(error[d / 3]);
        const double N = m->noise + error[d / 3], root = seen ? 1 / sqrt(N) : 0;
        e[d] = seen ? root * (y[d] - m->mean[d]) : 0;
        for (size_t k = 0; k < M; k++) W[d * M + k] = root * m->mode[k * D + d];
        eNe += e[d] * e[d];
        logdet += seen ? log(N) : 0;
        n += seen;
    }
    apsm_syrk(M, D, W, 0, s->B);
    apsm_gemm(1, 0, M, 1, D, 1, W, M, e, 1, 0, s->b, 1);
    APSM_TRY(solve_scores(m, n, eNe, logdet, s, solve));
    if (x) particles_of_scores(m, y, error, s, x);
    for (size_t j = 0; block && j < D / 3; j++)
        block_of(m, s, j, pull_of(m, error[j]), block + 9 * j, W);
    return APSM_OK;
}

/* ---- one coordinate of particles ---- */

/* V = (I - pull n n') U of particle j (3 x M) and its block of (44).  work: 6 M. */
static void normal_block(const posterior_model *m, const posterior_scores *s, size_t j,
                         const double n[3], double pull, double block[9], double *work)
{
    const size_t D = m->D, M = m->M;
    double *V = work, *VB = work + 3 * M;
    for (size_t k = 0; k < M; k++) {
        const double *u = m->mode + k * D + 3 * j, along = n[0] * u[0] + n[1] * u[1] + n[2] * u[2];
        for (size_t a = 0; a < 3; a++) V[a * M + k] = u[a] - pull * along * n[a];
    }
    apsm_gemm(0, 0, 3, M, M, 1, V, M, s->B, M, 0, VB, M);
    apsm_gemm(0, 1, 3, 3, M, 1, VB, M, V, M, 0, block, 3);
    for (size_t a = 0; a < 3; a++)
        for (size_t b = 0; b < 3; b++)
            block[3 * a + b] += m->noise * ((a == b ? 1 : 0) - pull * n[a] * n[b]);
}

static void along_normals_of_scores(const posterior_model *m, const double *normal, const double *y,
                                    const double *error, const posterior_scores *s, double *x)
{
    memcpy(x, m->mean, m->D * sizeof *x);
    for (size_t k = 0; k < m->M; k++)
        for (size_t d = 0; d < m->D; d++) x[d] += s->b[k] * m->mode[k * m->D + d];
    for (size_t d = 0; d < m->D; d += 3) {
        const double *n = normal + d, pull = pull_of(m, error[d / 3]);
        double e = 0;
        for (size_t c = 0; c < 3 && pull > 0; c++) e += n[c] * (y[d + c] - x[d + c]);
        for (size_t c = 0; c < 3; c++) x[d + c] += pull * e * n[c];
    }
}

apsm_status posterior_along_normals(const posterior_model *m, const double *normal, const double *y,
                                    const double *error, posterior_scores *s, double *x,
                                    double *block, double *work)
{
    const size_t D = m->D, M = m->M, J = D / 3;
    double *W = work, *e = W + D * M + 6 * M, *solve = e + D, eNe = 0, logdet = 0;
    size_t n = 0;
    for (size_t j = 0; j < J; j++) { /* N^-1/2 e and N^-1/2 G, zero where nothing is seen */
        const bool seen = !isinf(error[j]);
        const double N = m->noise + error[j], root = seen ? 1 / sqrt(N) : 0, *a = normal + 3 * j;
        e[j] = 0;
        for (size_t c = 0; c < 3 && seen; c++)
            e[j] += root * a[c] * (y[3 * j + c] - m->mean[3 * j + c]);
        for (size_t k = 0; k < M; k++) {
            const double *u = m->mode + k * D + 3 * j;
            W[j * M + k] = root * (a[0] * u[0] + a[1] * u[1] + a[2] * u[2]);
        }
        eNe += e[j] * e[j];
        logdet += seen ? log(N) : 0;
        n += seen;
    }
    apsm_syrk(M, J, W, 0, s->B);
    apsm_gemm(1, 0, M, 1, J, 1, W, M, e, 1, 0, s->b, 1);
    APSM_TRY(solve_scores(m, n, eNe, logdet, s, solve));
    if (x) along_normals_of_scores(m, normal, y, error, s, x);
    for (size_t j = 0; block && j < J; j++)
        normal_block(m, s, j, normal + 3 * j, pull_of(m, error[j]), block + 9 * j, W);
    return APSM_OK;
}
