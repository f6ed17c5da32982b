/* JSON files: layout, exact numbers, errors that name the place. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <jansson.h>
#include <math.h>
#include <string.h>

#include "files/files.h"
#include "folder.h"

static apsm_context *ctx;

static void layout_is_indented_with_rows_on_a_line(void **state)
{
    char path[TEST_PATH], *data;
    size_t size;
    const double X[6] = { 1, 0.1, -2.5, 1e-300, 3, 1.0 / 3 };
    json_t *root = json_pack("{s:s, s:i, s:o, s:{s:b, s:n}, s:[], s:[{s:s}]}", "format", "apsm-x",
                             "version", 1, "rows", apsm_json_matrix(2, 3, X), "inner", "yes", 1,
                             "none", "empty", "list", "na\"me", "g\xc3\xbcrtel");
    assert_int_equal(apsm_json_write(ctx, folder_path(state, "a.json", path), root), APSM_OK);
    assert_int_equal(apsm_read_file(ctx, path, 1000, &data, &size), APSM_OK);
    assert_string_equal(data, "{\n"
                              "    \"format\": \"apsm-x\",\n"
                              "    \"version\": 1,\n"
                              "    \"rows\": [\n"
                              "        [1.0, 0.10000000000000001, -2.5],\n"
                              "        [1e-300, 3.0, 0.33333333333333331]\n"
                              "    ],\n"
                              "    \"inner\": {\n"
                              "        \"yes\": true,\n"
                              "        \"none\": null\n"
                              "    },\n"
                              "    \"empty\": [],\n"
                              "    \"list\": [\n"
                              "        {\n"
                              "            \"na\\\"me\": \"g\xc3\xbcrtel\"\n"
                              "        }\n"
                              "    ]\n"
                              "}\n");
    free(data);
    json_t *back;
    double Y[6];
    assert_int_equal(apsm_json_read(ctx, path, &back), APSM_OK);
    assert_true(json_equal(root, back));
    assert_true(apsm_json_get_matrix(json_object_get(back, "rows"), 2, 3, Y));
    assert_memory_equal(X, Y, sizeof X);
    json_decref(back);
    json_decref(root);
}

static void what_is_not_finite_is_refused(void **state)
{
    char path[TEST_PATH];
    const double X[2] = { 1, NAN };
    assert_null(apsm_json_vector(2, X));
    assert_null(apsm_json_matrix(1, 2, X));
    folder_path(state, "a.json", path);
    assert_int_equal(apsm_json_write(ctx, path, apsm_json_vector(2, X)), APSM_ERR_NONFINITE);
    assert_non_null(strstr(apsm_error_text(ctx), "a.json"));
    assert_false(apsm_file_exists(path));
    json_t *null = apsm_json_number_or_null(INFINITY), *number = apsm_json_number_or_null(2);
    assert_true(json_is_null(null));
    assert_true(json_number_value(number) == 2);
    json_decref(null);
    json_decref(number);
}

static void expect_refusal(void **state, const char *text, const char *words)
{
    char path[TEST_PATH];
    json_t *root;
    folder_put(state, "bad.json", text, strlen(text));
    assert_int_equal(apsm_json_read(ctx, folder_path(state, "bad.json", path), &root),
                     APSM_ERR_FORMAT);
    assert_null(root);
    if (!strstr(apsm_error_text(ctx), words))
        fail_msg("'%s' does not say '%s'", apsm_error_text(ctx), words);
}

static void damage_is_told_with_line_and_column(void **state)
{
    expect_refusal(state, "{\n  \"a\": 1,\n  \"b\": ]\n}", "bad.json:3:8:");
    expect_refusal(state, "{\"a\": 1, \"a\": 2}", "duplicate object key");
    expect_refusal(state, "", "bad.json:1:0:");
    expect_refusal(state, "{} x", "bad.json:1:4:");
    expect_refusal(state, "{\"a\": NaN}", "bad.json:1:");
    expect_refusal(state, "{\"a\": \"\xff\"}", "bad.json:1:");
    expect_refusal(state, "[1e999]", "real number overflow");
    expect_refusal(state, "[1, 2", "bad.json:1:");
}

static void a_byte_order_mark_is_harmless(void **state)
{
    char path[TEST_PATH];
    json_t *root;
    folder_put(state, "a.json", "\xef\xbb\xbf{\"a\": 1}\r\n", 13);
    assert_int_equal(apsm_json_read(ctx, folder_path(state, "a.json", path), &root), APSM_OK);
    json_decref(root);
}

static void expect_verdict(const char *text, apsm_status expected, const char *words)
{
    json_t *root = json_loads(text, JSON_DECODE_ANY, NULL);
    assert_int_equal(apsm_json_check(ctx, "m.json", root, "apsm-model", 2), expected);
    if (expected != APSM_OK && !strstr(apsm_error_text(ctx), words))
        fail_msg("'%s' does not say '%s'", apsm_error_text(ctx), words);
    json_decref(root);
}

static void formats_and_versions_are_checked(void **state)
{
    (void)state;
    expect_verdict("{\"format\": \"apsm-model\", \"version\": 1}", APSM_OK, "");
    expect_verdict("{\"format\": \"apsm-model\", \"version\": 2}", APSM_OK, "");
    expect_verdict("{\"format\": \"apsm-model\", \"version\": 3}", APSM_ERR_FORMAT, "newer");
    expect_verdict("{\"format\": \"apsm-model\", \"version\": 0}", APSM_ERR_FORMAT, "version");
    expect_verdict("{\"format\": \"apsm-model\"}", APSM_ERR_FORMAT, "version");
    expect_verdict("{\"format\": \"other\", \"version\": 1}", APSM_ERR_FORMAT, "\"other\", not");
    expect_verdict("{\"version\": 1}", APSM_ERR_FORMAT, "missing");
    expect_verdict("[]", APSM_ERR_FORMAT, "missing");
    expect_verdict("{\"format\": 3, \"version\": 1}", APSM_ERR_FORMAT, "missing");
}

static void matrices_of_another_shape_are_refused(void **state)
{
    (void)state;
    double x[6];
    json_t *json = json_loads("[[1, 2], [3, 4], [5, true]]", 0, NULL);
    assert_false(apsm_json_get_matrix(json, 3, 2, x));
    assert_true(apsm_json_get_matrix(json_array_get(json, 1), 2, 0, x));
    assert_true(x[0] == 3 && x[1] == 4);
    assert_false(apsm_json_get_matrix(json, 2, 2, x));
    assert_false(apsm_json_get_matrix(json, 3, 3, x));
    assert_false(apsm_json_get_matrix(NULL, 1, 1, x));
    json_decref(json);
}

static bool intact(const char *path)
{
    bool is;
    assert_int_equal(apsm_json_is_intact(ctx, path, &is), APSM_OK);
    return is;
}

/* A sealed file is ordinary JSON; any altered byte, a missing end and a missing seal are seen. */
static void a_seal_breaks_with_any_byte(void **state)
{
    char path[TEST_PATH], *data;
    size_t size;
    json_t *root = json_pack("{s:s, s:{s:[i, i]}, s:[]}", "sha256", "of another file", "rows", "a",
                             1, 2, "empty"),
           *read;
    folder_path(state, "a.json", path);
    assert_int_equal(apsm_json_write_sealed(ctx, path, root), APSM_OK);
    assert_true(intact(path));
    assert_int_equal(apsm_json_read(ctx, path, &read), APSM_OK);
    assert_int_equal(json_object_size(read), 3);
    assert_true(json_equal(json_object_get(read, "rows"), json_object_get(root, "rows")));
    assert_int_equal(apsm_read_file(ctx, path, 1 << 20, &data, &size), APSM_OK);
    for (size_t k = 0; k < size; k++) {
        data[k] ^= 1;
        folder_put(state, "b.json", data, size);
        if (intact(folder_path(state, "b.json", path))) fail_msg("byte %zu of %zu", k, size);
        data[k] ^= 1;
    }
    folder_put(state, "b.json", data, size - 1);
    assert_false(intact(path));
    folder_put(state, "b.json", "{}\n", 3);
    assert_false(intact(path));
    free(data);
    json_decref(read);
    json_decref(root);
}

/* ---- long lists ---- */

static apsm_status give_value(apsm_context *c, size_t i, void *user, json_t **value)
{
    const size_t *bad = user;
    (void)c;
    if (i == *bad) return apsm_fail(c, APSM_ERR_STATE, "no value %zu", i);
    *value = i == 5 ? NULL : json_pack("{s:s, s:[i, i]}", "name", "x, ]}", "row", (int)i, 1);
    return APSM_OK;
}

static apsm_status take_value(apsm_context *c, size_t i, const json_t *value, void *user)
{
    size_t *n = user;
    (void)c;
    assert_int_equal(json_integer_value(json_array_get(json_object_get(value, "row"), 0)), i);
    ++*n;
    return i == 3 ? apsm_fail(c, APSM_ERR_STATE, "enough") : APSM_OK;
}

static apsm_status skip_value(apsm_context *c, size_t i, const json_t *value, void *user)
{
    (void)c, (void)i, (void)value, (void)user;
    return APSM_OK;
}

/* The bytes of a list that is written value by value are those of the whole. */
static void long_lists_go_value_by_value(void **state)
{
    char a[TEST_PATH], b[TEST_PATH];
    folder_path(state, "a.json", a);
    folder_path(state, "b.json", b);
    for (size_t n = 0; n < 3; n++) {
        size_t none = 9, seen = 0;
        json_t *head = json_pack("{s:s}", "format", "apsm-x"), *all = json_array();
        json_t *value = NULL, *back;
        for (size_t i = 0; i < n; i++) {
            assert_int_equal(give_value(ctx, i, &none, &value), APSM_OK);
            json_array_append_new(all, value);
        }
        const apsm_json_list list = { "list", n, give_value, &none };
        assert_int_equal(apsm_json_write_list(ctx, a, head, &list), APSM_OK);
        assert_int_equal(apsm_json_read_list(ctx, a, "list", &back, take_value, &seen), APSM_OK);
        assert_true(seen == n && json_equal(back, head));
        json_object_set_new(head, "list", all);
        assert_int_equal(apsm_json_write(ctx, b, head), APSM_OK);
        char *x, *y;
        size_t nx, ny;
        assert_int_equal(apsm_read_file(ctx, a, 10000, &x, &nx), APSM_OK);
        assert_int_equal(apsm_read_file(ctx, b, 10000, &y, &ny), APSM_OK);
        assert_string_equal(x, y);
        free(x);
        free(y);
        json_decref(head);
        json_decref(back);
    }
}

static void broken_lists_leave_nothing(void **state)
{
    char a[TEST_PATH];
    json_t *head = json_object(), *back;
    size_t bad = 2, seen = 0;
    folder_path(state, "a.json", a);
    const apsm_json_list list = { "list", 7, give_value, &bad };
    assert_int_equal(apsm_json_write_list(ctx, a, head, &list), APSM_ERR_STATE);
    bad = 9;
    assert_int_equal(apsm_json_write_list(ctx, a, head, &list), APSM_ERR_NONFINITE);
    assert_int_equal(folder_count(*state), 0);
    const apsm_json_list five = { "list", 5, give_value, &bad };
    assert_int_equal(apsm_json_write_list(ctx, a, head, &five), APSM_OK);
    assert_int_equal(apsm_json_read_list(ctx, a, "list", &back, take_value, &seen), APSM_ERR_STATE);
    assert_true(seen == 4 && !back);
    assert_int_equal(apsm_json_read_list(ctx, a, "other", &back, take_value, &seen),
                     APSM_ERR_FORMAT);
    static const char *const damage[] = { "{\n    \"list\": [",
                                          "{\n    \"list\": [{} {}]}",
                                          "{\n    \"list\": [{}, ]}",
                                          "{\n    \"list\": [{},",
                                          "{\"list\": []}",
                                          "{\n    x\n    \"list\": []}",
                                          "" };
    for (size_t k = 0; k < sizeof damage / sizeof *damage; k++) {
        seen = 0;
        folder_put(state, "a.json", damage[k], strlen(damage[k]));
        assert_int_equal(apsm_json_read_list(ctx, a, "list", &back, skip_value, NULL),
                         APSM_ERR_FORMAT);
        assert_null(back);
    }
    json_decref(head);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(layout_is_indented_with_rows_on_a_line),
        TEST(what_is_not_finite_is_refused),
        TEST(damage_is_told_with_line_and_column),
        TEST(a_byte_order_mark_is_harmless),
        TEST(long_lists_go_value_by_value),
        TEST(broken_lists_leave_nothing),
        TEST(a_seal_breaks_with_any_byte),
        cmocka_unit_test(formats_and_versions_are_checked),
        cmocka_unit_test(matrices_of_another_shape_are_refused),
    };
    ctx = apsm_context_new();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
