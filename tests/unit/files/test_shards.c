/* Journals of shares: all of a folder are found, whatever else is there, and only they are removed.
 */
#include "cmocka_all.h"

#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "files/shards.h"
#include "folder.h"

static apsm_context *ctx;

static journal_key key_of(int k)
{
    journal_key key;
    memset(&key, 7 * k + 1, sizeof key);
    return key;
}

/* A journal of a share with piece k, an int. */
static void keep(const char *folder, size_t shard, size_t shards, int k)
{
    journal *j;
    const journal_key key = key_of(k);
    char *path = shard_path(folder, shard, shards);
    assert_non_null(path);
    assert_ok(journal_open(ctx, path, false, &j));
    assert_ok(journal_add(ctx, j, &key, &k, sizeof k));
    journal_close(j);
    free(path);
}

static void make_state(void **state)
{
    char path[TEST_PATH];
    assert_ok(apsm_make_folder(ctx, folder_path(state, "state", path)));
}

static bool is_there(void **state, const char *name)
{
    char path[TEST_PATH];
    return apsm_file_exists(folder_path(state, name, path));
}

static bool finds(const journal_set *set, int k)
{
    void *data;
    size_t size;
    const journal_key key = key_of(k);
    assert_ok(journal_set_find(ctx, set, &key, &data, &size));
    if (data) assert_true(size == sizeof k && memcmp(data, &k, size) == 0);
    free(data);
    return data != NULL;
}

static void all_shares_of_a_folder_are_found(void **state)
{
    journal_set set = { 0 };
    const char *folder = *state;
    assert_ok(journal_set_add_shards(ctx, &set, folder));
    assert_int_equal(set.n, 0);
    make_state(state);
    keep(folder, 0, 3, 1);
    keep(folder, 2, 3, 2);
    keep(folder, 0, 7, 3);
    folder_put(state, "state/shard-4-of-7.journal", "a text of somebody's", 20);
    folder_put(state, "state/shard-5-of-7.journal.bak", "another", 7);
    folder_put(state, "state/work.journal", "none of a share", 15);
    assert_ok(journal_set_add_shards(ctx, &set, folder));
    assert_int_equal(set.n, 3);
    for (int k = 1; k <= 3; k++) assert_true(finds(&set, k));
    assert_false(finds(&set, 4));
    journal_set_close(&set);
    assert_ok(shards_remove(ctx, folder, false));
    assert_false(is_there(state, "state/shard-1-of-3.journal") ||
                 is_there(state, "state/shard-3-of-3.journal") ||
                 is_there(state, "state/shard-1-of-7.journal"));
    assert_true(is_there(state, "state/shard-4-of-7.journal") &&
                is_there(state, "state/shard-5-of-7.journal.bak") &&
                is_there(state, "state/work.journal"));
}

static void a_share_at_work_keeps_its_journal(void **state)
{
    const char *folder = *state;
    journal *j;
    make_state(state);
    keep(folder, 0, 2, 1);
    char *path = shard_path(folder, 1, 2);
    assert_ok(journal_open(ctx, path, false, &j));
    assert_ok(shards_remove(ctx, folder, false));
    assert_false(is_there(state, "state/shard-1-of-2.journal"));
    assert_true(is_there(state, "state/shard-2-of-2.journal") && journal_is_there(j));
    assert_ok(shards_remove(ctx, folder, true));
    assert_false(is_there(state, "state/shard-2-of-2.journal") || journal_is_there(j));
    keep(folder, 1, 2, 1); /* another file at its path */
    assert_false(journal_is_there(j));
    journal_close(j);
    assert_ok(shards_remove(ctx, folder, false));
    assert_false(is_there(state, "state/shard-2-of-2.journal"));
    free(path);
}

static void names_are_told_apart(void **state)
{
    (void)state;
    assert_true(shard_is_one("a/state/shard-2-of-7.journal"));
    assert_true(shard_is_one("/state/shard-12-of-70.journal"));
    assert_false(shard_is_one("shard-2-of-7.journal"));
    assert_false(shard_is_one("a/restate/../shard-2-of-7.journal"));
    assert_false(shard_is_one("a/state/shard-2-of-7.journal2"));
    assert_false(shard_is_one("a/state/shard-2-of-.journal"));
    assert_false(shard_is_one("a/state/b/shard-2-of-7.journal"));
}

int main(void)
{
    ctx = apsm_context_new();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(all_shares_of_a_folder_are_found, folder_set_up,
                                        folder_tear_down),
        cmocka_unit_test_setup_teardown(a_share_at_work_keeps_its_journal, folder_set_up,
                                        folder_tear_down),
        cmocka_unit_test(names_are_told_apart),
    };
    const int failed = cmocka_run_group_tests_name("shards", tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
