#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "cohorts.h"
#include "golden.h"

static void agrees_with_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("metrics");
    double *P = golden_member(root, "P", 6 * 10 * 3), got[5];
    double *want = golden_member(root, "compactness", 5);
    apsm_shape_model model = fit_model(6, 10, P);
    apsm_compactness(&model, got);
    golden_close("compactness", 5, got, want, 1e-9);
    apsm_shape_model_free(&model);
    free(P);
    free(want);
    json_decref(root);
}

static void modes_that_are_missing_count_as_complete(void **state)
{
    (void)state;
    double *P = cohort(8, 5, 2, 1), c[7];
    apsm_shape_model model = fit_model(8, 5, P);
    assert_int_equal(model.modes, 2);
    apsm_compactness(&model, c);
    assert_true(c[0] > 0.5 && c[0] < 1.0);
    for (size_t m = 1; m < 7; m++) golden_close("rest", 1, &c[m], &(double){ 1.0 }, 1e-14);
    apsm_shape_model_free(&model);
    for (size_t k = 0; k < 8 * 15; k++) P[k] = 1.0;
    model = fit_model(8, 5, P);
    apsm_compactness(&model, c);
    for (size_t m = 0; m < 7; m++) assert_true(c[m] == 1.0);
    apsm_shape_model_free(&model);
    free(P);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_golden),
        cmocka_unit_test(modes_that_are_missing_count_as_complete),
    };
    return cmocka_run_group_tests_name("compactness", tests, NULL, NULL);
}
