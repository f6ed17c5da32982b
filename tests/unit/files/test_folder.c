/* What is in a folder, and its SHA-256. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "files/files.h"
#include "folder.h"

static apsm_context *ctx;

static void fill(void **state)
{
    char path[TEST_PATH];
    assert_int_equal(mkdir(folder_path(state, "b", path), 0777), 0);
    assert_int_equal(mkdir(folder_path(state, "b/c", path), 0777), 0);
    assert_int_equal(symlink(".", folder_path(state, "loop", path)), 0);
    folder_put(state, "b.txt", "1", 1);
    folder_put(state, "a", "2", 1);
    folder_put(state, "b/z", "3", 1);
    folder_put(state, "b/c/y", "", 0);
}

static void expect_list(void **state, bool deep, size_t n, const char *const *expected)
{
    apsm_file_list list;
    assert_int_equal(apsm_list_files(ctx, *state, deep, &list), APSM_OK);
    assert_int_equal(list.n, n);
    for (size_t k = 0; k < n; k++) assert_string_equal(list.path[k], expected[k]);
    apsm_file_list_free(&list);
}

static void files_are_listed_in_the_order_of_their_bytes(void **state)
{
    static const char *const flat[] = { "a", "b.txt", "loop" };
    static const char *const deep[] = { "a", "b.txt", "b/c/y", "b/z", "loop" };
    expect_list(state, true, 0, NULL);
    fill(state);
    expect_list(state, false, 3, flat);
    expect_list(state, true, 5, deep);
}

static void what_is_no_folder_is_refused(void **state)
{
    char path[TEST_PATH], hex[65];
    apsm_file_list list;
    assert_int_equal(apsm_list_files(ctx, folder_path(state, "no", path), true, &list),
                     APSM_ERR_IO);
    assert_non_null(strstr(apsm_error_text(ctx), "/no: cannot be read"));
    folder_put(state, "no", "", 0);
    assert_int_equal(apsm_list_files(ctx, path, true, &list), APSM_ERR_IO);
    assert_int_equal(apsm_sha256_folder(ctx, path, hex), APSM_ERR_IO);
}

static void a_folder_has_a_digest(void **state)
{
    char hex[65], other[65];
    static const char text[] = /* as sha256sum gives for "2" */
        "d4735e3a265e16eee03f59718b9b5d03019c07d8b6c51f90da3a666eec13ab35";
    apsm_sha256 sha;
    unsigned char digest[32];
    folder_put(state, "a", "2", 1);
    assert_int_equal(apsm_sha256_folder(ctx, *state, hex), APSM_OK);
    apsm_sha256_begin(&sha);
    apsm_sha256_add(&sha, text, 64);
    apsm_sha256_add(&sha, "a", 2);
    apsm_sha256_end(&sha, digest);
    apsm_sha256_hex(digest, other);
    assert_string_equal(hex, other);
}

static void names_and_contents_change_the_digest(void **state)
{
    char path[TEST_PATH], hex[3][65];
    folder_put(state, "a", "2", 1);
    assert_int_equal(apsm_sha256_folder(ctx, *state, hex[0]), APSM_OK);
    folder_put(state, "a", "3", 1);
    assert_int_equal(apsm_sha256_folder(ctx, *state, hex[1]), APSM_OK);
    assert_int_equal(unlink(folder_path(state, "a", path)), 0);
    folder_put(state, "b", "2", 1);
    assert_int_equal(apsm_sha256_folder(ctx, *state, hex[2]), APSM_OK);
    for (int k = 0; k < 3; k++) assert_string_not_equal(hex[k], hex[(k + 1) % 3]);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(files_are_listed_in_the_order_of_their_bytes),
        TEST(what_is_no_folder_is_refused),
        TEST(a_folder_has_a_digest),
        TEST(names_and_contents_change_the_digest),
    };
    ctx = apsm_context_new();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
