/* Folder trees made at random: every level of folders, and the file's own name, either is the same
 * for all shapes or has several values, in all combinations.  All shapes are found, whatever else
 * lies beside them, and their names are told from the rule of docs/formats.md by arithmetic on the
 * values alone. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/random.h"
#include "files/files.h"
#include "input/input.h"
#include "scratch.h"

enum { TREES = 60, DEEPEST = 4, MOST = 3, ROOM = 81 }; /* ROOM: MOST^DEEPEST */

typedef struct tree {
    size_t levels, values[DEEPEST]; /* the last level is the file */
    const char *extension;
} tree;

static tree draw(apsm_random *rng)
{
    static const char *const extensions[] = { ".ply", ".nii.gz", ".STL", ".nrrd" };
    tree t = { .levels = 2 + apsm_random_below(rng, DEEPEST - 1),
               .extension = extensions[apsm_random_below(rng, 4)] };
    for (size_t l = 0; l < t.levels; l++)
        t.values[l] = apsm_random_uniform(rng) < 0.4 ? 1 : 2 + apsm_random_below(rng, MOST - 1);
    return t;
}

/* Value v of level l, different for all. */
static void word_of(size_t l, size_t v, char out[16])
{
    static const char *const stems[] = { "site", "sub-", "anat", "seg" };
    snprintf(out, 16, "%s%c", stems[l], (char)('a' + v));
}

static size_t shapes_of(const tree *t)
{
    size_t n = 1;
    for (size_t l = 0; l < t->levels; l++) n *= t->values[l];
    return n;
}

/* Shape i's path below the folder, and its name. */
static void describe(const tree *t, size_t i, char path[256], char name[128])
{
    const bool by_file = t->values[t->levels - 1] == shapes_of(t); /* files' names tell all apart */
    *path = *name = '\0';
    for (size_t l = 0; l < t->levels; l++) {
        char word[16];
        size_t below = 1;
        for (size_t k = l + 1; k < t->levels; k++) below *= t->values[k];
        word_of(l, i / below % t->values[l], word);
        if (l > 0) strcat(path, "/");
        strcat(path, word);
        const bool part = by_file ? l + 1 == t->levels : t->values[l] > 1;
        if (part && *name) strcat(name, "_");
        if (part) strcat(name, word);
    }
    strcat(path, t->extension);
}

static void touch(const char *folder, const char *path)
{
    char full[512];
    for (const char *slash = strchr(path, '/'); slash; slash = strchr(slash + 1, '/')) {
        apsm_context *const ctx = apsm_context_new();
        snprintf(full, sizeof full, "%s/%.*s", folder, (int)(slash - path), path);
        assert_int_equal(apsm_make_folder(ctx, full), APSM_OK);
        apsm_context_free(ctx);
    }
    snprintf(full, sizeof full, "%s/%s", folder, path);
    scratch_write(full, "x", 1);
}

/* What lies about in such folders and is no shape. */
static void litter(apsm_random *rng, const char *folder, const char *path)
{
    static const char *const files[] = { ".DS_Store", "notes.txt", "._a.ply", "Thumbs.db" };
    char full[256];
    const char *const slash = strrchr(path, '/');
    snprintf(full, sizeof full, "%.*s/%s", (int)(slash - path), path,
             files[apsm_random_below(rng, 4)]);
    touch(folder, full);
}

static int by_text(const void *a, const void *b)
{
    return strcmp(a, b);
}

static void check_tree(apsm_random *rng, const char *folder)
{
    static char names[ROOM][128];
    const tree t = draw(rng);
    const size_t n = shapes_of(&t);
    apsm_context *const ctx = apsm_context_new();
    apsm_input_list list;
    for (size_t i = 0; i < n; i++) {
        char path[256];
        describe(&t, i, path, names[i]);
        touch(folder, path);
        if (apsm_random_uniform(rng) < 0.3) litter(rng, folder, path);
    }
    qsort(names, n, sizeof *names, by_text);
    if (apsm_input_expand(ctx, 1, &folder, NULL, NULL, &list) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    assert_int_equal(list.n, n);
    for (size_t i = 0; i < n; i++)
        if (n > 1) assert_string_equal(list.cases[i].name, names[i]);
    apsm_input_list_free(&list);
    apsm_context_free(ctx);
}

static void all_shapes_are_found_and_named(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(14, APSM_STREAM_TEST, 0, 0);
    for (int k = 0; k < TREES; k++) {
        char folder[SCRATCH_LENGTH];
        scratch_make(folder);
        check_tree(&rng, folder);
        scratch_remove(folder);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(all_shapes_are_found_and_named) };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
