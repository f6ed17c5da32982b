/* The folder of fits: what is somebody else's is refused before anything is made. */
#include "cmocka_all.h"

#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "fit/fit_folder.h"
#include "folder.h"

static apsm_context *ctx;

static fit_folder folder_at(const char *path)
{
    static const char *const files[] = { "fit.csv" }, *const folders[] = { "shapes" };
    return (fit_folder){ .path = path,
                         .what = "fits",
                         .maker = "fit",
                         .marker = "fit.json",
                         .files = 1,
                         .file = files,
                         .folders = 1,
                         .folder = folders };
}

static apsm_status check(const char *path, bool overwrite)
{
    fit_folder f = folder_at(path);
    f.overwrite = overwrite;
    return fit_folder_check(ctx, &f);
}

static void looking_makes_nothing(void **state)
{
    char path[TEST_PATH], shapes[TEST_PATH];
    folder_path(state, "new", path);
    folder_path(state, "new/shapes", shapes);
    const fit_folder f = folder_at(path);
    assert_ok(fit_folder_check(ctx, &f));
    assert_false(apsm_is_folder(path));
    assert_ok(fit_folder_make(ctx, &f));
    assert_true(apsm_is_folder(shapes));
    assert_int_equal(check(path, false), APSM_ERR_STATE); /* of a call that did not end */
    assert_ok(check(path, true));
}

static void the_root_is_refused_by_any_name(void **state)
{
    char link[TEST_PATH];
    assert_int_equal(symlink("/", folder_path(state, "all", link)), 0);
    const char *const names[] = { "/", "//", "/tmp/..", link };
    for (size_t k = 0; k < 4; k++)
        for (int overwrite = 0; overwrite < 2; overwrite++) {
            assert_int_equal(check(names[k], overwrite), APSM_ERR_ARG);
            assert_non_null(strstr(apsm_error_text(ctx), "is the folder of the whole system"));
        }
}

static void files_of_others_are_refused(void **state)
{
    folder_put(state, "fit.csv", "a", 1);
    assert_int_equal(check(*state, true), APSM_ERR_STATE);
    folder_put(state, "fit.json", "{}", 2);
    assert_int_equal(check(*state, false), APSM_ERR_STATE);
    assert_ok(check(*state, true));
    folder_put(state, "project.swproj", "{}", 2);
    assert_int_equal(check(*state, true), APSM_ERR_STATE);
}

/* Of two that are at work one is refused, and what the other has left meanwhile is seen. */
static void one_works_at_a_time(void **state)
{
    char path[TEST_PATH];
    folder_path(state, "fits", path);
    const fit_folder f = folder_at(path);
    apsm_lock first = { .fd = -1 }, second = { .fd = -1 };
    assert_ok(fit_folder_lock(ctx, &f, &first));
    fit_folder other = f;
    other.overwrite = true;
    assert_int_equal(fit_folder_lock(ctx, &other, &second), APSM_ERR_STATE);
    assert_non_null(strstr(apsm_error_text(ctx), "is working in this folder"));
    apsm_unlock_folder(&second);
    apsm_unlock_folder(&first);
    assert_ok(fit_folder_lock(ctx, &other, &second));
    apsm_unlock_folder(&second);
}

int main(void)
{
    ctx = apsm_context_new();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(looking_makes_nothing, folder_set_up, folder_tear_down),
        cmocka_unit_test_setup_teardown(the_root_is_refused_by_any_name, folder_set_up,
                                        folder_tear_down),
        cmocka_unit_test_setup_teardown(files_of_others_are_refused, folder_set_up,
                                        folder_tear_down),
        cmocka_unit_test_setup_teardown(one_works_at_a_time, folder_set_up, folder_tear_down),
    };
    const int failed = cmocka_run_group_tests_name("fit_folder", tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
