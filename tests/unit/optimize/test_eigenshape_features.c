/* The eigenshape term with features: its gradient is that of the loss, and features have a say. */
#include <stdlib.h>
#include <string.h>

#include "cmocka_all.h"
#include "geometry/vec3.h"
#include "initialize/features.h"
#include "optimize/optimizer.h"
#include "optimize/terms.h"
#include "synthetic.h"

enum { I = 4, J = 16, LEVEL = 3, D = 3 * J };

typedef struct scene {
    apsm_context *ctx;
    apsm_cohort cohort;
    apsm_optimize_options options;
    apsm_optimizer_state state;
    optimizer op;
    size_t batch[I];
} scene;

/* Shapes whose field is a wave that moves on from one to the next; weight 0: without. */
static void make_scene(scene *s, double weight)
{
    static const char *const names[I] = { "a", "b", "c", "d" };
    static const term *const terms[] = { &term_eigenshape };
    apsm_mesh mesh[I];
    double M[16 * I] = { 0 }, *field[I];
    size_t flat;
    *s = (scene){ .ctx = apsm_context_new() };
    for (size_t i = 0; i < I; i++) {
        mesh[i] = synthetic_shape(SYNTHETIC_BUMP, i, I, LEVEL);
        for (size_t c = 0; c < 4; c++) M[16 * i + 5 * c] = 1;
        field[i] = malloc(mesh[i].nv * sizeof(double));
        for (size_t v = 0; v < mesh[i].nv; v++)
            field[i][v] = sin(0.1 * mesh[i].V[3 * v] + (double)i);
    }
    const apsm_cohort_input in = { I, names, mesh, M, 0 };
    assert_int_equal(apsm_cohort_build(s->ctx, &in, 1, 8, &s->cohort), APSM_OK);
    if (weight > 0)
        assert_int_equal(
            apsm_cohort_features(&s->cohort, 1, (const double *const *)field, &weight, 0.5, &flat),
            APSM_OK);
    s->options = apsm_optimize_defaults();
    s->options.eigenshape.eigen_reg_absolute = 1;
    s->options.eigenshape.eigen_share = 0;
    s->options.schedule.stage2_epochs = 1; /* the scratch of epochs */
    assert_int_equal(apsm_optimizer_state_alloc(I, J, &s->state), APSM_OK);
    assert_int_equal(apsm_first_particles(s->ctx, &s->cohort, &s->options, J, s->state.P), APSM_OK);
    s->state.h = 5;
    assert_int_equal(optimizer_alloc(s->ctx, &s->cohort, &s->options, 1, terms, &s->state, &s->op),
                     APSM_OK);
    for (size_t i = 0; i < I; i++) s->batch[i] = i;
    s->op.batch = s->batch;
    s->op.batch_size = I;
    s->op.w.beta = 1;
    for (size_t i = 0; i < I; i++) {
        apsm_mesh_free(&mesh[i]);
        free(field[i]);
    }
}

static void free_scene(scene *s)
{
    optimizer_free(&s->op);
    apsm_optimizer_state_free(&s->state);
    apsm_cohort_free(&s->cohort);
    apsm_context_free(s->ctx);
}

static double loss(scene *s)
{
    assert_int_equal(term_eigenshape.prepare(&s->op), APSM_OK);
    return s->op.eigenshape;
}

/* Every particle goes to the middle of its face, where a small move along it changes no face. */
static void seat_in_faces(scene *s)
{
    for (size_t k = 0; k < I * J; k++) {
        const apsm_mesh *m = &s->cohort.shape[k / J].mesh;
        apsm_surface_point on;
        double *p = s->state.P + 3 * k;
        apsm_shape_look_up(&s->cohort.shape[k / J], 1, p, &on, NULL, NULL);
        for (size_t c = 0; c < 3; c++) {
            const uint32_t *f = m->F + 3 * (size_t)on.face;
            p[c] = (m->V[3 * f[0] + c] + m->V[3 * f[1] + c] + m->V[3 * f[2] + c]) / 3;
        }
    }
}

static void gradient_is_that_of_the_loss(void **unused)
{
    (void)unused;
    for (int with = 0; with < 2; with++) {
        scene s;
        double g[D], none;
        make_scene(&s, with ? 1.0 : 0.0);
        seat_in_faces(&s);
        (void)loss(&s);
        const size_t k = 2, rows = s.op.row_particles;
        assert_int_equal(rows, with ? J + (4 * J + 2) / 3 : J);
        assert_int_equal(term_eigenshape.gradient(&s.op, k, s.op.worker, &none, g), APSM_OK);
        for (size_t j = 0; j < J; j++) {
            const apsm_mesh *m = &s.cohort.shape[k].mesh;
            apsm_surface_point on;
            double *p = s.state.P + 3 * (k * J + j), along[3], before[3];
            memcpy(before, p, sizeof before);
            apsm_shape_look_up(&s.cohort.shape[k], 1, p, &on, NULL, NULL);
            const uint32_t *f = m->F + 3 * (size_t)on.face;
            vec3_sub(m->V + 3 * (size_t)f[1], m->V + 3 * (size_t)f[0], along);
            const double e = 1e-4;
            vec3_add_scaled(p, e, along);
            const double more = loss(&s);
            memcpy(p, before, sizeof before);
            vec3_add_scaled(p, -e, along);
            const double slope = (more - loss(&s)) / (2 * e);
            memcpy(p, before, sizeof before);
            assert_true(fabs(slope - vec3_dot(g + 3 * j, along)) < 1e-4 * (1 + fabs(slope)));
        }
        free_scene(&s);
    }
}

static void features_have_a_say(void **unused)
{
    (void)unused;
    scene bare, with;
    make_scene(&bare, 0);
    make_scene(&with, 1);
    memcpy(bare.state.P, with.state.P, I * D * sizeof(double));
    const double a = loss(&bare), b = loss(&with);
    if (!(fabs(a - b) > 0.05)) fail_msg("loss %g with features, %g without", b, a);
    free_scene(&with);
    free_scene(&bare);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gradient_is_that_of_the_loss),
        cmocka_unit_test(features_have_a_say),
    };
    return cmocka_run_group_tests_name("eigenshape with features", tests, NULL, NULL);
}
