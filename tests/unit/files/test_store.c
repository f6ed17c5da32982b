/* The store of shapes: arrays are what they were, the process keeps to the limit, no file is left,
 * and a disk that takes no more is an error. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <signal.h>
#include <string.h>
#include <sys/resource.h>

#include "files/stored.h"
#include "folder.h"

enum { MB = 1 << 20 };

static apsm_context *ctx;

static int set_up(void **state)
{
    ctx = apsm_context_new();
    return ctx ? folder_set_up(state) : -1;
}

static int tear_down(void **state)
{
    apsm_context_free(ctx);
    return folder_tear_down(state);
}

/* n bytes that the number k determines. */
static unsigned char *pattern(size_t n, unsigned k)
{
    unsigned char *x = malloc(n ? n : 1);
    if (!x) abort();
    for (size_t i = 0; i < n; i++) x[i] = (unsigned char)(i * 31 + k * 101 + (i >> 8));
    return x;
}

static bool has_pattern(const unsigned char *x, size_t n, unsigned k)
{
    for (size_t i = 0; i < n; i++)
        if (x[i] != (unsigned char)(i * 31 + k * 101 + (i >> 8))) return false;
    return true;
}

static void test_arrays_are_kept(void **state)
{
    const size_t size[] = { 1, 63, 64, 0, 4097, 3 * MB + 5 };
    enum { N = sizeof size / sizeof *size, OBJECTS = 3 };
    unsigned char *x[OBJECTS][N];
    apsm_store *store;
    assert_int_equal(apsm_store_open(ctx, *state, 64 * MB, &store), APSM_OK);
    assert_int_equal(folder_count(*state), 0);
    for (unsigned o = 0; o < OBJECTS; o++) {
        array_list arrays = { 0 };
        for (unsigned k = 0; k < N; k++) {
            x[o][k] = pattern(size[k], o * N + k);
            arrays_add(&arrays, &x[o][k], size[k]);
        }
        assert_int_equal(store_put(ctx, store, &arrays), APSM_OK);
    }
    for (int round = 0; round < 2; round++, apsm_store_trim(store))
        for (unsigned o = 0; o < OBJECTS; o++)
            for (unsigned k = 0; k < N; k++) {
                assert_int_equal((uintptr_t)x[o][k] % 64, 0);
                assert_true(has_pattern(x[o][k], size[k], o * N + k));
            }
    assert_true(apsm_store_bytes(store) >= (size_t)OBJECTS * (3 * MB + 5 + 4097 + 128));
    apsm_store_close(store);
    assert_int_equal(folder_count(*state), 0);
}

static size_t resident(void)
{
    unsigned long long size, pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (!file) return 0;
    if (fscanf(file, "%llu %llu", &size, &pages) != 2) pages = 0;
    fclose(file);
    return (size_t)pages * (size_t)sysconf(_SC_PAGESIZE);
}

#ifdef __SANITIZE_ADDRESS__
/* What is freed is not kept for long, as it counts as resident. */
__attribute__((visibility("default"))) const char *__asan_default_options(void);
const char *__asan_default_options(void)
{
    return "quarantine_size_mb=1";
}
#endif

/* 40 arrays of 4 MB, looked at again and again by several threads, in 64 MB above what the process
 * needs anyway. */
typedef struct visiting {
    apsm_store *store;
    unsigned char *x[40];
    size_t most;
} visiting;
enum { EACH = 4 * MB };

static apsm_status visit(apsm_context *task, size_t k, int worker, void *user)
{
    (void)task, (void)worker;
    visiting *v = user;
    const unsigned which = (unsigned)(k % 40);
    const bool same = has_pattern(v->x[which], EACH, which);
    const size_t now = resident();
#pragma omp critical
    if (now > v->most) v->most = now;
    return same ? APSM_OK : APSM_ERR_FORMAT;
}

static void trim(void *store)
{
    apsm_store_trim(store);
}

static void test_limit_is_kept(void **state)
{
    visiting v = { .most = 0 };
    const size_t before = resident(), limit = before + 64 * MB;
    if (before == 0) skip();
    assert_int_equal(apsm_store_open(ctx, *state, limit, &v.store), APSM_OK);
    for (unsigned k = 0; k < 40; k++) {
        array_list arrays = { 0 };
        v.x[k] = pattern(EACH, k);
        arrays_add(&arrays, &v.x[k], EACH);
        assert_int_equal(store_put(ctx, v.store, &arrays), APSM_OK);
    }
    apsm_context_set_threads(ctx, 3);
    apsm_context_set_between(ctx, trim, v.store);
    assert_int_equal(apsm_parallel_for(ctx, 120, visit, &v, NULL), APSM_OK);
    apsm_context_set_between(ctx, NULL, NULL);
    if (v.most > limit) fail_msg("%zu MB resident, limit %zu", v.most / MB, limit / MB);
    if (v.most < before + 16 * MB) fail_msg("nothing was ever resident: the test shows nothing");
    apsm_store_close(v.store);
}

static void test_folder_must_be_there(void **state)
{
    char path[TEST_PATH];
    apsm_store *store;
    assert_int_equal(apsm_store_open(ctx, folder_path(state, "none", path), MB, &store),
                     APSM_ERR_IO);
    assert_null(store);
    assert_non_null(strstr(apsm_error_text(ctx), "none: no file for shapes can be made there"));
}

/* A file that may not grow stands for a full disk. */
static void test_full_disk(void **state)
{
    apsm_store *store;
    array_list arrays = { 0 };
    unsigned char *x = pattern(2 * MB, 1), *before = x;
    struct rlimit old, small;
    assert_int_equal(apsm_store_open(ctx, *state, 64 * MB, &store), APSM_OK);
    arrays_add(&arrays, &x, 2 * MB);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    small = old;
    small.rlim_cur = MB;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    assert_int_equal(store_put(ctx, store, &arrays), APSM_ERR_IO);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    assert_non_null(strstr(apsm_error_text(ctx), "shapes cannot be stored there"));
    assert_ptr_equal(x, before); /* still the caller's */
    assert_true(has_pattern(x, 2 * MB, 1));
    free(x);
    apsm_store_close(store);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_arrays_are_kept, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_limit_is_kept, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_folder_must_be_there, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_full_disk, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
