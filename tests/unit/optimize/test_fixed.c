/* Fixed shapes: their particles take part and do not move. */
#include <stdlib.h>
#include <string.h>

#include "cmocka_all.h"
#include "optimize/optimizer.h"
#include "synthetic.h"

enum { I = 5, J = 32, LEVEL = 3, D = 3 * J };

typedef struct scene {
    apsm_context *ctx;
    apsm_cohort cohort;
    apsm_optimize_options options;
    double P[I * D];
} scene;

static void make_scene(scene *s)
{
    apsm_mesh mesh[I];
    double M[16 * I] = { 0 };
    const char *const names[I] = { "a", "b", "c", "d", "e" };
    s->ctx = apsm_context_new();
    for (size_t i = 0; i < I; i++) {
        mesh[i] = synthetic_shape(SYNTHETIC_BUMP, i, I, LEVEL);
        for (size_t c = 0; c < 4; c++) M[16 * i + 5 * c] = 1;
    }
    s->options = apsm_optimize_defaults();
    const apsm_rbf_options *rbf = &s->options.rbf;
    const double h = apsm_expected_spacing(apsm_mesh_area(&mesh[0]), J);
    const apsm_cohort_input in = { I, names, mesh, M, 0 };
    assert_int_equal(
        apsm_cohort_build(s->ctx, &in, 0.125 * h, 1.1 * rbf->band * rbf->dipole * h, &s->cohort),
        APSM_OK);
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
    s->options.schedule.stage1_epochs = 4;
    s->options.schedule.stage2_epochs = 4;
    s->options.fidelity.fidelity_rounds = 2;
    assert_int_equal(apsm_first_particles(s->ctx, &s->cohort, &s->options, J, s->P), APSM_OK);
}

static void free_scene(scene *s)
{
    apsm_cohort_free(&s->cohort);
    apsm_context_free(s->ctx);
}

/* P of s optimised, with the shapes of `fixed` in their places. */
static void optimise(scene *s, unsigned fixed, double P[I * D])
{
    apsm_optimizer_state state;
    s->cohort.fixed = calloc(I, sizeof *s->cohort.fixed);
    for (size_t i = 0; i < I; i++) s->cohort.fixed[i] = fixed & (1u << i);
    assert_int_equal(apsm_optimizer_state_alloc(I, J, &state), APSM_OK);
    memcpy(state.P, s->P, sizeof s->P);
    assert_int_equal(apsm_optimize(s->ctx, &s->cohort, &s->options, &state, NULL, NULL), APSM_OK);
    memcpy(P, state.P, sizeof s->P);
    apsm_optimizer_state_free(&state);
    free(s->cohort.fixed);
    s->cohort.fixed = NULL;
}

static void fixed_shapes_stay_and_others_move(void **state)
{
    scene s;
    double P[I * D];
    (void)state;
    make_scene(&s);
    for (size_t x = 0; x < D; x++)
        s.P[D + x] *= 1.0000001; /* off the surface, by rounding of files */
    optimise(&s, 1u << 0 | 1u << 1, P);
    assert_memory_equal(P, s.P, 2 * D * sizeof *P);
    for (size_t i = 2; i < I; i++) assert_memory_not_equal(P + i * D, s.P + i * D, D * sizeof *P);
    free_scene(&s);
}

/* A fixed shape has its say: where its particles are changes those of the others. */
static void fixed_shapes_take_part(void **state)
{
    scene s;
    double P[I * D], Q[I * D], swap[3];
    (void)state;
    make_scene(&s);
    optimise(&s, 1u << 0 | 1u << 1, P);
    memcpy(swap, s.P + D, sizeof swap);
    memcpy(s.P + D, s.P + D + 3, sizeof swap);
    memcpy(s.P + D + 3, swap, sizeof swap);
    optimise(&s, 1u << 0 | 1u << 1, Q);
    assert_memory_equal(Q, P, D * sizeof *P);
    assert_memory_not_equal(Q + 2 * D, P + 2 * D, D * sizeof *P);
    free_scene(&s);
}

/* First particles of the others are the fixed template's, carried. */
static void a_fixed_template_is_carried(void **state)
{
    scene s;
    double P[I * D], *first;
    (void)state;
    make_scene(&s);
    s.cohort.fixed = calloc(I, sizeof *s.cohort.fixed);
    s.cohort.fixed[0] = s.cohort.fixed[3] = true;
    memcpy(P, s.P, sizeof P);
    first = s.P + 2 * D;
    for (size_t j = 0; j < J; j++) /* the same places with other names */
        memcpy(P + 3 * j, s.P + 3 * (J - 1 - j), 3 * sizeof *P);
    double template[D], other[D];
    const double h = apsm_expected_spacing(apsm_mesh_area(&s.cohort.shape[0].mesh), J);
    memcpy(template, P, sizeof template);
    memcpy(other, P + 3 * D, sizeof other);
    assert_int_equal(apsm_first_particles(s.ctx, &s.cohort, &s.options, J, P), APSM_OK);
    assert_memory_equal(P, template, sizeof template);
    assert_memory_equal(P + 3 * D, other, sizeof other);
    for (size_t j = 0; j < J; j++)
        for (size_t c = 0; c < 3; c++)
            assert_true(fabs(P[2 * D + 3 * j + c] - first[3 * (J - 1 - j) + c]) < 0.05 * h);
    free_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(fixed_shapes_stay_and_others_move),
                                        cmocka_unit_test(fixed_shapes_take_part),
                                        cmocka_unit_test(a_fixed_template_is_carried) };
    return cmocka_run_group_tests_name("fixed", tests, NULL, NULL);
}
