/* Files of landmarks, and the landmarks of a cohort. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmocka_all.h"
#include "landmarks/landmark_table.h"
#include "scratch.h"

static apsm_context *ctx;

static void put(const char *name, const char *text)
{
    FILE *f = fopen(name, "w");
    assert_non_null(f);
    fputs(text, f);
    fclose(f);
}

static void expect(const char *name, const char *text, size_t n, const char *label, double x)
{
    landmark_list l;
    put(name, text);
    assert_int_equal(landmark_list_read(ctx, name, &l), APSM_OK);
    assert_int_equal(l.n, n);
    assert_string_equal(l.name[n - 1], label);
    assert_true(l.x[3 * (n - 1)] == x);
    landmark_list_free(&l);
}

static void refuse(const char *name, const char *text, const char *words)
{
    landmark_list l;
    put(name, text);
    assert_int_not_equal(landmark_list_read(ctx, name, &l), APSM_OK);
    assert_non_null(strstr(apsm_error_text(ctx), words));
    assert_int_equal(l.n, 0);
}

static void files_of_all_kinds(void **state)
{
    (void)state;
    expect("a.csv", "name,x,y,z\na,1,2,3\n\"b, \"\"the\"\" 2nd\" , 4 ,5,6\r\n", 2, "b, \"the\" 2nd",
           4);
    expect("a.fcsv", "# CoordinateSystem = 0\n1,7,8,9,0,0,0,1,1,1,0,tip,,\n", 1, "tip", -7);
    expect("b.fcsv", "# CoordinateSystem = LPS\n1,7,8,9,0,0,0,1,1,1,0,tip,,\n", 1, "tip", 7);
    expect("c.csv", "label,r,a,s,defined,selected\na,1,2,3,1,1\nb,4,5,6,0,1\n", 1, "a", -1);
    expect("c.csv", "Name,X (mm),Y (mm),Z (mm)\na,1,2,3\n", 1, "a", 1);
    expect("c.csv", "name,L,P,S\na,1,2,3\n", 1, "a", 1);
    expect("c.csv", "\"name\",\"x\",\"y\",\"z\"\r\n\"a\",1,2,3\r\n", 1, "a", 1);
    expect("c.csv", "\"label\",\"r\",\"a\",\"s\",\"defined\"\na,1,2,3,1\nb,4,5,6,0\n", 1, "a", -1);
    expect("c.csv", " name ,x,y,z\na,1,2,3\n", 1, "a", 1);
    expect("c.csv", "# CoordinateSystem: RAS\nname,x,y,z\na,1,2,3\n", 1, "a", -1);
    expect("c.csv", "# CoordinateSystem: RAS\nname,l,p,s\na,1,2,3\n", 1, "a", 1);
    expect("c.csv", "names,1,2,3\n", 1, "names", 1);
    refuse("c.csv", "\"name\",\"z\",\"y\",\"x\"\na,1,2,3\n", "columns are not name,x,y,z");
    refuse("c.csv", "name,z,y,x\na,1,2,3\n", "columns are not name,x,y,z");
    refuse("c.csv", "name;x;y;z\na;1,5;2;3\n", "commas between");
    expect("b.fcsv", "# CoordinateSystem: LPS\n1,7,8,9,0,0,0,1,1,1,0,tip,,\n", 1, "tip", 7);
    expect("b.fcsv", "# CoordinateSystem LPS\n1,7,8,9,0,0,0,1,1,1,0,tip,,\n", 1, "tip", 7);
    expect("b.fcsv", "# the CoordinateSystem is Slicer's\n1,7,8,9,0,0,0,1,1,1,0,tip,,\n", 1, "tip",
           -7);
    refuse("b.fcsv", "# CoordinateSystem: IJK\n1,7,8,9,0,0,0,1,1,1,0,tip,,\n", "neither LPS");
    refuse("b.fcsv", "# CoordinateSystem = IJK\n1,7,8,9,0,0,0,1,1,1,0,tip,,\n", "neither LPS");
    refuse("c.csv", "name,x,y,z\na,1,2\n", "c.csv:2");
    refuse("c.csv", "name,x,y,z\na,1,2,3\na,1,2,4\n", "two points are called 'a'");
    refuse("c.csv", "name,x,y,z\na,1,2,nan\n", "is no number");
    refuse("c.csv", "name,x,y,z\n", "holds no points");
}

static void markups_come_back(void **state)
{
    (void)state;
    landmark_list l = { 0 }, back;
    const double x[2][3] = { { 1.5, -2, 1e-9 }, { 0.1, 0.2, 1.0 / 3 } };
    assert_int_equal(landmark_list_add(ctx, "m", "é \"q\"", x[0], &l), APSM_OK);
    assert_int_equal(landmark_list_add(ctx, "m", "2", x[1], &l), APSM_OK);
    assert_int_equal(landmark_list_write(ctx, "m.mrk.json", &l), APSM_OK);
    assert_int_equal(landmark_list_read(ctx, "m.mrk.json", &back), APSM_OK);
    assert_int_equal(back.n, 2);
    assert_memory_equal(back.x, x, sizeof x);
    assert_string_equal(back.name[0], l.name[0]);
    landmark_list_free(&l);
    landmark_list_free(&back);
}

#define POINT(label, more) "{\"label\": \"" label "\", \"position\": [1, 2, 3]" more "}"
#define LIST(system, points)                                                                       \
    "{\"coordinateSystem\": \"" system "\", \"controlPoints\": [" points "]}"

/* Each with its frame; points that wait to be placed are none. */
static void all_lists_of_markups_are_read(void **state)
{
    (void)state;
    expect("l.mrk.json",
           "{\"markups\": [" LIST("LPS", POINT("a", "")) "," LIST(
               "RAS", POINT("b", "") "," POINT("c", ", \"positionStatus\": \"undefined\"")) "]}",
           2, "b", -1);
    refuse("l.mrk.json", "{\"markups\": [" LIST("IJK", POINT("a", "")) "]}", "neither LPS");
}

static void points_without_names(void **state)
{
    (void)state;
    const char *const names[] = { "tip" };
    landmark_list l;
    put("p.txt", "1 2 3\n\n 4,5,6 \n");
    assert_int_equal(landmark_list_read_plain(ctx, "p.txt", 1, names, &l), APSM_OK);
    assert_int_equal(l.n, 2);
    assert_string_equal(l.name[0], "tip");
    assert_string_equal(l.name[1], "2");
    assert_true(l.x[5] == 6);
    landmark_list_free(&l);
    put("p.txt", "1 2 3 4\n");
    assert_int_equal(landmark_list_read_plain(ctx, "p.txt", 0, NULL, &l), APSM_ERR_FORMAT);
}

static void a_cohort_with_gaps(void **state)
{
    (void)state;
    const char *const names[] = { "s0", "s, 1" };
    landmark_table t, back;
    size_t others;
    put("t.csv", "shape,name,x,y,z\ns0,a,1,2,3\n\"s, 1\",b,4,5,6\nelse,a,0,0,0\ns0,b,7,8,9\n");
    assert_int_equal(landmark_table_read(ctx, "t.csv", 2, names, &t, &others), APSM_OK);
    assert_int_equal(t.L, 2);
    assert_int_equal(others, 1);
    assert_true(landmark_is_there(&t, 0, 0) && landmark_is_there(&t, 0, 1));
    assert_true(!landmark_is_there(&t, 1, 0) && landmark_at(&t, 1, 1)[2] == 6);
    assert_int_equal(landmark_table_write(ctx, "u.csv", names, &t), APSM_OK);
    assert_int_equal(landmark_table_gather(ctx, "u.csv", 2, names, &back), APSM_OK);
    assert_memory_equal(back.has, t.has, 4);
    assert_memory_equal(back.x, t.x, 12 * sizeof *t.x);
    landmark_table_free(&t);
    landmark_table_free(&back);
    put("t.csv", "\"shape\",\"name\",\"x\",\"y\",\"z\"\n\"s0\",\"a\",1,2,3\n");
    assert_int_equal(landmark_table_read(ctx, "t.csv", 2, names, &t, NULL), APSM_OK);
    assert_true(landmark_at(&t, 0, 0)[2] == 3);
    landmark_table_free(&t);
    put("t.csv", "shape,name,x,y,zz\ns0,a,1,2,3\n");
    assert_int_equal(landmark_table_read(ctx, "t.csv", 2, names, &t, NULL), APSM_ERR_FORMAT);
    put("t.csv", "shape,name,x,y,z\ns0,a,1,2,3\ns0,a,4,5,6\n");
    assert_int_equal(landmark_table_read(ctx, "t.csv", 2, names, &t, NULL), APSM_ERR_FORMAT);
    assert_non_null(strstr(apsm_error_text(ctx), "t.csv:3"));
}

static char folder[SCRATCH_LENGTH];

static int enter(void **state)
{
    (void)state;
    scratch_make(folder);
    return chdir(folder);
}

static int leave(void **state)
{
    (void)state;
    scratch_remove(folder);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(files_of_all_kinds),
                                        cmocka_unit_test(markups_come_back),
                                        cmocka_unit_test(points_without_names),
                                        cmocka_unit_test(all_lists_of_markups_are_read),
                                        cmocka_unit_test(a_cohort_with_gaps) };
    ctx = apsm_context_new();
    if (!ctx) return 1;
    const int failed = cmocka_run_group_tests(tests, enter, leave);
    apsm_context_free(ctx);
    return failed;
}
