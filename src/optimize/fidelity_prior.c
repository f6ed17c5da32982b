/* The prior of the fidelity stage: what the other shapes say about one.  Mean and modes are those
 * of probabilistic PCA (Tipping and Bishop, J. R. Stat. Soc. B 61, 1999), whose spectrum beside the
 * first m modes is one variance, the noise; m is what gives shapes outside the model the largest
 * likelihood.  All of it lives in the Gram matrix of the shapes.
 *
 * A model is judged by the distances by which it fails, not by their squares, and squares weighted
 * by the inverse of what is expected add up like distances.  So a mode of standard deviation s is
 * held by noise / s, where the likelihood would take noise^2 / s^2. */
#include "optimize/fidelity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"
#include "linalg/linalg.h"

enum { MOST_FOLDS = 32, MOST_SHAPES = 256 };

typedef struct fitting {
    size_t I, J, n;       /* n: shapes that the models are made from */
    size_t stride;        /* every stride-th shape is one of them, */
    const bool *left_out; /* but for those left out */
    double *X;            /* I x 3J: particles over h, without their mean */
    double *G;            /* I x n: inner products with the shapes of the models */
    /* per fold */
    size_t *count;      /* shapes of the model */
    double *w, *Q;      /* n, n x n: eigenvalues and vectors of the fold's centred Gram matrix */
    double *likelihood; /* folds x n: summed over the fold's shapes, by number of modes */
    apsm_fidelity_prior *prior;
} fitting;

static void fitting_free(fitting *f)
{
    free(f->X);
    free(f->G);
    free(f->count);
    free(f->w);
    free(f->Q);
    free(f->likelihood);
}

void apsm_fidelity_prior_free(apsm_fidelity_prior *p)
{
    free(p->noise);
    free(p->mean);
    free(p->mode);
    free(p->weight);
    *p = (apsm_fidelity_prior){ 0 };
}

/* Shapes of the fold's model as numbers 0..n-1 among those of all models; returns how many. */
static size_t members(const fitting *f, size_t fold, size_t *member)
{
    size_t m = 0;
    for (size_t k = 0; k < f->n; k++)
        if ((k * f->stride) % f->prior->folds != fold &&
            !(f->left_out && f->left_out[k * f->stride]))
            member[m++] = k;
    return m;
}

/* Log-likelihood of a shape that has scores b on the model's modes and squared distance r2 from
 * its mean, added for every number of modes; without constants. */
static void add_likelihood(size_t modes, size_t D, const double *variance, const double *b,
                           double r2, double *likelihood)
{
    double rest = 0, logs = 0, inside = 0, left = r2;
    for (size_t k = 0; k < modes; k++) rest += variance[k];
    for (size_t m = 0; m < modes; m++) {
        const double noise = rest / (double)(D - m);
        likelihood[m] -=
            0.5 * (logs + (double)(D - m) * log(noise) + inside + fmax(left, 0) / noise);
        logs += log(variance[m]);
        inside += b[m] * b[m] / variance[m];
        left -= b[m] * b[m];
        rest -= variance[m];
    }
}

/* Eigenpairs of a fold's model and what it makes of the shapes outside. */
static apsm_status examine_fold(apsm_context *ctx, size_t fold, int worker, void *user)
{
    (void)ctx, (void)worker;
    fitting *f = user;
    const size_t n = f->n;
    double *C = malloc((n * n + 3 * n) * sizeof *C), *row = C + n * n, *c = row + n, *b = c + n;
    size_t *member = malloc(n * sizeof *member);
    apsm_status status = C && member ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        const size_t m = members(f, fold, member);
        double all = 0;
        for (size_t a = 0; a < m; a++) {
            row[a] = 0;
            for (size_t k = 0; k < m; k++)
                row[a] += f->G[member[a] * f->stride * n + member[k]] / (double)m;
            all += row[a] / (double)m;
        }
        for (size_t a = 0; a < m; a++)
            for (size_t k = 0; k < m; k++)
                C[a * m + k] = f->G[member[a] * f->stride * n + member[k]] - row[a] - row[k] + all;
        double *w = f->w + fold * n, *Q = f->Q + fold * n * n;
        f->count[fold] = m;
        status = apsm_symmetric_eigen(m, C, w, Q);
        size_t modes = 0;
        while (status == APSM_OK && modes + 1 < m && w[modes] > 1e-9 * w[0]) modes++;
        for (size_t k = 0; k < m; k++) w[k] = k < modes ? w[k] / (double)(m - 1) : 0;
        for (size_t i = fold; status == APSM_OK && i < f->I; i += f->prior->folds) {
            double mean = 0, r2 = 0;
            const double *x = f->X + i * 3 * f->J;
            for (size_t k = 0; k < 3 * f->J; k++) r2 += x[k] * x[k];
            for (size_t a = 0; a < m; a++) mean += f->G[i * n + member[a]] / (double)m;
            for (size_t a = 0; a < m; a++) c[a] = f->G[i * n + member[a]] - mean - row[a] + all;
            for (size_t k = 0; k < modes; k++) {
                double s = 0;
                for (size_t a = 0; a < m; a++) s += Q[k * m + a] * c[a];
                b[k] = s / sqrt(w[k] * (double)(m - 1));
            }
            add_likelihood(modes, 3 * f->J, w, b, r2 - 2 * mean + all, f->likelihood + fold * n);
        }
    }
    free(C);
    free(member);
    return status;
}

/* Modes that every fold has, at most a third of its shapes; of those the most likely number. */
static size_t choose_modes(const fitting *f, long wanted, double *gain)
{
    const size_t folds = f->prior->folds;
    size_t most = f->n, best = 0;
    for (size_t fold = 0; fold < folds; fold++) {
        size_t have = 0;
        while (have < f->count[fold] && f->w[fold * f->n + have] > 0) have++;
        if (have < most) most = have;
    }
    if (most > 0) most--; /* something must be left for the noise */
    if (most > 3 * f->J / 2) most = 3 * f->J / 2;
    double best_sum = -INFINITY, first = 0;
    for (size_t m = 0; m <= most && most > 0; m++) {
        double sum = 0;
        for (size_t fold = 0; fold < folds; fold++) sum += f->likelihood[fold * f->n + m];
        if (m == 0) first = sum;
        if (sum > best_sum) best_sum = sum, best = m;
    }
    *gain = most > 0 ? (best_sum - first) / (double)f->I : 0;
    return wanted < 0 ? best : (size_t)wanted < most ? (size_t)wanted : most;
}

static apsm_status make_fold(apsm_context *ctx, size_t fold, int worker, void *user)
{
    (void)ctx, (void)worker;
    fitting *f = user;
    apsm_fidelity_prior *p = f->prior;
    const size_t n = f->n, D = 3 * f->J, m = f->count[fold];
    const double *w = f->w + fold * n, *Q = f->Q + fold * n * n;
    double *mean = p->mean + fold * D;
    size_t *member = malloc(n * sizeof *member);
    if (!member) return APSM_ERR_MEMORY;
    members(f, fold, member);
    memset(mean, 0, D * sizeof *mean);
    for (size_t a = 0; a < m; a++)
        for (size_t k = 0; k < D; k++) mean[k] += f->X[member[a] * f->stride * D + k] / (double)m;
    double rest = 0;
    for (size_t k = p->modes; k < m; k++) rest += w[k];
    p->noise[fold] = rest / (double)(D - p->modes);
    for (size_t k = 0; k < p->modes; k++) {
        double *u = p->mode + (fold * p->modes + k) * D;
        memset(u, 0, D * sizeof *u);
        /* the rows of Q sum to zero, so the mean need not be taken away */
        const double scale = 1 / sqrt(w[k] * (double)(m - 1));
        for (size_t a = 0; a < m; a++) {
            const double q = scale * Q[k * m + a], *x = f->X + member[a] * f->stride * D;
            for (size_t e = 0; e < D; e++) u[e] += q * x[e];
        }
        p->weight[fold * p->modes + k] = 1 - sqrt(p->noise[fold] / w[k]);
    }
    free(member);
    return APSM_OK;
}

/* Models of all folds for f->X as it is. */
static apsm_status fit_models(apsm_context *ctx, long modes, fitting *f)
{
    apsm_fidelity_prior *p = f->prior;
    const size_t D = 3 * f->J;
    memset(f->likelihood, 0, p->folds * f->n * sizeof *f->likelihood);
    apsm_gemm(0, 1, f->I, f->n, D, 1, f->X, D, f->X, D * f->stride, 0, f->G, f->n);
    APSM_TRY(apsm_parallel_for(ctx, p->folds, examine_fold, f, NULL));
    p->modes = choose_modes(f, modes, &p->gain);
    p->mode = malloc((p->folds * p->modes * D + 1) * sizeof *p->mode);
    p->weight = malloc((p->folds * p->modes + 1) * sizeof *p->weight);
    if (!p->mode || !p->weight) return APSM_ERR_MEMORY;
    return apsm_parallel_for(ctx, p->folds, make_fold, f, NULL);
}

static apsm_status fit(apsm_context *ctx, const double *P, double h, long modes, double *centre,
                       fitting *f)
{
    apsm_fidelity_prior *p = f->prior;
    const size_t I = f->I, D = 3 * f->J;
    for (size_t k = 0; k < D; k++) {
        centre[k] = 0;
        for (size_t i = 0; i < I; i++) centre[k] += P[i * D + k] / (double)I;
    }
    for (size_t i = 0; i < I; i++)
        for (size_t k = 0; k < D; k++) f->X[i * D + k] = (P[i * D + k] - centre[k]) / h;
    APSM_TRY(fit_models(ctx, modes, f));
    for (size_t fold = 0; fold < p->folds; fold++)
        for (size_t k = 0; k < D; k++) p->mean[fold * D + k] += centre[k] / h;
    return APSM_OK;
}

apsm_status apsm_fidelity_prior_fit(apsm_context *ctx, size_t I, size_t J, const double *P,
                                    double h, long modes, const bool *left_out,
                                    apsm_fidelity_prior *prior)
{
    *prior = (apsm_fidelity_prior){ .I = I, .J = J, .folds = I < MOST_FOLDS ? I : MOST_FOLDS };
    if (I < 2 || J == 0 || !(h > 0)) return APSM_ERR_ARG;
    fitting f = { .I = I, .J = J, .left_out = left_out, .prior = prior };
    f.stride = (I + MOST_SHAPES - 1) / MOST_SHAPES;
    f.n = (I + f.stride - 1) / f.stride;
    f.X = malloc(I * 3 * J * sizeof *f.X);
    f.G = malloc(I * f.n * sizeof *f.G);
    f.count = calloc(prior->folds, sizeof *f.count);
    f.w = calloc(prior->folds * f.n, sizeof *f.w);
    f.Q = malloc(prior->folds * f.n * f.n * sizeof *f.Q);
    f.likelihood = calloc(prior->folds * f.n, sizeof *f.likelihood);
    prior->noise = malloc(prior->folds * sizeof *prior->noise);
    prior->mean = malloc(prior->folds * 3 * J * sizeof *prior->mean);
    double *centre = malloc(3 * J * sizeof *centre);
    const bool ok = f.X && f.G && f.count && f.w && f.Q && f.likelihood && prior->noise &&
                    prior->mean && centre;
    const apsm_status status = ok ? fit(ctx, P, h, modes, centre, &f) : APSM_ERR_MEMORY;
    free(centre);
    fitting_free(&f);
    if (status != APSM_OK) apsm_fidelity_prior_free(prior);
    return status;
}
