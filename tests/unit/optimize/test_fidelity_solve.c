/* The step of (12) for many particles: by a band and conjugate gradients, against a factor of the
 * whole in double precision. */
#include <math.h>
#include <string.h>

#include "check.h"
#include "cmocka_all.h"
#include "geometry/vec3.h"
#include "linalg/linalg.h"
#include "optimize/fidelity_shape.h"

enum { J = 520, N = 2 * J, MODES = 2, POINTS = 900 };
static const double prior = 0.02;

typedef struct system_ {
    apsm_fidelity f;
    fidelity_work w;
    double *H, *g, *x; /* by particle, with the modes; and the solution */
} system_;

/* Evenly on a long ellipsoid, in an order that says nothing of the place. */
static void scatter(size_t n, double *X)
{
    for (size_t k = 0; k < n; k++) {
        const size_t i = k * 211 % n;
        const double z = 2 * ((double)i + 0.5) / (double)n - 1,
                     angle = 2.399963229728653 * (double)i;
        const double x[3] = { cos(angle) * sqrt(1 - z * z), sin(angle) * sqrt(1 - z * z), 1.8 * z };
        memcpy(X + 3 * k, x, sizeof x);
    }
}

/* A point that hangs on the particles around it, the farther ones hardly. */
static void add_point(const double *T, const double *y, const double *coefficient, system_ *s)
{
    static const double reach = 0.12;
    static double row[N], kept[N];
    static uint32_t particle[J];
    size_t n = 0;
    for (size_t x = 0; x < N; x++)
        row[x] = coefficient[x] * exp(-vec3_distance2(T + 3 * (x / 2), y) / (2 * reach * reach));
    for (size_t j = 0; j < J; j++) {
        if (vec3_distance2(T + 3 * j, y) > 25 * reach * reach) continue;
        particle[n] = (uint32_t)j;
        memcpy(kept + 2 * n++, row + 2 * j, 2 * sizeof *row);
    }
    fidelity_system_put(&s->f, n, particle, kept, &s->w.system);
    for (size_t x = 0; x < N; x++)
        for (size_t y2 = 0; y2 <= x; y2++) s->H[x * N + y2] += row[x] * row[y2];
}

/* What couples particles like smoothness, all of them by `everywhere`. */
static double smoothness(const double *T, size_t j, size_t k, double everywhere)
{
    const double d2 = vec3_distance2(T + 3 * j, T + 3 * k);
    return everywhere + 0.02 * exp(-d2 / (2 * 0.1 * 0.1));
}

static void add_smoothness(const double *T, double everywhere, const double *tangent, system_ *s)
{
    s->f.Q32 = malloc(J * J * sizeof *s->f.Q32);
    s->w.system.smooth = 1;
    for (size_t x = 0; x < N; x++)
        for (size_t y = 0; y < N; y++) {
            const double q = smoothness(T, x / 2, y / 2, everywhere);
            s->f.Q32[s->f.place[x / 2] * J + s->f.place[y / 2]] = (float)q;
            if (y <= x) s->H[x * N + y] += q * vec3_dot(tangent + 3 * x, tangent + 3 * y);
        }
}

static void add_modes(system_ *s)
{
    for (size_t m = 0; m < MODES; m++) {
        const double *u = s->w.tangent_mode + m * N;
        for (size_t x = 0; x < N; x++)
            for (size_t y = 0; y <= x; y++) s->H[x * N + y] -= prior * u[x] * u[y];
    }
}

static void fill(const double *T, double everywhere, system_ *s)
{
    double *Y = check_alloc(3 * POINTS), *c = check_alloc(N), *tangent = check_alloc(3 * N);
    scatter(POINTS, Y);
    check_uniform(4, 3 * N, -1, 1, tangent);
    for (size_t x = 0; x < N; x++) vec3_normalise(tangent + 3 * x);
    memset(s->H, 0, N * N * sizeof *s->H);
    fidelity_system_begin(&s->f, tangent, &s->w.system);
    for (size_t k = 0; k < POINTS; k++) {
        check_uniform(100 + k, N, -1, 1, c);
        add_point(T, Y + 3 * k, c, s);
    }
    add_smoothness(T, everywhere, tangent, s);
    for (size_t x = 0; x < N; x++) {
        s->H[x * N + x] += 0.02;
        fidelity_system_put_diagonal(&s->f, x, 0.02, &s->w.system);
    }
    add_modes(s);
    free(Y), free(c), free(tangent);
}

static void build(double everywhere, system_ *s)
{
    double *T = check_alloc(3 * J);
    *s = (system_){ .f = { .J = J }, .w = { .sparse = true } };
    s->H = check_alloc(N * N), s->g = check_alloc(N), s->x = check_alloc(N);
    scatter(J, T);
    s->f.place = malloc(J * sizeof *s->f.place);
    assert_int_equal(fidelity_find_band(J, T, s->f.place, &s->f.band), APSM_OK);
    assert_true(s->f.band > 0 && s->f.band < N / 2);
    s->w.H = check_alloc(N * N), s->w.g = check_alloc(N), s->w.row = check_alloc(8 * J);
    s->w.K = check_alloc(MODES * MODES), s->w.tangent_mode = check_alloc(MODES * N);
    s->w.band = malloc(N * (s->f.band + 1) * sizeof(float));
    s->w.rows = malloc(N * FIDELITY_ROWS * sizeof(float));
    assert_int_equal(fidelity_system_alloc(J, POINTS, POINTS * J, &s->w.system), APSM_OK);
    check_uniform(3, MODES * N, -0.03, 0.03, s->w.tangent_mode);
    check_uniform(2, N, -1, 1, s->g);
    fill(T, everywhere, s);
    memcpy(s->w.g, s->g, N * sizeof *s->g);
    free(T);
}

static void release(system_ *s)
{
    free(s->H), free(s->g), free(s->x), free(s->f.place), free(s->w.H), free(s->w.g);
    free(s->w.row), free(s->w.K), free(s->w.tangent_mode), free(s->w.band), free(s->w.rows);
    free(s->f.Q32);
    fidelity_system_free(&s->w.system);
}

/* Error of the step by H's own measure. */
static double error_of(system_ *s)
{
    double *A = check_alloc(N * N), off = 0, size = 0;
    memcpy(A, s->H, N * N * sizeof *A);
    for (size_t x = 0; x < N; x++) s->x[x] = -s->g[x];
    assert_int_equal(apsm_cholesky(N, A), APSM_OK);
    apsm_cholesky_solve(N, A, 1, s->x);
    for (size_t x = 0; x < N; x++)
        for (size_t y = 0; y < N; y++) {
            const double a = s->H[x > y ? x * N + y : y * N + x];
            off += a * (s->w.g[x] - s->x[x]) * (s->w.g[y] - s->x[y]);
            size += a * s->x[x] * s->x[y];
        }
    free(A);
    return sqrt(off / size);
}

/* everywhere: couples all particles with all, so that no band will do. */
static void check_step(double everywhere, bool by_band)
{
    system_ s;
    build(everywhere, &s);
    s.w.H[0] = -7;
    const fidelity_weights q = { .prior = prior, .modes = MODES };
    assert_int_equal(fidelity_solve(&s.f, &q, &s.w), APSM_OK);
    assert_int_equal(s.w.H[0] == -7, by_band); /* not formed */
    const double error = error_of(&s);
    print_message("error of the step %.2g\n", error);
    assert_true(error < 1e-4);
    release(&s);
}

static void step_is_that_of_the_whole(void **state)
{
    (void)state;
    check_step(0, true);
    check_step(1e-4, true);
}

static void without_a_band_the_whole_is_factored(void **state)
{
    (void)state;
    check_step(0.3, false);
}

static void indefinite_is_refused(void **state)
{
    (void)state;
    system_ s;
    build(0, &s);
    const fidelity_weights q = { .prior = 0 };
    fidelity_system_put_diagonal(&s.f, 5, -100, &s.w.system);
    assert_int_equal(fidelity_solve(&s.f, &q, &s.w), APSM_ERR_SINGULAR);
    release(&s);
}

/* Product and whole are those of the same matrix. */
static void product_is_that_of_the_whole(void **state)
{
    (void)state;
    system_ s;
    build(1e-3, &s);
    double *H = check_alloc(N * N), *x = check_alloc(N);
    float x32[N], y[N];
    check_uniform(9, N, -1, 1, x);
    for (size_t k = 0; k < N; k++) x32[k] = (float)x[k];
    fidelity_system_multiply(&s.f, &s.w.system, x32, y);
    fidelity_system_form(&s.f, &s.w.system, H);
    for (size_t a = 0; a < N; a++) {
        double sum = 0;
        for (size_t b = 0; b < N; b++) sum += H[a > b ? a * N + b : b * N + a] * (double)x32[b];
        assert_true(fabs(sum - (double)y[a]) < 1e-4);
    }
    free(H), free(x);
    release(&s);
}

/* The band is the whole's, but for the diagonal, which has .15 of what is beyond more. */
static void band_is_that_of_the_whole(void **state)
{
    (void)state;
    system_ s;
    build(1e-3, &s);
    const size_t width = s.f.band;
    double *H = check_alloc(N * N), *beyond = check_alloc(N);
    memset(beyond, 0, N * sizeof *beyond);
    fidelity_system_form(&s.f, &s.w.system, H);
    fidelity_system_band(&s.f, &s.w.system, s.w.band);
    for (size_t x = 0; x < N; x++)
        for (size_t y = 0; y < x; y++) {
            const double h = H[x * N + y],
                         b = x - y <= width ? (double)s.w.band[y * (width + 1) + x - y] : 0;
            const bool in = x / 2 - y / 2 <= width / 2;
            if (!(fabs(b - (in ? h : 0)) < 1e-5)) fail_msg("%zu, %zu: %g, %g", x, y, b, h);
            beyond[x] += in ? 0 : fabs(h);
            beyond[y] += in ? 0 : fabs(h);
        }
    for (size_t x = 0; x < N; x++) {
        const double d = (double)s.w.band[x * (width + 1)] - H[x * N + x];
        if (!(fabs(d - 0.15 * beyond[x]) < 1e-4)) fail_msg("%zu: %g, %g", x, d, beyond[x]);
    }
    free(H), free(beyond);
    release(&s);
}

static void few_particles_have_no_band(void **state)
{
    (void)state;
    double T[3 * 100];
    uint32_t place[100];
    size_t band = 1;
    scatter(99, T);
    assert_int_equal(fidelity_find_band(99, T, place, &band), APSM_OK);
    assert_int_equal(band, 0);
    scatter(100, T);
    assert_int_equal(fidelity_find_band(100, T, place, &band), APSM_OK);
    assert_int_equal(band, 2 * 50 + 1); /* 5 rings of 10 particles, to both sides */
}

/* A ball has no longest axis; any order will do, but it has to be one. */
static void a_ball_has_an_order(void **state)
{
    (void)state;
    double T[3 * J];
    uint32_t place[J];
    bool taken[J] = { false };
    size_t band = 0;
    scatter(J, T);
    for (size_t j = 0; j < J; j++) T[3 * j + 2] /= 1.8;
    assert_int_equal(fidelity_find_band(J, T, place, &band), APSM_OK);
    assert_true(band > 0);
    for (size_t j = 0; j < J; j++) {
        assert_true(place[j] < J && !taken[place[j]]);
        taken[place[j]] = true;
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(step_is_that_of_the_whole),
        cmocka_unit_test(without_a_band_the_whole_is_factored),
        cmocka_unit_test(indefinite_is_refused),
        cmocka_unit_test(product_is_that_of_the_whole),
        cmocka_unit_test(band_is_that_of_the_whole),
        cmocka_unit_test(few_particles_have_no_band),
        cmocka_unit_test(a_ball_has_an_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
