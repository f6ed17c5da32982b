/* Fisher's discriminant d = S^-1 (m_1 - m_0) with S the covariance within groups in the modes'
 * scores; a shape scores d . (b - (m_0 + m_1) / 2), standardised by sqrt(d . (m_1 - m_0)), so that
 * scores of different folds may be compared. */
#include "statistics/classify.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/linalg.h"
#include "model/shape_model.h"

enum { LEAST = 4 };
static const double kept_share = 0.9;

typedef struct classifying {
    size_t N, J;
    const double *P;
    const size_t *group;
    size_t *fold; /* N */
    double *score;
} classifying;

static void deal(size_t N, const size_t *group, size_t folds, size_t *fold)
{
    size_t next[2] = { 0, 0 };
    for (size_t i = 0; i < N; i++) fold[i] = next[group[i]]++ % folds;
}

static size_t modes_used(const apsm_shape_model *m)
{
    double all = 0, so_far = 0;
    size_t k = 0;
    for (size_t j = 0; j < m->modes; j++) all += m->variance[j];
    while (k < m->modes && so_far < kept_share * all) so_far += m->variance[k++];
    const size_t most = m->I / 3 > 0 ? m->I / 3 : 1;
    return k < most ? k : most;
}

/* Means of the groups (2 x K) and their pooled covariance (K x K) of scores (n of them, stride
 * apart). */
static void moments(const apsm_shape_model *m, const size_t *group, size_t K, double *mean,
                    double *S)
{
    double n[2] = { 0, 0 };
    memset(mean, 0, 2 * K * sizeof *mean);
    memset(S, 0, K * K * sizeof *S);
    for (size_t i = 0; i < m->I; i++) {
        n[group[i]]++;
        for (size_t k = 0; k < K; k++) mean[group[i] * K + k] += m->score[i * m->modes + k];
    }
    for (size_t k = 0; k < 2 * K; k++) mean[k] /= n[k / K];
    for (size_t i = 0; i < m->I; i++)
        for (size_t a = 0; a < K; a++)
            for (size_t b = 0; b < K; b++)
                S[a * K + b] += (m->score[i * m->modes + a] - mean[group[i] * K + a]) *
                                (m->score[i * m->modes + b] - mean[group[i] * K + b]) /
                                (n[0] + n[1] - 2);
}

/* direction (K, out) of the discriminant. */
static apsm_status discriminant(const apsm_shape_model *m, const size_t *group, size_t K,
                                double *mean, double *direction)
{
    double *S = malloc((K * K + 1) * sizeof *S), length = 0;
    if (!S) return APSM_ERR_MEMORY;
    moments(m, group, K, mean, S);
    for (size_t k = 0; k < K; k++) {
        direction[k] = mean[K + k] - mean[k];
        S[k * (K + 1)] += 1e-9 * m->variance[0];
    }
    const apsm_status status = apsm_cholesky(K, S);
    if (status == APSM_OK) apsm_cholesky_solve(K, S, 1, direction);
    for (size_t k = 0; k < K; k++) length += direction[k] * (mean[K + k] - mean[k]);
    for (size_t k = 0; k < K && length > 0; k++) direction[k] /= sqrt(length);
    free(S);
    return status;
}

static apsm_status score_left_out(const classifying *c, size_t f, const apsm_shape_model *m,
                                  const size_t *group)
{
    const size_t K = modes_used(m);
    double *b = malloc((m->modes + 3 * K + 1) * sizeof *b);
    if (!b) return APSM_ERR_MEMORY;
    double *mean = b + m->modes, *direction = mean + 2 * K;
    const apsm_status status = discriminant(m, group, K, mean, direction);
    for (size_t i = 0; i < c->N && status == APSM_OK; i++) {
        if (c->fold[i] != f) continue;
        apsm_shape_model_scores(m, c->P + i * c->J * 3, b);
        c->score[i] = 0;
        for (size_t k = 0; k < K; k++)
            c->score[i] += direction[k] * (b[k] - 0.5 * (mean[k] + mean[K + k]));
    }
    free(b);
    return status;
}

static apsm_status run_fold(apsm_context *ctx, size_t f, int worker, void *user)
{
    (void)worker;
    const classifying *c = user;
    const size_t n3 = 3 * c->J;
    apsm_shape_model model = { 0 };
    double *P = malloc(c->N * n3 * sizeof *P);
    size_t *group = malloc(c->N * sizeof *group), n = 0;
    apsm_status status = P && group ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; i < c->N && status == APSM_OK; i++) {
        if (c->fold[i] == f) continue;
        memcpy(P + n * n3, c->P + i * n3, n3 * sizeof *P);
        group[n++] = c->group[i];
    }
    if (status == APSM_OK) status = apsm_shape_model_fit(ctx, n, c->J, P, &model);
    if (status == APSM_OK && model.modes > 0) status = score_left_out(c, f, &model, group);
    apsm_shape_model_free(&model);
    free(P);
    free(group);
    return status;
}

/* Share of pairs that are in the right order, and its variance by DeLong: of each shape the share
 * of the other group that it is on the right side of. */
void apsm_judge_scores(size_t N, const size_t *group, const double *score, double threshold,
                       apsm_classification *r)
{
    double n[2] = { 0, 0 }, right[2] = { 0, 0 }, sum[2] = { 0, 0 }, square[2] = { 0, 0 };
    for (size_t i = 0; i < N; i++) n[group[i]]++;
    for (size_t i = 0; i < N; i++) {
        const size_t g = group[i];
        double wins = 0;
        for (size_t k = 0; k < N; k++) {
            if (group[k] == g) continue;
            const double ahead = g == 1 ? score[i] - score[k] : score[k] - score[i];
            wins += (ahead > 0) + 0.5 * (ahead == 0);
        }
        wins /= n[1 - g];
        sum[g] += wins;
        square[g] += wins * wins;
        right[g] += g == 1 ? score[i] > threshold : score[i] <= threshold;
    }
    r->auc = sum[1] / n[1];
    r->accuracy = 0.5 * (right[0] / n[0] + right[1] / n[1]);
    double variance = 0;
    for (int g = 0; g < 2; g++)
        variance += (square[g] - sum[g] * sum[g] / n[g]) / (n[g] - 1) / n[g];
    const double half = 1.959963984540054 * sqrt(fmax(variance, 0));
    r->auc_low = fmax(0, r->auc - half);
    r->auc_high = fmin(1, r->auc + half);
}

apsm_status apsm_classify(apsm_context *ctx, size_t N, size_t J, const double *P,
                          const size_t *group, size_t folds, double *score,
                          apsm_classification *result)
{
    size_t n[2] = { 0, 0 };
    for (size_t i = 0; i < N; i++) n[group[i]]++;
    const size_t least = n[0] < n[1] ? n[0] : n[1];
    *result = (apsm_classification){ .folds = folds < least ? folds : least };
    if (least < LEAST || folds < 2)
        return apsm_fail(ctx, APSM_ERR_ARG, "a group has %zu shapes; 4 are needed to learn from it",
                         least);
    classifying c = { N, J, P, group, malloc(N * sizeof(size_t)), score };
    if (!c.fold) return APSM_ERR_MEMORY;
    memset(score, 0, N * sizeof *score);
    deal(N, group, result->folds, c.fold);
    const apsm_status status = apsm_parallel_for(ctx, result->folds, run_fold, &c, NULL);
    if (status == APSM_OK) apsm_judge_scores(N, group, score, 0, result);
    free(c.fold);
    return status;
}
