/* Records in a file without a name. */
#include "cmocka_all.h"

#include <string.h>

#include "files/records.h"
#include "folder.h"

enum { N = 40, SIZE = 300 };

static void come_back_as_they_were(void **state)
{
    apsm_context *ctx = apsm_context_new();
    const char *folder = *state;
    unsigned char in[SIZE], out[SIZE];
    records r;
    assert_int_equal(records_open(ctx, folder, SIZE, &r), APSM_OK);
    assert_int_equal(folder_count(folder), 0);
    for (size_t k = 0; k < N; k++) { /* in another order than they are read */
        const size_t i = 7 * k % N;
        memset(in, (int)i + 1, SIZE);
        assert_int_equal(records_put(ctx, &r, i, in), APSM_OK);
    }
    for (size_t i = 0; i < N; i++) {
        memset(in, (int)i + 1, SIZE);
        assert_int_equal(records_get(ctx, &r, i, out), APSM_OK);
        assert_memory_equal(in, out, SIZE);
    }
    assert_int_equal(records_get(ctx, &r, N, out), APSM_ERR_IO); /* was never put */
    records_close(&r);
    assert_int_equal(records_open(ctx, "/nowhere/at/all", SIZE, &r), APSM_ERR_IO);
    records_close(&r);
    apsm_context_free(ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(come_back_as_they_were, folder_set_up, folder_tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
