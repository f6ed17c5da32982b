/* A cohort of more shapes than particles: its model and figures need no matrix that grows with the
 * square of the number of shapes. */
#define _DEFAULT_SOURCE /* getrusage's maxrss */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <sys/resource.h>

#include "cohorts.h"

enum { I = 3000, J = 40, N = 3 * J, MODES = 20 };

static double peak_megabytes(void)
{
    struct rusage usage;
    assert_int_equal(getrusage(RUSAGE_SELF, &usage), 0);
    return (double)usage.ru_maxrss / 1024;
}

/* One I x I matrix alone would be 72 MB. */
static void memory_stays_flat(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    assert_non_null(ctx);
    apsm_context_set_threads(ctx, 1);
    double *P = cohort(I, J, MODES, 1);
    const apsm_evaluate_input input = { .I = I, .J = J, .P = P, .options.specificity_samples = 20 };
    apsm_evaluation e;
    const double before = peak_megabytes();
    assert_int_equal(apsm_evaluate(ctx, &input, &e), APSM_OK);
    const double grown = peak_megabytes() - before;
    if (!(grown < 30)) fail_msg("%g MB for the figures of %d shapes", grown, I);
    assert_int_equal(e.modes, MODES);
    assert_int_equal(e.left_out, 1000);
    assert_int_equal(e.n_generalization, I - 2);
    assert_true(e.generalization[MODES - 2] > 0 && e.generalization[MODES - 1] < 1e-9);
    assert_true(e.generalization[I - 3] == e.generalization[MODES - 1]);
    apsm_evaluation_free(&e);
    free(P);
    apsm_context_free(ctx);
}

/* The mean over the sample differs from that over all by no more than its error says. */
static void a_sample_tells_what_all_do(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    double *P = cohort(I, J, MODES, 2), sum[3] = { 0 };
    double *gen = malloc(2 * I * sizeof *gen), *error = gen + I;
    apsm_shape_model model = fit_model(I, J, P);
    assert_true(ctx && gen);
    assert_int_equal(apsm_generalization(ctx, &model, gen, error), APSM_OK);
    /* of 3,000 shapes one hardly moves the modes: the residuals are those of the model of all */
    for (size_t i = 0; i < I; i++) {
        double x[N];
        for (size_t m = 0; m < 3; m++) {
            double distance = 0;
            apsm_shape_model_synthesize(&model, m + 1, model.score + i * model.modes, x);
            for (size_t j = 0; j < J; j++) {
                double d2 = 0;
                for (size_t c = 3 * j; c < 3 * j + 3; c++)
                    d2 += (x[c] - P[i * N + c]) * (x[c] - P[i * N + c]);
                distance += sqrt(d2);
            }
            sum[m] += distance / (J * (double)I);
        }
    }
    for (size_t m = 0; m < 3; m++)
        if (!(fabs(gen[m] - sum[m]) < 4 * error[m] && error[m] < 0.05 * gen[m]))
            fail_msg("%zu modes: %g, of all %g, error %g", m + 1, gen[m], sum[m], error[m]);
    apsm_shape_model_free(&model);
    free(gen);
    free(P);
    apsm_context_free(ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(memory_stays_flat),
        cmocka_unit_test(a_sample_tells_what_all_do),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
