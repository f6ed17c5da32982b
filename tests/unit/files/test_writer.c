/* Files appear whole or not at all. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <signal.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "files/files.h"
#include "folder.h"

static apsm_context *ctx;

static void expect_content(const char *path, const char *expected)
{
    char *data;
    size_t size;
    assert_int_equal(apsm_read_file(ctx, path, 1 << 20, &data, &size), APSM_OK);
    assert_int_equal(size, strlen(expected));
    assert_string_equal(data, expected);
    free(data);
}

static void commit_makes_the_whole_file_and_nothing_else(void **state)
{
    char path[TEST_PATH];
    apsm_writer *w;
    assert_int_equal(apsm_writer_open(ctx, folder_path(state, "a.txt", path), &w), APSM_OK);
    apsm_writer_write(w, "one ", 4);
    apsm_writer_printf(w, "%s %d %.3f\n", "two", 3, 0.5);
    apsm_writer_number(w, 0.1);
    assert_false(apsm_file_exists(path));
    assert_int_equal(apsm_writer_commit(w), APSM_OK);
    expect_content(path, "one two 3 0.500\n0.1");
    assert_int_equal(folder_count(*state), 1);
}

static void old_content_stays_until_commit_and_after_abort(void **state)
{
    char path[TEST_PATH];
    apsm_writer *w;
    folder_put(state, "a.txt", "old", 3);
    assert_int_equal(apsm_writer_open(ctx, folder_path(state, "a.txt", path), &w), APSM_OK);
    apsm_writer_printf(w, "new");
    expect_content(path, "old");
    apsm_writer_abort(w);
    expect_content(path, "old");
    assert_int_equal(folder_count(*state), 1);
}

/* Pieces smaller than, equal to and larger than the buffer, and texts that cross its end. */
static void long_contents_arrive_in_order(void **state)
{
    char path[TEST_PATH], *data;
    size_t size, expected = 0;
    apsm_writer *w;
    assert_int_equal(apsm_writer_open(ctx, folder_path(state, "long", path), &w), APSM_OK);
    static char piece[200000];
    for (size_t i = 0; i < sizeof piece; i++) piece[i] = (char)('a' + i % 26);
    const size_t sizes[] = { 1, 65535, 65536, 65537, 200000, 7, 130000 };
    for (size_t k = 0; k < 7; k++) {
        apsm_writer_write(w, piece, sizes[k]);
        apsm_writer_printf(w, "%.*s|", (int)sizes[k], piece);
        expected += 2 * sizes[k] + 1;
    }
    assert_int_equal(apsm_writer_commit(w), APSM_OK);
    assert_int_equal(apsm_read_file(ctx, path, 10000000, &data, &size), APSM_OK);
    assert_int_equal(size, expected);
    const char *at = data;
    for (size_t k = 0; k < 7; k++) {
        assert_memory_equal(at, piece, sizes[k]);
        assert_memory_equal(at + sizes[k], piece, sizes[k]);
        at += 2 * sizes[k];
        assert_int_equal(*at++, '|');
    }
    free(data);
}

static void csv_fields_are_quoted_where_needed(void **state)
{
    char path[TEST_PATH];
    apsm_writer *w;
    assert_int_equal(apsm_writer_open(ctx, folder_path(state, "a.csv", path), &w), APSM_OK);
    apsm_writer_csv(w, "plain name");
    apsm_writer_printf(w, ",");
    apsm_writer_csv(w, "a,b \"c\"");
    assert_int_equal(apsm_writer_commit(w), APSM_OK);
    expect_content(path, "plain name,\"a,b \"\"c\"\"\"");
}

static void expect_failure(apsm_status status, apsm_status expected, const char *words)
{
    assert_int_equal(status, expected);
    if (!strstr(apsm_error_text(ctx), words))
        fail_msg("'%s' does not say '%s'", apsm_error_text(ctx), words);
    assert_null(strchr(apsm_error_text(ctx), '\n'));
}

static void a_place_that_cannot_be_written_is_named(void **state)
{
    char path[TEST_PATH];
    apsm_writer *w;
    folder_put(state, "file", "x", 1);
    expect_failure(apsm_writer_open(ctx, folder_path(state, "none/a", path), &w), APSM_ERR_IO,
                   "none/a: cannot be written");
    assert_null(w);
    expect_failure(apsm_writer_open(ctx, folder_path(state, "file/a", path), &w), APSM_ERR_IO,
                   "a part of the path is a file");
    assert_int_equal(mkdir(folder_path(state, "folder", path), 0777), 0);
    assert_int_equal(apsm_writer_open(ctx, path, &w), APSM_OK);
    expect_failure(apsm_writer_commit(w), APSM_ERR_IO, "it is a folder");
    assert_int_equal(folder_count(*state), 2);
}

/* A full disk, as far as a process can stage one: files may not grow beyond 100 000 bytes.  The
 * failure comes late, in the middle of the data; it must be told and leave the old file. */
static void a_full_disk_is_told_and_leaves_the_old_file(void **state)
{
    char path[TEST_PATH];
    apsm_writer *w;
    struct rlimit before, small;
    folder_put(state, "a", "old", 3);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    small = before;
    small.rlim_cur = 100000;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    assert_int_equal(apsm_writer_open(ctx, folder_path(state, "a", path), &w), APSM_OK);
    for (int i = 0; i < 100000; i++) apsm_writer_printf(w, "%d\n", i);
    assert_true(apsm_writer_failed(w));
    const apsm_status status = apsm_writer_commit(w);
    setrlimit(RLIMIT_FSIZE, &before);
    expect_failure(status, APSM_ERR_IO, "ulimit -f");
    expect_content(path, "old");
    assert_int_equal(folder_count(*state), 1);
}

/* Root may write everywhere, so a child without privileges tries. */
static void a_read_only_folder_is_refused(void **state)
{
    char path[TEST_PATH];
    assert_int_equal(chmod(*state, 0555), 0);
    const pid_t child = fork();
    if (child == 0) {
        if (geteuid() == 0 && (setgid(65534) != 0 || setuid(65534) != 0)) _exit(9);
        apsm_writer *w;
        const apsm_status s = apsm_writer_open(ctx, folder_path(state, "a", path), &w);
        _exit(s == APSM_ERR_IO && strstr(apsm_error_text(ctx), "permissions") ? 0 : 1);
    }
    int result;
    assert_int_equal(waitpid(child, &result, 0), child);
    chmod(*state, 0777);
    assert_true(WIFEXITED(result));
    assert_int_equal(WEXITSTATUS(result), 0);
}

static void another_librarys_file_is_put_in_place(void **state)
{
    char temp[TEST_PATH], path[TEST_PATH];
    folder_put(state, "mesh.tmp", "new", 3);
    folder_put(state, "mesh", "old", 3);
    folder_path(state, "mesh.tmp", temp);
    assert_int_equal(apsm_replace_file(ctx, temp, folder_path(state, "mesh", path)), APSM_OK);
    expect_content(path, "new");
    assert_int_equal(folder_count(*state), 1);
    expect_failure(apsm_replace_file(ctx, temp, path), APSM_ERR_IO, "mesh: cannot be written");
    folder_put(state, "mesh.tmp", "new", 3);
    expect_failure(apsm_replace_file(ctx, temp, folder_path(state, "no/mesh", path)), APSM_ERR_IO,
                   "no/mesh");
    assert_int_equal(folder_count(*state), 1);
}

static void reading_keeps_to_the_limit(void **state)
{
    char path[TEST_PATH], *data;
    size_t size;
    static char big[10000];
    memset(big, 'x', sizeof big);
    folder_put(state, "big", big, sizeof big);
    folder_path(state, "big", path);
    assert_int_equal(apsm_read_file(ctx, path, sizeof big, &data, &size), APSM_OK);
    assert_int_equal(size, sizeof big);
    assert_int_equal(data[size], 0);
    free(data);
    expect_failure(apsm_read_file(ctx, path, sizeof big - 1, &data, &size), APSM_ERR_FORMAT,
                   "larger than the 9999 bytes");
    assert_null(data);
    folder_put(state, "empty", "", 0);
    assert_int_equal(apsm_read_file(ctx, folder_path(state, "empty", path), 10, &data, &size),
                     APSM_OK);
    assert_int_equal(size, 0);
    free(data);
    expect_failure(apsm_read_file(ctx, folder_path(state, "none", path), 10, &data, &size),
                   APSM_ERR_IO, "check the name");
    expect_failure(apsm_read_file(ctx, *state, 10, &data, &size), APSM_ERR_IO, "it is a folder");
    /* Devices have no end that can be relied on. */
    expect_failure(apsm_read_file(ctx, "/dev/null", 10, &data, &size), APSM_ERR_IO,
                   "/dev/null: is a pipe or device");
    expect_failure(apsm_read_file(ctx, "/dev/zero", 10000, &data, &size), APSM_ERR_IO,
                   "/dev/zero: is a pipe or device");
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(commit_makes_the_whole_file_and_nothing_else),
        TEST(old_content_stays_until_commit_and_after_abort),
        TEST(long_contents_arrive_in_order),
        TEST(csv_fields_are_quoted_where_needed),
        TEST(a_place_that_cannot_be_written_is_named),
        TEST(a_full_disk_is_told_and_leaves_the_old_file),
        TEST(a_read_only_folder_is_refused),
        TEST(another_librarys_file_is_put_in_place),
        TEST(reading_keeps_to_the_limit),
    };
    ctx = apsm_context_new();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
