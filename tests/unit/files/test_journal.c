/* Journals: pieces come back by their keys, whichever byte is hurt or missing. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <signal.h>
#include <string.h>
#include <sys/resource.h>

#include "files/files.h"
#include "files/journal.h"
#include "folder.h"

static apsm_context *ctx;

static journal_key key_of(int k)
{
    journal_key key;
    memset(&key, 7 * k + 1, sizeof key);
    return key;
}

static const char *const content[] = { "first piece", "", "the third, of another length" };
enum { PIECES = 3 };

static journal *opened(const char *path, bool fresh)
{
    journal *j;
    assert_int_equal(journal_open(ctx, path, fresh, &j), APSM_OK);
    return j;
}

static void add(journal *j, int k, const char *text)
{
    const journal_key key = key_of(k);
    assert_int_equal(journal_add(ctx, j, &key, text, strlen(text)), APSM_OK);
}

static void fill(const char *path, const char *data, size_t size)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

static void write_three(const char *path)
{
    journal *j = opened(path, true);
    for (int k = 0; k < PIECES; k++) add(j, k, content[k]);
    journal_close(j);
}

/* Whether piece k is there; if so it must be text. */
static bool has(const journal *j, int k, const char *text)
{
    const journal_key key = key_of(k);
    void *data;
    size_t size;
    assert_int_equal(journal_find(ctx, j, &key, &data, &size), APSM_OK);
    if (!data) return false;
    assert_int_equal(size, strlen(text));
    assert_memory_equal(data, text, size);
    free(data);
    return true;
}

static void pieces_come_back(void **state)
{
    char path[TEST_PATH];
    write_three(folder_path(state, "j", path));
    journal *j = opened(path, false);
    assert_int_equal(journal_count(j), PIECES);
    for (int k = 0; k < PIECES; k++) assert_true(has(j, k, content[k]));
    assert_false(has(j, 5, ""));
    add(j, 5, "one more");
    add(j, 0, "the first anew");
    journal_close(j);
    j = opened(path, false);
    assert_int_equal(journal_count(j), PIECES + 2);
    assert_true(has(j, 0, "the first anew")); /* the last of a key counts */
    assert_true(has(j, 5, "one more"));
    journal_close(j);
    j = opened(path, true);
    assert_int_equal(journal_count(j), 0);
    assert_false(has(j, 0, ""));
    journal_close(j);
}

/* A kill in the middle of a write: the pieces before it are there, and more can follow. */
static void any_length_is_read(void **state)
{
    char path[TEST_PATH], *data;
    size_t size;
    write_three(folder_path(state, "j", path));
    assert_int_equal(apsm_read_file(ctx, path, SIZE_MAX / 2, &data, &size), APSM_OK);
    for (size_t length = 0; length < size; length++) {
        fill(path, data, length);
        journal *j = opened(path, false);
        const size_t whole = journal_count(j);
        assert_true(whole < PIECES);
        for (int k = 0; k < PIECES; k++) assert_int_equal(has(j, k, content[k]), (size_t)k < whole);
        add(j, 9, "after it");
        journal_close(j);
        j = opened(path, false);
        assert_int_equal(journal_count(j), whole + 1);
        assert_true(has(j, 9, "after it"));
        journal_close(j);
    }
    free(data);
}

static bool same_bytes(const char *path, const char *data, size_t size)
{
    char *now;
    size_t n;
    assert_int_equal(apsm_read_file(ctx, path, SIZE_MAX / 2, &now, &n), APSM_OK);
    const bool same = n == size && memcmp(now, data, size) == 0;
    free(now);
    return same;
}

static void no_altered_byte_is_believed(void **state)
{
    char path[TEST_PATH], *data;
    size_t size, kept = 0;
    write_three(folder_path(state, "j", path));
    assert_int_equal(apsm_read_file(ctx, path, SIZE_MAX / 2, &data, &size), APSM_OK);
    for (size_t at = 0; at < size; at++) {
        data[at] ^= 0x10;
        fill(path, data, size);
        if (at < 8) { /* what begins otherwise is none, and is not touched */
            journal *none;
            assert_int_equal(journal_open(ctx, path, true, &none), APSM_ERR_STATE);
            assert_true(!none && same_bytes(path, data, size));
        } else {
            journal *j = opened(path, false);
            for (int k = 0; k < PIECES; k++) kept += has(j, k, content[k]);
            journal_close(j);
        }
        data[at] ^= 0x10;
    }
    assert_true(kept > size); /* the others are not lost with it */
    free(data);
}

static void a_full_disk_is_told_and_leaves_the_rest(void **state)
{
    char path[TEST_PATH], large[4096];
    const journal_key key = key_of(8);
    struct rlimit before, small;
    write_three(folder_path(state, "j", path));
    journal *j = opened(path, false);
    memset(large, 'x', sizeof large);
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    small = before;
    small.rlim_cur = 2048;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    const apsm_status status = journal_add(ctx, j, &key, large, sizeof large);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_int_equal(status, APSM_ERR_IO);
    assert_non_null(strstr(apsm_error_text(ctx), path));
    add(j, 5, "small");
    journal_close(j);
    j = opened(path, false);
    assert_int_equal(journal_count(j), PIECES + 1);
    assert_true(has(j, 5, "small"));
    assert_true(has(j, 2, content[2]));
    journal_close(j);
}

static void a_missing_folder_is_told(void **state)
{
    char path[TEST_PATH];
    journal *j;
    folder_path(state, "nowhere/j", path);
    assert_int_equal(journal_open(ctx, path, false, &j), APSM_ERR_IO);
    assert_null(j);
    assert_non_null(strstr(apsm_error_text(ctx), "nowhere/j"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(pieces_come_back, folder_set_up, folder_tear_down),
        cmocka_unit_test_setup_teardown(any_length_is_read, folder_set_up, folder_tear_down),
        cmocka_unit_test_setup_teardown(no_altered_byte_is_believed, folder_set_up,
                                        folder_tear_down),
        cmocka_unit_test_setup_teardown(a_full_disk_is_told_and_leaves_the_rest, folder_set_up,
                                        folder_tear_down),
        cmocka_unit_test_setup_teardown(a_missing_folder_is_told, folder_set_up, folder_tear_down),
    };
    ctx = apsm_context_new();
    const int failed = cmocka_run_group_tests_name("journal", tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
