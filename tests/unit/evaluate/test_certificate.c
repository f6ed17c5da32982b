/* The certificate: silent on sound correspondence, and every planted fault is found. */
#include "cmocka_all.h"

#include <string.h>

#include "core/random.h"
#include "correspond/certificate.h"
#include "optimize/correspondence_loss.h"
#include "shapes.h"

enum { J = 128, I = 6 };

typedef struct body {
    apsm_mesh mesh;
    apsm_topology topology;
    apsm_geodesic *g;
    apsm_geodesic_work *w;
    apsm_bvh *bvh;
    double *VN;
    apsm_surface_point points[J];
    double P[3 * J], N[3 * J], distance[J];
} body;

typedef struct cohort {
    body shape[I]; /* shape 0 is the template */
    uint32_t N6[6 * J];
    double h;
    apsm_neighbourhoods reference, rows;
    double row_factor; /* 0: 2 */
    apsm_certificate certificate;
} cohort;

static void spiral(size_t j, double u[3])
{
    const double z = 1 - (2.0 * (double)j + 1) / J, r = sqrt(1 - z * z);
    u[0] = r * cos(2.399963229728653 * (double)j);
    u[1] = r * sin(2.399963229728653 * (double)j);
    u[2] = z;
}

static void put(body *b, size_t j, const double x[3])
{
    apsm_closest c;
    apsm_bvh_closest(b->bvh, x, INFINITY, &c);
    b->points[j] = c.on;
    memcpy(b->P + 3 * j, c.x, sizeof c.x);
    apsm_surface_normal(&b->mesh, b->VN, &c.on, b->N + 3 * j);
}

static void make_body(body *b, size_t i)
{
    const double t = (double)i, a[3] = { 30 + 2 * sin(1.7 * t), 25 + 2 * sin(2.3 * t + 1),
                                         22 + 2 * sin(2.9 * t + 2) };
    b->mesh = shape_ellipsoid(4, a[0], a[1], a[2]);
    b->VN = malloc(3 * b->mesh.nv * sizeof *b->VN);
    assert_non_null(b->VN);
    assert_ok(apsm_topology_build(&b->mesh, &b->topology));
    assert_ok(apsm_geodesic_build(&b->mesh, &b->topology, &b->g));
    assert_ok(apsm_geodesic_work_new(b->g, &b->w));
    assert_ok(apsm_bvh_build(&b->mesh, &b->bvh));
    apsm_mesh_vertex_normals(&b->mesh, b->VN);
    for (size_t j = 0; j < J; j++) {
        double u[3], x[3];
        spiral(j, u);
        for (int c = 0; c < 3; c++) x[c] = a[c] * u[c];
        put(b, j, x);
        b->distance[j] = 0;
    }
}

static int make_cohort(void **state)
{
    cohort *c = calloc(1, sizeof *c);
    if (!c) return -1;
    for (size_t i = 0; i < I; i++) make_body(&c->shape[i], i);
    body *t = &c->shape[0];
    assert_ok(apsm_neighbours6(J, t->P, c->N6));
    c->h = apsm_spacing(J, t->P, c->N6, NULL);
    assert_ok(apsm_geodesic_neighbourhoods(t->g, t->w, J, t->points, t->P, APSM_REFERENCE_FACTOR,
                                           &c->reference));
    *state = c;
    return 0;
}

static int free_cohort(void **state)
{
    cohort *c = *state;
    for (size_t i = 0; i < I; i++) {
        body *b = &c->shape[i];
        apsm_bvh_free(b->bvh);
        apsm_geodesic_work_free(b->w);
        apsm_geodesic_free(b->g);
        apsm_topology_free(&b->topology);
        apsm_mesh_free(&b->mesh);
        free(b->VN);
    }
    apsm_neighbourhoods_free(&c->reference);
    apsm_neighbourhoods_free(&c->rows);
    apsm_certificate_free(&c->certificate);
    free(c);
    return 0;
}

/* Of the rows in c. */
static const apsm_certificate *certify_rows(cohort *c, size_t i)
{
    const body *b = &c->shape[i], *t = &c->shape[0];
    const apsm_certificate_input in = { .J = J,
                                        .h = c->h,
                                        .reference = &c->reference,
                                        .shape = &c->rows,
                                        .N6 = c->N6,
                                        .template_P = t->P,
                                        .template_N = t->N,
                                        .P = b->P,
                                        .N = b->N,
                                        .distance = b->distance };
    const apsm_certificate_options o = apsm_certificate_defaults();
    assert_ok(apsm_certify(&in, &o, &c->certificate));
    return &c->certificate;
}

static const apsm_certificate *certify(cohort *c, size_t i)
{
    body *b = &c->shape[i];
    assert_ok(apsm_geodesic_neighbourhoods(b->g, b->w, J, b->points, b->P,
                                           c->row_factor > 0 ? c->row_factor : 2.0, &c->rows));
    return certify_rows(c, i);
}

static void exchange(body *b, size_t j, size_t k)
{
    double x[3], y[3];
    memcpy(x, b->P + 3 * j, sizeof x);
    memcpy(y, b->P + 3 * k, sizeof y);
    put(b, j, y);
    put(b, k, x);
}

static void sound_shapes_are_certified(void **state)
{
    cohort *c = *state;
    for (size_t i = 0; i < I; i++) {
        const apsm_certificate *r = certify(c, i);
        if (!r->certified || r->swaps || r->folds)
            fail_msg("shape %zu: reasons %x, %zu mismatched, %zu swaps, %zu folds", i, r->reasons,
                     r->mismatched, r->swaps, r->folds);
        assert_true(r->min_separation > 0.5 && r->off_surface_max == 0);
    }
}

/* Neighbours, neighbours of neighbours, and far apart: the pair is named, and no other. */
static void swaps_are_named(void **state)
{
    cohort *c = *state;
    for (uint32_t n = 0; n < 60; n++) {
        const size_t i = 1 + n % (I - 1);
        const uint32_t j = 17 * n % J, near = c->N6[6 * j + n % 6];
        const uint32_t choice[3] = { near, c->N6[6 * near + n % 5], (j + 64) % J };
        const uint32_t k = choice[n % 3] == j ? near : choice[n % 3];
        exchange(&c->shape[i], j, k);
        const apsm_certificate *r = certify(c, i);
        assert_false(r->certified);
        assert_true(r->reasons & 1u << APSM_REVIEW_SWAPPED);
        if (r->swaps != 1 || r->swap[0][0] != (j < k ? j : k) || r->swap[0][1] != (j < k ? k : j))
            fail_msg("%u and %u on shape %zu: %zu swaps found", j, k, i, r->swaps);
        exchange(&c->shape[i], j, k);
    }
}

static bool among_six(const cohort *c, uint32_t j, uint32_t k)
{
    for (int e = 0; e < 6; e++)
        if (c->N6[6 * j + (uint32_t)e] == k) return true;
    return false;
}

static double side(const cohort *c, uint32_t j, uint32_t k)
{
    const double *a = c->shape[0].P + 3 * j, *b = c->shape[0].P + 3 * k;
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static bool about_equilateral(const cohort *c, const uint32_t t[3])
{
    const double a = side(c, t[0], t[1]), b = side(c, t[1], t[2]), d = side(c, t[2], t[0]);
    return fmax(a, fmax(b, d)) < 1.4 * fmin(a, fmin(b, d));
}

/* Two of j's neighbours that are mutual with it and with each other; false if there are none. */
static bool triangle_at(const cohort *c, uint32_t j, uint32_t t[3])
{
    t[0] = j;
    for (uint32_t e = 0; e < 36; e++) {
        t[1] = c->N6[6 * j + e / 6];
        t[2] = c->N6[6 * j + e % 6];
        if (t[1] != t[2] && among_six(c, t[1], j) && among_six(c, t[2], j) &&
            among_six(c, t[1], t[2]) && among_six(c, t[2], t[1]) && about_equilateral(c, t))
            return true;
    }
    return false;
}

static bool same_triangle(const uint32_t a[3], const uint32_t t[3])
{
    return a[0] < a[1] && a[1] < a[2] && a[0] + a[1] + a[2] == t[0] + t[1] + t[2] &&
           (uint64_t)a[0] * a[1] * a[2] == (uint64_t)t[0] * t[1] * t[2];
}

/* A particle pushed through the opposite side of a triangle turns it over. */
static void folds_are_found(void **state)
{
    cohort *c = *state;
    size_t planted = 0;
    for (uint32_t n = 0; n < 30; n++) {
        body *b = &c->shape[1 + n % (I - 1)];
        const uint32_t j = 23 * n % J;
        uint32_t t[3];
        if (!triangle_at(c, j, t)) continue;
        planted++;
        double old[3], x[3];
        memcpy(old, b->P + 3 * j, sizeof old);
        for (int flat = 0; flat < 2; flat++) { /* only as far as the side: nothing is turned over */
            for (uint32_t e = 0; e < 3; e++) {
                const double middle = 0.5 * (b->P[3 * t[1] + e] + b->P[3 * t[2] + e]);
                x[e] = old[e] + (flat ? 1.0 : 1.6) * (middle - old[e]);
            }
            put(b, j, x);
            const apsm_certificate *r = certify(c, 1 + n % (I - 1));
            bool named = false;
            for (size_t f = 0; f < r->folds; f++) named |= same_triangle(r->fold[f], t);
            if (named == flat) fail_msg("triangle %u %u %u, flat %d", t[0], t[1], t[2], flat);
            assert_true(flat || r->reasons & 1u << APSM_REVIEW_FOLDED);
        }
        put(b, j, old);
    }
    assert_true(planted > 20);
}

/* As certify, with rows that tell how far mismatched neighbours are. */
static const apsm_certificate *certify_far(cohort *c, size_t i)
{
    c->row_factor = 8.0;
    const apsm_certificate *certificate = certify(c, i);
    c->row_factor = 0.0;
    return certificate;
}

/* Every particle of the template, moved. */
static void place(cohort *c, size_t i, void (*map)(const double *, double *))
{
    for (size_t j = 0; j < J; j++) {
        double x[3];
        map(c->shape[0].P + 3 * j, x);
        put(&c->shape[i], j, x);
    }
}

static void as_it_is(const double *p, double *x)
{
    memcpy(x, p, 3 * sizeof *p);
}

/* The northern cap is turned by one and a half spacings at its rim. */
static void slip(const double *p, double *x)
{
    const double angle = p[2] > 8 ? 0.42 : 0.0;
    x[0] = cos(angle) * p[0] - sin(angle) * p[1];
    x[1] = sin(angle) * p[0] + cos(angle) * p[1];
    x[2] = p[2];
}

static void slipped_region_is_found(void **state)
{
    cohort *c = *state;
    place(c, 1, slip);
    const apsm_certificate *far = certify_far(c, 1);
    assert_int_equal(far->certified, false);
    assert_true(far->reasons & (1u << APSM_REVIEW_MISMATCHED));
    assert_true(far->lost > J / 50 && far->lost <= far->mismatched);
    place(c, 1, as_it_is);
}

/* Particles that come near others leave nobody behind: a short row cannot tell, a longer one can.
 */
static void crowding_is_no_loss(void **state)
{
    cohort *c = *state;
    body *b = &c->shape[1];
    place(c, 1, as_it_is);
    for (size_t j = 10; j < 120; j += 20) {
        double x[3];
        const size_t k = c->N6[6 * j];
        for (size_t a = 0; a < 3; a++) x[a] = 0.6 * b->P[3 * j + a] + 0.4 * b->P[3 * k + a];
        put(b, j, x);
    }
    assert_int_equal(certify(c, 1)->certified, false);
    const apsm_certificate *far = certify_far(c, 1);
    assert_true(far->mismatched > J / 50);
    assert_int_equal(far->lost, 0);
    assert_int_equal(far->certified, true);
    place(c, 1, as_it_is);
}

static void stray_and_coincident_particles(void **state)
{
    cohort *c = *state;
    body *b = &c->shape[1];
    b->distance[5] = 0.02 * c->h;
    const apsm_certificate *r = certify(c, 1);
    assert_int_equal(r->reasons, 1u << APSM_REVIEW_OFF_SURFACE);
    assert_near(r->off_surface_max, 0.02, 1e-12);
    assert_near(r->off_surface_mean, 0.02 / J, 1e-12);
    b->distance[5] = 0;
    double old[3];
    memcpy(old, b->P + 15, sizeof old);
    put(b, 5, b->P + 18);
    r = certify(c, 1);
    assert_true(r->reasons & 1u << APSM_REVIEW_COINCIDENT);
    assert_true(r->min_separation < 1e-6);
    put(b, 5, old);
    const double x = b->P[7];
    b->P[7] = NAN;
    const apsm_certificate_options o = apsm_certificate_defaults();
    const apsm_certificate_input in = {
        .J = J, .h = c->h, .reference = &c->reference, .shape = &c->rows, .P = b->P
    };
    assert_ok(apsm_certify(&in, &o, &c->certificate));
    assert_int_equal(c->certificate.reasons, 1u << APSM_REVIEW_NONFINITE);
    assert_false(c->certificate.certified);
    b->P[7] = x;
}

/* Rows that are searched no farther than the certificate asks give the certificate of whole rows.
 */
static void expect_same_by_short_rows(cohort *c, size_t i)
{
    body *b = &c->shape[i];
    const apsm_certificate *r = certify(c, i);
    const size_t strict = r->mismatched_strict, mismatched = r->mismatched, lost = r->lost,
                 swaps = r->swaps, folds = r->folds;
    const unsigned reasons = r->reasons;
    assert_ok(apsm_certificate_rows(b->g, b->w, J, b->points, b->P, &c->reference, &c->rows));
    r = certify_rows(c, i);
    assert_int_equal(r->mismatched, mismatched);
    assert_int_equal(r->lost, lost);
    assert_int_equal(r->swaps, swaps);
    assert_int_equal(r->folds, folds);
    assert_int_equal(r->reasons, reasons);
    assert_int_equal(r->mismatched_strict, strict);
}

static void short_rows_give_the_same_certificate(void **state)
{
    cohort *c = *state;
    for (size_t i = 0; i < I; i++) expect_same_by_short_rows(c, i);
    for (size_t j = 3; j < 23; j++) { /* far ones, and neighbours */
        const size_t other[2] = { j + 90, c->N6[6 * j] };
        for (size_t k = 0; k < 2; k++) {
            exchange(&c->shape[2], j, other[k]);
            expect_same_by_short_rows(c, 2);
            exchange(&c->shape[2], j, other[k]);
        }
    }
    place(c, 1, slip);
    expect_same_by_short_rows(c, 1);
    place(c, 1, as_it_is);
}

/* The lists say what the counts say. */
static void lists_agree_with_counts(void **state)
{
    cohort *c = *state;
    exchange(&c->shape[2], 3, 90);
    const apsm_certificate *r = certify(c, 2);
    uint32_t count[J];
    assert_int_equal(r->mismatched, apsm_mismatches(&c->reference, &c->rows, 2.0, count));
    assert_true(r->mismatched > 2 && r->mismatched <= r->mismatched_strict);
    size_t n = 0;
    for (uint32_t j = 0; j < J; j++)
        if (count[j]) assert_int_equal(r->mismatched_list[n++], j);
    assert_int_equal(n, r->mismatched);
    exchange(&c->shape[2], 3, 90);
    for (int i = 0; i < APSM_REVIEW_COUNT; i++)
        assert_true(strlen(apsm_review_text((apsm_review)i)) > 5);
}

/* A particle alone on a part of the surface, from which no other is reached: all of its neighbours
 * are mismatched and lost, it is in both lists, and nobody has changed places with it. */
static void an_isolated_particle_is_listed_and_not_swapped(void **state)
{
    enum { ALONE = 17 };
    cohort *c = *state;
    double *D = malloc(J * J * sizeof *D);
    uint32_t count[J];
    assert_non_null(D);
    for (size_t j = 0; j < J; j++)
        for (size_t k = 0; k < J; k++) {
            const double *p = c->shape[1].P + 3 * j, *q = c->shape[1].P + 3 * k;
            D[j * J + k] = sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                                (p[2] - q[2]) * (p[2] - q[2]));
            if ((j == ALONE) != (k == ALONE)) D[j * J + k] = INFINITY;
        }
    assert_ok(apsm_matrix_neighbourhoods(J, D, 4.0, &c->rows));
    free(D);
    const apsm_certificate *r = certify_rows(c, 1);
    const size_t neighbours = c->reference.start[ALONE + 1] - c->reference.start[ALONE];
    apsm_mismatches(&c->reference, &c->rows, 2.0, count);
    assert_int_equal(count[ALONE], neighbours);
    bool mismatched = false, lost = false;
    for (size_t k = 0; k < r->mismatched; k++) mismatched |= r->mismatched_list[k] == ALONE;
    for (size_t k = 0; k < r->lost; k++) lost |= r->lost_list[k] == ALONE;
    assert_true(mismatched && lost);
    assert_int_equal(r->swaps, 0);
    assert_false(r->certified);
}

/* Corners on both sides of a sheet: whatever way round, no verdict. */
static void triangles_across_a_sheet_say_nothing(void **state)
{
    (void)state;
    const apsm_certificate_options o = apsm_certificate_defaults();
    const double P[9] = { 0, 0, 0, 1, 0, 0, 0, 1, 0.1 };
    const double same[9] = { 0, 0, 1, 0, 0, 1, 0, 0, 1 }, both[9] = { 0, 0, 1, 0, 0, 1, 0, 0, -1 };
    const uint32_t t[3] = { 0, 1, 2 }, back[3] = { 0, 2, 1 };
    assert_int_equal(apsm_triangle_orientation(P, same, t, &o), 1);
    assert_int_equal(apsm_triangle_orientation(P, same, back, &o), -1);
    assert_int_equal(apsm_triangle_orientation(P, both, t, &o), 0);
    assert_int_equal(apsm_triangle_orientation(P, both, back, &o), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sound_shapes_are_certified),
        cmocka_unit_test(swaps_are_named),
        cmocka_unit_test(folds_are_found),
        cmocka_unit_test(slipped_region_is_found),
        cmocka_unit_test(crowding_is_no_loss),
        cmocka_unit_test(stray_and_coincident_particles),
        cmocka_unit_test(short_rows_give_the_same_certificate),
        cmocka_unit_test(lists_agree_with_counts),
        cmocka_unit_test(an_isolated_particle_is_listed_and_not_swapped),
        cmocka_unit_test(triangles_across_a_sheet_say_nothing),
    };
    return cmocka_run_group_tests(tests, make_cohort, free_cohort);
}
