/* Journals of shares: all of a folder are found, whatever else is there, and only they are removed.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "files/shards.h"
#include "folder.h"

static apsm_context *ctx;
static const char *folder;

static journal_key key_of(int k)
{
    journal_key key;
    memset(&key, 7 * k + 1, sizeof key);
    return key;
}

/* A journal of a share with piece k, an int. */
static void keep(size_t shard, size_t shards, int k)
{
    journal *j;
    const journal_key key = key_of(k);
    char *path = shard_path(folder, shard, shards);
    assert_non_null(path);
    assert_int_equal(journal_open(ctx, path, false, &j), APSM_OK);
    assert_int_equal(journal_add(ctx, j, &key, &k, sizeof k), APSM_OK);
    journal_close(j);
    free(path);
}

static char *in_state(const char *name)
{
    char relative[64];
    snprintf(relative, sizeof relative, "state/%s", name);
    char *path = apsm_path_join(folder, relative);
    assert_non_null(path);
    return path;
}

static void put(const char *name, const char *text)
{
    char *path = in_state(name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
    free(path);
}

static bool is_there(const char *name)
{
    char *path = in_state(name);
    const bool there = apsm_file_exists(path);
    free(path);
    return there;
}

static bool finds(const journal_set *set, int k)
{
    void *data;
    size_t size;
    const journal_key key = key_of(k);
    assert_int_equal(journal_set_find(ctx, set, &key, &data, &size), APSM_OK);
    if (data) assert_true(size == sizeof k && memcmp(data, &k, size) == 0);
    free(data);
    return data != NULL;
}

static void all_shares_of_a_folder_are_found(void **state)
{
    journal_set set = { 0 };
    folder = *state;
    assert_int_equal(journal_set_add_shards(ctx, &set, folder), APSM_OK);
    assert_int_equal(set.n, 0);
    char *path = apsm_path_join(folder, "state");
    assert_int_equal(apsm_make_folder(ctx, path), APSM_OK);
    free(path);
    keep(0, 3, 1);
    keep(2, 3, 2);
    keep(0, 7, 3);
    put("shard-4-of-7.journal", "a text of somebody's");
    put("shard-5-of-7.journal.bak", "another");
    put("work.journal", "none of a share");
    assert_int_equal(journal_set_add_shards(ctx, &set, folder), APSM_OK);
    assert_int_equal(set.n, 3);
    for (int k = 1; k <= 3; k++) assert_true(finds(&set, k));
    assert_false(finds(&set, 4));
    journal_set_close(&set);
    assert_int_equal(shards_remove(ctx, folder, false), APSM_OK);
    assert_false(is_there("shard-1-of-3.journal") || is_there("shard-3-of-3.journal") ||
                 is_there("shard-1-of-7.journal"));
    assert_true(is_there("shard-4-of-7.journal") && is_there("shard-5-of-7.journal.bak") &&
                is_there("work.journal"));
}

static void a_share_at_work_keeps_its_journal(void **state)
{
    folder = *state;
    journal *j;
    char *path = apsm_path_join(folder, "state");
    assert_int_equal(apsm_make_folder(ctx, path), APSM_OK);
    free(path);
    keep(0, 2, 1);
    path = shard_path(folder, 1, 2);
    assert_int_equal(journal_open(ctx, path, false, &j), APSM_OK);
    assert_int_equal(shards_remove(ctx, folder, false), APSM_OK);
    assert_false(is_there("shard-1-of-2.journal"));
    assert_true(is_there("shard-2-of-2.journal") && journal_is_there(j));
    assert_int_equal(shards_remove(ctx, folder, true), APSM_OK);
    assert_false(is_there("shard-2-of-2.journal") || journal_is_there(j));
    keep(1, 2, 1); /* another file at its path */
    assert_false(journal_is_there(j));
    journal_close(j);
    assert_int_equal(shards_remove(ctx, folder, false), APSM_OK);
    assert_false(is_there("shard-2-of-2.journal"));
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
