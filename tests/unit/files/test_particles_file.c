/* Particle files: ours and everyone's, and no broken one passes for a shorter one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "files/files.h"
#include "files/particles_file.h"
#include "folder.h"

static apsm_context *ctx;

static void what_is_written_is_read(void **state)
{
    char path[TEST_PATH], *data;
    size_t n, size;
    double *Q;
    const double P[9] = { -5.13761, -4.72842, -7.3192, 1e-20, 123456789.25, 0, 1.0 / 3, -0.0, 7 };
    folder_path(state, "a_local.particles", path);
    assert_int_equal(apsm_particles_write(ctx, path, 3, P), APSM_OK);
    assert_int_equal(apsm_read_file(ctx, path, 1000, &data, &size), APSM_OK);
    assert_string_equal(data, "-5.13761 -4.72842 -7.3192\n1e-20 123456789 0\n0.333333333 -0 7\n");
    free(data);
    assert_int_equal(apsm_particles_read(ctx, path, &n, &Q), APSM_OK);
    assert_int_equal(n, 3);
    for (int i = 0; i < 9; i++)
        if (!(fabs(Q[i] - P[i]) <= 5e-9 * fabs(P[i]))) fail_msg("%g became %g", P[i], Q[i]);
    free(Q);
}

/* As ShapeWorks writes it (trailing spaces), as editors and Windows leave it, as .lpts are. */
static void all_common_dialects_are_read(void **state)
{
    const char *const texts[] = {
        "1 2 3 \n4 5 6 \n",         "1 2 3\n4 5 6",           "1 2 3\r\n4 5 6\r\n",
        "  1\t2    3\n\n4 5 6\n\n", "1.000 2e0 +3\n4. 5 6\n", "\n\n1 2 3\n4 5 6 ",
    };
    for (size_t k = 0; k < sizeof texts / sizeof *texts; k++) {
        char path[TEST_PATH];
        size_t n;
        double *P;
        folder_put(state, "x.lpts", texts[k], strlen(texts[k]));
        assert_int_equal(apsm_particles_read(ctx, folder_path(state, "x.lpts", path), &n, &P),
                         APSM_OK);
        assert_int_equal(n, 2);
        for (int i = 0; i < 6; i++) assert_true(P[i] == i + 1);
        free(P);
    }
}

static void expect_refusal(void **state, const char *text, size_t size, const char *words)
{
    char path[TEST_PATH];
    size_t n;
    double *P;
    folder_put(state, "bad.particles", text, size);
    assert_int_equal(apsm_particles_read(ctx, folder_path(state, "bad.particles", path), &n, &P),
                     APSM_ERR_FORMAT);
    assert_null(P);
    if (!strstr(apsm_error_text(ctx), words))
        fail_msg("'%s' does not say '%s'", apsm_error_text(ctx), words);
}

static void damage_is_told_with_its_line(void **state)
{
#define REFUSE(text, words) expect_refusal(state, text, sizeof text - 1, words)
    REFUSE("1 2 3\n4 five 6\n", "bad.particles:2:3: 'five' is not a finite number");
    REFUSE("1 2 3\n4 5\n", "bad.particles:2: fewer than three numbers");
    REFUSE("1 2 3\n4 5 6 7\n", "bad.particles:2: more than three numbers");
    REFUSE("1 2 3\n4 5 6 7 8 9\n", "bad.particles:2: more");
    REFUSE("1 2 nan\n", "bad.particles:1:5: 'nan'");
    REFUSE("1 2 inf\n", "'inf'");
    REFUSE("1 2 1e400\n", "'1e400'");
    REFUSE("1,5 2 3\n", "'1,5'");
    REFUSE("0x1 2 3\n", "'0x1'");
    REFUSE("1 2 3\n4 5 \0 6\n", "bad.particles:2:5");
    REFUSE("", "holds no particles");
    REFUSE(" \n\n", "holds no particles");
    REFUSE("x y z\n1 2 3\n", "bad.particles:1:1: 'x'");
}

static void counts_must_agree(void **state)
{
    char path[TEST_PATH];
    double P[6] = { 0 };
    folder_put(state, "x", "1 2 3\n4 5 6\n", 12);
    folder_path(state, "x", path);
    assert_int_equal(apsm_particles_read_n(ctx, path, 2, P), APSM_OK);
    assert_true(P[5] == 6);
    assert_int_equal(apsm_particles_read_n(ctx, path, 3, P), APSM_ERR_FORMAT);
    assert_non_null(strstr(apsm_error_text(ctx), "holds 2 particles where 3"));
}

static void what_is_not_finite_is_not_written(void **state)
{
    char path[TEST_PATH];
    const double P[6] = { 1, 2, 3, 4, INFINITY, 6 };
    folder_path(state, "x", path);
    assert_int_equal(apsm_particles_write(ctx, path, 2, P), APSM_ERR_NONFINITE);
    assert_non_null(strstr(apsm_error_text(ctx), "coordinate 1 of particle 1"));
    assert_int_equal(folder_count(*state), 0);
}

/* ---- Traps of other programs are told ---- */

static char said[4096];
static void keep(void *user, apsm_log_level level, const char *text)
{
    (void)user;
    assert_int_equal(level, APSM_LOG_WARNING);
    strncat(said, text, sizeof said - strlen(said) - 1);
}

static void traps_are_told(void **state)
{
    static const struct {
        const char *text, *words; /* words NULL: nothing is said */
    } cases[] = {
        { "1 2 3\n4 5 6\n", NULL },
        { "1 2 3\n4 5 6 ", NULL }, /* a blank after the last number is enough */
        { "1 2 3\n4 5 6", "lose the last one" },
        { "12345.6 1 2\n12346.7 3 4\n", "steps of 0.1" },
        { "12345.61 1 2\n12346.7 3 4\n", NULL },
        { "0.00123456 1 2\n0.00223456 3 4\n", NULL },
        { "647.544 1 2\n600.123 3 4\n", NULL },
        { "-1.23456e+08 0 0\n-1.23457e+08 0 0\n", "steps of 1000" },
        { "100000 1 2\n100003 3 4\n", "steps of 1" },
        { "100 1 2\n103 3 4\n", NULL },
    };
    char path[TEST_PATH];
    size_t n;
    double *P;
    apsm_context_set_log(ctx, keep, NULL);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        said[0] = '\0';
        folder_put(state, "p.particles", cases[k].text, strlen(cases[k].text));
        assert_int_equal(apsm_particles_read(ctx, folder_path(state, "p.particles", path), &n, &P),
                         APSM_OK);
        assert_int_equal(n, 2);
        free(P);
        if (cases[k].words ? !strstr(said, cases[k].words) : *said)
            fail_msg("%s: said '%s'", cases[k].text, said);
    }
    apsm_context_set_log(ctx, NULL, NULL);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(what_is_written_is_read),           TEST(all_common_dialects_are_read),
        TEST(damage_is_told_with_its_line),      TEST(counts_must_agree),
        TEST(what_is_not_finite_is_not_written), TEST(traps_are_told),
    };
    ctx = apsm_context_new();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
