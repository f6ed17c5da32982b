#include <string.h>

#include "cmocka_all.h"
#include "folder/stages.h"

static void stages_stand_in_their_order(void **state)
{
    (void)state;
    assert_true(stage_is_before("groom", "evaluate"));
    assert_false(stage_is_before("evaluate", "groom"));
    assert_false(stage_is_before("groom", "groom"));
    assert_false(stage_is_before("nothing", "evaluate"));
    assert_string_equal(stage_name(3), "evaluate");
    assert_null(stage_name(4)); /* the report is not recorded as done */
    assert_string_equal(stage_of_all(4), "report");
    assert_null(stage_of_all(5));
}

static void a_stage_writes_its_files_alone(void **state)
{
    (void)state;
    assert_true(stage_writes("evaluate", "model.json"));
    assert_false(stage_writes("optimize", "model.json"));
    assert_true(stage_writes("initialize", "particles/a_local.particles"));
    assert_true(stage_writes("optimize", "particles/a_local.particles"));
    assert_false(stage_writes("optimize", "particles/deeper/a_local.particles"));
    assert_false(stage_writes("optimize", "particles/.particles"));
    assert_true(stages_write_between("groom", "optimize", "history.csv"));
    assert_false(stages_write_between("groom", "initialize", "history.csv"));
    assert_true(stages_write_between("groom", "groom", "manifest.json"));
}

static void other_peoples_files_are_not_ours(void **state)
{
    (void)state;
    assert_true(folder_is_ours("state/work.journal"));
    assert_false(folder_is_ours("notes.txt"));
    assert_false(folder_is_ours("model.json.bak"));
    assert_int_equal(folder_left_over("model.json.123.tmp"), strlen("model.json"));
    assert_int_equal(folder_left_over("model.json.tmp"), 0);
    assert_int_equal(folder_left_over("notes.txt.123.tmp"), 0);
    assert_int_equal(folder_left_over("state/shapes.abcdef"), strlen("state/shapes.abcdef"));
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(stages_stand_in_their_order),
                                        cmocka_unit_test(a_stage_writes_its_files_alone),
                                        cmocka_unit_test(other_peoples_files_are_not_ours) };
    return cmocka_run_group_tests_name("stages", tests, NULL, NULL);
}
