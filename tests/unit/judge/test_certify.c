/* The last lines of a run: every shape that needs review is named, reasons that many share once. */
#include "cmocka_all.h"

#include <stdio.h>
#include <string.h>

#include "judge/certify.h"

enum { I = 9 };

typedef struct lines {
    char text[I][300];
    size_t n;
} lines;

static void keep_line(void *user, apsm_log_level level, const char *text)
{
    lines *l = user;
    if (level == APSM_LOG_WARNING && strstr(text, "review") && l->n < I)
        snprintf(l->text[l->n++], sizeof l->text[0], "%s", text);
}

/* The first `mirrored` shapes look mirrored, the last one is a stranger. */
static lines told(size_t mirrored)
{
    static char name[I][4];
    apsm_shape shape[I] = { 0 };
    apsm_certificate of[I] = { 0 };
    unsigned doubts[I] = { 0 };
    lines l = { .n = 0 };
    apsm_context *ctx = apsm_context_new();
    assert_non_null(ctx);
    apsm_context_set_log(ctx, keep_line, &l);
    for (size_t i = 0; i < I; i++) {
        snprintf(name[i], sizeof name[i], "s%zu", i);
        shape[i].name = name[i];
        of[i].certified = true;
        of[i].J = 32;
        doubts[i] = i < mirrored ? 1u << APSM_DOUBT_MIRRORED : 0;
    }
    doubts[I - 1] = 1u << APSM_DOUBT_SIZE;
    const apsm_cohort cohort = { .I = I, .shape = shape };
    const cohort_certificate c = { .I = I, .shape = of, .doubts = doubts };
    certify_tell(ctx, &cohort, &c);
    apsm_context_free(ctx);
    return l;
}

static void few_are_told_singly(void **state)
{
    (void)state;
    const lines l = told(5);
    assert_int_equal(l.n, 6);
    assert_non_null(strstr(l.text[4], "s4 needs review: "));
    assert_non_null(strstr(l.text[5], "s8 needs review: "));
}

static void many_are_told_once(void **state)
{
    (void)state;
    const lines l = told(6);
    assert_int_equal(l.n, 2);
    assert_non_null(strstr(l.text[0], "6 shapes need review, s0 the first: "));
    assert_non_null(strstr(l.text[0], apsm_doubt_text(APSM_DOUBT_MIRRORED)));
    assert_non_null(strstr(l.text[1], "s8 needs review: "));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(few_are_told_singly),
        cmocka_unit_test(many_are_told_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
