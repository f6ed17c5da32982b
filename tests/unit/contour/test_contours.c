/* Curves whose correspondence is known: closed ones with a bump that slides, in any pose, order and
 * direction. */
#include <math.h>
#include <string.h>

#include "align/align.h"
#include "cmocka_all.h"
#include "contour/contours.h"
#include "geometry/affine.h"

enum { I = 6, POINTS = 300, J = 40, N = CONTOUR_POINTS };

/* Where the bump is, and the place of the curve at u in [0, 1): u = 0 is the bump's top. */
static double place_of(size_t i)
{
    return 0.3 * ((double)i - 2.5) / 2.5;
}
static void place(size_t i, double u, bool closed, double x[3])
{
    const double slide = place_of(i),
                 near = closed ? 0.5 * (1 + cos(2 * M_PI * u)) : 1 - fabs(2 * u - 1);
    const double phi = (closed ? 2 * M_PI * u : M_PI * (u - 0.5)) + slide * near;
    const double d = closed ? sin(M_PI * u) : 2 * (u - 0.5);
    const double r = 1 + 0.5 * exp(-d * d / 0.02);
    x[0] = 30 * r * cos(phi);
    x[1] = (sin(phi) > 0 ? 10 : 34) * r * sin(phi); /* no curve is its own mirror image */
    x[2] = 3 * cos(2 * phi);
}

typedef struct curves {
    double x[I][3 * POINTS], M[I][16];
    const double *P[I];
    size_t n[I];
} curves;

/* Every curve begins elsewhere, every second runs the other way, all are turned and moved. */
static void make(curves *c, bool closed, bool moved)
{
    for (size_t i = 0; i < I; i++) {
        const double a = moved ? 0.9 * (double)i : 0, cs = cos(a), sn = sin(a), t = moved ? 7 : 0;
        const double M[16] = { cs, -sn, 0, t * (double)i, sn, cs, 0, t, 0, 0, 1, -t, 0, 0, 0, 1 };
        memcpy(c->M[i], M, sizeof M);
        for (size_t k = 0; k < POINTS; k++) {
            const size_t at = i % 2 && moved ? POINTS - 1 - k : k;
            const double u = closed ? fmod((double)at / POINTS + (moved ? 0.17 * (double)i : 0), 1)
                                    : (double)at / (POINTS - 1);
            place(i, u, closed, c->x[i] + 3 * k);
            apsm_affine_apply(M, 1, c->x[i] + 3 * k, c->x[i] + 3 * k);
        }
        c->P[i] = c->x[i];
        c->n[i] = POINTS;
    }
}

/* u of the place of curve i that is nearest to x, which is in the curve's own frame. */
static double parameter(size_t i, const double M[16], const double x[3], bool closed)
{
    double best = INFINITY, at = 0, y[3];
    for (size_t k = 0; k < 4000; k++) {
        const double u = (double)k / (closed ? 4000 : 3999);
        place(i, u, closed, y);
        apsm_affine_apply(M, 1, y, y);
        const double d = hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]);
        if (d < best) best = d, at = u;
    }
    assert_true(best < 0.5); /* particles lie on their curves */
    return at;
}

/* Root mean square spread of u over the shapes at a particle. */
static double truth_error(const curves *in, const contour_cohort *c, bool closed)
{
    double sum = 0;
    for (size_t j = 0; j < c->J; j++) {
        double u[I], mean = 0;
        for (size_t i = 0; i < I; i++) {
            double back[16], x[3];
            assert_int_equal(apsm_affine_invert(c->M + 16 * i, back), APSM_OK);
            apsm_affine_apply(back, 1, c->P + 3 * (i * c->J + j), x);
            u[i] = parameter(i, in->M[i], x, closed);
            if (closed) u[i] -= floor(u[i] - u[0] + 0.5); /* round the corner */
            mean += u[i] / I;
        }
        for (size_t i = 0; i < I; i++) sum += (u[i] - mean) * (u[i] - mean) / (I * (double)c->J);
    }
    return sqrt(sum);
}

static void bumps_meet(void **state)
{
    static curves in;
    const contour_options o = { .align = APSM_ALIGN_RIGID, .adaptivity = 0.5, .J = J };
    (void)state;
    for (int closed = 0; closed < 2; closed++) {
        contour_cohort c;
        make(&in, closed, true);
        assert_int_equal(contour_cohort_make(I, in.n, in.P, closed, &o, &c), APSM_OK);
        const double error = truth_error(&in, &c, closed);
        if (!(error < 0.02))
            fail_msg("%s: off by %g of the curve", closed ? "closed" : "open", error);
        contour_cohort_free(&c);
    }
}

static void poses_do_not_matter(void **state)
{
    static curves here, there;
    const contour_options o = { .align = APSM_ALIGN_RIGID, .adaptivity = 0.5, .J = J };
    contour_cohort a, b;
    double worst = 0;
    (void)state;
    make(&here, true, false);
    make(&there, true, true);
    assert_int_equal(contour_cohort_make(I, here.n, here.P, true, &o, &a), APSM_OK);
    assert_int_equal(contour_cohort_make(I, there.n, there.P, true, &o, &b), APSM_OK);
    for (size_t i = 1; i < I; i++)
        for (size_t x = 0; x < 3 * J; x++) {
            const double d = a.P[i * 3 * J + x] - b.P[i * 3 * J + x];
            worst = fmax(worst, fabs(d));
        }
    assert_true(worst < 2); /* of 60: other points stand for the same curves */
    contour_cohort_free(&a);
    contour_cohort_free(&b);
}

static void particles_rebuild_their_curve(void **state)
{
    static curves in;
    const contour_options o = { .align = APSM_ALIGN_RIGID, .adaptivity = 0.5, .J = J };
    contour_cohort c;
    double X[3 * N], most;
    (void)state;
    make(&in, true, true);
    assert_int_equal(contour_cohort_make(I, in.n, in.P, true, &o, &c), APSM_OK);
    for (size_t i = 0; i < I; i++) {
        contour_rebuild(&c, c.P + 3 * i * J, X);
        assert_true(curve_distance(N, X, N, c.Q + 3 * i * N, true, &most) < 0.3);
        assert_true(most < 2);
    }
    contour_cohort_free(&c);
}

static void places_and_lengths(void **state)
{
    const double square[] = { 0, 0, 0, 4, 0, 0, 4, 4, 0, 0, 4, 0 };
    double Q[3 * 32], t[8], x[3], most;
    (void)state;
    assert_true(fabs(curve_resample(4, square, true, 32, Q) - 16) < 1e-12);
    for (size_t k = 0; k < 32; k++) {
        const double *a = Q + 3 * k, *b = Q + 3 * ((k + 1) % 32);
        assert_true(fabs(hypot(a[0] - b[0], a[1] - b[1]) - 0.5) < 1e-12);
    }
    assert_true(fabs(curve_resample(4, square, false, 25, Q) - 12) < 1e-12);
    assert_true(Q[72] == 0 && Q[73] == 4);
    curve_resample(4, square, true, 32, Q);
    curve_places(32, Q, true, 0, 8, t);
    for (size_t j = 0; j < 8; j++) assert_true(fabs(t[j] - 4 * (double)j) < 1e-9);
    curve_places(32, Q, true, 1, 8, t);
    for (size_t j = 1; j < 8; j++) assert_true(t[j] > t[j - 1] && t[j] < 32);
    curve_at(32, Q, true, 31.5, x);
    assert_true(fabs(x[1] - 0.25) < 1e-12);
    assert_true(fabs(curve_distance(1, (double[]){ 2, 2, 1 }, 32, Q, true, &most) - sqrt(5)) <
                1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(bumps_meet),
                                        cmocka_unit_test(poses_do_not_matter),
                                        cmocka_unit_test(particles_rebuild_their_curve),
                                        cmocka_unit_test(places_and_lengths) };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
