/* Structs of programs that were built with other versions of the headers. */
#include "cmocka_all.h"

#include "apsm/context.h"
#include "core/sized.h"

typedef struct known {
    int a, b;
} known;
typedef struct newer {
    int a, b, c;
} newer;

static void what_is_not_there_is_zero(void **state)
{
    (void)state;
    const int older = 7;
    known k = { 0 };
    assert_true(apsm_take_sized(&older, sizeof older, &k, sizeof k));
    assert_int_equal(k.a, 7);
    assert_int_equal(k.b, 0);
}

static void what_we_do_not_know_must_be_zero(void **state)
{
    (void)state;
    newer n = { 1, 2, 0 };
    known k = { 0 };
    assert_true(apsm_take_sized(&n, sizeof n, &k, sizeof k));
    assert_int_equal(k.b, 2);
    n.c = 3;
    apsm_context *ctx = apsm_context_new();
    assert_int_equal(apsm_take_settings(ctx, "door", &n, sizeof n, &k, sizeof k), APSM_ERR_ARG);
    assert_string_equal(apsm_error_text(ctx),
                        "door: no settings, or some that this version does not know");
    assert_int_equal(apsm_take_settings(ctx, "door", NULL, sizeof n, &k, sizeof k), APSM_ERR_ARG);
    apsm_context_free(ctx);
}

/* Nothing is written beyond what the program has room for. */
static void what_is_given_keeps_to_its_room(void **state)
{
    (void)state;
    const known k = { 1, 2 };
    int older[2] = { 0, 9 };
    newer n = { 5, 6, 7 };
    apsm_give_sized(&k, sizeof k, older, sizeof *older);
    assert_int_equal(older[0], 1);
    assert_int_equal(older[1], 9);
    apsm_give_sized(&k, sizeof k, &n, sizeof n);
    assert_int_equal(n.b, 2);
    assert_int_equal(n.c, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_not_there_is_zero),
        cmocka_unit_test(what_we_do_not_know_must_be_zero),
        cmocka_unit_test(what_is_given_keeps_to_its_room),
    };
    return cmocka_run_group_tests_name("sized", tests, NULL, NULL);
}
