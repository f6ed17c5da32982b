/* Conditioning of probabilistic PCA: the golden cases, and the two kernels against each other. */
#include "cmocka_all.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "fit/posterior.h"
#include "golden.h"
#include "linalg/linalg.h"

enum { J = 6, D = 3 * J, M = 3 };

typedef struct golden_case {
    const json_t *json;
    double *mean, *mode, *variance, *y;
    posterior_model model;
    size_t n;
    double A[D * D], R[D * D];
} golden_case;

static void measure_coordinates(golden_case *c, const json_t *particles, double noise)
{
    for (size_t k = 0; k < json_array_size(particles); k++) {
        const size_t j = (size_t)json_integer_value(json_array_get(particles, k));
        for (size_t a = 0; a < 3; a++, c->n++) {
            c->A[c->n * D + 3 * j + a] = 1;
        }
    }
    for (size_t a = 0; a < c->n; a++) c->R[a * c->n + a] = noise;
}

static void measure_landmarks(golden_case *c)
{
    double *W = golden_array(golden_get(c->json, "W"), 0);
    double *R = golden_array(golden_get(c->json, "observation_covariance"), 0);
    c->n = 3 * json_array_size(golden_get(c->json, "W"));
    for (size_t l = 0; l < c->n / 3; l++)
        for (size_t j = 0; j < J; j++)
            for (size_t a = 0; a < 3; a++) c->A[(3 * l + a) * D + 3 * j + a] = W[l * J + j];
    memcpy(c->R, R, c->n * c->n * sizeof *R);
    free(W);
    free(R);
}

static void measure_along_normal(golden_case *c)
{
    double *normal = golden_array(golden_get(c->json, "normal"), 3);
    const json_t *particles = golden_get(c->json, "particles");
    c->n = json_array_size(particles);
    for (size_t k = 0; k < c->n; k++) {
        const size_t j = (size_t)json_integer_value(json_array_get(particles, k));
        for (size_t a = 0; a < 3; a++) c->A[k * D + 3 * j + a] = normal[a];
        c->R[k * c->n + k] = golden_number(c->json, "observation_noise");
    }
    free(normal);
}

static void load(const json_t *json, golden_case *c)
{
    *c = (golden_case){ .json = json };
    c->mean = golden_array(golden_get(json, "mean"), D);
    c->mode = golden_array(golden_get(json, "modes"), M * D);
    c->variance = golden_array(golden_get(json, "variances"), M);
    c->y = golden_array(golden_get(json, "y"), 0);
    c->model = (posterior_model){ D,       M,           c->mean,
                                  c->mode, c->variance, golden_number(json, "noise_variance") };
    if (json_object_get(json, "W"))
        measure_landmarks(c);
    else if (json_object_get(json, "normal"))
        measure_along_normal(c);
    else
        measure_coordinates(c, golden_get(json, "observed_particles"),
                            golden_number(json, "observation_noise"));
}

static void unload(golden_case *c)
{
    free(c->mean);
    free(c->mode);
    free(c->variance);
    free(c->y);
}

static void check_near(const char *what, size_t n, const double *x, const json_t *json,
                       const char *key, double tolerance)
{
    double *expected = golden_array(golden_get(json, key), n), most = 0;
    for (size_t k = 0; k < n; k++) most = fmax(most, fabs(expected[k]));
    for (size_t k = 0; k < n; k++)
        if (!(fabs(x[k] - expected[k]) <= tolerance * (1 + most)))
            fail_msg("%s, %s[%zu]: %.17g, not %.17g", what, key, k, x[k], expected[k]);
    free(expected);
}

static void check_case(const json_t *json, double tolerance)
{
    golden_case c;
    load(json, &c);
    const char *name = json_string_value(golden_get(json, "name"));
    double b[M], B[M * M], x[D], C[D * D];
    double *work = malloc(posterior_work_size(&c.model, c.n) * sizeof *work);
    posterior_scores s = { .b = b, .B = B };
    const posterior_seen seen = { c.n, c.A, c.R, c.y };
    assert_int_equal(posterior_of(&c.model, &seen, &s, x, C, work), APSM_OK);
    check_near(name, D, x, json, "posterior_mean", tolerance);
    check_near(name, D * D, C, json, "posterior_covariance", tolerance);
    check_near(name, M, b, json, "score_mean", tolerance);
    check_near(name, M * M, B, json, "score_covariance", tolerance);
    check_near(name, 1, &s.log_likelihood, json, "log_likelihood", tolerance);
    check_near(name, 1, &s.mahalanobis2, json, "mahalanobis2", tolerance);
    free(work);
    unload(&c);
}

static void golden_cases(void **state)
{
    (void)state;
    json_t *root = golden_load("posterior");
    const double tolerance = golden_number(root, "tolerance");
    const json_t *cases = golden_get(root, "cases");
    assert_int_equal(json_array_size(cases), 4);
    for (size_t k = 0; k < json_array_size(cases); k++)
        check_case(json_array_get(cases, k), tolerance);
    json_decref(root);
}

/* The cases that measure particles, by the kernel made for them. */
static void golden_particles(void **state)
{
    (void)state;
    json_t *root = golden_load("posterior");
    const double tolerance = golden_number(root, "tolerance");
    for (size_t k = 0; k < 2; k++) {
        const json_t *json = json_array_get(golden_get(root, "cases"), k);
        golden_case c;
        load(json, &c);
        double b[M], B[M * M], x[D], block[9 * J], y[D] = { 0 }, error[J];
        const json_t *observed = golden_get(json, "observed_particles");
        for (size_t j = 0; j < J; j++) error[j] = INFINITY;
        for (size_t l = 0; l < json_array_size(observed); l++) {
            const size_t j = (size_t)json_integer_value(json_array_get(observed, l));
            error[j] = golden_number(json, "observation_noise");
            memcpy(y + 3 * j, c.y + 3 * l, 3 * sizeof *y);
        }
        double *work = malloc(posterior_particles_work_size(&c.model) * sizeof *work);
        double *C = golden_array(golden_get(json, "posterior_covariance"), D * D);
        posterior_scores s = { .b = b, .B = B };
        assert_int_equal(posterior_of_particles(&c.model, y, error, &s, x, block, work), APSM_OK);
        check_near("particles", D, x, json, "posterior_mean", tolerance);
        check_near("particles", M * M, B, json, "score_covariance", tolerance);
        check_near("particles", 1, &s.log_likelihood, json, "log_likelihood", tolerance);
        check_near("particles", 1, &s.mahalanobis2, json, "mahalanobis2", tolerance);
        for (size_t j = 0; j < J; j++)
            for (size_t a = 0; a < 9; a++)
                assert_true(fabs(block[9 * j + a] - C[(3 * j + a / 3) * D + 3 * j + a % 3]) <
                            tolerance);
        free(C);
        free(work);
        unload(&c);
    }
    json_decref(root);
}

/* The case that measures one coordinate, by the kernel made for it. */
static void golden_normals(void **state)
{
    (void)state;
    json_t *root = golden_load("posterior");
    const double tolerance = golden_number(root, "tolerance");
    const json_t *json = json_array_get(golden_get(root, "cases"), 3);
    golden_case c;
    load(json, &c);
    double b[M], B[M * M], x[D], block[9 * J], y[D] = { 0 }, error[J], normals[D];
    double *normal = golden_array(golden_get(json, "normal"), 3);
    double *C = golden_array(golden_get(json, "posterior_covariance"), D * D);
    double *work = malloc(posterior_particles_work_size(&c.model) * sizeof *work);
    const json_t *particles = golden_get(json, "particles");
    for (size_t j = 0; j < J; j++) {
        error[j] = INFINITY;
        memcpy(normals + 3 * j, normal, 3 * sizeof *normal);
    }
    for (size_t k = 0; k < c.n; k++) {
        const size_t j = (size_t)json_integer_value(json_array_get(particles, k));
        error[j] = golden_number(json, "observation_noise");
        for (size_t a = 0; a < 3; a++) y[3 * j + a] = c.y[k] * normal[a];
    }
    posterior_scores s = { .b = b, .B = B };
    assert_int_equal(posterior_along_normals(&c.model, normals, y, error, &s, x, block, work),
                     APSM_OK);
    check_near("normals", D, x, json, "posterior_mean", tolerance);
    check_near("normals", M * M, B, json, "score_covariance", tolerance);
    check_near("normals", 1, &s.log_likelihood, json, "log_likelihood", tolerance);
    check_near("normals", 1, &s.mahalanobis2, json, "mahalanobis2", tolerance);
    for (size_t j = 0; j < J; j++)
        for (size_t a = 0; a < 9; a++)
            assert_true(fabs(block[9 * j + a] - C[(3 * j + a / 3) * D + 3 * j + a % 3]) <
                        tolerance);
    free(normal);
    free(C);
    free(work);
    unload(&c);
    json_decref(root);
}

/* Nothing measured: the model itself. */
static void nothing_seen(void **state)
{
    (void)state;
    json_t *root = golden_load("posterior");
    golden_case c;
    load(json_array_get(golden_get(root, "cases"), 0), &c);
    double b[M], B[M * M], x[D], block[9 * J], y[D] = { 0 }, error[J];
    for (size_t j = 0; j < J; j++) error[j] = INFINITY;
    double *work = malloc(posterior_particles_work_size(&c.model) * sizeof *work);
    posterior_scores s = { .b = b, .B = B };
    assert_int_equal(posterior_of_particles(&c.model, y, error, &s, x, block, work), APSM_OK);
    assert_true(s.mahalanobis2 == 0 && fabs(s.log_likelihood) < 1e-12);
    for (size_t k = 0; k < M; k++) {
        assert_true(b[k] == 0);
        assert_true(fabs(B[k * M + k] - c.variance[k]) < 1e-12);
    }
    for (size_t d = 0; d < D; d++) assert_true(x[d] == c.mean[d]);
    free(work);
    unload(&c);
    json_decref(root);
}

/* What the others say of one of two measured particles, directly. */
static void left_out(void **state)
{
    (void)state;
    enum { N = 6 };
    json_t *root = golden_load("posterior");
    golden_case c;
    load(json_array_get(golden_get(root, "cases"), 0), &c);
    double A[N * D] = { 0 }, R[N * N] = { 0 }, y[N], miss[N], z2[2], b[M], B[M * M], x[D], C[D * D];
    for (size_t a = 0; a < N; a++) {
        A[a * D + a] = 1;
        R[a * N + a] = 0.1;
        y[a] = c.mean[a] + 0.3 * (double)(a + 1);
    }
    double *work = malloc(
        (posterior_left_out_size(&c.model, N) + posterior_work_size(&c.model, N)) * sizeof *work);
    const posterior_seen both = { N, A, R, y };
    assert_int_equal(posterior_left_out(&c.model, &both, miss, z2, work), APSM_OK);
    double R3[9] = { 0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.1 };
    const posterior_seen second = { 3, A + 3 * D, R3, y + 3 };
    posterior_scores s = { .b = b, .B = B };
    assert_int_equal(posterior_of(&c.model, &second, &s, x, C, work), APSM_OK);
    double S[9], e[3], z = 0;
    for (size_t a = 0; a < 9; a++) S[a] = C[(a / 3) * D + a % 3] + (a % 4 == 0 ? 0.1 : 0);
    for (size_t a = 0; a < 3; a++) {
        e[a] = y[a] - x[a];
        assert_true(fabs(e[a] - miss[a]) < 1e-9 * (1 + fabs(e[a])));
    }
    double r[3] = { e[0], e[1], e[2] };
    assert_int_equal(apsm_cholesky(3, S), APSM_OK);
    apsm_cholesky_solve(3, S, 1, r);
    for (size_t a = 0; a < 3; a++) z += e[a] * r[a];
    assert_true(fabs(z - z2[0]) < 1e-9 * z);
    free(work);
    unload(&c);
    json_decref(root);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(golden_cases), cmocka_unit_test(golden_particles),
        cmocka_unit_test(golden_normals), cmocka_unit_test(nothing_seen), cmocka_unit_test(left_out)
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
