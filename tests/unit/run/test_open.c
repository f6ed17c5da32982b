/* The door of a job: what the command line refuses is refused here, too, and leaves no folder. */
#include "cmocka_all.h"

#include <string.h>

#include "apsm/run.h"
#include "files/files.h"
#include "folder.h"
#include "locale_comma.h"
#include "session/session.h"

static apsm_status open_with(void **state, const char *key, const char *value, apsm_run **run,
                             apsm_context *ctx)
{
    static char path[TEST_PATH];
    const char *const set[][2] = { { key, value } };
    const apsm_run_settings settings = { .folder = folder_path(state, "model", path),
                                         .n_set = 1,
                                         .set = set };
    return apsm_run_open(ctx, &settings, run);
}

static void refuse(void **state, const char *key, const char *value)
{
    char path[TEST_PATH];
    apsm_run *run;
    apsm_context *ctx = apsm_context_new();
    if (open_with(state, key, value, &run, ctx) != APSM_ERR_ARG) fail_msg("%s = %s", key, value);
    assert_null(run);
    assert_non_null(strstr(apsm_error_text(ctx), key));
    assert_false(apsm_is_folder(folder_path(state, "model", path)));
    apsm_context_free(ctx);
}

static void values_that_are_none_leave_no_folder(void **state)
{
    static const char *const seeds[] = { "",    "-1", " -1",
                                         " 1",  "1 ", "0x1",
                                         "1.5", "+1", "99999999999999999999" };
    for (size_t k = 0; k < sizeof seeds / sizeof *seeds; k++) refuse(state, "seed", seeds[k]);
    refuse(state, "original_frame", "perhaps");
    refuse(state, "particles", "6");
    refuse(state, "particels", "64");
}

static void words_for_true_are_one_option(void **state)
{
    static const char *const words[] = { "true", "yes", "1", "on" };
    for (size_t k = 0; k < sizeof words / sizeof *words; k++) {
        apsm_run *run;
        apsm_context *ctx = apsm_context_new();
        assert_int_equal(open_with(state, "original_frame", words[k], &run, ctx), APSM_OK);
        assert_true(run->options.writing.original_frame);
        assert_string_equal(apsm_project_get(&run->project, "apsm", "original_frame"), "true");
        apsm_run_close(run);
        apsm_context_free(ctx);
    }
}

static void what_is_missing_is_told(void **state)
{
    (void)state;
    apsm_run *run;
    apsm_context *ctx = apsm_context_new();
    const char *const null_pair[][2] = { { "seed", NULL } };
    const char *const null_input[] = { NULL };
    const apsm_run_settings bad[] = {
        { .folder = "x", .n_inputs = 2 }, { .folder = "" },
        { .folder = "x", .n_inputs = 1 }, { .folder = "x", .n_inputs = 1, .inputs = null_input },
        { .folder = "x", .n_set = 1 },    { .folder = "x", .n_set = 1, .set = null_pair }
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++)
        assert_int_equal(apsm_run_open(ctx, &bad[k], &run), APSM_ERR_ARG);
    assert_int_equal(apsm_run_open(ctx, NULL, &run), APSM_ERR_ARG);
    assert_int_equal(apsm_run_open(NULL, &bad[0], &run), APSM_ERR_ARG);
    assert_int_equal(apsm_run_open(ctx, &bad[0], NULL), APSM_ERR_ARG);
    assert_int_equal(apsm_run_groom(NULL), APSM_ERR_ARG);
    assert_int_equal(apsm_run_initialize(NULL), APSM_ERR_ARG);
    assert_int_equal(apsm_run_optimize(NULL), APSM_ERR_ARG);
    assert_int_equal(apsm_run_evaluate(NULL), APSM_ERR_ARG);
    assert_int_equal(apsm_run_report(NULL), APSM_ERR_ARG);
    assert_int_equal(apsm_run_all(NULL), APSM_ERR_ARG);
    assert_int_equal(apsm_run_dry(NULL), APSM_ERR_ARG);
    assert_int_equal(apsm_run_check(NULL, NULL, NULL, NULL), APSM_ERR_ARG);
    apsm_run_close(NULL);
    assert_false(apsm_is_folder("x"));
    apsm_context_free(ctx);
}

static size_t nobody(void *user, size_t value)
{
    (void)user;
    return value;
}

/* Callbacks of a newer program are taken if it uses none that we do not know. */
static void callbacks_carry_their_size(void **state)
{
    char path[TEST_PATH];
    struct {
        apsm_company known;
        void *more;
    } newer = { { NULL, nobody, NULL }, NULL };
    apsm_run *run;
    apsm_context *ctx = apsm_context_new();
    const apsm_run_settings settings = { .folder = folder_path(state, "model", path),
                                         .company = &newer.known,
                                         .company_size = sizeof newer };
    assert_int_equal(apsm_run_open(ctx, &settings, &run), APSM_OK);
    assert_ptr_equal(run->company->meet, nobody);
    apsm_run_close(run);
    newer.more = &newer;
    assert_int_equal(apsm_run_open(ctx, &settings, &run), APSM_ERR_ARG);
    apsm_context_free(ctx);
}

/* What the project then holds, the program reads again. */
static void a_decimal_comma_of_the_process_changes_no_file(void **state)
{
    apsm_run *run;
    apsm_context *ctx = apsm_context_new();
    if (!use_decimal_comma(*state)) {
        apsm_context_free(ctx);
        print_message("skipped: no locale with a decimal comma\n");
        skip();
    }
    assert_int_equal(open_with(state, "beta", "0.25", &run, ctx), APSM_OK);
    assert_string_equal(apsm_project_get(&run->project, "apsm", "tau"), "0.125");
    assert_string_equal(apsm_project_get(&run->project, "apsm", "beta"), "0.25");
    apsm_run_close(run);
    setlocale(LC_ALL, "C");
    apsm_context_free(ctx);
}

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, folder_set_up, folder_tear_down)
int main(void)
{
    const struct CMUnitTest tests[] = { IN_FOLDER(values_that_are_none_leave_no_folder),
                                        IN_FOLDER(words_for_true_are_one_option),
                                        IN_FOLDER(callbacks_carry_their_size),
                                        cmocka_unit_test(what_is_missing_is_told),
                                        IN_FOLDER(a_decimal_comma_of_the_process_changes_no_file) };
    return cmocka_run_group_tests_name("session", tests, NULL, NULL);
}
