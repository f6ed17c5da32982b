/* Folders, paths, locks. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>
#include <sys/wait.h>
#include <time.h>

#include "files/files.h"
#include "folder.h"

static apsm_context *ctx;

static void expect_text(char *text, const char *expected)
{
    assert_non_null(text);
    assert_string_equal(text, expected);
    free(text);
}

static void paths_are_joined_and_taken_apart(void **state)
{
    (void)state;
    expect_text(apsm_path_join("a/b", "c"), "a/b/c");
    expect_text(apsm_path_join("a/", "c"), "a/c");
    expect_text(apsm_path_join("a", "/c"), "/c");
    expect_text(apsm_path_join(".", "c"), "c");
    expect_text(apsm_path_join("/", "c"), "/c");
    expect_text(apsm_path_folder("a/b/c"), "a/b");
    expect_text(apsm_path_folder("c"), ".");
    expect_text(apsm_path_folder("/c"), "/");
    expect_text(apsm_path_folder("a//c"), "a");
    expect_text(apsm_path_stem("a.b/talus_01.ply"), "talus_01");
    expect_text(apsm_path_stem("liver.nii.gz"), "liver");
    expect_text(apsm_path_stem("liver.NRRD"), "liver");
    expect_text(apsm_path_stem("x/v1.2.nrrd"), "v1.2");
    expect_text(apsm_path_stem("x/plain"), "plain");
    expect_text(apsm_path_stem(".hidden"), ".hidden");
}

static void relative_paths_lead_back(void **state)
{
    char a[TEST_PATH], b[TEST_PATH];
    folder_path(state, "model", a);
    assert_int_equal(apsm_make_folder(ctx, folder_path(state, "model/groomed", b)), APSM_OK);
    expect_text(apsm_path_relative(a, folder_path(state, "model/groomed/x.ply", b)),
                "groomed/x.ply");
    expect_text(apsm_path_relative(a, folder_path(state, "data/x.ply", b)), "../data/x.ply");
    expect_text(apsm_path_relative(a, folder_path(state, "model2/x.ply", b)), "../model2/x.ply");
    expect_text(apsm_path_relative(a, folder_path(state, "mod", b)), "../mod");
    expect_text(apsm_path_relative(a, a), ".");
    expect_text(apsm_path_relative(a, *state), "..");
    expect_text(apsm_path_relative(folder_path(state, "model/groomed", b), a), "..");
    /* A symbolic link must not fool "..". */
    char link[TEST_PATH];
    assert_int_equal(symlink(b, folder_path(state, "link", link)), 0);
    expect_text(apsm_path_relative(link, folder_path(state, "model/y", b)), "../y");
}

static void folders_are_made_with_their_parents(void **state)
{
    char path[TEST_PATH];
    assert_int_equal(apsm_make_folder(ctx, folder_path(state, "a/b//c/", path)), APSM_OK);
    assert_true(apsm_is_folder(path));
    assert_int_equal(apsm_make_folder(ctx, path), APSM_OK);
    folder_put(state, "file", "", 0);
    assert_int_equal(apsm_make_folder(ctx, folder_path(state, "file/x", path)), APSM_ERR_IO);
    assert_non_null(strstr(apsm_error_text(ctx), "file/x"));
    assert_int_equal(apsm_make_folder(ctx, ""), APSM_ERR_IO);
    assert_true(apsm_file_exists(folder_path(state, "file", path)));
    assert_false(apsm_file_exists(*state));
    assert_false(apsm_is_folder(path));
}

static void a_second_process_is_refused_until_the_first_ends(void **state)
{
    apsm_lock mine, again;
    assert_int_equal(apsm_lock_folder(ctx, *state, &mine), APSM_OK);
    const pid_t child = fork();
    if (child == 0) {
        char expected[32];
        snprintf(expected, sizeof expected, "process %ld", (long)getppid());
        const apsm_status s = apsm_lock_folder(ctx, *state, &again);
        _exit(s == APSM_ERR_STATE && strstr(apsm_error_text(ctx), expected) ? 0 : 1);
    }
    int result;
    waitpid(child, &result, 0);
    assert_int_equal(result, 0);
    apsm_unlock_folder(&mine);
    assert_int_equal(folder_count(*state), 0);
    assert_int_equal(apsm_lock_folder(ctx, *state, &again), APSM_OK);
    apsm_unlock_folder(&again);
    apsm_unlock_folder(&again);
}

/* A run that was killed leaves the file, but not the lock. */
static void a_killed_run_leaves_no_lock(void **state)
{
    const pid_t child = fork();
    if (child == 0) {
        apsm_lock lock;
        _exit(apsm_lock_folder(ctx, *state, &lock) == APSM_OK ? 0 : 1);
    }
    int result;
    waitpid(child, &result, 0);
    assert_int_equal(result, 0);
    assert_int_equal(folder_count(*state), 1);
    apsm_lock lock;
    assert_int_equal(apsm_lock_folder(ctx, *state, &lock), APSM_OK);
    apsm_unlock_folder(&lock);
}

/* Many processes at once: never two inside.  Each makes a file that must not exist yet. */
static void no_two_processes_hold_the_lock(void **state)
{
    enum { PROCESSES = 8, ROUNDS = 600 };
    char inside[TEST_PATH];
    folder_path(state, "inside", inside);
    pid_t child[PROCESSES];
    for (int p = 0; p < PROCESSES; p++) {
        if ((child[p] = fork()) != 0) continue;
        for (int k = 0; k < ROUNDS; k++) {
            apsm_lock lock;
            if (apsm_lock_folder(NULL, *state, &lock) != APSM_OK) continue;
            if (mkdir(inside, 0777) != 0) _exit(1);
            nanosleep(&(struct timespec){ .tv_nsec = 20000 }, NULL); /* time for others to err */
            rmdir(inside);
            apsm_unlock_folder(&lock);
        }
        _exit(0);
    }
    for (int p = 0; p < PROCESSES; p++) {
        int result;
        waitpid(child[p], &result, 0);
        assert_int_equal(result, 0);
    }
}

static void a_folder_that_is_not_there_cannot_be_locked(void **state)
{
    char path[TEST_PATH];
    apsm_lock lock;
    assert_int_equal(apsm_lock_folder(ctx, folder_path(state, "none", path), &lock), APSM_ERR_IO);
    apsm_unlock_folder(&lock);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(paths_are_joined_and_taken_apart),
        TEST(relative_paths_lead_back),
        TEST(folders_are_made_with_their_parents),
        TEST(a_second_process_is_refused_until_the_first_ends),
        TEST(a_killed_run_leaves_no_lock),
        TEST(no_two_processes_hold_the_lock),
        TEST(a_folder_that_is_not_there_cannot_be_locked),
    };
    ctx = apsm_context_new();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
