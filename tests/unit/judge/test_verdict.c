/* Judging: kernels against closed forms, faults that are planted in a cohort of known shapes, and
 * silence about the cohort without them. */
#include "cmocka_all.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"
#include "core/robust.h"
#include "geometry/affine.h"
#include "geometry/form.h"
#include "geometry/vec3.h"
#include "judge/certify.h"
#include "judge/left_out.h"
#include "judge/slip.h"
#include "judge/twins.h"
#include "judge/verdict.h"
#include "optimize/correspondence_loss.h"
#include "shapes.h"

enum { I = 8, J = 96 };

/* A lopsided body without symmetry; every shape a little another one. */
static void body(size_t i, const double u[3], double x[3])
{
    apsm_random rng = apsm_random_stream(11, APSM_STREAM_TEST, i, 0);
    double k[4];
    for (int c = 0; c < 4; c++) k[c] = 1 + 0.08 * apsm_random_normal(&rng);
    const double bump = exp(-8 * (1 - (0.6 * u[0] + 0.48 * u[1] + 0.64 * u[2])));
    const double dent = exp(-6 * (1 - (-0.8 * u[0] + 0.6 * u[1])));
    const double r = 1 + 0.4 * k[3] * bump - 0.25 * dent + 0.15 * u[0] * u[1];
    shape_set3(x, 30 * k[0] * r * u[0], 20 * k[1] * r * u[1], 14 * k[2] * r * u[2]);
}

static void spiral(size_t j, double u[3])
{
    const double z = 1 - (2.0 * (double)j + 1) / J, r = sqrt(1 - z * z);
    u[0] = r * cos(2.399963229728653 * (double)j);
    u[1] = r * sin(2.399963229728653 * (double)j);
    u[2] = z;
}

typedef struct scene {
    apsm_context *ctx;
    apsm_cohort cohort;
    double P[I * J * 3];
} scene;

typedef void form(size_t i, const double u[3], double x[3]);

static void open_scene_of(scene *s, form *of)
{
    static const char *const names[I] = { "a", "b", "c", "d", "e", "f", "g", "h" };
    apsm_mesh mesh[I];
    double M[16 * I];
    s->ctx = apsm_context_new();
    for (size_t i = 0; i < I; i++) {
        mesh[i] = shape_icosphere(4);
        for (size_t v = 0; v < mesh[i].nv; v++) {
            const double u[3] = { mesh[i].V[3 * v], mesh[i].V[3 * v + 1], mesh[i].V[3 * v + 2] };
            of(i, u, mesh[i].V + 3 * v);
        }
        apsm_affine_identity(M + 16 * i);
        for (size_t j = 0; j < J; j++) {
            double u[3];
            spiral(j, u);
            of(i, u, s->P + 3 * (J * i + j));
        }
    }
    const apsm_cohort_input in = { I, names, mesh, M, 0 };
    assert_int_equal(apsm_cohort_build(s->ctx, &in, 0, 0, &s->cohort), APSM_OK);
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
}

static void open_scene(scene *s)
{
    open_scene_of(s, body);
}

static void close_scene(scene *s)
{
    apsm_cohort_free(&s->cohort);
    apsm_context_free(s->ctx);
}

static void judge(scene *s, unsigned doubts[I])
{
    const apsm_verdict_options options = apsm_verdict_defaults();
    apsm_judgement g;
    assert_int_equal(apsm_judge(s->ctx, &s->cohort, J, s->P, &g), APSM_OK);
    for (size_t i = 0; i < I; i++) doubts[i] = apsm_verdict_doubts(&g.shape[i], &options);
    apsm_judgement_free(&g);
}

static void right_shapes_pass(void **state)
{
    (void)state;
    static scene s;
    unsigned doubts[I];
    open_scene(&s);
    judge(&s, doubts);
    for (size_t i = 0; i < I; i++)
        if (doubts[i]) fail_msg("shape %zu is doubted: %x", i, doubts[i]);
    close_scene(&s);
}

/* Shape 3's particles are those of a body that was moved by A: particle j lies where A u_j is. */
static void misplace(scene *s, const double A[9])
{
    for (size_t j = 0; j < J; j++) {
        double u[3], v[3];
        spiral(j, u);
        for (size_t c = 0; c < 3; c++)
            v[c] = A[3 * c] * u[0] + A[3 * c + 1] * u[1] + A[3 * c + 2] * u[2];
        body(3, v, s->P + 3 * (J * 3 + j));
    }
}

static void only_shape_3(scene *s, unsigned any_of)
{
    unsigned doubts[I];
    judge(s, doubts);
    if (!(doubts[3] & any_of)) fail_msg("the fault is not found: %x", doubts[3]);
    for (size_t i = 0; i < I; i++)
        if (i != 3 && doubts[i]) fail_msg("shape %zu is doubted: %x", i, doubts[i]);
    close_scene(s);
}

static void half_turn_is_found(void **state)
{
    (void)state;
    static scene s;
    const double about_z[9] = { -1, 0, 0, 0, -1, 0, 0, 0, 1 };
    open_scene(&s);
    misplace(&s, about_z);
    only_shape_3(&s, 1u << APSM_DOUBT_TURNED | 1u << APSM_DOUBT_FORM);
}

static void mirror_image_is_found(void **state)
{
    (void)state;
    static scene s;
    const double through_x[9] = { -1, 0, 0, 0, 1, 0, 0, 0, 1 };
    open_scene(&s);
    misplace(&s, through_x);
    only_shape_3(&s, 1u << APSM_DOUBT_MIRRORED | 1u << APSM_DOUBT_FORM);
}

/* All shapes' particles keep to the middle: no shape is unusual, and all miss their ends. */
static void ends_missed_by_all_are_found(void **state)
{
    (void)state;
    static scene s;
    unsigned doubts[I];
    open_scene(&s);
    for (size_t i = 0; i < I; i++)
        for (size_t j = 0; j < J; j++) {
            double u[3];
            spiral(j, u);
            u[2] *= 0.5;
            for (int c = 0; c < 2; c++) u[c] *= sqrt((1 - u[2] * u[2]) / (1 - 4 * u[2] * u[2]));
            body(i, u, s.P + 3 * (J * i + j));
        }
    judge(&s, doubts);
    for (size_t i = 0; i < I; i++)
        if (!(doubts[i] & 1u << APSM_DOUBT_ENDS)) fail_msg("shape %zu: %x", i, doubts[i]);
    close_scene(&s);
}

/* A region of shape 3 moves along the surface by `far`, fading out. */
static void plant_slip(scene *s, double far)
{
    const double at[3] = { 0, 1, 0 };
    open_scene(s);
    for (size_t j = 0; j < J; j++) {
        double u[3], norm = 0;
        spiral(j, u);
        const double near = u[0] * at[0] + u[1] * at[1] + u[2] * at[2];
        u[0] += far * fmax(near, 0) * fmax(near, 0);
        for (int c = 0; c < 3; c++) norm += u[c] * u[c];
        for (int c = 0; c < 3; c++) u[c] /= sqrt(norm);
        body(3, u, s->P + 3 * (J * 3 + j));
    }
    only_shape_3(s, 1u << APSM_DOUBT_SLIP);
}

/* By about a spacing, and by half of it. */
static void slip_is_found(void **state)
{
    (void)state;
    static scene s;
    plant_slip(&s, 0.4);
    plant_slip(&s, 0.2);
}

/* A slip is the mean over the patch of vectors along the surface: what goes along the normal, or
 * this way and that, is none. */
static void slips_are_coherent(void **state)
{
    (void)state;
    enum { n = 5 };
    const double P[3 * n] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 9, 0, 0, 0, 0, 1 };
    const double N[3 * n] = { 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, -1 };
    const double x[n] = { 1, 2, 6, 4, 100 }, usual[n] = { 0.5, 0.5, 0.5, 0.01, 1 };
    double mean[n], times[n];
    apsm_patches patches = { 0 };
    assert_int_equal(apsm_patches_make(2, n, P, N, 0.5, &patches), APSM_OK);
    apsm_patches_mean(&patches, x, mean);
    assert_near(mean[0], 3, 1e-12); /* not what is far, nor what looks the other way */
    assert_near(mean[3], 4, 1e-12);
    apsm_slip_times(&patches, x, usual, times, mean);
    assert_near(times[2], 12, 1e-12);
    assert_near(times[3], 4 / 0.05, 1e-9);
    apsm_patches_free(&patches);
}

/* What the others span and polynomials up to the degree is explained, and nothing else. */
static void smooth_deformations_leave_no_rest(void **state)
{
    (void)state;
    enum { shapes = 5, D = 3 * J };
    static double P[shapes * D], rests[APSM_LEFT_OUT_DEGREES * D];
    double *work = malloc(apsm_left_out_work_size(J) * sizeof *work);
    assert_non_null(work);
    for (int degree = 1; degree <= 4; degree++) {
        for (size_t i = 0; i < shapes; i++)
            for (size_t j = 0; j < J; j++) {
                double *p = P + i * D + 3 * j;
                spiral(j, p);
                const double x = p[0], z = p[2];
                p[1] += (double)(i % 3) * sin(9 * (double)j);
                if (i == 2) p[0] += 0.1 * z * pow(x, degree - 1);
            }
        apsm_left_out_rests(shapes, J, P, 2, rests, work);
        for (int d = 1; d <= APSM_LEFT_OUT_DEGREES; d++) {
            double most = 0;
            for (size_t k = 0; k < D; k++) most = fmax(most, fabs(rests[(d - 1) * D + (int)k]));
            if ((most < 1e-9) != (degree <= d)) fail_msg("%d %d: %g", degree, d, most);
        }
    }
    free(work);
}

/* The particles keep away from one end of shape 3. */
static void missed_end_is_found(void **state)
{
    (void)state;
    static scene s;
    unsigned doubts[I];
    open_scene(&s);
    for (size_t j = 0; j < J; j++) {
        double u[3], norm = 0;
        spiral(j, u);
        u[0] = u[0] > 0 ? 0.6 * u[0] : u[0];
        for (int c = 0; c < 3; c++) norm += u[c] * u[c];
        for (int c = 0; c < 3; c++) u[c] /= sqrt(norm);
        body(3, u, s.P + 3 * (J * 3 + j));
    }
    judge(&s, doubts);
    assert_true(doubts[3] & (1u << APSM_DOUBT_ENDS));
    close_scene(&s);
}

/* Two cones base to base, whose normals are about 120 degrees apart; every shape a little another
 * one. */
static void roof(size_t i, const double u[3], double x[3])
{
    apsm_random rng = apsm_random_stream(12, APSM_STREAM_TEST, i, 0);
    const double slope = 0.6, r = 30 / (hypot(u[0], u[1]) + fabs(u[2]) / slope);
    for (size_t c = 0; c < 3; c++) x[c] = r * u[c] * (1 + 0.03 * apsm_random_normal(&rng));
}

/* Particle `at` of shape 3 goes to the other cone; whether it alone is found there. */
static bool is_found_on_the_other_side(size_t at)
{
    static scene s;
    apsm_judgement g;
    size_t opposed = 0;
    double u[3];
    open_scene_of(&s, roof);
    spiral(at, u);
    u[2] = -u[2];
    roof(3, u, s.P + 3 * (J * 3 + at));
    assert_int_equal(apsm_judge(s.ctx, &s.cohort, J, s.P, &g), APSM_OK);
    for (size_t k = 0; k < I * J; k++) opposed += g.opposed[k];
    const bool found = g.opposed[J * 3 + at] && g.shape[3].opposed == 1;
    assert_int_equal(opposed, found);
    apsm_judgement_free(&g);
    close_scene(&s);
    return found;
}

static void other_side_is_found_beyond_edges(void **state)
{
    (void)state;
    assert_true(is_found_on_the_other_side(J / 8));
    assert_false(is_found_on_the_other_side(J / 2 - 5)); /* next to the edge */
}

/* A pin on shape 3, or a dent in it, narrower than the particles are apart, where none is. */
static double pin_height;
static void pinned(size_t i, const double u[3], double x[3])
{
    double between[3], first[3], second[3], r = 0;
    spiral(J / 2, first);
    spiral(J / 2 + 13, second); /* beside it */
    for (size_t c = 0; c < 3; c++) between[c] = first[c] + second[c];
    const double norm = sqrt(vec3_dot(between, between));
    for (size_t c = 0; c < 3; c++) r += (u[c] - between[c] / norm) * (u[c] - between[c] / norm);
    body(i, u, x);
    if (i != 3) return;
    const double high = 1 + pin_height * exp(-0.5 * r / (0.1 * 0.1));
    for (size_t c = 0; c < 3; c++) x[c] *= high;
}

static void parts_unlike_the_others_are_found(void **state)
{
    (void)state;
    static scene s;
    static const double height[2] = { 0.5, -0.6 };
    for (int k = 0; k < 2; k++) {
        pin_height = height[k];
        open_scene_of(&s, pinned);
        only_shape_3(&s, 1u << APSM_DOUBT_PART);
    }
}

/* Shape 5 is shape 2 again, its particles a little elsewhere. */
static void repeated(size_t i, const double u[3], double x[3])
{
    const size_t subject = i == 5 ? 2 : i;
    apsm_random rng = apsm_random_stream(13, APSM_STREAM_TEST, subject, 0);
    body(subject, u, x);
    for (size_t c = 0; c < 9; c++)
        x[c % 3] += apsm_random_normal(&rng) * sin(3 * u[c / 3] + (double)c);
    for (size_t c = 0; c < 3 && i == 5; c++) x[c] += 0.1 * sin(40 * u[c]);
}

static void twins_are_found(void **state)
{
    (void)state;
    static scene s;
    apsm_judgement g;
    open_scene_of(&s, repeated);
    assert_int_equal(apsm_judge(s.ctx, &s.cohort, J, s.P, &g), APSM_OK);
    for (size_t i = 0; i < I; i++) assert_int_equal(g.twin[i], i == 5 ? 2 : i);
    apsm_judgement_free(&g);
    close_scene(&s);
}

/* What apsm_twins_find says, by all distances. */
static void twins_of_all_pairs(size_t n, size_t m, const double *Q, const double *X,
                               const double *size, uint32_t *twin)
{
    double *d = calloc(n * n, sizeof *d), *usual = calloc(n, sizeof *usual);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < n * m; k++) {
            const double to = Q[m * i + k % m] - Q[k], off = Q[m * i + k % m] - X[m * i + k % m];
            d[n * i + k / m] += to * to;
            if (k < m) usual[i] += off * off;
        }
    const double most = robust_median(n, usual) / 16;
    for (size_t i = 0; i < n; i++) {
        double nearest = INFINITY;
        twin[i] = (uint32_t)i;
        for (size_t k = n; k-- > 0;) {
            if (k == i || d[n * i + k] > most || fabs(size[i] - size[k]) > 0.01) continue;
            nearest = fmin(nearest, d[n * i + k]);
            if (k < i || twin[i] == i) twin[i] = (uint32_t)k;
        }
        for (size_t k = 0; k < n; k++)
            if (k != i && d[n * i + k] > most && d[n * i + k] <= 9 * nearest) twin[i] = (uint32_t)i;
        if (twin[i] > i) twin[i] = (uint32_t)i;
    }
    free(d);
    free(usual);
}

/* Sixty shapes in groups of three by chance, some near, some of another size. */
static void twins_are_those_of_all_pairs(void **state)
{
    (void)state;
    enum { N = 60, M = 60 };
    static double Q[N * M], X[N * M], size[N], work[N];
    uint32_t twin[N], expected[N];
    size_t found = 0, alone = 0;
    apsm_context *ctx = apsm_context_new();
    for (size_t i = 0; i < N; i++) {
        const size_t subject = i % 20;
        apsm_random of = apsm_random_stream(5, APSM_STREAM_TEST, subject, 0);
        apsm_random own = apsm_random_stream(6, APSM_STREAM_TEST, i, 0);
        const double off = (i < 20 ? 0.0 : i < 40 ? 0.1 : 0.06) * (double)(1 + subject % 4);
        for (size_t k = 0; k < M; k++)
            Q[M * i + k] = apsm_random_normal(&of) + off * apsm_random_normal(&own);
        size[i] = 0.02 * apsm_random_normal(&of) + (subject % 3 ? 0.003 : 0.03) * (double)(i / 20);
    }
    assert_int_equal(apsm_twins_find(ctx, N, M / 3, Q, X, size, twin, work), APSM_OK);
    twins_of_all_pairs(N, M, Q, X, size, expected);
    for (size_t i = 0; i < N; i++) {
        assert_int_equal(twin[i], expected[i]);
        found += twin[i] != i;
        alone += i >= 20 && twin[i] == i;
    }
    assert_true(found > 5 && alone > 5);
    apsm_context_free(ctx);
}

/* Particles in four places: no warp follows them, and the verdict is a review, no failure. */
static void particles_in_few_places_are_judged(void **state)
{
    (void)state;
    static scene s;
    cohort_certificate c;
    open_scene(&s);
    for (size_t j = 4; j < J; j++) memcpy(s.P + 3 * j, s.P + 3 * (j % 4), 3 * sizeof *s.P);
    assert_int_equal(certify_cohort(s.ctx, &s.cohort, J, s.P, NULL, &c), APSM_OK);
    assert_string_equal(certify_verdict_of(&c, 0), "needs review");
    certify_free(&c);
    close_scene(&s);
}

/* A name of 299 letters and an umlaut: no text may end within it. */
static void long_names_of_twins_are_whole(void **state)
{
    (void)state;
    static scene s;
    cohort_certificate c;
    char name[400];
    memset(name, 'x', 299);
    strcpy(name + 299, "\xc3\xa4 whole");
    open_scene_of(&s, repeated);
    const char *const before = s.cohort.shape[2].name;
    s.cohort.shape[2].name = name;
    assert_int_equal(certify_cohort(s.ctx, &s.cohort, J, s.P, NULL, &c), APSM_OK);
    const json_t *const note = json_array_get(c.notes, 0);
    const char *const text = json_string_value(json_object_get(note, "text"));
    assert_non_null(text);
    assert_non_null(strstr(text, name));
    s.cohort.shape[2].name = before;
    certify_free(&c);
    close_scene(&s);
}

/* On a row of particles two places depart alike; only that around `at` is meant. */
static void only_what_is_around_a_part_is_meant(void **state)
{
    (void)state;
    enum { N = 20 };
    double departs[N] = { 0 }, P[3 * N] = { 0 };
    uint32_t N6[N * 6], queue[N];
    bool in[N];
    for (size_t j = 0; j < N; j++) P[3 * j] = (double)j;
    assert_int_equal(apsm_neighbours6(N, P, N6), APSM_OK);
    departs[2] = departs[16] = 3;
    departs[3] = 2;
    departs[5] = 1.6; /* next but one */
    departs[15] = 1.4;
    departs[17] = 2;
    const apsm_judgement g = { .I = 1, .J = N, .departs = departs, .N6 = N6 };
    apsm_judgement_around(&g, 0, 2, in, queue);
    for (size_t j = 0; j < N; j++) assert_int_equal(in[j], j == 2 || j == 3 || j == 5);
    apsm_judgement_around(&g, 0, 16, in, queue);
    for (size_t j = 0; j < N; j++) assert_int_equal(in[j], j == 16 || j == 17);
}

static void size_of_a_stranger_is_found(void **state)
{
    (void)state;
    apsm_findings f = { .agreement = 1.5, .off = 1.0, .size = 2.0, .size_excess = 12.0 };
    const apsm_verdict_options o = apsm_verdict_defaults();
    f.turn[0].evidence = f.turn[1].evidence = 2.0;
    assert_int_equal(apsm_verdict_doubts(&f, &o), 1u << APSM_DOUBT_SIZE);
    f.size_excess = 2.0; /* the others differ as much */
    assert_int_equal(apsm_verdict_doubts(&f, &o), 0);
}

/* Weak evidence either way is no doubt, but is not told either; clear evidence against is one. */
static void evidence_decides_pose_and_hand(void **state)
{
    (void)state;
    apsm_findings f = { .agreement = 1.5, .off = 1.0, .size = 1.0 };
    const apsm_verdict_options o = apsm_verdict_defaults();
    f.turn[0].evidence = 2.0;
    f.turn[0].staying = f.turn[1].staying = INFINITY;
    f.turn[1].evidence = -0.1;
    assert_int_equal(apsm_verdict_doubts(&f, &o), 0);
    assert_true(apsm_verdict_tells(&f, APSM_ASPECT_POSE, &o));
    assert_false(apsm_verdict_tells(&f, APSM_ASPECT_HAND, &o));
    f.turn[1].evidence = f.turn[1].staying = 2.0;
    assert_true(apsm_verdict_tells(&f, APSM_ASPECT_HAND, &o));
    f.turn[1].staying = 0.5; /* a thin shape, whose mirror image is as good in the same places */
    assert_false(apsm_verdict_tells(&f, APSM_ASPECT_HAND, &o));
    f.turn[1].evidence = -0.5;
    assert_int_equal(apsm_verdict_doubts(&f, &o), 1u << APSM_DOUBT_MIRRORED);
    f.turn[0].evidence = -0.4;
    f.turn[1].evidence = 0.1;
    assert_int_equal(apsm_verdict_doubts(&f, &o), 1u << APSM_DOUBT_TURNED);
}

/* More evidence and agreement, less probability; none where the surface does not tell. */
static void probability_follows_form(void **state)
{
    (void)state;
    apsm_findings f = { .agreement = 2.4 };
    const apsm_verdict_options o = apsm_verdict_defaults();
    f.turn[0].evidence = f.turn[1].evidence = 3.0;
    assert_float_equal(apsm_verdict_probability(&f, &o), 0.04, 1e-12);
    f.agreement = 0.9;
    const double middling = apsm_verdict_probability(&f, &o);
    assert_true(middling > 0.1 && middling < 0.5);
    f.turn[1].evidence = -0.5;
    assert_true(apsm_verdict_probability(&f, &o) > middling);
    f.turn[0].evidence = -1.0;
    f.agreement = 0.0;
    assert_float_equal(apsm_verdict_probability(&f, &o), 0.96, 1e-12);
    f.turn[0].evidence = 0.2;
    assert_true(isnan(apsm_verdict_probability(&f, &o)));
}

static void quantiles_leave_one_out(void **state)
{
    (void)state;
    const double x[5] = { 4, 1, 3, 5, 1 };
    double q[5], scratch[5];
    robust_left_out_quantiles(5, x, 0.75, q, scratch);
    assert_float_equal(q[0], 3.5, 1e-12); /* of 1 1 3 5 */
    assert_float_equal(q[1], 4.25, 1e-12);
    assert_float_equal(q[3], 3.25, 1e-12);
    robust_left_out_quantiles(5, x, 1.0, q, scratch);
    assert_float_equal(q[3], 4, 1e-12);
    robust_left_out_quantiles(2, x, 0.75, q, scratch);
    assert_float_equal(q[0], 1, 1e-12);
}

/* What grooming doubted is settled where form speaks clearly. */
static void form_settles_notes(void **state)
{
    (void)state;
    const apsm_verdict_options o = apsm_verdict_defaults();
    const unsigned mirrored = 1u << APSM_DOUBT_MIRRORED;
    apsm_findings f = { .agreement = 1.5 };
    f.turn[0].agreement = f.turn[1].agreement = 0.5;
    f.turn[0].evidence = f.turn[1].evidence = 2.0;
    f.turn[0].staying = f.turn[1].staying = INFINITY;
    assert_int_equal(apsm_verdict_note_pose(&f, 1.0, APSM_POSE_AMBIGUOUS, &o), 0);
    assert_int_equal(apsm_verdict_note_pose(&f, 5.0, APSM_POSE_AMBIGUOUS, &o),
                     1u << APSM_DOUBT_POSE);
    f.turn[0].agreement = 1.4;
    assert_int_equal(apsm_verdict_note_pose(&f, 1.0, APSM_POSE_AMBIGUOUS, &o),
                     1u << APSM_DOUBT_POSE);
    assert_int_equal(apsm_verdict_note_hand(NULL, INFINITY, false, &o), mirrored);
    assert_int_equal(apsm_verdict_note_hand(&f, 1.0, false, &o), 0);
    f.turn[0].agreement = 0.5; /* less settles a hand than a pose */
    assert_int_equal(apsm_verdict_note_hand(&f, 3.0, false, &o), 0);
    assert_int_equal(apsm_verdict_note_pose(&f, 3.0, APSM_POSE_AMBIGUOUS, &o),
                     1u << APSM_DOUBT_POSE);
    f.turn[1].staying = -0.1;
    assert_int_equal(apsm_verdict_note_hand(&f, 1.0, false, &o), mirrored);
    f.turn[1].agreement = 1.6;
    assert_int_equal(apsm_verdict_note_hand(&f, 1.0, false, &o), mirrored);
    f.turn[1].agreement = 1.4;
    assert_int_equal(apsm_verdict_note_hand(&f, 0.1, false, &o), 0); /* nobody's hand is told */
    f.turn[1].evidence = -0.1; /* but of this one against it */
    assert_int_equal(apsm_verdict_note_hand(&f, 0.1, false, &o), mirrored);
    f.turn[1].evidence = 0.1;
    assert_int_equal(apsm_verdict_note_hand(&f, 0.1, false, &o), 0);
    f.turn[1].agreement = 1.6;
    assert_int_equal(apsm_verdict_note_hand(&f, 0.1, false, &o), mirrored);
    assert_int_equal(apsm_verdict_note_hand(&f, 0.1, true, &o), 1u << APSM_DOUBT_HAND);
}

/* A pose that only the surface tells is in doubt where it does not tell. */
static void sought_poses_have_to_be_told(void **state)
{
    (void)state;
    const apsm_verdict_options o = apsm_verdict_defaults();
    apsm_findings f = { .agreement = 1.0 };
    f.turn[0].agreement = 0.9;
    f.turn[0].evidence = 0.6;
    assert_int_equal(apsm_verdict_note_pose(&f, 1.0, APSM_POSE_SOUGHT, &o), 0);
    assert_int_equal(apsm_verdict_note_pose(&f, 0.4, APSM_POSE_SOUGHT, &o), 1u << APSM_DOUBT_POSE);
    f.turn[0].evidence = 0.1;
    assert_int_equal(apsm_verdict_note_pose(&f, 1.0, APSM_POSE_SOUGHT, &o), 1u << APSM_DOUBT_POSE);
    f.turn[0].evidence = -0.3; /* turned, which is said */
    assert_int_equal(apsm_verdict_note_pose(&f, 1.0, APSM_POSE_SOUGHT, &o), 0);
    assert_int_equal(apsm_verdict_note_pose(NULL, INFINITY, APSM_POSE_SOUGHT, &o), 0);
}

/* One that stands against the others' orientation has to be told more clearly than usual ones are.
 */
static void poses_against_the_others_have_to_be_clear(void **state)
{
    (void)state;
    const apsm_verdict_options o = apsm_verdict_defaults();
    apsm_findings f = { .agreement = 1.6 };
    f.turn[0].agreement = 0.8;
    f.turn[0].staying = INFINITY;
    f.turn[0].evidence = 1.5;
    assert_int_equal(apsm_verdict_note_pose(&f, 1.2, APSM_POSE_AMBIGUOUS, &o), 0);
    assert_int_equal(apsm_verdict_note_pose(&f, 1.2, APSM_POSE_AGAINST, &o), 1u << APSM_DOUBT_POSE);
    f.turn[0].evidence = 4.0;
    assert_int_equal(apsm_verdict_note_pose(&f, 5.0, APSM_POSE_AGAINST, &o), 0);
}

/* How many shapes are doubted when grooming calls the poses of the first `ambiguous` so. */
static size_t doubted_poses(size_t ambiguous)
{
    static const char *const name[I] = { "a", "b", "c", "d", "e", "f", "g", "h" };
    static scene s;
    cohort_certificate c;
    size_t n = 0;
    json_t *notes = json_array();
    for (size_t i = 0; i < ambiguous; i++)
        json_array_append_new(notes, json_pack("{s:s, s:s}", "shape", name[i], "aspect", "pose"));
    open_scene(&s);
    assert_int_equal(certify_cohort(s.ctx, &s.cohort, J, s.P, notes, &c), APSM_OK);
    for (size_t i = 0; i < I; i++) n += c.doubts[i] == 1u << APSM_DOUBT_POSE;
    certify_free(&c);
    close_scene(&s);
    json_decref(notes);
    return n;
}

static void form_settles_no_poses_of_which_most_are_ambiguous(void **state)
{
    (void)state;
    assert_int_equal(doubted_poses(I / 2), 0);
    assert_int_equal(doubted_poses(I / 2 + 1), I);
}

/* On a sphere of radius R the mean height within r of a point is -r^2 / 4R, and no scale's sign or
 * unit depends on the pose. */
static void heights_on_a_sphere(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(5, 20);
    double *faces = malloc(apsm_form_size(mesh.nf) * sizeof *faces), height[APSM_FORM_SCALES];
    const double p[3] = { 0, 0, 20 }, n[3] = { 0, 0, 1 }, h = 2;
    assert_non_null(faces);
    apsm_form_faces(&mesh, faces);
    apsm_form_heights(mesh.nf, faces, 1, p, n, h, height);
    for (int s = 0; s < APSM_FORM_SCALES; s++) {
        const double r = apsm_form_radius[s] * h, expected = -r / (4 * 20);
        if (!(fabs(height[s] - expected) < 0.15 * fabs(expected)))
            fail_msg("scale %d: %g, expected %g", s, height[s], expected);
    }
    free(faces);
    apsm_mesh_free(&mesh);
}

static void medians_leave_one_out(void **state)
{
    (void)state;
    const double X[5] = { 5, 1, 2, 9, 4 };
    double out[5], column[5];
    const double expected[5] = { 3, 4.5, 4.5, 3, 3.5 };
    robust_left_out_medians(5, 1, X, out, column);
    for (int i = 0; i < 5; i++) assert_true(out[i] == expected[i]);
    const double Y[4] = { 1, 2, 3, 100 }, others[4] = { 3, 3, 2, 2 };
    robust_left_out_medians(4, 1, Y, out, column);
    for (int i = 0; i < 4; i++) assert_true(out[i] == others[i]);
}

/* As told one by one: the median of the others and of their distances from it. */
static void excesses_are_those_over_the_others(void **state)
{
    enum { MOST = 12 };
    (void)state;
    uint64_t seed = 7;
    for (size_t n = 3; n <= MOST; n++)
        for (int k = 0; k < 20; k++) {
            double x[MOST], excess[MOST], median[MOST], scratch[MOST];
            for (size_t i = 0; i < n; i++) { /* with ties */
                seed = seed * 6364136223846793005u + 1442695040888963407u;
                x[i] = (double)(seed >> 33 & 15) / 3.0;
            }
            robust_excesses(n, x, 0.1, excess, median, scratch);
            for (size_t i = 0; i < n; i++) {
                size_t others = 0;
                double y[MOST];
                for (size_t l = 0; l < n; l++)
                    if (l != i) y[others++] = x[l];
                const double m = robust_median(others, y);
                for (size_t l = 0; l < others; l++) y[l] = fabs(y[l] - m);
                const double spread = fmax(1.4826 * robust_median(others, y), 0.1);
                assert_true(median[i] == m && excess[i] == (x[i] - m) / spread);
            }
        }
}

/* Shapes on a line in shape space are predicted without a rest; one off it is not. */
static void usual_variation_leaves_no_rest(void **state)
{
    (void)state;
    enum { n = 6, points = 8 };
    double P[n * points * 3], r[points * 3], most = 0;
    double *work = malloc(apsm_left_out_work_size(points) * sizeof *work);
    assert_non_null(work);
    for (int i = 0; i < n; i++)
        for (int k = 0; k < points * 3; k++) P[i * points * 3 + k] = k + i * ((k * 7) % 5);
    assert_int_equal(apsm_left_out_residual(n, points, P, 2, r, work), APSM_OK);
    for (int k = 0; k < points * 3; k++) most = fmax(most, fabs(r[k]));
    assert_true(most < 1e-9);
    P[2 * points * 3 + 4] += 1;
    assert_int_equal(apsm_left_out_residual(n, points, P, 2, r, work), APSM_OK);
    assert_true(fabs(r[4]) > 0.8);
    free(work);
}

/* Of two parts alike, one of which is misplaced in subject 3. */
static void parts_are_judged_apart(void **state)
{
    (void)state;
    static scene a, b;
    static double P[I * 2 * J * 3];
    const size_t own[2] = { J, J };
    apsm_cohort both;
    cohort_certificate c[2];
    open_scene(&a);
    open_scene(&b);
    misplace(&b, (const double[9]){ -1, 0, 0, 0, -1, 0, 0, 0, 1 });
    apsm_cohort parts[2] = { a.cohort, b.cohort };
    assert_int_equal(apsm_cohort_join(a.ctx, 2, parts, own, &both), APSM_OK);
    cohort_put_part(&both, 0, 2 * J, a.P, P);
    cohort_put_part(&both, 1, 2 * J, b.P, P);
    assert_int_equal(certify_parts(a.ctx, &both, 2 * J, P, c), APSM_OK);
    for (size_t i = 0; i < I; i++) {
        assert_int_equal(c[0].doubts[i], 0);
        assert_true((c[1].doubts[i] != 0) == (i == 3));
    }
    certify_free(&c[0]);
    certify_free(&c[1]);
    apsm_cohort_free(&both);
    apsm_context_free(a.ctx);
    apsm_context_free(b.ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(right_shapes_pass),
        cmocka_unit_test(half_turn_is_found),
        cmocka_unit_test(mirror_image_is_found),
        cmocka_unit_test(slip_is_found),
        cmocka_unit_test(slips_are_coherent),
        cmocka_unit_test(smooth_deformations_leave_no_rest),
        cmocka_unit_test(ends_missed_by_all_are_found),
        cmocka_unit_test(missed_end_is_found),
        cmocka_unit_test(other_side_is_found_beyond_edges),
        cmocka_unit_test(parts_unlike_the_others_are_found),
        cmocka_unit_test(twins_are_found),
        cmocka_unit_test(twins_are_those_of_all_pairs),
        cmocka_unit_test(particles_in_few_places_are_judged),
        cmocka_unit_test(long_names_of_twins_are_whole),
        cmocka_unit_test(only_what_is_around_a_part_is_meant),
        cmocka_unit_test(size_of_a_stranger_is_found),
        cmocka_unit_test(evidence_decides_pose_and_hand),
        cmocka_unit_test(probability_follows_form),
        cmocka_unit_test(form_settles_notes),
        cmocka_unit_test(sought_poses_have_to_be_told),
        cmocka_unit_test(form_settles_no_poses_of_which_most_are_ambiguous),
        cmocka_unit_test(poses_against_the_others_have_to_be_clear),
        cmocka_unit_test(quantiles_leave_one_out),
        cmocka_unit_test(heights_on_a_sphere),
        cmocka_unit_test(medians_leave_one_out),
        cmocka_unit_test(excesses_are_those_over_the_others),
        cmocka_unit_test(usual_variation_leaves_no_rest),
        cmocka_unit_test(parts_are_judged_apart),
    };
    return cmocka_run_group_tests_name("verdict", tests, NULL, NULL);
}
