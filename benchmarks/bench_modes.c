/* How far the modes of models of the same shapes agree: of other seeds, numbers of particles, or
 * templates.
 *
 *   bench_modes MODEL_DIR MODEL_DIR...
 *
 * One JSON line for each of the first modes: its trust in the first model, and ICC(2,1) of the
 * scores (two-way random effects, absolute agreement, one rater: Shrout and Fleiss, Psychol. Bull.
 * 86, 1979), the models being the raters: as they are written, and after every model's mode was
 * given the sign that suits the first model's best.  The models must have the same shapes. */
#include "bench.h"
#include "folder/model_folder.h"
#include "model/mode_trust.h"

enum { MODES = 12 };

typedef struct bench {
    size_t models, I, modes;
    model_folder *m;
    double *x; /* I x models: scores of a mode */
} bench;

static void read_models(apsm_context *ctx, char **folder, bench *b)
{
    b->m = bench_alloc(b->models * sizeof *b->m);
    b->modes = MODES;
    for (size_t c = 0; c < b->models; c++) {
        bench_must(model_folder_read(ctx, folder[c], FOLDER_SCORES, &b->m[c]));
        if (b->m[c].model.modes < b->modes) b->modes = b->m[c].model.modes;
        bench_must(b->m[c].I == b->m[0].I ? APSM_OK : APSM_ERR_ARG);
        for (size_t i = 0; i < b->m[0].I; i++)
            bench_must(strcmp(b->m[c].names[i], b->m[0].names[i]) ? APSM_ERR_ARG : APSM_OK);
    }
    b->I = b->m[0].I;
    b->x = bench_doubles(b->I * b->models);
}

/* x <- scores of mode k; turned: with the signs that suit the first model's best. */
static void gather(const bench *b, size_t k, bool turned)
{
    for (size_t c = 0; c < b->models; c++) {
        const apsm_shape_model *m = &b->m[c].model;
        double dot = 0.0;
        for (size_t i = 0; i < b->I; i++) {
            b->x[i * b->models + c] = m->score[i * m->modes + k];
            dot += b->x[i * b->models + c] * b->x[i * b->models];
        }
        for (size_t i = 0; turned && dot < 0 && i < b->I; i++) b->x[i * b->models + c] *= -1.0;
    }
}

/* Sum of squared deviations of the means over `inner` from `all`, times inner. */
static double between(const double *x, size_t outer, size_t step, size_t inner, size_t stride,
                      double all)
{
    double sum = 0.0;
    for (size_t o = 0; o < outer; o++) {
        double mean = 0.0;
        for (size_t k = 0; k < inner; k++) mean += x[o * step + k * stride] / (double)inner;
        sum += (double)inner * (mean - all) * (mean - all);
    }
    return sum;
}

static double icc(const bench *b)
{
    const size_t n = b->I, k = b->models;
    double all = 0.0, total = 0.0;
    for (size_t a = 0; a < n * k; a++) all += b->x[a] / (double)(n * k);
    for (size_t a = 0; a < n * k; a++) total += (b->x[a] - all) * (b->x[a] - all);
    const double rows = between(b->x, n, k, k, 1, all), columns = between(b->x, k, 1, n, k, all);
    const double N = (double)n, K = (double)k, R = rows / (N - 1), C = columns / (K - 1);
    const double E = (total - rows - columns) / ((N - 1) * (K - 1));
    return (R - E) / (R + (K - 1) * E + K * (C - E) / N);
}

static void tell(const bench *b, size_t k, const apsm_mode_trust *t)
{
    gather(b, k, false);
    const double written = icc(b);
    gather(b, k, true);
    printf("{\"bench\": \"modes\", \"mode\": %zu, \"share\": %.4f, \"chance\": %.4f, "
           "\"cosine\": %.3f, \"direction\": %.2f, \"trusted\": %s, \"icc\": %.3f, "
           "\"icc_turned\": %.3f}\n",
           k + 1, t->share, t->chance, t->cosine, t->direction, t->trusted ? "true" : "false",
           written, icc(b));
}

int main(int argc, char **argv)
{
    apsm_context *ctx = apsm_context_new();
    bench b = { .models = (size_t)argc - 1 };
    if (!ctx || argc < 3) return 2;
    read_models(ctx, argv + 1, &b);
    apsm_mode_trust *trust = bench_alloc(b.I * sizeof *trust);
    bench_must(apsm_mode_trust_of(ctx, &b.m[0].model, trust));
    for (size_t k = 0; k < b.modes; k++) tell(&b, k, &trust[k]);
    for (size_t c = 0; c < b.models; c++) model_folder_free(&b.m[c]);
    free(b.m);
    free(b.x);
    free(trust);
    apsm_context_free(ctx);
    return 0;
}
