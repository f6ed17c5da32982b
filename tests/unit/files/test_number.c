/* Numbers as text: exact, and the same under a locale with a decimal comma. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <float.h>
#include <jansson.h>
#include <math.h>
#include <string.h>

#include "core/random.h"
#include "files/files.h"
#include "files/particles_file.h"
#include "folder.h"
#include "locale_comma.h"

static void numbers_come_back_bit_by_bit(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(7, APSM_STREAM_TEST, 1, 0);
    char text[APSM_NUMBER_LENGTH];
    for (int i = 0; i < 20000; i++) {
        const uint64_t bits = apsm_random_next(&rng);
        double x, y;
        memcpy(&x, &bits, sizeof x);
        if (!isfinite(x)) continue;
        apsm_format_number(x, text);
        assert_true(apsm_parse_number(text, strlen(text), &y));
        assert_memory_equal(&x, &y, sizeof x);
    }
}

static void short_numbers_stay_short(void **state)
{
    (void)state;
    const struct {
        double x;
        const char *text;
    } cases[] = { { 0, "0" },
                  { -0.0, "-0" },
                  { 1, "1" },
                  { 0.1, "0.1" },
                  { -4.999999, "-4.999999" },
                  { 1e300, "1e+300" },
                  { 0.1 + 0.2, "0.30000000000000004" },
                  { DBL_MAX, "1.7976931348623157e+308" } };
    char text[APSM_NUMBER_LENGTH];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        apsm_format_number(cases[i].x, text);
        assert_string_equal(text, cases[i].text);
    }
}

static void what_is_no_decimal_number_is_refused(void **state)
{
    (void)state;
    const char *const bad[] = { "",    " 1", "1 ",    "1,5", "0x10", "nan", "inf", "-inf", "1e999",
                                "--1", "1e", "1.2.3", "e5",  ".",    "+",   "1d5", "abc",  "NaN" };
    double x = 42;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        if (apsm_parse_number(bad[i], strlen(bad[i]), &x)) fail_msg("'%s' was taken", bad[i]);
        assert_true(x == 42);
    }
    assert_false(apsm_parse_number("1\0002", 3, &x));
    const char *const good[] = { "1", "+1", "01", "1.", "1e0", "10e-1", "1.000000" };
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        assert_true(apsm_parse_number(good[i], strlen(good[i]), &x));
        assert_true(x == 1);
    }
    assert_true(apsm_parse_number("123", 2, &x));
    assert_true(x == 12);
}

static json_t *text_of(const char *format, ...)
{
    va_list args;
    va_start(args, format);
    json_t *const text = apsm_json_vtext(format, args);
    va_end(args);
    return text;
}

/* Everything that writes or reads numbers, in a process whose printf writes "1,5". */
static void a_decimal_comma_changes_nothing(void **state)
{
    char path[TEST_PATH], text[64], *data;
    if (!use_decimal_comma(*state)) {
        print_message("no locale with a decimal comma here: skipped\n");
        skip();
    }
    snprintf(text, sizeof text, "%.1f", 1.5);
    assert_string_equal(text, "1,5");
    double x, *P;
    size_t n;
    apsm_format_number(1.5, text);
    assert_string_equal(text, "1.5");
    assert_true(apsm_parse_number("2.25", 4, &x));
    assert_true(x == 2.25);
    assert_false(apsm_parse_number("2,25", 4, &x));
    apsm_print(text, sizeof text, "%.2f mm", 0.25);
    assert_string_equal(text, "0.25 mm");
    apsm_context *ctx = apsm_context_new();
    apsm_fail(ctx, APSM_ERR_FORMAT, "is %.1f times as large", 2.5);
    assert_string_equal(apsm_error_text(ctx), "is 2.5 times as large");
    apsm_context_free(ctx);

    const double points[6] = { 1.5, -2.25, 1e-7, 0, 12345.678, 3 };
    folder_path(state, "p.particles", path);
    assert_int_equal(apsm_particles_write(NULL, path, 2, points), APSM_OK);
    assert_int_equal(apsm_read_file(NULL, path, 1000, &data, &n), APSM_OK);
    assert_string_equal(data, "1.5 -2.25 1e-07\n0 12345.678 3\n");
    free(data);
    assert_int_equal(apsm_particles_read(NULL, path, &n, &P), APSM_OK);
    assert_memory_equal(P, points, sizeof points);
    free(P);

    struct json_t *json = apsm_json_vector(6, points), *back;
    double y[6];
    folder_path(state, "p.json", path);
    assert_int_equal(apsm_json_write(NULL, path, json), APSM_OK);
    assert_int_equal(apsm_read_file(NULL, path, 1000, &data, &n), APSM_OK);
    assert_null(strstr(data, "1,5"));
    free(data);
    assert_int_equal(apsm_json_read(NULL, path, &back), APSM_OK);
    assert_true(apsm_json_get_matrix(back, 6, 0, y));
    assert_memory_equal(y, points, sizeof y);
    json_decref(json);
    json_decref(back);
    json = text_of("%g to %g", 1.5, -2.25);
    assert_string_equal(json_string_value(json), "1.5 to -2.25");
    json_decref(json);
    setlocale(LC_ALL, "C");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_come_back_bit_by_bit),
        cmocka_unit_test(short_numbers_stay_short),
        cmocka_unit_test(what_is_no_decimal_number_is_refused),
        cmocka_unit_test_setup_teardown(a_decimal_comma_changes_nothing, folder_set_up,
                                        folder_tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
