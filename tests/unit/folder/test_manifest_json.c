#include "cmocka_all.h"
#include "files/files.h"
#include "folder.h"
#include "folder/manifest_json.h"

static json_t *with_an_input(void)
{
    static const char *const names[] = { "a" }, *const paths[] = { "/nowhere" };
    char sha256[1][65] = { "0123" };
    json_t *root = manifest_json_new();
    assert_non_null(root);
    assert_int_equal(
        json_object_set_new(root, "inputs", manifest_json_inputs(1, names, paths, sha256)), 0);
    return root;
}

static void a_seal_tells_a_change(void **state)
{
    char path[TEST_PATH];
    bool is_intact = false;
    json_t *root = with_an_input();
    folder_path(state, "manifest.json", path);
    assert_int_equal(manifest_json_write(NULL, path, root, true), APSM_OK);
    json_decref(root);
    assert_int_equal(manifest_json_read(NULL, path, &root, &is_intact), APSM_OK);
    assert_true(is_intact);
    assert_string_equal(manifest_json_sha256(root, "a"), "0123");
    assert_null(manifest_json_sha256(root, "b"));
    json_object_set_new(json_object_get(root, "options"), "seed", json_string("2"));
    assert_int_equal(apsm_json_write(NULL, path, root), APSM_OK); /* somebody else */
    json_decref(root);
    assert_int_equal(manifest_json_read(NULL, path, &root, &is_intact), APSM_OK);
    assert_false(is_intact);
    assert_int_equal(manifest_json_write(NULL, path, root, is_intact), APSM_OK);
    json_decref(root);
    assert_int_equal(manifest_json_read(NULL, path, &root, &is_intact), APSM_OK);
    assert_null(json_object_get(root, "sha256")); /* not vouched for */
    json_decref(root);
}

static void what_lacks_a_part_is_refused(void **state)
{
    char path[TEST_PATH];
    bool is_intact;
    json_t *root = with_an_input();
    folder_path(state, "lacking.json", path);
    json_object_del(root, "stages");
    assert_int_equal(manifest_json_write(NULL, path, root, true), APSM_OK);
    json_decref(root);
    assert_int_equal(manifest_json_read(NULL, path, &root, &is_intact), APSM_ERR_FORMAT);
    assert_null(root);
}

static void stages_begin_and_end_in_their_order(void **state)
{
    (void)state;
    json_t *root = manifest_json_new();
    assert_int_equal(manifest_json_set_begun(root, "optimize", true), 0);
    assert_int_equal(manifest_json_set_begun(root, "groom", true), 0);
    json_t *expected = json_pack("[s, s]", "groom", "optimize");
    assert_true(json_equal(json_object_get(root, "begun"), expected));
    json_decref(expected);
    assert_int_equal(manifest_json_set_begun(root, "groom", false), 0);
    assert_int_equal(manifest_json_set_begun(root, "optimize", false), 0);
    assert_null(json_object_get(root, "begun"));
    json_decref(root);
}

static void a_unit_is_said_or_of_images(void **state)
{
    (void)state;
    json_t *root = manifest_json_new();
    assert_null(manifest_unit(root));
    json_object_set_new(root, "groomed", json_pack("[{s:s}]", "kind", "mask"));
    assert_string_equal(manifest_unit(root), "mm");
    json_object_set_new(json_object_get(root, "options"), "unit", json_string("cm"));
    assert_string_equal(manifest_unit(root), "cm");
    assert_false(manifest_json_is_joint(root));
    json_decref(root);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_seal_tells_a_change, folder_set_up, folder_tear_down),
        cmocka_unit_test_setup_teardown(what_lacks_a_part_is_refused, folder_set_up,
                                        folder_tear_down),
        cmocka_unit_test(stages_begin_and_end_in_their_order),
        cmocka_unit_test(a_unit_is_said_or_of_images)
    };
    return cmocka_run_group_tests_name("manifest_json", tests, NULL, NULL);
}
