/* features.csv: what is written comes back, in the order that is asked for; damage is told with its
 * line. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmocka_all.h"
#include "folder/features_csv.h"
#include "scratch.h"

enum { SHAPES = 3, PARTICLES = 4, FIELDS = 2 };
static apsm_context *ctx;
static char folder[SCRATCH_LENGTH];
static const char *const names[SHAPES] = { "a, \"b\"", "plain", "c" };

static void comes_back_in_another_order(void **state)
{
    (void)state;
    char *field[FIELDS] = { "thick, mm", "ct" };
    double value[SHAPES * PARTICLES * FIELDS];
    for (size_t k = 0; k < SHAPES * PARTICLES * FIELDS; k++) value[k] = 0.1 * (double)k - 1;
    const sampled_fields out = { SHAPES, PARTICLES, FIELDS, field, value };
    assert_int_equal(features_csv_write(ctx, scratch_path(folder, "f.csv"), names, &out), APSM_OK);
    const char *const two[] = { names[2], names[0] };
    sampled_fields in;
    assert_int_equal(features_csv_read(ctx, scratch_path(folder, "f.csv"), 2, two, PARTICLES, &in),
                     APSM_OK);
    assert_int_equal(in.S, FIELDS);
    for (size_t s = 0; s < FIELDS; s++) assert_string_equal(in.name[s], field[s]);
    assert_memory_equal(in.value, value + 2 * PARTICLES * FIELDS,
                        PARTICLES * FIELDS * sizeof *value);
    assert_memory_equal(in.value + PARTICLES * FIELDS, value, PARTICLES * FIELDS * sizeof *value);
    sampled_fields_free(&in);
}

static void refuse(const char *text, const char *words)
{
    static const char *const one[] = { "a" };
    sampled_fields f;
    FILE *file = fopen(scratch_path(folder, "bad.csv"), "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    assert_int_equal(features_csv_read(ctx, scratch_path(folder, "bad.csv"), 1, one, 2, &f),
                     APSM_ERR_FORMAT);
    assert_non_null(strstr(apsm_error_text(ctx), words));
    assert_null(f.name);
    assert_null(f.value);
}

static void damage_is_told(void **state)
{
    (void)state;
    refuse("", "empty");
    refuse("name,particle\na,0\n", "line 1: the head");
    refuse("shape,particle,x\na,0,1\n", "line 1: the head");
    refuse("name,particle,x\na,0,1\n", "ends before every particle");
    refuse("name,particle,x\na,0,1\na,1\n", "line 3: has another number of fields");
    refuse("name,particle,x\na,0,1\na,1,2,3\n", "line 3: has another number of fields");
    refuse("name,particle,x\na,0,1\na,2,1\n", "line 3: has a particle that the model has not");
    refuse("name,particle,x\na,0,1\na,-1,1\n", "line 3: has no number of a particle");
    refuse("name,particle,x\na,0.5,1\n", "line 2: has no number of a particle");
    refuse("name,particle,x\na,0,one\n", "line 2: has no number in a field");
    refuse("name,particle,x\n\"a\n", "line 2: has another number of fields");
}

static int enter(void **state)
{
    (void)state;
    scratch_make(folder);
    return 0;
}

static int leave(void **state)
{
    (void)state;
    scratch_remove(folder);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(comes_back_in_another_order),
                                        cmocka_unit_test(damage_is_told) };
    ctx = apsm_context_new();
    if (!ctx) return 1;
    const int failed = cmocka_run_group_tests(tests, enter, leave);
    apsm_context_free(ctx);
    return failed;
}
