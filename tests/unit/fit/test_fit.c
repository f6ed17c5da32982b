/* A model of ellipsoids, made in memory: its file, and new shapes that meet it. */
#include "cmocka_all.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/fit.h"
#include "files/checkpoint_file.h"
#include "files/files.h"
#include "fit/fit_model.h"
#include "geometry/affine.h"
#include "scratch.h"
#include "shapes.h"

enum { I = 9, J = 42, D = 3 * J };

/* Half axes of shape i: two ways of variation that are told apart. */
static void axes_of(size_t i, double a[3])
{
    a[0] = 30 + 1.2 * (double)(i % 3);
    a[1] = 20 + 0.9 * (double)(i / 3 % 3);
    a[2] = 14;
}

/* An ellipsoid with a bump on one side, so that its pose and hand show. */
static void shape_point(const double u[3], const double a[3], double x[3])
{
    const double away =
        (u[0] - 0.6) * (u[0] - 0.6) + (u[1] - 0.6) * (u[1] - 0.6) + (u[2] - 0.5) * (u[2] - 0.5);
    const double bump = 1 + 0.5 * exp(-4 * away);
    for (int c = 0; c < 3; c++) x[c] = a[c] * bump * u[c];
}

static apsm_mesh make_mesh(const double a[3])
{
    apsm_mesh mesh = shape_icosphere(4);
    for (size_t v = 0; v < mesh.nv; v++) {
        double x[3];
        shape_point(mesh.V + 3 * v, a, x);
        memcpy(mesh.V + 3 * v, x, sizeof x);
    }
    return mesh;
}

/* Particles are the vertices of a coarser ball, so their correspondence is exact. */
static void particles_of(const double a[3], double *P)
{
    apsm_mesh ball = shape_icosphere(1);
    assert_int_equal(ball.nv, J);
    for (size_t j = 0; j < J; j++) shape_point(ball.V + 3 * j, a, P + 3 * j);
    apsm_mesh_free(&ball);
}

static apsm_fit_model *make_model(apsm_context *ctx)
{
    double P[I * D], a[3];
    apsm_fit_model *m = calloc(1, sizeof *m);
    for (size_t i = 0; i < I; i++) {
        axes_of(i, a);
        particles_of(a, P + i * D);
    }
    /* a little that no mode explains, else nothing is left for the noise */
    for (size_t k = 0; k < I * D; k++) P[k] += 0.1 * sin(12.9898 * (double)k);
    m->path = strdup("memory");
    m->options = apsm_options_defaults();
    m->T = malloc(D * sizeof *m->T);
    axes_of(4, a);
    particles_of(a, m->T);
    apsm_mesh mesh = make_mesh(a);
    for (int k = 0; k < 9; k++) m->common[k] = k % 4 == 0;
    assert_int_equal(apsm_shape_model_fit(ctx, I, J, P, &m->model), APSM_OK);
    assert_int_equal(fit_model_take_mesh(ctx, &mesh, m), APSM_OK);
    assert_int_equal(fit_model_prepare(ctx, m), APSM_OK);
    return m;
}

/* A shape between those of the model, turned and shifted, or mirrored before. */
static apsm_mesh make_patient(bool mirrored, double scale)
{
    const double a[3] = { 31.3 * scale, 21.2 * scale, 14 * scale };
    const double M[16] = { 0, -1, 0, 50, 0, 0, -1, 7, 1, 0, 0, -20, 0, 0, 0, 1 };
    const double F[16] = { mirrored ? -1 : 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };
    apsm_mesh mesh = make_mesh(a);
    apsm_mesh_transform(&mesh, F);
    apsm_mesh_transform(&mesh, M);
    return mesh;
}

/* Mean distance of fitted particles from the true ones, in h. */
static double miss_of(const apsm_fit *fit)
{
    const double a[3] = { 31.3, 21.2, 14 };
    double P[D], A[16], sum = 0;
    particles_of(a, P);
    /* rigid motion aside: what is asked is the shape and the places on it */
    apsm_affine_fit(J, fit->world, P, NULL, 0, A);
    for (size_t j = 0; j < J; j++) {
        double x[3], d2 = 0;
        apsm_affine_apply(A, 1, fit->world + 3 * j, x);
        for (int c = 0; c < 3; c++)
            d2 += (x[c] - P[3 * j + (size_t)c]) * (x[c] - P[3 * j + (size_t)c]);
        sum += sqrt(d2) / J;
    }
    return sum / fit->h;
}

static void whole_shapes(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_fit_model *m = make_model(ctx);
    const apsm_fit_options o = apsm_fit_defaults();
    for (int mirrored = 0; mirrored < 2; mirrored++) {
        apsm_mesh mesh = make_patient(mirrored, 1);
        apsm_fit fit, again;
        assert_int_equal(apsm_fit_surface(ctx, m, "patient", &mesh, &o, &fit), APSM_OK);
        assert_int_not_equal(fit.verdict, APSM_FIT_REFUSED);
        assert_int_equal(fit.mirrored, mirrored);
        assert_true(miss_of(&fit) < 0.15);
        assert_true(fit.distance.two_way.mean < 0.05 * fit.h);
        assert_true(fit.tail > 0.01 && fit.tail <= 1);
        for (size_t j = 0; j < J; j++) assert_true(fit.observed[j] && fit.sd[j] > 0);
        /* original particles lie where the input lies */
        double x[3];
        apsm_affine_apply(fit.M, 1, fit.original, x);
        for (int c = 0; c < 3; c++) assert_true(fabs(x[c] - fit.world[c]) < 1e-9);
        assert_int_equal(apsm_fit_surface(ctx, m, "patient", &mesh, &o, &again), APSM_OK);
        assert_memory_equal(fit.world, again.world, D * sizeof *fit.world);
        apsm_fit_free(&fit);
        apsm_fit_free(&again);
        apsm_mesh_free(&mesh);
    }
    apsm_fit_model_free(m);
    apsm_context_free(ctx);
}

/* A start is a pose, and of the hand that is asked for. */
static void bad_starts(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_fit_model *m = make_model(ctx);
    apsm_fit_options o = apsm_fit_defaults();
    apsm_mesh mesh = make_patient(false, 1);
    apsm_fit fit = { 0 }, again = { 0 };
    double start[16];
    assert_int_equal(apsm_fit_surface(ctx, m, "patient", &mesh, &o, &fit), APSM_OK);
    memcpy(start, fit.M, sizeof start);
    o.start = start;
    o.hand = APSM_HAND_SAME;
    assert_int_equal(apsm_fit_surface(ctx, m, "patient", &mesh, &o, &again), APSM_OK);
    assert_true(miss_of(&again) < 0.15);
    apsm_fit_free(&again);
    o.hand = APSM_HAND_OTHER;
    assert_int_equal(apsm_fit_surface(ctx, m, "patient", &mesh, &o, &again), APSM_ERR_ARG);
    o.hand = APSM_HAND_AUTO;
    start[6] = NAN;
    assert_int_equal(apsm_fit_surface(ctx, m, "patient", &mesh, &o, &again), APSM_ERR_ARG);
    memset(start, 0, sizeof start);
    assert_int_equal(apsm_fit_surface(ctx, m, "patient", &mesh, &o, &again), APSM_ERR_ARG);
    const char *const inputs[] = { "patient.ply" };
    const apsm_fit_settings run = { .model = "memory",
                                    .n_inputs = 1,
                                    .inputs = inputs,
                                    .folder = "x",
                                    .options = &o,
                                    .options_size = sizeof o };
    apsm_fit_totals totals;
    assert_int_equal(apsm_fit_run(ctx, &run, &totals), APSM_ERR_ARG);
    assert_non_null(strstr(apsm_error_text(ctx), "one shape"));
    apsm_fit_free(&fit);
    apsm_fit_free(&again);
    apsm_mesh_free(&mesh);
    apsm_fit_model_free(m);
    apsm_context_free(ctx);
}

static void strangers(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_fit_model *m = make_model(ctx);
    apsm_fit_options o = apsm_fit_defaults();
    apsm_mesh half = make_patient(false, 0.5);
    apsm_fit fit;
    assert_int_equal(apsm_fit_surface(ctx, m, "half", &half, &o, &fit), APSM_OK);
    assert_int_equal(fit.verdict, APSM_FIT_REFUSED);
    assert_true(fit.J == 0 && strstr(fit.reason, "0.5"));
    apsm_fit_free(&fit);
    o.force = true;
    assert_int_equal(apsm_fit_surface(ctx, m, "half", &half, &o, &fit), APSM_OK);
    assert_int_equal(fit.verdict, APSM_FIT_REVIEW);
    assert_int_equal(fit.J, J);
    apsm_fit_free(&fit);
    assert_int_equal(apsm_fit_surface(ctx, m, "half", NULL, &o, &fit), APSM_ERR_ARG);
    half.V[4] = NAN;
    assert_int_equal(apsm_fit_surface(ctx, m, "half", &half, &o, &fit), APSM_ERR_NONFINITE);
    apsm_mesh_free(&half);
    apsm_fit_model_free(m);
    apsm_context_free(ctx);
}

/* Half of the surface, and the particles alone as a cloud and as landmarks. */
static void parts(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_fit_model *m = make_model(ctx);
    const apsm_fit_options o = { .hand = APSM_HAND_SAME };
    apsm_mesh mesh = make_patient(false, 1), cloud = make_patient(false, 1);
    apsm_fit fit;
    size_t nf = 0;
    for (size_t f = 0; f < mesh.nf; f++) /* z of the patient is the long axis */
        if (mesh.V[3 * mesh.F[3 * f] + 2] > -35)
            memmove(mesh.F + 3 * nf++, mesh.F + 3 * f, 3 * sizeof *mesh.F);
    mesh.nf = nf;
    assert_int_equal(apsm_fit_surface(ctx, m, "part", &mesh, &o, &fit), APSM_OK);
    assert_true(fit.partial && fit.J == J);
    assert_true(fit.observed_share > 0.5 && fit.observed_share < 0.95);
    assert_true(miss_of(&fit) < 0.3);
    double seen = 0, hidden = 0;
    for (size_t j = 0; j < J; j++) {
        if (fit.observed[j]) seen = fmax(seen, fit.sd_normal[j]);
        if (!fit.observed[j]) hidden = fmax(hidden, fit.sd_normal[j]);
    }
    assert_true(hidden > seen);
    apsm_fit_free(&fit);
    assert_int_equal(apsm_fit_points(ctx, m, "cloud", cloud.nv, cloud.V, &o, &fit), APSM_OK);
    assert_true(fit.J == J && miss_of(&fit) < 0.3);
    apsm_fit_free(&fit);
    assert_int_equal(apsm_fit_points(ctx, m, "cloud", 9, cloud.V, &o, &fit), APSM_ERR_GEOMETRY);

    double P[D];
    const double a[3] = { 31.3, 21.2, 14 };
    particles_of(a, P);
    assert_int_equal(apsm_fit_landmarks(ctx, m, "marks", 12, m->model.mean, P, &o, &fit), APSM_OK);
    assert_true(fit.J == J && miss_of(&fit) < 0.1);
    apsm_fit_free(&fit);
    assert_int_equal(apsm_fit_landmarks(ctx, m, "marks", 2, m->model.mean, P, &o, &fit),
                     APSM_ERR_GEOMETRY);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&cloud);
    apsm_fit_model_free(m);
    apsm_context_free(ctx);
}

/* More landmarks than are judged together, of which two have changed places. */
static void swapped_landmarks(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_fit_model *m = make_model(ctx);
    const apsm_fit_options o = apsm_fit_defaults();
    const double mean[3] = { 31.2, 20.9, 14 }, own[3] = { 31.3, 21.2, 14 };
    apsm_mesh at = shape_icosphere(2), x = shape_icosphere(2);
    apsm_fit fit;
    assert_true(at.nv > 150);
    for (size_t v = 0; v < at.nv; v++) {
        double p[3];
        shape_point(at.V + 3 * v, mean, p);
        memcpy(at.V + 3 * v, p, sizeof p);
        shape_point(x.V + 3 * v, own, p);
        memcpy(x.V + 3 * v, p, sizeof p);
    }
    assert_int_equal(apsm_fit_landmarks(ctx, m, "marks", at.nv, at.V, x.V, &o, &fit), APSM_OK);
    assert_int_equal(fit.verdict, APSM_FIT_GOOD);
    apsm_fit_free(&fit);
    for (size_t c = 0; c < 3; c++) {
        const double t = x.V[3 * 60 + c];
        x.V[3 * 60 + c] = x.V[3 * 141 + c];
        x.V[3 * 141 + c] = t;
    }
    assert_int_equal(apsm_fit_landmarks(ctx, m, "marks", at.nv, at.V, x.V, &o, &fit), APSM_OK);
    assert_int_equal(fit.verdict, APSM_FIT_REVIEW);
    if (!strstr(fit.reason, "landmark 61 ") && !strstr(fit.reason, "landmark 142 "))
        fail_msg("%s", fit.reason);
    apsm_fit_free(&fit);
    apsm_mesh_free(&at);
    apsm_mesh_free(&x);
    apsm_fit_model_free(m);
    apsm_context_free(ctx);
}

/* Faces without area, and vertices so far that there is none, are no surface, in any pose. */
static void no_surface(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_fit_model *m = make_model(ctx);
    apsm_fit_options o = { .aligned = true, .extent = APSM_EXTENT_WHOLE };
    apsm_fit fit;
    for (int k = 0; k < 4; k++) {
        apsm_mesh mesh = make_patient(false, 1);
        for (size_t x = 0; x < 3 * mesh.nv; x++) mesh.V[x] = k < 2 ? 1 : 1e170 * mesh.V[x];
        o.aligned = k % 2;
        assert_int_equal(apsm_fit_surface(ctx, m, "none", &mesh, &o, &fit), APSM_ERR_GEOMETRY);
        assert_non_null(strstr(apsm_error_text(ctx), "no area"));
        apsm_mesh_free(&mesh);
    }
    apsm_fit_model_free(m);
    apsm_context_free(ctx);
}

static apsm_status load(apsm_context *ctx, const char *path, const char *bytes, size_t size)
{
    apsm_fit_model *m = NULL;
    scratch_write(path, bytes, size);
    const apsm_status status = apsm_fit_model_load(ctx, path, &m);
    apsm_fit_model_free(m);
    return status;
}

/* What is read back fits alike; a changed bit and a lost end are refused. */
static void model_file(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_fit_model *m = make_model(ctx), *back = NULL;
    const apsm_fit_options o = apsm_fit_defaults();
    apsm_mesh mesh = make_patient(false, 1);
    apsm_fit a, b;
    char folder[SCRATCH_LENGTH];
    scratch_make(folder);
    const char *path = scratch_path(folder, "model.apsm");
    const char *damaged = scratch_path(folder, "damaged.apsm");
    assert_int_equal(apsm_fit_model_write(ctx, m, path), APSM_OK);
    assert_int_equal(apsm_fit_model_load(ctx, path, &back), APSM_OK);
    assert_int_equal(apsm_fit_surface(ctx, m, "a", &mesh, &o, &a), APSM_OK);
    assert_int_equal(apsm_fit_surface(ctx, back, "b", &mesh, &o, &b), APSM_OK);
    assert_memory_equal(a.world, b.world, D * sizeof *a.world);
    assert_memory_equal(a.sd, b.sd, J * sizeof *a.sd);
    char *bytes;
    size_t size;
    assert_int_equal(apsm_read_file(ctx, path, 1 << 24, &bytes, &size), APSM_OK);
    for (size_t k = 0; k < 40; k++) {
        bytes[k * (size - 1) / 39] ^= 4;
        assert_int_equal(load(ctx, damaged, bytes, size), APSM_ERR_FORMAT);
        bytes[k * (size - 1) / 39] ^= 4;
        assert_int_equal(load(ctx, damaged, bytes, k * (size - 1) / 39), APSM_ERR_FORMAT);
    }
    assert_int_equal(load(ctx, damaged, bytes, size), APSM_OK);
    free(bytes);
    scratch_remove(folder);
    apsm_fit_free(&a);
    apsm_fit_free(&b);
    apsm_mesh_free(&mesh);
    apsm_fit_model_free(back);
    apsm_fit_model_free(m);
    apsm_context_free(ctx);
}

/* A kind that is its own mirror image does not show the side: review, unless the side is told. */
static void side_of_a_symmetric_kind(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_fit_model *m = make_model(ctx);
    apsm_fit_options o = apsm_fit_defaults();
    apsm_mesh mesh = make_patient(false, 1);
    apsm_fit fit;
    assert_true(m->mirror > 0);
    m->oriented = 0;
    m->mirror = 0;
    assert_int_equal(apsm_fit_surface(ctx, m, "patient", &mesh, &o, &fit), APSM_OK);
    assert_int_equal(fit.verdict, APSM_FIT_REVIEW);
    assert_non_null(strstr(fit.reason, "its side is not known"));
    apsm_fit_free(&fit);
    o.hand = APSM_HAND_SAME;
    assert_int_equal(apsm_fit_surface(ctx, m, "patient", &mesh, &o, &fit), APSM_OK);
    assert_null(strstr(fit.reason, "its side is not known"));
    apsm_fit_free(&fit);
    apsm_mesh_free(&mesh);
    apsm_fit_model_free(m);
    apsm_context_free(ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(whole_shapes),      cmocka_unit_test(bad_starts),
        cmocka_unit_test(strangers),         cmocka_unit_test(parts),
        cmocka_unit_test(swapped_landmarks), cmocka_unit_test(no_surface),
        cmocka_unit_test(model_file),        cmocka_unit_test(side_of_a_symmetric_kind)
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
