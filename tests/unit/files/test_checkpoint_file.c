/* Checkpoints: whole or refused, whichever byte is hurt. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <signal.h>
#include <string.h>
#include <sys/resource.h>

#include "files/checkpoint_file.h"
#include "files/files.h"
#include "folder.h"

static apsm_context *ctx;
static const double positions[5] = { 1.5, -2, 3e100, 0, 5 };

static void write_one(const char *path)
{
    apsm_checkpoint_writer *w;
    const uint64_t epoch = 17;
    assert_int_equal(apsm_checkpoint_open(ctx, path, &w), APSM_OK);
    apsm_checkpoint_add(w, "epoch", &epoch, sizeof epoch);
    apsm_checkpoint_add(w, "note", "abc", 3);
    apsm_checkpoint_add(w, "positions", positions, sizeof positions);
    apsm_checkpoint_add(w, "empty", NULL, 0);
    assert_int_equal(apsm_checkpoint_commit(w), APSM_OK);
}

static void sections_come_back(void **state)
{
    char path[TEST_PATH];
    apsm_checkpoint *c;
    uint64_t epoch;
    double P[5];
    size_t size;
    write_one(folder_path(state, "c", path));
    assert_int_equal(apsm_checkpoint_read(ctx, path, &c), APSM_OK);
    assert_int_equal(apsm_checkpoint_get(ctx, c, "epoch", &epoch, sizeof epoch), APSM_OK);
    assert_int_equal(epoch, 17);
    assert_int_equal(apsm_checkpoint_get(ctx, c, "positions", P, sizeof P), APSM_OK);
    assert_memory_equal(P, positions, sizeof P);
    const void *block = apsm_checkpoint_find(c, "positions", &size);
    assert_int_equal(size, sizeof positions);
    assert_int_equal((uintptr_t)block % 8, 0);
    assert_non_null(apsm_checkpoint_find(c, "empty", &size));
    assert_int_equal(size, 0);
    assert_null(apsm_checkpoint_find(c, "other", &size));
    assert_int_equal(apsm_checkpoint_get(ctx, c, "other", P, 8), APSM_ERR_STATE);
    assert_non_null(strstr(apsm_error_text(ctx), "holds no 'other'"));
    assert_int_equal(apsm_checkpoint_get(ctx, c, "epoch", P, 4), APSM_ERR_STATE);
    assert_non_null(strstr(apsm_error_text(ctx), "8 bytes where 4"));
    apsm_checkpoint_free(c);
}

static void expect_refused(void **state, const char *data, size_t size, const char *what, size_t at)
{
    char path[TEST_PATH];
    apsm_checkpoint *c;
    folder_put(state, "bad", data, size);
    if (apsm_checkpoint_read(ctx, folder_path(state, "bad", path), &c) != APSM_ERR_FORMAT)
        fail_msg("%s at %zu was taken", what, at);
    assert_null(c);
    assert_non_null(strstr(apsm_error_text(ctx), "bad: is "));
}

static void every_truncation_and_a_flipped_bit_in_every_byte_is_refused(void **state)
{
    char path[TEST_PATH], *data;
    size_t size;
    write_one(folder_path(state, "c", path));
    assert_int_equal(apsm_read_file(ctx, path, 10000, &data, &size), APSM_OK);
    for (size_t n = 0; n < size; n++) expect_refused(state, data, n, "a truncation", n);
    for (size_t byte = 0; byte < size; byte++) {
        const size_t bit = 8 * byte + byte % 8;
        data[bit / 8] = (char)(data[bit / 8] ^ 1 << bit % 8);
        expect_refused(state, data, size, "a flipped bit", bit);
        data[bit / 8] = (char)(data[bit / 8] ^ 1 << bit % 8);
    }
    expect_refused(state, data, size + 1, "a byte more", size);
    free(data);
}

static void the_reason_of_a_refusal_is_told(void **state)
{
    char path[TEST_PATH], *data;
    size_t size;
    write_one(folder_path(state, "c", path));
    assert_int_equal(apsm_read_file(ctx, path, 10000, &data, &size), APSM_OK);
    expect_refused(state, "hello, world, hello, world", 26, "a foreign file", 0);
    assert_non_null(strstr(apsm_error_text(ctx), "no checkpoint of apsm"));
    data[8] = 2;
    expect_refused(state, data, size, "version 2", 8);
    assert_non_null(strstr(apsm_error_text(ctx), "another version"));
    data[8] = 1;
    memcpy(data + 12, "\1\2\3\4", 4);
    expect_refused(state, data, size, "big endian", 12);
    assert_non_null(strstr(apsm_error_text(ctx), "byte order"));
    free(data);
}

static void an_unfinished_checkpoint_leaves_the_last_one(void **state)
{
    char path[TEST_PATH];
    apsm_checkpoint_writer *w;
    apsm_checkpoint *c;
    write_one(folder_path(state, "c", path));
    assert_int_equal(apsm_checkpoint_open(ctx, path, &w), APSM_OK);
    apsm_checkpoint_add(w, "x", "1", 1);
    apsm_checkpoint_abort(w);
    assert_int_equal(apsm_checkpoint_open(ctx, path, &w), APSM_OK);
    apsm_checkpoint_add(w, "a name that is far too long for its field", "1", 1);
    assert_int_equal(apsm_checkpoint_commit(w), APSM_ERR_ARG);
    struct rlimit before, small;
    getrlimit(RLIMIT_FSIZE, &before);
    small = before;
    small.rlim_cur = 100;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(apsm_checkpoint_open(ctx, path, &w), APSM_OK);
    setrlimit(RLIMIT_FSIZE, &small);
    apsm_checkpoint_add(w, "x", positions, sizeof positions);
    const apsm_status status = apsm_checkpoint_commit(w);
    setrlimit(RLIMIT_FSIZE, &before);
    assert_int_equal(status, APSM_ERR_IO);
    assert_int_equal(folder_count(*state), 1);
    assert_int_equal(apsm_checkpoint_read(ctx, path, &c), APSM_OK);
    apsm_checkpoint_free(c);
    assert_int_equal(apsm_checkpoint_read(ctx, *state, &c), APSM_ERR_IO);
    assert_int_equal(apsm_checkpoint_open(ctx, folder_path(state, "no/c", path), &w), APSM_ERR_IO);
    assert_null(w);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(sections_come_back),
        TEST(every_truncation_and_a_flipped_bit_in_every_byte_is_refused),
        TEST(the_reason_of_a_refusal_is_told),
        TEST(an_unfinished_checkpoint_leaves_the_last_one),
    };
    ctx = apsm_context_new();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
