/* An open cohort: ellipsoids below one height of the ball that all are images of, so that rims
 * correspond and the truth is known. */
#include "cmocka_all.h"

#include "geometry/clip.h"
#include "geometry/vec3.h"
#include "optimize/epoch.h"
#include "optimize/optimizer.h"
#include "synthetic.h"

enum { I = 4, J = 48, LEVEL = 4 };
static const double height = 0.45; /* of the ball, from -1 to 1 */

typedef struct scene {
    apsm_context *ctx;
    apsm_optimize_options o;
    apsm_cohort cohort;
    double P[I * J * 3];
} scene;

static apsm_mesh open_shape(size_t i)
{
    apsm_mesh ball = shape_icosphere(LEVEL), part;
    double *below = malloc(ball.nv * sizeof *below);
    for (size_t v = 0; v < ball.nv; v++) below[v] = height - ball.V[3 * v + 2];
    assert_int_equal(apsm_mesh_clip_field(&ball, below, &part), APSM_OK);
    for (size_t v = 0; v < part.nv; v++) {
        const double u[3] = { part.V[3 * v], part.V[3 * v + 1], part.V[3 * v + 2] };
        double unit[3] = { u[0], u[1], u[2] };
        vec3_normalise(unit);
        synthetic_map(SYNTHETIC_ELLIPSOID, i, I, unit, part.V + 3 * v);
    }
    free(below);
    apsm_mesh_free(&ball);
    return part;
}

static void make_scene(scene *s, bool with_fields)
{
    apsm_mesh mesh[I];
    double M[16 * I] = { 0 };
    const char *const names[I] = { "a", "b", "c", "d" };
    s->ctx = apsm_context_new();
    s->o = apsm_optimize_defaults();
    s->o.particles = J;
    for (size_t i = 0; i < I; i++) {
        mesh[i] = open_shape(i);
        for (size_t c = 0; c < 4; c++) M[16 * i + 5 * c] = 1;
    }
    const double h = apsm_expected_spacing(apsm_mesh_area(&mesh[1]), J);
    const apsm_cohort_input in = { I, names, mesh, M, 1 };
    assert_int_equal(apsm_cohort_build(s->ctx, &in, with_fields ? h / 8 : 0, h / 4, &s->cohort),
                     APSM_OK);
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
}

static void free_scene(scene *s)
{
    apsm_cohort_free(&s->cohort);
    apsm_context_free(s->ctx);
}

/* Which particles of the template are on its rim; as many as the spacing asks for. */
static void find_seats(const scene *s, bool on[J])
{
    const apsm_shape *t = &s->cohort.shape[1];
    size_t n = 0;
    apsm_shape_find_on_rim(t, J, s->P + 3 * J, on);
    for (size_t j = 0; j < J; j++) n += on[j];
    const double h = apsm_expected_spacing(apsm_mesh_area(&t->mesh), J);
    const double expected = apsm_rim_length(&t->rim) / h;
    assert_true(fabs((double)n - expected) < 1.0);
}

/* All particles on the surfaces, those of the rim on the rims. */
static void assert_rim_to_rim(const scene *s, const bool on[J])
{
    for (size_t i = 0; i < I; i++) {
        const apsm_shape *shape = &s->cohort.shape[i];
        const double h = apsm_expected_spacing(apsm_mesh_area(&shape->mesh), J);
        for (size_t j = 0; j < J; j++) {
            apsm_closest c;
            apsm_rim_point p;
            const double *x = s->P + 3 * (i * J + j);
            apsm_bvh_closest(shape->bvh, x, INFINITY, &c);
            assert_true(c.distance2 < 1e-12 * h * h);
            if (!on[j]) continue;
            apsm_rim_closest(&shape->rim, x, &p);
            if (on[j]) assert_true(p.distance2 < 1e-12 * h * h);
        }
    }
}

/* Mean distance of particles of shape i from the images of the template's, in spacings: by the
 * vertex of the template next to a particle, whose image is the vertex of that number. */
static double truth_error(const scene *s, size_t i)
{
    const apsm_mesh *t = &s->cohort.shape[1].mesh, *m = &s->cohort.shape[i].mesh;
    const double h = apsm_expected_spacing(apsm_mesh_area(t), J);
    double sum = 0.0;
    for (size_t j = 0; j < J; j++) {
        apsm_closest c;
        apsm_bvh_closest(s->cohort.shape[1].bvh, s->P + 3 * (J + j), INFINITY, &c);
        double x[3];
        apsm_surface_position(m, &c.on, x);
        sum += sqrt(vec3_distance2(x, s->P + 3 * (i * J + j)));
    }
    return sum / (h * J);
}

static void rim_goes_to_rim(void **state)
{
    (void)state;
    scene s;
    bool on[J], later[J];
    make_scene(&s, true);
    assert_int_equal(apsm_first_particles(s.ctx, &s.cohort, &s.o, J, s.P), APSM_OK);
    find_seats(&s, on);
    assert_rim_to_rim(&s, on);
    apsm_optimizer_state at;
    assert_int_equal(apsm_optimizer_state_alloc(I, J, &at), APSM_OK);
    memcpy(at.P, s.P, sizeof s.P);
    assert_int_equal(apsm_optimize(s.ctx, &s.cohort, &s.o, &at, NULL, NULL), APSM_OK);
    memcpy(s.P, at.P, sizeof s.P);
    apsm_optimizer_state_free(&at);
    find_seats(&s, later);
    assert_memory_equal(on, later, sizeof on);
    assert_rim_to_rim(&s, on);
    /* The closed ellipsoids end at 0.018 spacings, the open ones too. */
    for (size_t i = 0; i < I; i++) assert_true(truth_error(&s, i) < 0.03);
    free_scene(&s);
}

/* The second goes back from the third, to where the first has come: that goes back, too.  The
 * fourth is not of the rim. */
static void crowded_rim_particles_keep_apart(void **state)
{
    (void)state;
    const bool on[4] = { true, true, true, false };
    const double before[12] = { 0, 0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0 };
    double P[12] = { 0.9, 0, 0, 1.6, 0, 0, 1.8, 0, 0, 1.7, 0, 0 };
    keep_rim_apart(4, on, 0.4, before, P);
    assert_memory_equal(P, before, 9 * sizeof *P);
    assert_true(P[9] == 1.7);
}

/* Near-surface points come from above and below the surface, not from beyond its rim. */
static void nothing_is_drawn_beyond_the_rim(void **state)
{
    (void)state;
    enum { N = 4000 };
    scene s;
    make_scene(&s, true);
    const apsm_shape *shape = &s.cohort.shape[0];
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    double *B = malloc(4 * N * sizeof *B);
    apsm_field_draw(shape->field, &rng, apsm_field_band(shape->field), N, B, B + 3 * N);
    for (size_t k = 0; k < N; k++) {
        apsm_closest c;
        double n[3], to[3];
        apsm_bvh_closest(shape->bvh, B + 3 * k, INFINITY, &c);
        if (!apsm_rim_has(&shape->rim, &shape->topology, &c.on)) continue;
        apsm_surface_normal(&shape->mesh, shape->VN, &c.on, n);
        vec3_sub(B + 3 * k, c.x, to);
        assert_true(fabs(vec3_dot(to, n)) > 0.4 * vec3_norm(to));
    }
    free(B);
    free_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rim_goes_to_rim),
        cmocka_unit_test(crowded_rim_particles_keep_apart),
        cmocka_unit_test(nothing_is_drawn_beyond_the_rim),
    };
    return cmocka_run_group_tests_name("rim", tests, NULL, NULL);
}
