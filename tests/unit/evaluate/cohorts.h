/* cohorts.h -- random cohorts and plain reference computations for the tests of this room. */
#ifndef APSM_TEST_COHORTS_H
#define APSM_TEST_COHORTS_H

#include <math.h>
#include <stdlib.h>

#include "core/random.h"
#include "evaluate/metrics.h"

/* I shapes of J particles about a mean away from the origin, from `modes` random modes whose
 * standard deviations are 5 k^-1, k = 1, 2, ...  The caller frees. */
static inline double *cohort(size_t I, size_t J, size_t modes, uint64_t index)
{
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, index, 0);
    const size_t n = 3 * J;
    double *P = malloc(I * n * sizeof *P), *mode = malloc(n * sizeof *mode);
    if (!P || !mode) abort();
    for (size_t c = 0; c < n; c++) {
        const double mean = 50 + 30 * apsm_random_normal(&rng);
        for (size_t i = 0; i < I; i++) P[i * n + c] = mean;
    }
    for (size_t k = 0; k < modes; k++) {
        for (size_t c = 0; c < n; c++) mode[c] = apsm_random_normal(&rng);
        for (size_t i = 0; i < I; i++) {
            const double b = 5.0 / (double)(k + 1) * apsm_random_normal(&rng);
            for (size_t c = 0; c < n; c++) P[i * n + c] += b * mode[c];
        }
    }
    free(mode);
    return P;
}

static inline apsm_shape_model fit_model(size_t I, size_t J, const double *P)
{
    apsm_shape_model model;
    if (apsm_shape_model_fit(NULL, I, J, P, &model) != APSM_OK) abort();
    return model;
}

static inline double particle_distance(size_t J, const double *a, const double *b)
{
    double sum = 0.0;
    for (size_t j = 0; j < J; j++) {
        const double x = a[3 * j] - b[3 * j], y = a[3 * j + 1] - b[3 * j + 1],
                     z = a[3 * j + 2] - b[3 * j + 2];
        sum += sqrt(x * x + y * y + z * z);
    }
    return sum / (double)J;
}

/* Every model is fitted anew, every projection made in 3J coordinates. */
static inline void generalization_by_refitting(size_t I, size_t J, const double *P, double *gen)
{
    const size_t n = 3 * J;
    double *others = malloc((I - 1) * n * sizeof *others), *x = malloc(n * sizeof *x);
    double *b = malloc(I * sizeof *b);
    if (!others || !x || !b) abort();
    for (size_t m = 0; m + 2 < I; m++) gen[m] = 0.0;
    for (size_t i = 0; i < I; i++) {
        for (size_t k = 0, row = 0; k < I; k++)
            for (size_t c = 0; k != i && c < n; c++) others[row++] = P[k * n + c];
        apsm_shape_model model = fit_model(I - 1, J, others);
        apsm_shape_model_scores(&model, P + i * n, b);
        for (size_t m = 1; m + 1 < I; m++) {
            apsm_shape_model_synthesize(&model, m < model.modes ? m : model.modes, b, x);
            gen[m - 1] += particle_distance(J, x, P + i * n) / (double)I;
        }
        apsm_shape_model_free(&model);
    }
    free(others);
    free(x);
    free(b);
}

/* All shapes are measured for every sample. */
static inline void specificity_by_search(size_t I, size_t J, const double *P,
                                         const apsm_shape_model *model, size_t samples,
                                         const double *scores, double *spec)
{
    const size_t n = 3 * J, r = model->modes;
    double *x = malloc(n * sizeof *x);
    if (!x) abort();
    for (size_t m = 1; m <= r; m++) {
        spec[m - 1] = 0.0;
        for (size_t k = 0; k < samples; k++) {
            double best = INFINITY;
            apsm_shape_model_synthesize(model, m, scores + k * r, x);
            for (size_t i = 0; i < I; i++) best = fmin(best, particle_distance(J, x, P + i * n));
            spec[m - 1] += best / (double)samples;
        }
    }
    free(x);
}

/* A rotation by the unit quaternion (1,2,3,4)/sqrt(30), then a shift. */
static inline void move_rigidly(size_t n, double *x)
{
    const double R[9] = { -20, 4, 22, 20, -10, 20, 10, 28, 4 };
    for (size_t j = 0; j < n; j++) {
        const double p[3] = { x[3 * j], x[3 * j + 1], x[3 * j + 2] };
        for (size_t a = 0; a < 3; a++)
            x[3 * j + a] =
                (R[3 * a] * p[0] + R[3 * a + 1] * p[1] + R[3 * a + 2] * p[2]) / 30 + 7 * (double)a;
    }
}

#endif
