/* Which shapes of a large cohort a page shows. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>
#include <jansson.h>

#include "report/selection.h"

enum { SHAPES = 90, J = 2, MOST = 16, TEMPLATE = 41, OTHER = 60, FAR = 77 };

static bool is_doubtful(size_t i, size_t every)
{
    return i % every == every - 1;
}

/* Every `every`-th shape needs review, one lies far from its surface; particles tell the shape. */
static model_folder cohort(size_t every)
{
    model_folder m = { .I = SHAPES, .J = J, .template_index = TEMPLATE };
    json_t *verdicts = json_array(), *distances = json_array();
    assert_int_equal(apsm_project_init(NULL, ".", &m.project), APSM_OK);
    m.names = calloc(SHAPES, sizeof *m.names);
    m.P = calloc(SHAPES * 3 * J, sizeof *m.P);
    m.parts = 2;
    m.part = calloc(m.parts, sizeof *m.part);
    assert_true(m.names && m.P && m.part);
    m.part[0].template_index = TEMPLATE;
    m.part[1].template_index = OTHER;
    for (size_t i = 0; i < SHAPES; i++) {
        char name[16];
        apsm_subject *s;
        snprintf(name, sizeof name, "s%02zu", i);
        assert_int_equal(apsm_project_add(&m.project, name, NULL, &s), APSM_OK);
        json_array_append_new(verdicts, json_pack("{s:s, s:s}", "name", name, "verdict",
                                                  is_doubtful(i, every) ? "review" : "certified"));
        json_array_append_new(distances, json_pack("{s:s, s:f}", "name", name, "mean",
                                                   i == FAR ? 3.0 : 1.0 / (double)(i + 1)));
        for (size_t k = 0; k < 3 * J; k++) m.P[3 * J * i + k] = (double)i;
    }
    for (size_t i = 0; i < SHAPES; i++) m.names[i] = m.project.subjects[i].name;
    m.certificate = json_pack("{s:o}", "per_shape", verdicts);
    m.evaluation = json_pack("{s:{s:o}}", "surface_distance", "per_shape", distances);
    return m;
}

static bool has(const model_folder *m, size_t i)
{
    for (size_t k = 0; k < m->I; k++)
        if (m->P[3 * J * k] == (double)i) return true;
    return false;
}

static void check_order(const model_folder *m)
{
    for (size_t k = 0; k < m->I; k++) {
        char name[16];
        snprintf(name, sizeof name, "s%02d", (int)m->P[3 * J * k]);
        assert_string_equal(m->names[k], name);
        assert_string_equal(m->project.subjects[k].name, name);
        if (k > 0) assert_true(m->P[3 * J * k] > m->P[3 * J * (k - 1)]);
    }
    assert_string_equal(m->names[m->template_index], "s41");
    assert_string_equal(m->names[m->part[0].template_index], "s41");
    assert_string_equal(m->names[m->part[1].template_index], "s60");
    assert_int_equal(m->project.n, m->I);
}

static void outliers_and_the_template_are_shown(void **state)
{
    (void)state;
    size_t all;
    model_folder m = cohort(12);
    assert_int_equal(selection_make(MOST, &m, &all), APSM_OK);
    assert_int_equal(all, SHAPES);
    assert_int_equal(m.I, MOST);
    check_order(&m);
    assert_true(has(&m, FAR));
    for (size_t i = 0; i < SHAPES; i++)
        if (is_doubtful(i, 12)) assert_true(has(&m, i));
    assert_int_equal(json_array_size(json_object_get(m.certificate, "per_shape")), SHAPES);
    model_folder_free(&m);
}

/* Half of them need review: there is room for usual ones all the same. */
static void many_outliers_leave_room(void **state)
{
    (void)state;
    size_t all, usual = 0;
    model_folder m = cohort(2);
    assert_int_equal(selection_make(MOST, &m, &all), APSM_OK);
    assert_int_equal(m.I, MOST);
    check_order(&m);
    for (size_t i = 0; i < SHAPES; i++) usual += has(&m, i) && !is_doubtful(i, 2);
    assert_true(usual >= 2);
    model_folder_free(&m);
}

static void small_cohorts_are_shown_whole(void **state)
{
    (void)state;
    size_t all;
    model_folder m = cohort(5);
    assert_int_equal(selection_make(SHAPES, &m, &all), APSM_OK);
    assert_int_equal(m.I, SHAPES);
    assert_int_equal(all, SHAPES);
    check_order(&m);
    model_folder_free(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outliers_and_the_template_are_shown),
        cmocka_unit_test(many_outliers_leave_room),
        cmocka_unit_test(small_cohorts_are_shown_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
