#include "cmocka_all.h"

#include "core/random.h"
#include "geometry/affine.h"
#include "geometry/bvh.h"
#include "geometry/bvh_guess.h"
#include "shapes.h"

static apsm_bvh *build(const apsm_mesh *mesh)
{
    apsm_bvh *bvh;
    assert_ok(apsm_bvh_build(mesh, &bvh));
    return bvh;
}

static double clamp01(double t)
{
    return t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t;
}

static double segment_distance2(const double *x, const double *p, const double *q)
{
    double pq = 0.0, px = 0.0, sum = 0.0;
    for (int c = 0; c < 3; c++) {
        pq += (q[c] - p[c]) * (q[c] - p[c]);
        px += (q[c] - p[c]) * (x[c] - p[c]);
    }
    const double t = pq > 0.0 ? clamp01(px / pq) : 0.0;
    for (int c = 0; c < 3; c++) {
        const double d = p[c] + t * (q[c] - p[c]) - x[c];
        sum += d * d;
    }
    return sum;
}

/* By another way than the library's: distance to the plane if the foot is inside, else the
 * nearest edge. */
static double triangle_distance2(const double *x, const double *a, const double *b, const double *c)
{
    double u[3], v[3], w[3], n[3];
    for (int k = 0; k < 3; k++) {
        u[k] = b[k] - a[k];
        v[k] = c[k] - a[k];
        w[k] = x[k] - a[k];
    }
    for (int k = 0; k < 3; k++)
        n[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
    const double nn = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    double beta = 0.0, gamma = 0.0, height = 0.0;
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        beta += (w[i] * v[j] - w[j] * v[i]) * n[k];
        gamma += (u[i] * w[j] - u[j] * w[i]) * n[k];
        height += w[k] * n[k];
    }
    if (nn > 0.0 && beta >= 0.0 && gamma >= 0.0 && beta + gamma <= nn) return height * height / nn;
    return fmin(segment_distance2(x, a, b),
                fmin(segment_distance2(x, b, c), segment_distance2(x, c, a)));
}

static double brute_force(const apsm_mesh *mesh, const double *x)
{
    double best = INFINITY;
    for (size_t f = 0; f < mesh->nf; f++)
        best = fmin(best, triangle_distance2(x, mesh->V + 3 * mesh->F[3 * f],
                                             mesh->V + 3 * mesh->F[3 * f + 1],
                                             mesh->V + 3 * mesh->F[3 * f + 2]));
    return best;
}

static void random_point(apsm_random *rng, double size, double x[3])
{
    for (int c = 0; c < 3; c++) x[c] = size * (2.0 * apsm_random_uniform(rng) - 1.0);
}

static void check_consistent(const apsm_mesh *mesh, const double *x, const apsm_closest *c)
{
    double at[3], d2 = 0.0, sum = 0.0;
    apsm_surface_position(mesh, &c->on, at);
    for (int k = 0; k < 3; k++) {
        d2 += (x[k] - at[k]) * (x[k] - at[k]);
        sum += c->on.weight[k];
        assert_true(c->on.weight[k] >= 0.0);
        assert_true(at[k] == c->x[k]);
    }
    assert_near(sum, 1.0, 1e-15);
    assert_near(sqrt(d2), sqrt(c->distance2), 1e-14 * (1.0 + fabs(x[0])));
}

/* Triangles of all sizes and shapes, slivers and points among them. */
static apsm_mesh soup(apsm_random *rng, size_t nf)
{
    apsm_mesh mesh = shape_alloc(3 * nf, nf);
    for (size_t f = 0; f < nf; f++) {
        double centre[3];
        const double size = pow(10.0, -3.0 * apsm_random_uniform(rng));
        random_point(rng, 1.0, centre);
        for (size_t k = 0; k < 9; k++)
            mesh.V[9 * f + k] = centre[k % 3] + size * apsm_random_normal(rng);
        if (f % 17 == 0) memcpy(mesh.V + 9 * f + 3, mesh.V + 9 * f, 3 * sizeof(double));
        if (f % 31 == 0) /* three corners on a line */
            for (size_t k = 6; k < 9; k++)
                mesh.V[9 * f + k] = 0.5 * (mesh.V[9 * f + k - 3] + mesh.V[9 * f + k - 6]);
        if (f % 13 == 5) /* and nearly so */
            for (size_t k = 6; k < 9; k++)
                mesh.V[9 * f + k] =
                    0.3 * mesh.V[9 * f + k - 3] + 0.7 * mesh.V[9 * f + k - 6] +
                    size * pow(10.0, -1.0 - (double)(f % 11)) * apsm_random_normal(rng);
        if (f % 101 == 0)
            for (size_t k = 3; k < 9; k++) mesh.V[9 * f + k] = mesh.V[9 * f + k % 3];
        for (size_t k = 0; k < 3; k++) mesh.F[3 * f + k] = (uint32_t)(3 * f + k);
    }
    return mesh;
}

static void closest_equals_brute_force(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    apsm_mesh meshes[] = { soup(&rng, 500), shape_torus(40, 20, 1.0, 0.3), shape_cube(5, 1.0) };
    for (size_t m = 0; m < 3; m++) {
        apsm_bvh *bvh = build(&meshes[m]);
        for (int i = 0; i < 3000; i++) {
            double x[3];
            apsm_closest c;
            random_point(&rng, i % 10 ? 1.3 : 1e4, x);
            apsm_bvh_closest(bvh, x, INFINITY, &c);
            check_consistent(&meshes[m], x, &c);
            assert_near(sqrt(c.distance2), sqrt(brute_force(&meshes[m], x)),
                        1e-13 * (1.0 + fabs(x[0])));
        }
        apsm_bvh_free(bvh);
        apsm_mesh_free(&meshes[m]);
    }
}

/* From near its middle all faces of a ball are as far, to seven digits and more. */
static void near_ties_are_decided_in_double(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(10, APSM_STREAM_TEST, 0, 0);
    apsm_mesh ball = shape_icosphere(3);
    apsm_bvh *bvh = build(&ball);
    for (int i = 0; i < 300; i++) {
        double x[3];
        apsm_closest c;
        random_point(&rng, pow(10.0, -4.0 - i % 6), x);
        apsm_bvh_closest(bvh, x, INFINITY, &c);
        check_consistent(&ball, x, &c);
        assert_near(sqrt(c.distance2), sqrt(brute_force(&ball, x)), 1e-14);
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&ball);
}

static void check_same(const apsm_closest *a, const apsm_closest *b)
{
    assert_true(a->distance2 == b->distance2);
    assert_int_equal(a->on.face, b->on.face);
    assert_memory_equal(a->x, b->x, sizeof a->x);
}

/* A guess changes no answer. */
static void guesses_change_nothing(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(9, APSM_STREAM_TEST, 0, 0);
    apsm_mesh meshes[] = { soup(&rng, 400), shape_cube(6, 1.0) };
    for (size_t m = 0; m < 2; m++) {
        apsm_bvh *bvh = build(&meshes[m]);
        uint32_t slot = 0;
        for (int trial = 0; trial < 8000; trial++) {
            const double limit2 = trial % 3 ? INFINITY : 0.01;
            double x[3];
            apsm_closest want, guessed;
            random_point(&rng, 1.0, x);
            for (int c = 0; c < 3; c++) x[c] = rint(8.0 * x[c]) / 8.0; /* for ties on the cube */
            if (trial % 2) slot = (uint32_t)apsm_random_below(&rng, meshes[m].nf);
            apsm_bvh_closest(bvh, x, limit2, &want);
            bvh_closest_guess(bvh, x, limit2, &slot, &guessed);
            check_same(&guessed, &want);
        }
        apsm_bvh_free(bvh);
        apsm_mesh_free(&meshes[m]);
    }
}

/* Leaves near a cube, and of those the ones near a part of it, answer for every place in it. */
static void leaves_near_a_cube_suffice(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(10, APSM_STREAM_TEST, 0, 0);
    apsm_mesh meshes[] = { soup(&rng, 400), shape_cube(6, 1.0) };
    for (size_t m = 0; m < 2; m++) {
        apsm_bvh *bvh = build(&meshes[m]);
        bvh_near around, part;
        size_t known = 0;
        assert_int_equal(bvh_near_alloc(bvh, &around), APSM_OK);
        assert_int_equal(bvh_near_alloc(bvh, &part), APSM_OK);
        for (int trial = 0; trial < 4000; trial++) {
            const double half = 0.05 * (trial % 3), way = trial % 5 ? 0.1 : 0.5;
            double middle[3], x[BVH_AT_ONCE][3];
            apsm_closest want, found[BVH_AT_ONCE];
            uint32_t slot = (uint32_t)apsm_random_below(&rng, meshes[m].nf);
            random_point(&rng, 1.0, middle);
            bvh_near_collect(bvh, middle, 2 * half, way, &around);
            bvh_near_choose(bvh, &around, middle, half, way, &part);
            assert_true(part.n <= around.n && around.n <= around.room);
            for (int k = 0; k < BVH_AT_ONCE; k++) {
                random_point(&rng, half, x[k]);
                for (int c = 0; c < 3; c++) x[k][c] += middle[c];
            }
            bvh_near_closest_of(bvh, &part, (const double(*)[3])x, way * way, &slot, found);
            for (int k = 0; k < BVH_AT_ONCE; k++) {
                apsm_bvh_closest(bvh, x[k], way * way, &want);
                check_same(&found[k], &want);
                bvh_near_closest(bvh, &part, x[k], way * way, &slot, &found[k]);
                check_same(&found[k], &want);
                known += isfinite(want.distance2);
            }
        }
        assert_in_range(known, 500, 31999);
        bvh_near_free(&around);
        bvh_near_free(&part);
        apsm_bvh_free(bvh);
        apsm_mesh_free(&meshes[m]);
    }
}

/* Every surface point of every face is found again, at distance 0 up to rounding. */
static void points_on_the_surface_have_no_distance(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_ellipsoid(3, 5.0, 2.0, 0.5);
    apsm_bvh *bvh = build(&mesh);
    for (uint32_t f = 0; f < mesh.nf; f++) {
        const apsm_surface_point p = { f, { 0.2, 0.3, 0.5 } };
        double x[3];
        apsm_closest c;
        apsm_surface_position(&mesh, &p, x);
        apsm_bvh_closest(bvh, x, INFINITY, &c);
        assert_int_equal(c.on.face, f);
        assert_near(sqrt(c.distance2), 0.0, 1e-15 * 5.0);
        assert_near(c.on.weight[0], 0.2, 1e-12);
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
}

static void ties_go_to_the_smallest_face(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_cube(4, 2.0);
    apsm_bvh *bvh = build(&mesh);
    for (uint32_t v = 0; v < mesh.nv; v++) { /* beyond a vertex, all its faces are as near */
        uint32_t first = 0;
        double x[3];
        apsm_closest c;
        while (mesh.F[first] != v) first++;
        for (uint32_t k = 0; k < 3; k++) x[k] = mesh.V[3 * v + k];
        apsm_bvh_closest(bvh, x, INFINITY, &c);
        assert_int_equal(c.on.face, first / 3);
        assert_true(c.distance2 == 0.0);
        if (fabs(x[0]) == 1.0 && fabs(x[1]) == 1.0 && fabs(x[2]) == 1.0) {
            for (uint32_t k = 0; k < 3; k++) x[k] *= 1.5;
            apsm_bvh_closest(bvh, x, INFINITY, &c);
            assert_int_equal(c.on.face, first / 3);
            assert_true(c.distance2 == 0.75);
        }
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
}

static void bound_hides_what_is_not_nearer(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_cube(3, 2.0);
    apsm_bvh *bvh = build(&mesh);
    const double x[3] = { 0.1, 0.2, 3.0 };
    apsm_closest c;
    apsm_bvh_closest(bvh, x, 4.0, &c);
    assert_true(c.distance2 == INFINITY);
    apsm_bvh_closest(bvh, x, 4.0 * (1.0 + 1e-15), &c);
    assert_true(c.distance2 == 4.0);
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
}

/* Signed distance of a box, in closed form. */
static double box_distance(const double *x, const double half[3])
{
    double outside = 0.0, inside = -INFINITY;
    for (int c = 0; c < 3; c++) {
        const double d = fabs(x[c]) - half[c];
        if (d > 0.0) outside += d * d;
        inside = fmax(inside, d);
    }
    return inside <= 0.0 ? inside : sqrt(outside);
}

static void sign_is_right_on_sharp_and_thin_boxes(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(2, APSM_STREAM_TEST, 0, 0);
    const double sizes[][3] = { { 2, 2, 2 }, { 4, 3, 1e-3 }, { 1e-3, 1e-3, 5 }, { 4, 3, 1e-8 } };
    for (size_t k = 0; k < 4; k++) {
        const double *size = sizes[k], half[3] = { size[0] / 2, size[1] / 2, size[2] / 2 };
        apsm_mesh mesh = shape_box((size_t[3]){ 5, 4, 2 }, size);
        apsm_bvh *bvh = build(&mesh);
        for (int i = 0; i < 5000; i++) {
            double x[3];
            for (int c = 0; c < 3; c++)
                x[c] = (i % 2 ? 1.2 * size[c] : 3.0) * (apsm_random_uniform(&rng) - 0.5);
            const double want = box_distance(x, half);
            assert_near(apsm_bvh_signed_distance(bvh, x, NULL), want, 1e-15 * 8.0);
            if (fabs(want) > 1e-14)
                assert_true((apsm_bvh_signed_distance(bvh, x, NULL) < 0.0) == (want < 0.0));
        }
        apsm_bvh_free(bvh);
        apsm_mesh_free(&mesh);
    }
}

/* A needle of a tetrahedron: nearest features are mostly its sharp edges and vertices, where the
 * normals of single faces give the wrong sign for a good part of space. */
static void sign_is_right_around_a_needle(void **state)
{
    (void)state;
    static const uint8_t faces[4][3] = { { 0, 2, 1 }, { 0, 1, 3 }, { 1, 2, 3 }, { 2, 0, 3 } };
    const double V[12] = { 0, 0, 0, 1, 0.02, 0, 0.9, -0.03, 0.01, 3, 0.4, 0.05 };
    apsm_mesh mesh = shape_alloc(4, 4);
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, 0, 0);
    memcpy(mesh.V, V, sizeof V);
    for (size_t f = 0; f < 4;) shape_face(&mesh, &f, faces[f][0], faces[f][1], faces[f][2]);
    if (apsm_mesh_volume(&mesh) < 0.0)
        for (size_t f = 0; f < 4; f++) {
            const uint32_t swap = mesh.F[3 * f];
            mesh.F[3 * f] = mesh.F[3 * f + 1];
            mesh.F[3 * f + 1] = swap;
        }
    apsm_bvh *bvh = build(&mesh);
    for (int i = 0; i < 20000; i++) {
        double x[3], inside = INFINITY;
        random_point(&rng, i % 2 ? 0.3 : 4.0, x);
        for (size_t f = 0; f < 4; f++) { /* convex: inside is behind all four planes */
            const double *a = mesh.V + 3 * mesh.F[3 * f], *b = mesh.V + 3 * mesh.F[3 * f + 1],
                         *c = mesh.V + 3 * mesh.F[3 * f + 2];
            double n[3], d = 0.0;
            for (int k = 0; k < 3; k++) {
                const int u = (k + 1) % 3, v = (k + 2) % 3;
                n[k] = (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u]);
                d += n[k] * (x[k] - a[k]);
            }
            inside = fmin(inside, -d);
        }
        assert_true((apsm_bvh_signed_distance(bvh, x, NULL) < 0.0) == (inside > 0.0));
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
}

/* Sheets 0.01 apart: a query just under the upper one that faces down is sent to the lower. */
static void facing_keeps_to_its_side(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_box((size_t[3]){ 10, 10, 1 }, (double[3]){ 2, 2, 0.01 });
    apsm_bvh *bvh = build(&mesh);
    const double x[3] = { 0.13, 0.17, 0.004 }, up[3] = { 0, 0, 1 }, down[3] = { 0, 0, -1 };
    apsm_closest c;
    apsm_bvh_closest_facing(bvh, x, up, 0.5, INFINITY, &c);
    assert_near(c.x[2], 0.005, 1e-15);
    apsm_bvh_closest_facing(bvh, x, down, 0.5, INFINITY, &c);
    assert_near(c.x[2], -0.005, 1e-15);
    apsm_bvh_closest_facing(bvh, x, down, 0.5, 1e-6, &c);
    assert_true(c.distance2 == INFINITY);
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
}

static void rays_hit_where_they_must(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_cube(4, 2.0);
    apsm_bvh *bvh = build(&mesh);
    apsm_random rng = apsm_random_stream(4, APSM_STREAM_TEST, 0, 0);
    for (int i = 0; i < 5000; i++) {
        double x[3], d[3], want = INFINITY;
        random_point(&rng, 0.9, x);
        random_point(&rng, 1.0, d);
        if (i % 5 == 0) d[i % 3] = 0.0;
        if (i % 7 == 0) x[0] = x[1] = x[2] = 0.0; /* through diagonals, edges and vertices */
        if (i % 14 == 0)
            for (int c = 0; c < 3; c++) d[c] = rint(4.0 * d[c]);
        if (d[0] == 0.0 && d[1] == 0.0 && d[2] == 0.0) d[0] = 1.0;
        for (int c = 0; c < 3; c++)
            if (d[c] != 0.0) want = fmin(want, (copysign(1.0, d[c]) - x[c]) / d[c]);
        uint32_t face;
        assert_near(apsm_bvh_ray(bvh, x, d, 0.0, INFINITY, &face) / want, 1.0, 1e-13);
        assert_true(face < mesh.nf);
        assert_true(apsm_bvh_ray(bvh, x, d, 0.0, 0.999 * want, NULL) == INFINITY);
        for (int c = 0; c < 3; c++) x[c] += 5.0 * (d[c] != 0.0 ? copysign(1.0, d[c]) : 0.0);
        assert_true(apsm_bvh_ray(bvh, x, d, 0.0, INFINITY, &face) == INFINITY);
        assert_int_equal(face, UINT32_MAX);
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
}

/* Moving mesh and query together changes nothing but rounding; doubling them is exact. */
static void queries_move_and_scale_with_the_mesh(void **state)
{
    (void)state;
    const double angle = 0.7,
                 M[16] = { cos(angle), -sin(angle), 0, 100, sin(angle), cos(angle), 0, -50,
                           0,          0,           1, 20,  0,          0,          0, 1 };
    apsm_random rng = apsm_random_stream(5, APSM_STREAM_TEST, 0, 0);
    apsm_mesh mesh = shape_torus(30, 15, 1.0, 0.3), moved, big;
    assert_ok(apsm_mesh_copy(&mesh, &moved));
    assert_ok(apsm_mesh_copy(&mesh, &big));
    apsm_mesh_transform(&moved, M);
    for (size_t i = 0; i < 3 * big.nv; i++) big.V[i] *= 0x1p-70;
    apsm_bvh *a = build(&mesh), *b = build(&moved), *c = build(&big);
    for (int i = 0; i < 2000; i++) {
        double x[3], y[3], z[3];
        apsm_closest ca, cc;
        random_point(&rng, 1.4, x);
        apsm_affine_apply(M, 1, x, y);
        for (int k = 0; k < 3; k++) z[k] = x[k] * 0x1p-70;
        const double da = apsm_bvh_signed_distance(a, x, &ca);
        assert_near(apsm_bvh_signed_distance(b, y, NULL), da, 1e-13);
        assert_true(apsm_bvh_signed_distance(c, z, &cc) == da * 0x1p-70);
        assert_memory_equal(&ca.on, &cc.on, sizeof ca.on);
    }
    apsm_bvh_free(a);
    apsm_bvh_free(b);
    apsm_bvh_free(c);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&moved);
    apsm_mesh_free(&big);
}

/* All faces in one place, or each half as large as the last, must not exhaust the stack. */
/* A tree that follows a mesh which turns, grows and is dented answers like a new one. */
static void refit_answers_like_a_new_tree(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_torus(48, 24, 5, 2);
    apsm_bvh *bvh = build(&mesh);
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, 7, 0);
    for (int round = 0; round < 3; round++) {
        for (size_t v = 0; v < mesh.nv; v++) {
            double *x = mesh.V + 3 * v, t = x[0];
            x[0] = 1.7 * x[1] + 3;
            x[1] = -1.7 * t + 0.2 * sin(x[2]);
            x[2] += 0.3 * sin(t);
        }
        apsm_bvh_refit(bvh);
        apsm_bvh *fresh = build(&mesh);
        for (int i = 0; i < 500; i++) {
            apsm_closest a, b;
            double x[3];
            random_point(&rng, 40, x);
            apsm_bvh_closest(bvh, x, INFINITY, &a);
            apsm_bvh_closest(fresh, x, INFINITY, &b);
            assert_memory_equal(&a, &b, sizeof a);
            const double d = apsm_bvh_signed_distance(bvh, x, NULL);
            assert_true(d == apsm_bvh_signed_distance(fresh, x, NULL));
            assert_true(fabs(a.distance2 - brute_force(&mesh, x)) <= 1e-12 * (1 + a.distance2));
        }
        apsm_bvh_free(fresh);
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
}

static void hard_meshes_build(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_alloc(3000, 1000);
    for (int kind = 0; kind < 2; kind++) {
        for (size_t f = 0; f < 1000; f++) {
            const double s = kind ? ldexp(1.0, -(int)f) : 1.0;
            const double V[9] = { s, 0, 0, 2 * s, 0, 0, s, s, 0 };
            memcpy(mesh.V + 9 * f, V, sizeof V);
            for (size_t k = 0; k < 3; k++) mesh.F[3 * f + k] = (uint32_t)(3 * f + k);
        }
        apsm_bvh *bvh = build(&mesh);
        const double x[3] = { 1.2, 0.2, 1.0 };
        apsm_closest c;
        apsm_bvh_closest(bvh, x, INFINITY, &c);
        assert_near(c.distance2, 1.0, 1e-15);
        assert_int_equal(c.on.face, 0);
        apsm_bvh_free(bvh);
    }
    apsm_mesh_free(&mesh);
}

static void unusable_meshes_are_refused(void **state)
{
    (void)state;
    apsm_mesh none = { 0 }, mesh = shape_cube(1, 1.0);
    apsm_bvh *bvh;
    assert_int_equal(apsm_bvh_build(&none, &bvh), APSM_ERR_GEOMETRY);
    mesh.V[4] = NAN;
    assert_int_equal(apsm_bvh_build(&mesh, &bvh), APSM_ERR_NONFINITE);
    mesh.V[4] = 0.0;
    mesh.F[4] = 99;
    assert_int_equal(apsm_bvh_build(&mesh, &bvh), APSM_ERR_GEOMETRY);
    assert_null(bvh);
    apsm_bvh_free(NULL);
    apsm_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closest_equals_brute_force),
        cmocka_unit_test(near_ties_are_decided_in_double),
        cmocka_unit_test(guesses_change_nothing),
        cmocka_unit_test(leaves_near_a_cube_suffice),
        cmocka_unit_test(points_on_the_surface_have_no_distance),
        cmocka_unit_test(ties_go_to_the_smallest_face),
        cmocka_unit_test(bound_hides_what_is_not_nearer),
        cmocka_unit_test(sign_is_right_on_sharp_and_thin_boxes),
        cmocka_unit_test(sign_is_right_around_a_needle),
        cmocka_unit_test(facing_keeps_to_its_side),
        cmocka_unit_test(rays_hit_where_they_must),
        cmocka_unit_test(queries_move_and_scale_with_the_mesh),
        cmocka_unit_test(refit_answers_like_a_new_tree),
        cmocka_unit_test(hard_meshes_build),
        cmocka_unit_test(unusable_meshes_are_refused),
    };
    return cmocka_run_group_tests_name("bvh", tests, NULL, NULL);
}
