#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#include "cohorts.h"
#include "golden.h"
#include "shapes.h"

static apsm_context *ctx;
static char warning[512];

static void keep_warning(void *user, apsm_log_level level, const char *text)
{
    (void)user;
    if (level == APSM_LOG_WARNING) snprintf(warning, sizeof warning, "%s", text);
}

static int set_up(void **state)
{
    (void)state;
    ctx = apsm_context_new();
    if (ctx) apsm_context_set_log(ctx, keep_warning, NULL);
    return ctx ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    apsm_context_free(ctx);
    return 0;
}

static void gives_what_the_parts_give(void **state)
{
    (void)state;
    json_t *root = golden_load("metrics");
    double *P = golden_member(root, "P", 6 * 10 * 3), spec[5], error[5];
    double *compactness = golden_member(root, "compactness", 5);
    double *generalization = golden_member(root, "generalization", 4);
    double *variance = golden_member(root, "eigenvalues", 5);
    const apsm_evaluate_input input = {
        .I = 6, .J = 10, .P = P, .options.specificity_samples = 50
    };
    apsm_evaluation e;
    assert_int_equal(apsm_evaluate(ctx, &input, &e), APSM_OK);
    assert_true(e.shapes == 6 && e.particles == 10 && e.modes == 5 && e.samples == 50);
    assert_true(e.n_compactness == 5 && e.n_generalization == 4 && e.n_specificity == 5);
    assert_null(e.surface);
    golden_close("variance", 5, e.variance, variance, 1e-9);
    golden_close("compactness", 5, e.compactness, compactness, 1e-9);
    golden_close("generalization", 4, e.generalization, generalization, 1e-9);
    apsm_shape_model model = fit_model(6, 10, P);
    assert_int_equal(apsm_specificity(ctx, &model, APSM_DEFINITION_STANDARD, 50, 5, spec, error),
                     APSM_OK);
    assert_memory_equal(spec, e.specificity, sizeof spec);
    assert_memory_equal(error, e.specificity_error, sizeof error);
    apsm_shape_model_free(&model);
    apsm_evaluation_free(&e);

    apsm_evaluate_input three = input; /* fewer modes: the first of the same figures */
    three.options.specificity_modes = 3;
    assert_int_equal(apsm_evaluate(ctx, &three, &e), APSM_OK);
    assert_true(e.n_specificity == 3 && e.n_compactness == 5);
    assert_memory_equal(spec, e.specificity, 3 * sizeof *spec);
    assert_memory_equal(error, e.specificity_error, 3 * sizeof *error);
    apsm_evaluation_free(&e);
    free(P);
    free(compactness);
    free(generalization);
    free(variance);
    json_decref(root);
}

static void measures_surfaces_and_warns(void **state)
{
    (void)state;
    enum { I = 3, J = 42 };
    apsm_mesh mesh[I];
    double P[I * J * 3];
    for (size_t i = 0; i < I; i++) {
        mesh[i] = shape_sphere(2, 10 + (double)i);
        memcpy(P + i * 3 * J, mesh[i].V, 3 * J * sizeof *P); /* the vertices of level 1 */
    }
    const apsm_mesh_source source = apsm_mesh_source_array(mesh);
    apsm_evaluate_input input = { .I = I,
                                  .J = J,
                                  .P = P,
                                  .options.specificity_samples = 20,
                                  .options.definition = APSM_DEFINITION_SHAPEWORKS,
                                  .shape = &source,
                                  .template_mesh = &mesh[1],
                                  .template_index = 1 };
    apsm_evaluation e;
    warning[0] = 0;
    assert_int_equal(apsm_evaluate(ctx, &input, &e), APSM_OK);
    assert_non_null(strstr(warning, "shapeworks-compat"));
    assert_true(e.surface_summary.two_way.max < 1e-9 && e.surface[2].two_way.max < 1e-9);
    assert_true(e.surface[0].diagonal > 20 && e.n_generalization == 1);
    apsm_evaluation_free(&e);
    input.template_index = I;
    assert_int_equal(apsm_evaluate(ctx, &input, &e), APSM_ERR_ARG);
    assert_null(e.compactness);
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
}

static void one_shape_has_no_metrics(void **state)
{
    (void)state;
    double *P = cohort(2, 7, 3, 1);
    apsm_evaluate_input input = { .I = 1, .J = 7, .P = P, .options.specificity_samples = 5 };
    apsm_evaluation e;
    assert_int_equal(apsm_evaluate(ctx, &input, &e), APSM_OK);
    assert_true(e.modes == 0 && e.n_compactness == 0 && e.n_generalization == 0);
    apsm_evaluation_free(&e);
    input.I = 2;
    assert_int_equal(apsm_evaluate(ctx, &input, &e), APSM_OK);
    assert_true(e.modes == 1 && e.n_compactness == 1 && e.n_generalization == 0);
    assert_true(e.compactness[0] == 1 && e.specificity[0] > 0);
    apsm_evaluation_free(&e);
    input.I = 0;
    assert_int_equal(apsm_evaluate(ctx, &input, &e), APSM_ERR_ARG);
    free(P);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gives_what_the_parts_give),
        cmocka_unit_test(measures_surfaces_and_warns),
        cmocka_unit_test(one_shape_has_no_metrics),
    };
    return cmocka_run_group_tests_name("evaluate", tests, set_up, tear_down);
}
