/* The fidelity stage, equation (12). */
#include <math.h>
#include <string.h>

#include "check.h"
#include "cmocka_all.h"
#include "core/random.h"
#include "geometry/vec3.h"
#include "initialize/farthest_point.h"
#include "optimize/correspondence_loss.h"
#include "optimize/fidelity_shape.h"
#include "optimize/optimizer.h"
#include "optimize/snap.h"
#include "synthetic.h"

enum { I = 6, J = 48, LEVEL = 4 };

typedef struct scene {
    apsm_context *ctx;
    apsm_cohort cohort;
    double P[I * J * 3];
} scene;

static double noise(size_t k)
{
    return synthetic_weyl(k, 0.6180339887498949);
}

/* A cohort whose particles are true images of the template's, moved along the surface by up to
 * `error`, everything `size` times as large. */
static void make_scene(scene *s, synthetic_kind kind, double error, double size)
{
    apsm_mesh mesh[I];
    double M[16 * I] = { 0 };
    const char *const names[I] = { "a", "b", "c", "d", "e", "f" };
    s->ctx = apsm_context_new();
    assert_non_null(s->ctx);
    for (size_t i = 0; i < I; i++) {
        mesh[i] = synthetic_shape(kind, i, I, LEVEL);
        for (size_t x = 0; x < 3 * mesh[i].nv; x++) mesh[i].V[x] *= size;
        for (size_t c = 0; c < 4; c++) M[16 * i + 5 * c] = 1;
    }
    const apsm_cohort_input in = { I, names, mesh, M, 0 };
    assert_int_equal(apsm_cohort_build(s->ctx, &in, 0, 0, &s->cohort), APSM_OK);
    uint32_t order[J];
    double *nearest = malloc(mesh[0].nv * sizeof *nearest);
    apsm_geodesic_work *w = NULL;
    assert_int_equal(apsm_geodesic_work_new(s->cohort.shape[0].geodesic, &w), APSM_OK);
    assert_int_equal(
        apsm_farthest_vertices(s->cohort.shape[0].geodesic, w, 5, J, order, NULL, nearest),
        APSM_OK);
    apsm_geodesic_work_free(w);
    free(nearest);
    for (size_t i = 0; i < I; i++)
        for (size_t j = 0; j < J; j++)
            for (size_t c = 0; c < 3; c++) {
                const size_t x = (i * J + j) * 3 + c;
                s->P[x] = mesh[i].V[3 * (size_t)order[j] + c];
                if (i > 0) s->P[x] += size * error * noise(x);
            }
    for (size_t i = 0; i < I; i++) {
        apsm_surface_point S[J];
        double X[J * 3];
        apsm_shape_look_up(&s->cohort.shape[i], J, s->P + i * J * 3, S, X, NULL);
        memcpy(s->P + i * J * 3, X, sizeof X);
        apsm_mesh_free(&mesh[i]);
    }
}

static void free_scene(scene *s)
{
    apsm_cohort_free(&s->cohort);
    apsm_context_free(s->ctx);
}

static double truth_error(const scene *s, const double *P)
{
    double sum = 0;
    for (size_t i = 1; i < I; i++)
        sum += synthetic_truth_error(s->cohort.shape[i].bvh, &s->cohort.shape[0].mesh, J,
                                     P + i * J * 3, P);
    return sum / (I - 1);
}

static double distance_of(const apsm_fidelity *f, size_t i, const double *P, fidelity_work *w)
{
    memcpy(w->b.P, P, J * 3 * sizeof *P);
    fidelity_measure(f, i, 0, &w->b, w);
    return w->b.distance;
}

static apsm_fidelity *new_stage(scene *s, const apsm_fidelity_options *o)
{
    apsm_fidelity *f = NULL;
    assert_int_equal(apsm_fidelity_new(s->ctx, &s->cohort, J, s->P, o, &f), APSM_OK);
    return f;
}

static void run_all(scene *s, const apsm_fidelity_options *o, double *P)
{
    apsm_fidelity *f = new_stage(s, o);
    double P0[I * J * 3];
    memcpy(P, s->P, sizeof s->P);
    memcpy(P0, s->P, sizeof s->P);
    for (long k = 0; k < o->fidelity_rounds; k++) {
        apsm_fidelity_record r;
        assert_int_equal(apsm_fidelity_round(s->ctx, f, k, P0, P, &r), APSM_OK);
        if (k < o->fidelity_rounds / 2) assert_true(r.after <= r.before);
        if (k == 0) assert_true(r.moved > 0); /* later ones may find nothing better */
    }
    apsm_fidelity_free(f);
}

/* ---- the objective ---- */

/* Moves of all particles along their tangents, without the way back to the surface. */
static void shift(const apsm_fidelity *f, const fidelity_state *from, const double *tangent,
                  const double *d, double t, double *P)
{
    for (size_t j = 0; j < J; j++)
        for (size_t c = 0; c < 3; c++)
            P[3 * j + c] =
                from->P[3 * j + c] +
                f->h * t * (d[2 * j] * tangent[6 * j + c] + d[2 * j + 1] * tangent[6 * j + 3 + c]);
}

static fidelity_weights some_weights(const apsm_fidelity_prior *prior, size_t i, const double *from)
{
    const size_t fold = i % prior->folds;
    return (fidelity_weights){ .stay = 30,
                               .smooth = 20,
                               .from = from,
                               .prior = 40,
                               .order = 50,
                               .mean = prior->mean + fold * 3 * J,
                               .modes = prior->modes,
                               .mode = prior->mode + fold * prior->modes * 3 * J,
                               .weight = prior->weight + fold * prior->modes,
                               .noise = sqrt(prior->noise[fold]) };
}

/* A stage with a prior of two modes and scratch for it. */
typedef struct prior_scene {
    scene s;
    apsm_fidelity *f;
    apsm_fidelity_prior prior;
    fidelity_work w;
} prior_scene;

static void make_prior_scene(prior_scene *p)
{
    const apsm_fidelity_options o = apsm_fidelity_defaults();
    make_scene(&p->s, SYNTHETIC_BUMP, 4, 1);
    p->f = new_stage(&p->s, &o);
    assert_int_equal(apsm_fidelity_prior_fit(p->s.ctx, I, J, p->s.P, p->f->h, 2, NULL, &p->prior),
                     APSM_OK);
    assert_int_equal(p->prior.modes, 2);
    assert_int_equal(fidelity_work_alloc(p->f, p->prior.modes, &p->w), APSM_OK);
}

static void free_prior_scene(prior_scene *p)
{
    fidelity_work_free(&p->w);
    apsm_fidelity_prior_free(&p->prior);
    apsm_fidelity_free(p->f);
    free_scene(&p->s);
}

/* What is followed through a move is what a search finds there, of the same vertices. */
static void test_follows(void **state)
{
    (void)state;
    prior_scene p;
    make_prior_scene(&p);
    const size_t i = 2;
    size_t same = 0;
    double followed[2];
    fidelity_state *a = &p.w.a, *b = &p.w.b;
    memcpy(a->P, p.s.P + i * J * 3, 3 * J * sizeof *a->P);
    for (size_t x = 0; x < 3 * J; x++) b->P[x] = a->P[x] + 0.1 * p.f->h * noise(x + 3);
    fidelity_measure(p.f, i, 2, a, &p.w);
    fidelity_follow(p.f, i, a, b, &p.w);
    const size_t n = b->n, pulls = b->pulls;
    followed[0] = a->distance;
    followed[1] = b->distance;
    for (size_t k = 0; k < n; k++) a->match[k] = b->match[k];
    fidelity_measure(p.f, i, 2, b, &p.w);
    assert_true(fabs(followed[1] - followed[0]) > 0.05 * followed[0]); /* it was a move */
    assert_near(followed[1], b->distance, 0.01 * b->distance);
    assert_true(n == b->n && pulls == b->pulls);
    for (size_t k = 0; k < n; k++) {
        assert_int_equal(a->match[k].vertex, b->match[k].vertex);
        assert_true(a->match[k].distance >= b->match[k].distance - 1e-12);
        same += a->match[k].distance <= b->match[k].distance + 1e-12;
    }
    assert_true(same > n * 9 / 10);
    free_prior_scene(&p);
}

/* The gradient that Gauss-Newton takes is that of the value, and the matrix that of the quadratic
 * terms. */
static void test_gradient(void **state)
{
    (void)state;
    prior_scene p;
    make_prior_scene(&p);
    const apsm_fidelity *f = p.f;
    const size_t i = 3;
    double d[2 * J], from[3 * J];
    fidelity_weights q = some_weights(&p.prior, i, from);
    for (size_t x = 0; x < 3 * J; x++) from[x] = p.s.P[i * J * 3 + x] + f->h * 0.1 * noise(x + 7);
    memcpy(p.w.a.P, p.s.P + i * J * 3, 3 * J * sizeof *p.w.a.P);
    fidelity_set_prior(f, &q, p.w.a.P, &p.w);
    apsm_shape_look_up(&p.s.cohort.shape[i], J, p.w.a.P, p.w.a.S, NULL, p.w.a.N);
    fidelity_measure(f, i, 0, &p.w.a, &p.w);
    assert_true(fidelity_linearise(f, i, &p.w.a, &p.w) > 0);
    fidelity_add_quadratic(f, &q, &p.w.a, &p.w);
    for (size_t x = 0; x < 2 * J; x++) d[x] = noise(3 * x + 1);
    double slope = 0, curve = 0, value[2];
    for (size_t x = 0; x < 2 * J; x++) {
        slope += p.w.g[x] * d[x];
        for (size_t y = 0; y < x; y++) curve += 2 * p.w.H[x * 2 * J + y] * d[x] * d[y];
        curve += p.w.H[x * 2 * J + x] * d[x] * d[x];
    }
    const double t = 1e-6;
    for (int k = 0; k < 2; k++) {
        shift(f, &p.w.a, p.w.tangent, d, k ? t : -t, p.w.b.P);
        fidelity_measure(f, i, 0, &p.w.b, &p.w);
        fidelity_value(f, &q, &p.w.b, &p.w);
        value[k] = p.w.b.value;
    }
    const double difference = (value[1] - value[0]) / (2 * t);
    if (!(fabs(difference - slope) < 1e-4 * fabs(slope)))
        fail_msg("slope %.9g by differences, %.9g by the gradient", difference, slope);

    /* the order of the particles does take part in that */
    const double ordered = p.w.b.value;
    q.order = 0;
    fidelity_value(f, &q, &p.w.b, &p.w);
    assert_true(p.w.b.value < 0.99 * ordered);

    /* and so do the pull to where the stage began and what is not smooth */
    double *const weight[] = { &q.stay, &q.smooth };
    for (int k = 0; k < 2; k++) {
        const double with = p.w.b.value, kept = *weight[k];
        *weight[k] = 0;
        fidelity_value(f, &q, &p.w.b, &p.w);
        assert_true(p.w.b.value < 0.999 * with);
        *weight[k] = kept;
        fidelity_value(f, &q, &p.w.b, &p.w);
    }

    /* quadratic terms alone: H by second differences, exactly */
    double quadratic[3];
    memset(p.w.H, 0, 4 * J * J * sizeof *p.w.H);
    memset(p.w.g, 0, 2 * J * sizeof *p.w.g);
    fidelity_add_quadratic(f, &q, &p.w.a, &p.w);
    curve = 0;
    for (size_t x = 0; x < 2 * J; x++) {
        for (size_t y = 0; y < x; y++) curve += 2 * p.w.H[x * 2 * J + y] * d[x] * d[y];
        curve += p.w.H[x * 2 * J + x] * d[x] * d[x];
    }
    for (int k = 0; k < 3; k++) {
        shift(f, &p.w.a, p.w.tangent, d, 0.01 * (k - 1), p.w.b.P);
        p.w.b.n = 0;
        fidelity_value(f, &q, &p.w.b, &p.w);
        quadratic[k] = p.w.b.value;
    }
    const double second = (quadratic[0] - 2 * quadratic[1] + quadratic[2]) / 1e-4;
    if (!(fabs(second - curve) < 1e-6 * curve))
        fail_msg("curvature %.9g by differences, %.9g by the matrix", second, curve);
    free_prior_scene(&p);
}

/* What is smooth is the way from half-way between the other shapes' mean and the template: at that
 * place it costs nothing, at the mean and on the template as much as half of what is between. */
static void test_smooth_from(void **state)
{
    (void)state;
    prior_scene p;
    make_prior_scene(&p);
    const apsm_fidelity *f = p.f;
    fidelity_weights q = some_weights(&p.prior, 3, p.s.P);
    double value[3];
    q.stay = q.prior = q.order = 0;
    p.w.a.n = p.w.a.contacts = 0;
    for (int k = 0; k < 3; k++) {
        for (size_t x = 0; x < 3 * J; x++)
            p.w.a.P[x] = (1 - k / 2.0) * f->h * q.mean[x] + k / 2.0 * f->T[x];
        fidelity_value(f, &q, &p.w.a, &p.w);
        value[k] = p.w.a.value;
    }
    assert_near(f->o.common, 0.5, 0);
    assert_true(value[0] > 1e-6);
    assert_near(value[1], 0, 1e-9 * value[0]);
    assert_near(value[2], value[0], 1e-9 * value[0]);
    free_prior_scene(&p);
}

/* A ball whose surface just touches that of shape i at vertex v, from outside. */
static void put_ball(scene *s, size_t i, size_t v, double radius)
{
    const apsm_shape *shape = &s->cohort.shape[i];
    apsm_mesh ball = shape_sphere(3, radius);
    for (size_t x = 0; x < 3 * ball.nv; x++)
        ball.V[x] += shape->mesh.V[3 * v + x % 3] + 1.01 * radius * shape->VN[3 * v + x % 3];
    assert_int_equal(apsm_obstacles_add(&s->cohort.obstacles, i, &ball), APSM_OK);
    assert_null(ball.V);
}

/* Depths, in h, of the warped template in the obstacles. */
static double depth_of(const apsm_fidelity *f, size_t i, const double *P, fidelity_work *w)
{
    double sum = 0;
    distance_of(f, i, P, w);
    for (size_t k = w->b.n; k < w->b.n + w->b.contacts; k++) sum += w->b.match[k].distance;
    return sum;
}

/* What lies in another part is pushed out of it: the term's gradient is that of its value, its
 * matrix positive; and the stage leaves less in there than without, where anything is. */
static void test_contacts(void **state)
{
    (void)state;
    enum { OF = 3 };
    apsm_fidelity_options o = apsm_fidelity_defaults();
    double depth[2], P[I * J * 3];
    scene s;
    o.prior = 550; /* held back, so that without the penalty some of the surface ends in balls */
    o.stay = 0.02;
    o.recall = 0;
    make_scene(&s, SYNTHETIC_BUMP, 4, 1);
    assert_int_equal(apsm_obstacles_begin(I, &s.cohort.obstacles), APSM_OK);
    for (size_t v = 0; v < s.cohort.shape[OF].mesh.nv; v += 97) put_ball(&s, OF, v, 9);
    apsm_fidelity *f = new_stage(&s, &o);
    fidelity_work w;
    assert_int_equal(fidelity_work_alloc(f, 2, &w), APSM_OK);
    memcpy(w.a.P, s.P + OF * J * 3, 3 * J * sizeof *w.a.P);
    apsm_shape_look_up(&s.cohort.shape[OF], J, w.a.P, w.a.S, NULL, w.a.N);
    fidelity_measure(f, OF, 0, &w.a, &w);
    assert_true(w.a.contacts > 5);
    const fidelity_weights q = { .contact = 3, .shape = OF };
    double d[2 * J], slope = 0, curve = 0, value[2];
    fidelity_linearise(f, OF, &w.a, &w);
    memset(w.H, 0, 4 * J * J * sizeof *w.H);
    memset(w.g, 0, 2 * J * sizeof *w.g);
    fidelity_add_contacts(f, &q, &w.a, &w);
    for (size_t x = 0; x < 2 * J; x++) d[x] = noise(3 * x + 1);
    for (size_t x = 0; x < 2 * J; x++) {
        slope += w.g[x] * d[x];
        for (size_t y = 0; y <= x; y++) curve += (2 - (x == y)) * w.H[x * 2 * J + y] * d[x] * d[y];
    }
    const double t = 1e-6;
    for (int k = 0; k < 2; k++) {
        shift(f, &w.a, w.tangent, d, k ? t : -t, w.b.P);
        fidelity_measure(f, OF, 0, &w.b, &w);
        w.b.value = 0;
        fidelity_value_contacts(&q, &w.b);
        value[k] = w.b.value;
    }
    const double difference = (value[1] - value[0]) / (2 * t);
    if (!(fabs(difference - slope) < 1e-4 * fabs(slope)) || !(curve > 0))
        fail_msg("slope %.9g by differences, %.9g by the gradient; curve %g", difference, slope,
                 curve);
    apsm_fidelity_free(f);
    for (int k = 0; k < 2; k++) {
        o.contact = k ? 30 : 0;
        run_all(&s, &o, P);
        o.contact = 4; /* to measure */
        f = new_stage(&s, &o);
        depth[k] = depth_of(f, OF, P + OF * J * 3, &w);
        apsm_fidelity_free(f);
    }
    if (!(depth[0] > 0) || !(depth[1] < 0.5 * depth[0]))
        fail_msg("depth %g with the penalty, %g without", depth[1], depth[0]);
    fidelity_work_free(&w);
    free_scene(&s);
}

/* Obstacles that nothing touches change no byte. */
static void test_far_obstacles(void **state)
{
    (void)state;
    const apsm_fidelity_options o = apsm_fidelity_defaults();
    double P[I * J * 3], Q[I * J * 3];
    scene s;
    make_scene(&s, SYNTHETIC_BUMP, 4, 1);
    run_all(&s, &o, P);
    assert_int_equal(apsm_obstacles_begin(I, &s.cohort.obstacles), APSM_OK);
    apsm_mesh ball = shape_sphere(2, 5);
    for (size_t x = 0; x < 3 * ball.nv; x++) ball.V[x] += 300;
    assert_int_equal(apsm_obstacles_add(&s.cohort.obstacles, 2, &ball), APSM_OK);
    ball = shape_sphere(2, 100);
    ball.nf -= 9; /* open: nothing lies in it */
    assert_int_equal(apsm_obstacles_add(&s.cohort.obstacles, 2, &ball), APSM_OK);
    assert_int_equal(s.cohort.obstacles.n[2], 1);
    run_all(&s, &o, Q);
    assert_memory_equal(P, Q, sizeof P);
    free_scene(&s);
}

/* A plate that lies two thirds of its thickness off is matched side by side, not with the side that
 * happens to be closer. */
static void test_sides_of_sheets(void **state)
{
    (void)state;
    scene s;
    make_scene(&s, SYNTHETIC_PLATE, 0, 1);
    const apsm_fidelity_options o = apsm_fidelity_defaults();
    apsm_fidelity *f = new_stage(&s, &o);
    fidelity_work w;
    const size_t i = 3;
    const apsm_shape *shape = &s.cohort.shape[i];
    assert_int_equal(fidelity_work_alloc(f, 0, &w), APSM_OK);
    assert_true(shape->half_thickness < 0.5 * f->h);
    memcpy(w.a.P, s.P + i * J * 3, J * 3 * sizeof *w.a.P);
    for (size_t j = 0; j < J; j++) w.a.P[3 * j + 2] += 1.3 * shape->half_thickness;
    fidelity_measure(f, i, 0, &w.a, &w);
    size_t wrong = 0;
    for (size_t k = 0; k < w.a.pulls; k++) {
        const fidelity_match *m = &w.a.match[k];
        double n[3], cosine = 0;
        apsm_surface_normal(&shape->mesh, shape->VN, &m->on, n);
        for (size_t c = 0; c < 3; c++) cosine += n[c] * w.YN[3 * (size_t)m->vertex + c];
        wrong += cosine < 0;
    }
    print_message("%zu of %zu on the wrong side\n", wrong, w.a.pulls);
    assert_true(20 * wrong < w.a.pulls); /* rims */

    /* what lands from beyond the middle of the sheet lands on its own side */
    size_t turned = 0;
    const size_t nv = shape->mesh.nv;
    for (size_t v = 0; v < nv; v++) {
        const double *n = shape->VN + 3 * v;
        double x[3], is[3], cosine = 0;
        apsm_surface_point on;
        for (size_t c = 0; c < 3; c++)
            x[c] = shape->mesh.V[3 * v + c] - 1.4 * shape->half_thickness * n[c];
        fidelity_land(shape, false, n, x, &on);
        apsm_surface_normal(&shape->mesh, shape->VN, &on, is);
        for (size_t c = 0; c < 3; c++) cosine += is[c] * n[c];
        turned += cosine < 0;
    }
    print_message("%zu of %zu landed on the other side\n", turned, nv);
    assert_true(8 * turned < nv); /* rims; without sides more than half */
    fidelity_work_free(&w);
    apsm_fidelity_free(f);
    free_scene(&s);
}

/* ---- the prior ---- */

/* Two directions and a little noise are found as two modes, orthonormal, with that noise. */
static void test_prior_finds_modes(void **state)
{
    (void)state;
    enum { SHAPES = 24, D = 3 * J };
    double P[SHAPES * D];
    apsm_context *ctx = apsm_context_new();
    apsm_fidelity_prior p;
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    for (size_t i = 0; i < SHAPES; i++) {
        const double a = 8 * apsm_random_normal(&rng), b = 4 * apsm_random_normal(&rng);
        for (size_t x = 0; x < D; x++)
            P[i * D + x] = 50 * noise(x) + a * synthetic_weyl(x, 0.41421356) +
                           b * synthetic_weyl(x, 0.73205081) + 0.1 * apsm_random_normal(&rng);
    }
    assert_int_equal(apsm_fidelity_prior_fit(ctx, SHAPES, J, P, 2, -1, NULL, &p), APSM_OK);
    assert_int_equal(p.folds, SHAPES);
    assert_int_equal(p.modes, 2);
    assert_true(p.gain > 0);
    for (size_t fold = 0; fold < p.folds; fold++) {
        const double *u = p.mode + fold * 2 * D, *v = u + D;
        double uu = 0, uv = 0, vv = 0;
        for (size_t x = 0; x < D; x++) uu += u[x] * u[x], uv += u[x] * v[x], vv += v[x] * v[x];
        assert_true(fabs(uu - 1) < 1e-9 && fabs(vv - 1) < 1e-9 && fabs(uv) < 1e-9);
        const double sd = sqrt(p.noise[fold]) * 2;
        if (!(sd > 0.08 && sd < 0.11)) fail_msg("noise %g", sd);
        for (size_t k = 0; k < 2; k++)
            assert_true(p.weight[fold * 2 + k] > 0.9 && p.weight[fold * 2 + k] < 1);
    }
    /* a shape's own model does not know it */
    P[0] += 1000;
    apsm_fidelity_prior q;
    assert_int_equal(apsm_fidelity_prior_fit(ctx, SHAPES, J, P, 2, 2, NULL, &q), APSM_OK);
    for (size_t x = 0; x < D; x++) assert_true(fabs(p.mean[x] - q.mean[x]) < 1e-9);
    apsm_fidelity_prior_free(&p);
    apsm_fidelity_prior_free(&q);

    /* nor does any model know a shape that is left out */
    bool left_out[SHAPES] = { [3] = true };
    assert_int_equal(apsm_fidelity_prior_fit(ctx, SHAPES, J, P, 2, 2, left_out, &p), APSM_OK);
    P[3 * D + 5] -= 500;
    assert_int_equal(apsm_fidelity_prior_fit(ctx, SHAPES, J, P, 2, 2, left_out, &q), APSM_OK);
    for (size_t x = 0; x < SHAPES * D; x++) assert_true(fabs(p.mean[x] - q.mean[x]) < 1e-6);
    apsm_fidelity_prior_free(&p);
    apsm_fidelity_prior_free(&q);
    apsm_context_free(ctx);
}

static double squared_norm(const double v[3])
{
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

/* e' S e is the least over the modes' scores b of sum v_j |e - sum_k b_k u_k|_j^2 +
 * sum_k (1 / weight_k - 1) b_k^2. */
static double with_scores(const fidelity_weights *q, const double *v, const double *e,
                          const double *b)
{
    double sum = 0;
    for (size_t j = 0; j < J; j++) {
        double r[3];
        for (size_t c = 0; c < 3; c++) {
            r[c] = e[3 * j + c];
            for (size_t k = 0; k < q->modes; k++) r[c] -= b[k] * q->mode[k * 3 * J + 3 * j + c];
        }
        sum += v[j] * squared_norm(r);
    }
    for (size_t k = 0; k < q->modes; k++) sum += (1 / q->weight[k] - 1) * b[k] * b[k];
    return sum;
}

/* What is left of the prior alone at particles P. */
static double prior_alone(const apsm_fidelity *f, const fidelity_weights *q, const double *P,
                          fidelity_work *w)
{
    memcpy(w->b.P, P, 3 * J * sizeof *P);
    w->b.n = 0;
    fidelity_value(f, q, &w->b, w);
    return w->b.value;
}

static void test_prior_counts_distances(void **state)
{
    (void)state;
    prior_scene p;
    make_prior_scene(&p);
    const apsm_fidelity *f = p.f;
    double P[3 * J], e[3 * J];
    fidelity_weights q = some_weights(&p.prior, 2, p.s.P);
    q.stay = q.smooth = q.order = 0;
    q.prior = 2;
    /* the mean, scores on both modes, one particle far off, the others by what is usual */
    for (size_t j = 0; j < J; j++)
        for (size_t c = 0; c < 3; c++) {
            const size_t x = 3 * j + c;
            e[x] = 2 * q.mode[x] - 1.5 * q.mode[3 * J + x] + (j == 5 ? 20 : 1) * q.noise * noise(x);
            P[x] = f->h * (q.mean[x] + e[x]);
        }
    fidelity_set_prior(f, &q, P, &p.w);
    assert_true(p.w.v[5] <= 0.25 + 1e-12);
    size_t usual = 0;
    for (size_t j = 0; j < J; j++) {
        assert_true(p.w.v[j] >= 0.25 - 1e-12 && p.w.v[j] <= 4 + 1e-12);
        usual += p.w.v[j] > 0.5;
    }
    assert_true(2 * usual > J);
    const double value = prior_alone(f, &q, P, &p.w);
    double b[2] = { 0, 0 }, least = INFINITY;
    for (double a = -1, n = 4001, k = 0; k < n; k++) /* the scores by search, in turns */
        for (size_t m = 0; m < 2; m++) {
            const double at = b[m], step = a * pow(0.99, k);
            const double here = with_scores(&q, p.w.v, e, b);
            b[m] = at + step;
            const double up = with_scores(&q, p.w.v, e, b);
            b[m] = at - step;
            const double down = with_scores(&q, p.w.v, e, b);
            b[m] = up < here && up <= down ? at + step : down < here ? at - step : at;
            least = fmin(least, fmin(here, fmin(up, down)));
        }
    if (!(fabs(value - least) < 1e-6 * least))
        fail_msg("%.12g is not the least: %.12g", value, least);
    free_prior_scene(&p);
}

/* What displacements u of the template's particles cost: u' Q u over |u|^2. */
static double cost(const double *Q, const double *u)
{
    double sum = 0, norm = 0;
    for (size_t j = 0; j < J; j++) {
        norm += u[j] * u[j];
        for (size_t k = 0; k < J; k++) sum += u[j] * Q[j * J + k] * u[k];
    }
    return sum / norm;
}

/* Affine displacements are free, waves as long as the shape cost little, and what differs from
 * particle to particle costs a hundred times that; in any unit. */
static void test_smoothness(void **state)
{
    (void)state;
    scene s;
    double Q[J * J], again[J * J], T[3 * J], u[3][J], price[3];
    make_scene(&s, SYNTHETIC_ELLIPSOID, 0, 1);
    assert_int_equal(fidelity_smoothness(J, s.P, Q), APSM_OK);
    for (size_t j = 0; j < J; j++) {
        u[0][j] = s.P[3 * j] - 0.5 * s.P[3 * j + 2];
        u[1][j] = sin(s.P[3 * j] / 25);
        u[2][j] = noise(j);
    }
    for (int k = 0; k < 3; k++) price[k] = cost(Q, u[k]);
    print_message("affine %.2g, long %.2g, rough %.2g\n", price[0], price[1], price[2]);
    assert_true(price[0] > 0 && price[0] < 1e-3 && price[1] < 1e-2 && price[2] > 100 * price[1]);
    for (size_t x = 0; x < 3 * J; x++) T[x] = 1000 * s.P[x] - 5;
    assert_int_equal(fidelity_smoothness(J, T, again), APSM_OK);
    for (size_t x = 0; x < J * J; x++) assert_true(fabs(again[x] - Q[x]) < 1e-7);
    for (size_t x = 0; x < 3 * J; x++) T[x] = 3;
    assert_int_equal(fidelity_smoothness(J, T, again), APSM_ERR_GEOMETRY);
    free_scene(&s);
}

/* The prior waits until the surfaces have had their say, and then weighs the less the better they
 * fit, compared with what the shapes differ by; at fidelity 1 it never does. */
static void test_doubt(void **state)
{
    (void)state;
    const synthetic_kind kinds[] = { SYNTHETIC_ELLIPSOID, SYNTHETIC_BUMP };
    double doubt[2], P[I * J * 3];
    for (int k = 0; k < 2; k++) {
        scene s;
        apsm_fidelity_options o = apsm_fidelity_defaults();
        o.fidelity_points = 400;
        make_scene(&s, kinds[k], 2, 1);
        apsm_fidelity *f = new_stage(&s, &o);
        memcpy(P, s.P, sizeof P);
        for (long round = 0; round <= o.fidelity_rounds / 2; round++) {
            apsm_fidelity_record r;
            assert_true(apsm_fidelity_doubt(f) == 0);
            assert_int_equal(apsm_fidelity_round(s.ctx, f, round, s.P, P, &r), APSM_OK);
        }
        doubt[k] = apsm_fidelity_doubt(f);
        apsm_fidelity_free(f);
        o.fidelity = 1;
        f = new_stage(&s, &o);
        for (long round = 0; round < o.fidelity_rounds; round++) {
            apsm_fidelity_record r;
            assert_int_equal(apsm_fidelity_round(s.ctx, f, round, s.P, P, &r), APSM_OK);
        }
        assert_true(apsm_fidelity_doubt(f) == 0);
        apsm_fidelity_free(f);
        free_scene(&s);
    }
    print_message("doubt: ellipsoids %.2g, bumps %.2g\n", doubt[0], doubt[1]);
    assert_true(doubt[0] > 0 && 20 * doubt[0] < doubt[1] && doubt[1] < 0.1);
}

/* ---- the stage ---- */

static void test_distance_never_grows(void **state)
{
    (void)state;
    scene s;
    double P[I * J * 3], before = 0, after = 0;
    make_scene(&s, SYNTHETIC_BUMP, 3, 1);
    apsm_fidelity_options o = apsm_fidelity_defaults();
    o.fidelity_points = 100000; /* all: what is measured is what is fitted */
    run_all(&s, &o, P);
    apsm_fidelity *f = new_stage(&s, &o);
    fidelity_work w;
    assert_int_equal(fidelity_work_alloc(f, 0, &w), APSM_OK);
    for (size_t i = 1; i < I; i++) {
        const double a = distance_of(f, i, s.P + i * J * 3, &w);
        const double b = distance_of(f, i, P + i * J * 3, &w);
        if (b > a) fail_msg("shape %zu: %.6g h became %.6g h", i, a, b);
        before += a;
        after += b;
    }
    if (!(after < 0.9 * before)) fail_msg("mean %.6g became %.6g", before / 5, after / 5);
    assert_memory_equal(P, s.P, J * 3 * sizeof *P); /* the template stays */
    for (size_t j = 0; j < I * J; j++) {            /* and all on their surfaces */
        apsm_closest c;
        apsm_bvh_closest(s.cohort.shape[j / J].bvh, P + 3 * j, INFINITY, &c);
        assert_true(c.distance2 < 1e-20);
    }
    fidelity_work_free(&w);
    apsm_fidelity_free(f);
    free_scene(&s);
}

/* Particles that are off by a tenth of h come no farther from the truth. */
/* A prior that wants the surfaces farther apart yields to them instead of stopping every step. */
static void test_strong_prior_yields(void **state)
{
    (void)state;
    double P[I * J * 3], before = 0, after = 0;
    scene s;
    apsm_fidelity_options o = apsm_fidelity_defaults();
    o.fidelity = 0.02;
    make_scene(&s, SYNTHETIC_PLATE, 1, 1);
    apsm_fidelity *f = new_stage(&s, &o);
    fidelity_work w;
    assert_int_equal(fidelity_work_alloc(f, 8, &w), APSM_OK);
    run_all(&s, &o, P);
    for (size_t i = 1; i < I; i++) {
        before += distance_of(f, i, s.P + i * J * 3, &w);
        after += distance_of(f, i, P + i * J * 3, &w);
    }
    if (!(after < 0.8 * before)) fail_msg("mean %.6g became %.6g", before / 5, after / 5);
    fidelity_work_free(&w);
    apsm_fidelity_free(f);
    free_scene(&s);
}

static void test_truth_error(void **state)
{
    (void)state;
    /* Around the bump an ellipsoid slides over itself, by up to 25 mm: no surface shows that, and
     * the pull to where the stage began, where most of it is right, has to be stronger. */
    const synthetic_kind kinds[] = { SYNTHETIC_ELLIPSOID, SYNTHETIC_PLATE, SYNTHETIC_BUMP };
    const double stay[] = { 0.02, 0.02, 1 }, most[] = { 0.2, 0.75, 1 };
    for (size_t k = 0; k < 3; k++) {
        scene s;
        double P[I * J * 3];
        make_scene(&s, kinds[k], 2, 1);
        apsm_fidelity_options o = apsm_fidelity_defaults();
        o.stay = stay[k];
        run_all(&s, &o, P);
        const double before = truth_error(&s, s.P), after = truth_error(&s, P);
        print_message("cohort %zu: truth error %.4g -> %.4g\n", k, before, after);
        if (!(after <= most[k] * before)) fail_msg("cohort %zu: %g -> %g", k, before, after);
        free_scene(&s);
    }
}

/* The first rounds move a part of the particles, then all have followed it, and the last rounds,
 * for which what is wrong with single particles is left, bring them near to the truth. */
static void test_coarse(void **state)
{
    (void)state;
    enum { FEW = 16 };
    scene s;
    double P[2][I * J * 3], distance[2] = { 0 };
    make_scene(&s, SYNTHETIC_ELLIPSOID, 2, 1);
    for (int k = 0; k < 2; k++) {
        apsm_fidelity_options o = apsm_fidelity_defaults();
        o.coarse = k ? FEW : 0;
        apsm_fidelity *f = new_stage(&s, &o);
        assert_int_equal(fidelity_coarse_rounds(f), k ? 6 : 0);
        memcpy(P[k], s.P, sizeof s.P);
        for (long round = 0; round < o.fidelity_rounds; round++) {
            apsm_fidelity_record r;
            assert_int_equal(apsm_fidelity_round(s.ctx, f, round, s.P, P[k], &r), APSM_OK);
            distance[k] = r.after;
            size_t moved = 0;
            for (size_t j = 0; j < J; j++) moved += P[k][3 * (J + j)] != s.P[3 * (J + j)];
            if (k && round < 5) assert_in_range(moved, 1, FEW);
            if (k && round == 5) assert_in_range(moved, FEW + 1, J);
        }
        apsm_fidelity_free(f);
    }
    const double before = truth_error(&s, s.P), few = truth_error(&s, P[1]);
    print_message("truth error %.4g -> %.4g, with all %.4g; distance %.4g, with all %.4g\n", before,
                  few, truth_error(&s, P[0]), distance[1], distance[0]);
    assert_true(few < 0.3 * before);
    assert_true(distance[1] < 1e-3);
    free_scene(&s);
}

/* Not on sheets thinner than the few are apart, nor where landmarks hold particles, nor of few. */
static void test_where_coarse(void **state)
{
    (void)state;
    const synthetic_kind kinds[] = { SYNTHETIC_ELLIPSOID, SYNTHETIC_PLATE };
    apsm_fidelity_options o = apsm_fidelity_defaults();
    for (size_t k = 0; k < 2; k++) {
        scene s;
        make_scene(&s, kinds[k], 2, 1);
        o.coarse = J / 2;
        apsm_fidelity *f = new_stage(&s, &o);
        assert_int_equal(fidelity_coarse_rounds(f), k == 0 ? o.fidelity_rounds / 2 : 0);
        s.cohort.anchors.hold = true;
        assert_int_equal(fidelity_coarse_rounds(f), 0);
        s.cohort.anchors.hold = false;
        apsm_fidelity_free(f);
        o.coarse = J / 2 + 1;
        f = new_stage(&s, &o);
        assert_int_equal(fidelity_coarse_rounds(f), 0);
        apsm_fidelity_free(f);
        free_scene(&s);
    }
}

static size_t place_of(const apsm_fidelity *f, size_t unknown)
{
    return 2 * (size_t)f->place[unknown / 2] + unknown % 2;
}

/* The matrix of the terms in q but the prior's modes, in the particles' order. */
static void matrix_of_terms(scene *s, const apsm_fidelity *f, const fidelity_weights *q, double *H)
{
    fidelity_work w;
    assert_int_equal(fidelity_work_alloc(f, 2, &w), APSM_OK);
    memcpy(w.a.P, s->P + q->shape * J * 3, 3 * J * sizeof *s->P);
    apsm_shape_look_up(&s->cohort.shape[q->shape], J, w.a.P, w.a.S, NULL, w.a.N);
    fidelity_measure(f, q->shape, 0, &w.a, &w);
    assert_true(w.a.contacts > 5);
    fidelity_linearise(f, q->shape, &w.a, &w);
    if (!w.H) w.H = check_alloc(4 * J * J);
    memset(w.H, 0, 4 * J * J * sizeof *w.H);
    if (w.sparse) fidelity_system_begin(f, w.tangent, &w.system);
    fidelity_add_quadratic(f, q, &w.a, &w);
    if (w.sparse) fidelity_system_form(f, &w.system, w.H);
    for (size_t x = 0; x < 2 * J; x++)
        for (size_t y = 0; y <= x; y++) {
            const size_t a = w.sparse ? place_of(f, x) : x, b = w.sparse ? place_of(f, y) : y;
            H[x * 2 * J + y] = w.H[(a > b ? a : b) * 2 * J + (a > b ? b : a)];
        }
    fidelity_work_free(&w);
}

/* Squared difference of the two, over the first's square. */
static double apart_by(const fidelity_weights *q, scene *s, apsm_fidelity *const f[2])
{
    double *H[2], all = 0, off = 0;
    for (int k = 0; k < 2; k++) {
        H[k] = check_alloc(4 * J * J);
        matrix_of_terms(s, f[k], q, H[k]);
    }
    for (size_t x = 0; x < 2 * J; x++)
        for (size_t y = 0; y <= x; y++) {
            const double a = H[0][x * 2 * J + y], b = H[1][x * 2 * J + y];
            all += a * a;
            off += (a - b) * (a - b);
        }
    free(H[0]);
    free(H[1]);
    assert_true(all > 0);
    return off / all;
}

/* Each term's matrix is the same in both; that of contacts but for the faint weights of the warp.
 */
static void test_sparse_terms(void **state)
{
    (void)state;
    enum { OF = 3 };
    double mean[3 * J];
    apsm_fidelity *f[2];
    apsm_fidelity_options o = apsm_fidelity_defaults();
    scene s;
    make_scene(&s, SYNTHETIC_BUMP, 4, 1);
    for (size_t j = 0; j < J; j += 7) /* some neighbours drift apart */
        memcpy(s.P + 3 * (OF * J + j), s.P + 3 * (OF * J + (j + 1) % J), 3 * sizeof *s.P);
    assert_int_equal(apsm_obstacles_begin(I, &s.cohort.obstacles), APSM_OK);
    for (size_t v = 0; v < s.cohort.shape[OF].mesh.nv; v += 97) put_ball(&s, OF, v, 9);
    for (int k = 0; k < 2; k++) {
        if (k) o.dense = 0;
        f[k] = new_stage(&s, &o);
    }
    for (size_t x = 0; x < 3 * J; x++) mean[x] = s.P[x] / f[0]->h;
    const fidelity_weights none = { .shape = OF, .from = s.P + OF * J * 3, .mean = mean };
    fidelity_weights q[4] = { none, none, none, none };
    q[0].stay = q[1].smooth = q[2].order = q[3].contact = 2;
    for (size_t k = 0; k < 4; k++) {
        const double apart = apart_by(&q[k], &s, f);
        print_message("term %zu: %.2g\n", k, sqrt(apart));
        assert_true(apart < (k == 3 ? 4e-4 : 1e-12));
    }
    apsm_fidelity_free(f[0]);
    apsm_fidelity_free(f[1]);
    free_scene(&s);
}

/* What is left out of H for many unknowns changes neither the gradient nor, by much, the matrix,
 * and the stage ends where it does with all of it. */
static void test_sparse(void **state)
{
    (void)state;
    scene s;
    double g[2][2 * J], norm[2], apart = 0, P[2][I * J * 3];
    apsm_fidelity *f[2];
    fidelity_work w[2];
    apsm_fidelity_options o = apsm_fidelity_defaults();
    make_scene(&s, SYNTHETIC_PLATE, 2, 1);
    for (int k = 0; k < 2; k++) {
        if (k) o.dense = 0;
        run_all(&s, &o, P[k]);
        f[k] = new_stage(&s, &o);
        assert_int_equal(fidelity_work_alloc(f[k], 2, &w[k]), APSM_OK);
        assert_int_equal(w[k].sparse, k);
        memcpy(w[k].a.P, s.P + 3 * J * 3, 3 * J * sizeof *s.P);
        apsm_shape_look_up(&s.cohort.shape[3], J, w[k].a.P, w[k].a.S, NULL, w[k].a.N);
        fidelity_measure(f[k], 3, 0, &w[k].a, &w[k]);
        assert_true(fidelity_linearise(f[k], 3, &w[k].a, &w[k]) > 0);
        memcpy(g[k], w[k].g, sizeof g[k]);
        norm[k] = 0;
    }
    w[1].H = check_alloc(4 * J * J);
    fidelity_system_form(f[1], &w[1].system, w[1].H);
    double size = 0, off = 0; /* the warp's weights are rounded */
    for (size_t x = 0; x < 2 * J; x++) {
        size = fmax(size, fabs(g[0][x]));
        off = fmax(off, fabs(g[0][x] - g[1][x]));
    }
    print_message("gradients agree to %.2g of the largest\n", off / size);
    assert_true(off < 1e-5 * size);
    for (size_t x = 0; x < 2 * J; x++)
        for (size_t y = 0; y <= x; y++) {
            const size_t at_x = place_of(f[1], x), at_y = place_of(f[1], y);
            const size_t first = at_x < at_y ? at_x : at_y, last = at_x < at_y ? at_y : at_x;
            const double a = w[0].H[x * 2 * J + y], b = w[1].H[last * 2 * J + first];
            norm[0] += a * a;
            norm[1] += (a - b) * (a - b);
        }
    for (size_t j = 0; j < I * J; j++) {
        const double d = sqrt(vec3_distance2(P[0] + 3 * j, P[1] + 3 * j)) / f[0]->h;
        apart += d / (I * J);
    }
    const double dense = truth_error(&s, P[0]), sparse = truth_error(&s, P[1]);
    print_message("of H %.3g is left out; particles end %.3g h apart; truth error %.4g and %.4g\n",
                  sqrt(norm[1] / norm[0]), apart, dense, sparse);
    assert_true(norm[1] > 0 && norm[1] < 1e-5 * norm[0]);
    assert_true(apart > 0 && apart < 0.05);
    assert_true(sparse < 1.02 * dense);
    for (int k = 0; k < 2; k++) {
        fidelity_work_free(&w[k]);
        apsm_fidelity_free(f[k]);
    }
    free_scene(&s);
}

/* Mismatched particles of all shapes but the template. */
static size_t mismatched(const scene *s, const double *P)
{
    apsm_neighbourhoods reference = { 0 }, rows = { 0 };
    uint32_t count[J];
    size_t sum = 0;
    for (size_t i = 0; i < I; i++) {
        const apsm_shape *shape = &s->cohort.shape[i];
        apsm_surface_point S[J];
        apsm_geodesic_work *w = NULL;
        const double factor = i == 0 ? APSM_REFERENCE_FACTOR : 2.0;
        apsm_shape_look_up(shape, J, P + i * J * 3, S, NULL, NULL);
        assert_int_equal(apsm_neighbourhoods_resize(i ? &rows : &reference, J), APSM_OK);
        assert_int_equal(apsm_geodesic_work_new(shape->geodesic, &w), APSM_OK);
        assert_int_equal(apsm_geodesic_neighbourhoods(shape->geodesic, w, J, S, P + i * J * 3,
                                                      factor, i ? &rows : &reference),
                         APSM_OK);
        if (i > 0) sum += apsm_mismatches(&reference, &rows, 2.0, count);
        apsm_geodesic_work_free(w);
    }
    apsm_neighbourhoods_free(&reference);
    apsm_neighbourhoods_free(&rows);
    return sum;
}

/* The term that keeps neighbours together also brings lost ones back. */
static void test_neighbours_stay(void **state)
{
    (void)state;
    scene s;
    double P[I * J * 3], Q[I * J * 3];
    make_scene(&s, SYNTHETIC_BUMP, 1.5, 1);
    apsm_fidelity_options o = apsm_fidelity_defaults();
    o.fidelity = 1;
    run_all(&s, &o, P);
    o.order = 0;
    run_all(&s, &o, Q);
    const size_t first = mismatched(&s, s.P), with = mismatched(&s, P), without = mismatched(&s, Q);
    print_message("mismatched: %zu at first, %zu with the term, %zu without\n", first, with,
                  without);
    assert_true(first > 20 && 3 * with < first && 3 * with < without);
    free_scene(&s);
}

/* Particle 20 of shape 2 has come close to a neighbour since the stage began: the last round sends
 * back who tore neighbours apart, and leaves the others where they are. */
static void test_faults_return(void **state)
{
    (void)state;
    scene s;
    double P[I * J * 3];
    make_scene(&s, SYNTHETIC_ELLIPSOID, 0.5, 1);
    assert_int_equal(mismatched(&s, s.P), 0);
    apsm_fidelity_options o = apsm_fidelity_defaults();
    o.fidelity = 1;
    o.order = 0;
    apsm_fidelity *f = new_stage(&s, &o);
    memcpy(P, s.P, sizeof P);
    double *shape = P + 2 * J * 3;
    const size_t neighbour = f->N6[20 * APSM_NEIGHBOURS];
    for (size_t c = 0; c < 3; c++)
        shape[60 + c] = 0.2 * shape[60 + c] + 0.8 * shape[3 * neighbour + c];
    apsm_snap_closest(s.cohort.shape[2].bvh, 1, shape + 60, NULL, NULL);
    assert_true(mismatched(&s, P) > 0);
    apsm_fidelity_record r;
    assert_int_equal(apsm_fidelity_round(s.ctx, f, o.fidelity_rounds - 1, s.P, P, &r), APSM_OK);
    assert_int_equal(r.kept, 1);
    assert_int_equal(mismatched(&s, P), 0);
    size_t moved = 0;
    for (size_t j = 0; j < J; j++)
        moved += memcmp(shape + 3 * j, s.P + (2 * J + j) * 3, 3 * sizeof *P) != 0;
    assert_int_equal(moved, J);
    apsm_fidelity_free(f);
    free_scene(&s);
}

static void test_threads_and_size(void **state)
{
    (void)state;
    scene s, large;
    double P[I * J * 3], Q[I * J * 3];
    apsm_fidelity_options o = apsm_fidelity_defaults();
    o.fidelity_rounds = 2;
    o.fidelity_points = 500;
    make_scene(&s, SYNTHETIC_PLATE, 2, 1);
    run_all(&s, &o, P);
    apsm_context_set_threads(s.ctx, 3);
    run_all(&s, &o, Q);
    assert_memory_equal(P, Q, sizeof P);
    make_scene(&large, SYNTHETIC_PLATE, 2, 8);
    for (size_t x = 0; x < I * J * 3; x++) assert_true(large.P[x] == 8 * s.P[x]);
    run_all(&large, &o, Q);
    for (size_t x = 0; x < I * J * 3; x++)
        if (Q[x] != 8 * P[x]) fail_msg("coordinate %zu: %.17g is not 8 * %.17g", x, Q[x], P[x]);
    free_scene(&large);
    free_scene(&s);
}

/* A run that stops after every round and goes on ends in the same bytes. */
typedef struct stopper {
    double P[I * J * 3], own[I * J * 3];
    long epoch, wanted;
} stopper;

static apsm_status stop_after(void *user, const apsm_optimizer_state *state,
                              const apsm_epoch_record *r)
{
    stopper *s = user;
    assert_int_equal(state->stage, APSM_STAGE_FIDELITY);
    assert_true(r->surface_error > 0 && isnan(r->alpha) && isnan(r->loss[APSM_TERM_SAMPLING]));
    if (state->epoch != s->wanted) return APSM_OK;
    memcpy(s->P, state->P, sizeof s->P);
    memcpy(s->own, state->own, sizeof s->own);
    return APSM_ERR_INTERRUPTED;
}

static void resume_with(long coarse)
{
    scene s;
    apsm_optimize_options o = apsm_optimize_defaults();
    apsm_optimizer_state whole, part;
    make_scene(&s, SYNTHETIC_ELLIPSOID, 2, 1);
    o.fidelity.fidelity_points = 400;
    o.fidelity.coarse = coarse;
    stopper stop = { .wanted = -1 };
    assert_int_equal(apsm_optimizer_state_alloc(I, J, &whole), APSM_OK);
    whole.stage = APSM_STAGE_FIDELITY;
    memcpy(whole.P, s.P, sizeof s.P);
    assert_int_equal(apsm_optimize(s.ctx, &s.cohort, &o, &whole, stop_after, &stop), APSM_OK);
    assert_int_equal(whole.stage, APSM_STAGE_DONE);
    assert_int_equal(whole.epochs_run, o.fidelity.fidelity_rounds);
    assert_int_equal(apsm_optimizer_state_alloc(I, J, &part), APSM_OK);
    part.stage = APSM_STAGE_FIDELITY;
    memcpy(part.P, s.P, sizeof s.P);
    for (stop.wanted = 2; stop.wanted < o.fidelity.fidelity_rounds; stop.wanted += 6) {
        assert_int_equal(apsm_optimize(s.ctx, &s.cohort, &o, &part, stop_after, &stop),
                         APSM_ERR_INTERRUPTED);
        assert_int_equal(part.epoch, stop.wanted);
    }
    assert_int_equal(apsm_optimize(s.ctx, &s.cohort, &o, &part, NULL, NULL), APSM_OK);
    assert_memory_equal(whole.P, part.P, sizeof s.P);
    assert_memory_not_equal(whole.P, s.P, sizeof s.P);
    apsm_optimizer_state_free(&whole);
    apsm_optimizer_state_free(&part);
    free_scene(&s);
}

static void test_resumes(void **state)
{
    (void)state;
    resume_with(0);
    resume_with(J / 3);
}

/* Fidelity 0: the stage does nothing. */
static void test_off(void **state)
{
    (void)state;
    scene s;
    apsm_optimize_options o = apsm_optimize_defaults();
    apsm_optimizer_state st;
    make_scene(&s, SYNTHETIC_ELLIPSOID, 2, 1);
    o.fidelity.fidelity = 0;
    assert_int_equal(apsm_optimizer_state_alloc(I, J, &st), APSM_OK);
    st.stage = APSM_STAGE_FIDELITY;
    memcpy(st.P, s.P, sizeof s.P);
    assert_int_equal(apsm_optimize(s.ctx, &s.cohort, &o, &st, NULL, NULL), APSM_OK);
    assert_memory_equal(st.P, s.P, sizeof s.P);
    assert_int_equal(st.stage, APSM_STAGE_DONE);
    apsm_optimizer_state_free(&st);
    free_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_follows),
        cmocka_unit_test(test_gradient),
        cmocka_unit_test(test_smooth_from),
        cmocka_unit_test(test_contacts),
        cmocka_unit_test(test_far_obstacles),
        cmocka_unit_test(test_sides_of_sheets),
        cmocka_unit_test(test_prior_finds_modes),
        cmocka_unit_test(test_prior_counts_distances),
        cmocka_unit_test(test_smoothness),
        cmocka_unit_test(test_doubt),
        cmocka_unit_test(test_distance_never_grows),
        cmocka_unit_test(test_strong_prior_yields),
        cmocka_unit_test(test_truth_error),
        cmocka_unit_test(test_coarse),
        cmocka_unit_test(test_where_coarse),
        cmocka_unit_test(test_sparse),
        cmocka_unit_test(test_sparse_terms),
        cmocka_unit_test(test_neighbours_stay),
        cmocka_unit_test(test_faults_return),
        cmocka_unit_test(test_threads_and_size),
        cmocka_unit_test(test_resumes),
        cmocka_unit_test(test_off),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
