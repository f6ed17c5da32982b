/* The table of options: texts in, texts out, presets and contradictions; under any locale. */
#include "cmocka_all.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "folder.h"
#include "locale_comma.h"
#include "options/options.h"

static void every_default_is_what_its_text_says(void **state)
{
    (void)state;
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    for (size_t k = 0; k < n; k++) {
        char text[64], again[64];
        apsm_options o = apsm_options_defaults();
        assert_int_equal(apsm_options_get(&o, table[k].name, text), APSM_OK);
        if (strcmp(table[k].name, "method") != 0)
            assert_int_equal(apsm_options_set(NULL, &o, table[k].name, text), APSM_OK);
        assert_int_equal(apsm_options_get(&o, table[k].name, again), APSM_OK);
        assert_string_equal(text, again);
    }
    assert_int_equal(apsm_options_check(NULL, &(apsm_options){ 0 }), APSM_ERR_ARG);
}

static void refuse(const char *key, const char *value)
{
    apsm_context *ctx = apsm_context_new();
    apsm_options o = apsm_options_defaults();
    const apsm_options before = o;
    if (apsm_options_set(ctx, &o, key, value) != APSM_ERR_ARG) fail_msg("%s = %s", key, value);
    assert_memory_equal(&o, &before, sizeof o);
    assert_string_not_equal(apsm_error_text(ctx), "");
    apsm_context_free(ctx);
}

static void what_is_no_value_is_refused(void **state)
{
    (void)state;
    static const char *const numbers[] = { "",    " 1",  "1 ", "0x10", "nan", "inf", "1e999",
                                           "0,5", "--1", "1.", "-1",   "+",   "1-" };
    for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++) {
        if (strcmp(numbers[k], "1.") != 0) refuse("alpha", numbers[k]);
        refuse("stage1_epochs", numbers[k]);
    }
    refuse("stage1_epochs", "99999999999999999999");
    refuse("particles", "1e3");
    refuse("remesh", "maybe");
    refuse("align", "rig");
    refuse("align", "rigid|similarity");
    refuse("alphaa", "1");
}

/* The last one of share and length counts, and what a project stores comes back. */
static void radii_of_masks_are_shares_or_lengths(void **state)
{
    (void)state;
    apsm_options o = apsm_options_defaults();
    assert_int_equal(apsm_options_set(NULL, &o, "closing", "6mm"), APSM_OK);
    assert_true(o.groom.closing_length == 6.0 && o.groom.closing == -1.0);
    assert_int_equal(apsm_options_set(NULL, &o, "opening", "1.5mm"), APSM_OK);
    assert_true(o.groom.opening_length == 1.5 && o.groom.opening == 0.0);
    assert_int_equal(apsm_options_set(NULL, &o, "closing", "0.1"), APSM_OK);
    assert_true(o.groom.closing_length == 0.0 && o.groom.closing == 0.1);
    assert_int_equal(apsm_options_set(NULL, &o, "closing", "-6mm"), APSM_ERR_ARG);
    assert_int_equal(apsm_options_set(NULL, &o, "closing", "mm"), APSM_ERR_ARG);
}

/* A host program may live in a locale with a decimal comma: LC_NUMERIC is the process's. */
static void a_decimal_comma_of_the_process_changes_nothing(void **state)
{
    if (!use_decimal_comma(*state)) {
        print_message("skipped: no locale with a decimal comma\n");
        skip();
    }
    apsm_options o = apsm_options_defaults();
    char text[64];
    assert_int_equal(apsm_options_get(&o, "tau", text), APSM_OK);
    assert_string_equal(text, "0.125");
    assert_int_equal(apsm_options_set(NULL, &o, "tau", "0.375"), APSM_OK);
    assert_true(o.optimize.sampling.tau == 0.375);
    assert_int_equal(apsm_options_set(NULL, &o, "tau", "0,25"), APSM_ERR_ARG);
    assert_int_equal(apsm_options_preset(NULL, &o, "paper-literal-femur"), APSM_OK);
    assert_true(o.optimize.schedule.beta == 0.01);
    assert_int_equal(o.optimize.walk.stop_rule, APSM_STOP_RULE_MATCHED);
    assert_int_equal(apsm_options_set(NULL, &o, "method", "xu2023"), APSM_OK);
    assert_true(o.optimize.schedule.gamma == 0.1);
    setlocale(LC_ALL, "C");
}

static void xu2023_is_a_set_of_options(void **state)
{
    (void)state;
    apsm_options o = apsm_options_defaults();
    const double gamma = o.optimize.schedule.gamma;
    assert_int_equal(apsm_options_set(NULL, &o, "method", "xu2023"), APSM_OK);
    assert_int_equal(o.optimize.correspondence.correspondence, APSM_CORRES_FROBENIUS_SQUARED);
    assert_int_equal(o.optimize.step.snap, APSM_SNAP_NONE);
    assert_false(o.optimize.walk.geodesic_correspondence);
    if (o.optimize.schedule.gamma != 0.1) fail_msg("gamma %g", o.optimize.schedule.gamma);
    assert_int_equal(o.optimize.schedule.stage1_epochs + o.optimize.schedule.stage2_epochs, 100);
    if (o.optimize.schedule.alpha != 10 || o.optimize.schedule.beta != 0.02)
        fail_msg("alpha %g, beta %g", o.optimize.schedule.alpha, o.optimize.schedule.beta);
    assert_int_equal(apsm_options_set(NULL, &o, "gamma", "0.2"), APSM_OK);
    assert_int_equal(apsm_options_set(NULL, &o, "method", "xu2023"), APSM_OK);
    if (o.optimize.schedule.gamma != 0.2)
        fail_msg("gamma %g was overwritten", o.optimize.schedule.gamma);
    assert_int_equal(apsm_options_set(NULL, &o, "method", "adaptive"), APSM_OK);
    assert_int_equal(o.optimize.correspondence.correspondence, APSM_CORRES_NEIGHBOURHOOD);
    if (o.optimize.schedule.gamma != gamma) fail_msg("gamma %g", o.optimize.schedule.gamma);
    assert_int_equal(o.optimize.schedule.stage1_epochs,
                     apsm_options_defaults().optimize.schedule.stage1_epochs);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(radii_of_masks_are_shares_or_lengths),
        cmocka_unit_test(every_default_is_what_its_text_says),
        cmocka_unit_test(what_is_no_value_is_refused), cmocka_unit_test(xu2023_is_a_set_of_options),
        cmocka_unit_test_setup_teardown(a_decimal_comma_of_the_process_changes_nothing,
                                        folder_set_up, folder_tear_down)
    };
    return cmocka_run_group_tests_name("options", tests, NULL, NULL);
}
