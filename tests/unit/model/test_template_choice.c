/* The template is the shape whose mesh suits the others: not one with bumps of its own, however
 * typical its pose, and nothing about it depends on threads. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "geometry/affine.h"
#include "model/template_choice.h"
#include "synthetic.h"

enum { I = 7, TYPICAL = 3 };

typedef struct cohort {
    apsm_mesh mesh[I];
    const apsm_mesh *meshes[I];
    double M[16 * I], residual[I];
} cohort;

/* Ellipsoids that are the same up to a few per cent; those whose flag is set get ten bumps. */
static void make(const bool *bumpy, cohort *c)
{
    for (size_t i = 0; i < I; i++) {
        c->mesh[i] = synthetic_shape(SYNTHETIC_ELLIPSOID, i, I, 4);
        for (size_t v = 0; v < c->mesh[i].nv; v++) {
            double *x = c->mesh[i].V + 3 * v;
            const double r = 1 + 0.05 * sin(0.4 * x[0] + 1) * sin(0.4 * x[1]) * cos(0.4 * x[2]);
            for (size_t k = 0; bumpy[i] && k < 3; k++) x[k] *= r;
            x[0] += 0.004 * x[1] * x[1] + 0.05 * x[2]; /* no symmetry, no ties */
            x[2] += 0.002 * x[0] * x[0];
        }
        c->meshes[i] = &c->mesh[i];
        c->residual[i] = i == TYPICAL ? 0 : 1 + fabs((double)i - TYPICAL);
        apsm_affine_identity(c->M + 16 * i);
    }
}

static void clear(cohort *c)
{
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&c->mesh[i]);
}

static size_t choose(const cohort *c, size_t n, int threads, const bool *skip)
{
    apsm_context *ctx = apsm_context_new();
    size_t chosen = SIZE_MAX;
    apsm_context_set_threads(ctx, threads);
    assert_int_equal(
        apsm_choose_template(ctx, n, c->meshes, c->M, c->residual, skip, TYPICAL, &chosen), 0);
    apsm_context_free(ctx);
    return chosen;
}

static void test_the_smooth_one_wins(void **state)
{
    (void)state;
    bool bumpy[I], skip[I] = { false };
    cohort c;
    for (size_t i = 0; i < I; i++) bumpy[i] = i != 5;
    make(bumpy, &c);
    assert_int_equal(choose(&c, I, 1, NULL), 5);
    assert_int_equal(choose(&c, I, 3, NULL), 5);
    skip[5] = true;
    assert_int_not_equal(choose(&c, I, 1, skip), 5);
    clear(&c);
}

/* Where nothing else may be it, and where there is too little to judge by. */
static void test_the_typical_one_stays(void **state)
{
    (void)state;
    bool bumpy[I] = { false }, skip[I];
    cohort c;
    for (size_t i = 0; i < I; i++) skip[i] = i != TYPICAL;
    bumpy[TYPICAL] = true;
    make(bumpy, &c);
    assert_int_not_equal(choose(&c, I, 2, NULL), TYPICAL);
    assert_int_equal(choose(&c, I, 2, skip), TYPICAL);
    apsm_context *ctx = apsm_context_new();
    size_t chosen;
    assert_int_equal(
        apsm_choose_template(ctx, 3, c.meshes + TYPICAL, c.M, c.residual, NULL, 0, &chosen),
        APSM_OK);
    assert_int_equal(chosen, 0);
    apsm_context_free(ctx);
    clear(&c);
}

/* A cohort in another place and unit makes the same choice. */
static void test_place_and_unit(void **state)
{
    (void)state;
    bool bumpy[I];
    cohort c;
    for (size_t i = 0; i < I; i++) bumpy[i] = i != 5; /* no near ties: rounding may settle those */
    make(bumpy, &c);
    const size_t chosen = choose(&c, I, 2, NULL);
    assert_int_equal(chosen, 5);
    for (size_t i = 0; i < I; i++) /* from micrometres far off to where they were, in metres */
        for (size_t v = 0; v < c.mesh[i].nv; v++)
            for (size_t k = 0; k < 3; k++)
                c.mesh[i].V[3 * v + k] = 1000 * (c.mesh[i].V[3 * v + k] + 100.0 * (double)(i + k));
    for (size_t i = 0; i < I; i++)
        for (size_t k = 0; k < 3; k++) {
            c.M[16 * i + 5 * k] = 1e-6;
            c.M[16 * i + 4 * k + 3] = -0.1 * (double)(i + k);
        }
    assert_int_equal(choose(&c, I, 2, NULL), chosen);
    clear(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_smooth_one_wins),
        cmocka_unit_test(test_the_typical_one_stays),
        cmocka_unit_test(test_place_and_unit),
    };
    return cmocka_run_group_tests_name("template choice", tests, NULL, NULL);
}
