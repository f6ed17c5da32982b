/* Choosing the template's particles by the warp's error, and searching their number. */
#include <math.h>
#include <string.h>

#include "cmocka_all.h"
#include "optimize/particle_search.h"
#include "optimize/reseat.h"
#include "optimize/snap.h"
#include "synthetic.h"

enum { I = 8, J = 40, LEVEL = 4 };

typedef struct scene {
    apsm_context *ctx;
    apsm_cohort cohort;
    double P[I * J * 3];
} scene;

/* Point j of J that spread over the unit sphere by the golden angle. */
static void spread_point(size_t j, double u[3])
{
    const double z = 1 - (2 * (double)j + 1) / J, r = sqrt(1 - z * z), a = 2.39996323 * (double)j;
    u[0] = r * cos(a);
    u[1] = r * sin(a);
    u[2] = z;
}

/* Balls; all but the template (the middle one) are rippled around +z, finer than J particles see.
 */
static void rippled_ball(size_t i, const double u[3], double x[3])
{
    const bool ripples = i != I / 2 && u[2] > 0.4;
    const double r = 30 + (ripples ? 1.5 * sin(15 * u[0] + (double)i) * sin(15 * u[1]) : 0);
    for (size_t c = 0; c < 3; c++) x[c] = r * u[c];
}

/* Balls, or shapes with a bump, with particles that are true images of the template's. */
static void make_scene(scene *s, bool balls)
{
    apsm_mesh mesh[I];
    double M[16 * I] = { 0 };
    const char *const names[I] = { "a", "b", "c", "d", "e", "f", "g", "h" };
    s->ctx = apsm_context_new();
    assert_non_null(s->ctx);
    for (size_t i = 0; i < I; i++) {
        mesh[i] = balls ? shape_icosphere(LEVEL) : synthetic_shape(SYNTHETIC_BUMP, i, I, LEVEL);
        for (size_t c = 0; c < 4; c++) M[16 * i + 5 * c] = 1;
        for (size_t v = 0; balls && v < mesh[i].nv; v++) {
            double *x = mesh[i].V + 3 * v, u[3] = { x[0], x[1], x[2] };
            rippled_ball(i, u, x);
        }
        for (size_t j = 0; j < J; j++) {
            double u[3], *x = s->P + (i * J + j) * 3;
            spread_point(j, u);
            if (balls)
                rippled_ball(i, u, x);
            else
                synthetic_map(SYNTHETIC_BUMP, i, I, u, x);
        }
    }
    const apsm_cohort_input in = { I, names, mesh, M, I / 2 };
    assert_int_equal(apsm_cohort_build(s->ctx, &in, 0, 0, &s->cohort), APSM_OK);
    for (size_t i = 0; i < I; i++) {
        apsm_snap_closest(s->cohort.shape[i].bvh, J, s->P + i * J * 3, NULL, NULL);
        apsm_mesh_free(&mesh[i]);
    }
}

static void free_scene(scene *s)
{
    apsm_cohort_free(&s->cohort);
    apsm_context_free(s->ctx);
}

static double truth_error(const scene *s, size_t n, const double *P)
{
    const size_t t = s->cohort.template_index;
    double sum = 0;
    for (size_t i = 0; i < I; i++)
        sum += synthetic_truth_error(s->cohort.shape[i].bvh, &s->cohort.shape[t].mesh, n,
                                     P + i * n * 3, P + t * n * 3) /
               I;
    return sum;
}

/* Particles of the template in the cap with ripples: 3 of 10 if they are evenly spread. */
static size_t in_cap(size_t n, const double *T)
{
    size_t count = 0;
    for (size_t j = 0; j < n; j++) count += T[3 * j + 2] > 12;
    return count;
}

/* The warp errs where ripples are: particles gather there, more are added there, all stay on
 * their surfaces, and their correspondence is no worse. */
static void test_gathers_where_the_warp_errs(void **state)
{
    (void)state;
    enum { MORE = 60 };
    scene s;
    static double Q[I * MORE * 3], R[I * MORE * 3], even[I * MORE * 3];
    make_scene(&s, true);
    const size_t t = s.cohort.template_index;
    assert_int_equal(apsm_reseat(s.ctx, &s.cohort, J, s.P, NULL, 1, J, Q), APSM_OK);
    assert_int_equal(apsm_reseat(s.ctx, &s.cohort, J, s.P, NULL, 0, J, even), APSM_OK);
    const size_t gathered = in_cap(J, Q + t * J * 3), spread = in_cap(J, even + t * J * 3);
    print_message("in the cap: %zu even, %zu gathered; truth error %.3g\n", spread, gathered,
                  truth_error(&s, J, Q));
    assert_true(spread >= 11 && spread <= 13);
    assert_true(gathered >= 18);
    assert_true(truth_error(&s, J, Q) < 0.5);
    apsm_context_set_threads(s.ctx, 3);
    assert_int_equal(apsm_reseat(s.ctx, &s.cohort, J, s.P, NULL, 1, MORE, R), APSM_OK);
    apsm_context_set_threads(s.ctx, 1);
    assert_int_equal(apsm_reseat(s.ctx, &s.cohort, J, s.P, NULL, 1, MORE, Q), APSM_OK);
    assert_memory_equal(Q, R, sizeof Q);
    for (size_t k = 0; k < I * MORE; k++) {
        apsm_closest c;
        apsm_bvh_closest(s.cohort.shape[k / MORE].bvh, Q + 3 * k, INFINITY, &c);
        assert_true(c.distance2 < 1e-20);
    }
    assert_true(truth_error(&s, MORE, Q) < 0.5);
    assert_true(in_cap(MORE, Q + t * MORE * 3) >= 27);
    for (size_t a = 0; a < MORE; a++) /* no two at one place */
        for (size_t b = 0; b < a; b++)
            assert_true(hypot(hypot(Q[3 * a] - Q[3 * b], Q[3 * a + 1] - Q[3 * b + 1]),
                              Q[3 * a + 2] - Q[3 * b + 2]) > 2);
    assert_int_equal(apsm_reseat(s.ctx, &s.cohort, J, s.P, NULL, 1, J - 1, Q), APSM_ERR_ARG);
    free_scene(&s);
}

/* Shapes that are to judge have no say. */
static void test_judges_have_no_say(void **state)
{
    (void)state;
    scene s;
    static double Q[I * J * 3], R[I * J * 3];
    bool judged[I] = { [1] = true };
    make_scene(&s, false);
    const size_t t = s.cohort.template_index;
    assert_int_equal(apsm_reseat(s.ctx, &s.cohort, J, s.P, judged, 1, J, Q), APSM_OK);
    for (size_t j = 0; j < J; j++) /* another shape 1, or none of its particles right */
        memcpy(s.P + (J + j) * 3, s.P + (J + (j * 7) % J) * 3, 3 * sizeof *s.P);
    assert_int_equal(apsm_reseat(s.ctx, &s.cohort, J, s.P, judged, 1, J, R), APSM_OK);
    assert_memory_equal(Q + t * J * 3, R + t * J * 3, J * 3 * sizeof *Q);
    assert_int_equal(apsm_reseat(s.ctx, &s.cohort, J, s.P, NULL, 1, J, R), APSM_OK);
    assert_memory_not_equal(Q + t * J * 3, R + t * J * 3, J * 3 * sizeof *Q);
    free_scene(&s);
}

static void test_search(void **state)
{
    (void)state;
    scene s;
    apsm_optimize_options o = apsm_optimize_defaults();
    apsm_particle_search loose, tight, never;
    make_scene(&s, false);
    o.fidelity.fidelity_rounds = 2;
    o.search.error = 10;
    assert_int_equal(apsm_search_particles(s.ctx, &s.cohort, &o, J, s.P, &loose), APSM_OK);
    assert_true(loose.met && loose.J == J && loose.trials == 1 && loose.left_out == 2);
    assert_memory_equal(loose.P, s.P, sizeof s.P);
    o.search.error = 0.7 * loose.error;
    assert_int_equal(apsm_search_particles(s.ctx, &s.cohort, &o, J, s.P, &tight), APSM_OK);
    assert_true(tight.met && tight.J > J && tight.error <= o.search.error);
    print_message("%d particles: %.3g; %zu: %.3g\n", J, loose.error, tight.J, tight.error);
    o.search.error = 1e-9;
    assert_int_equal(apsm_search_particles(s.ctx, &s.cohort, &o, J, s.P, &never), APSM_OK);
    assert_true(!never.met && never.J > tight.J && never.error > o.search.error);
    free(loose.P);
    free(tight.P);
    free(never.P);
    s.cohort.I = 5;
    assert_int_equal(apsm_search_particles(s.ctx, &s.cohort, &o, J, s.P, &never), APSM_ERR_ARG);
    s.cohort.I = I;
    free_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_gathers_where_the_warp_errs),
        cmocka_unit_test(test_judges_have_no_say),
        cmocka_unit_test(test_search),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
