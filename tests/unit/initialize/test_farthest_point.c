/* Farthest-point sampling against the goldens and its own definition. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "golden.h"
#include "initialize/farthest_point.h"
#include "shapes.h"

#include "golden_mesh.h"

/* All shortest paths along edges, by relaxing until nothing changes. */
static double *edge_distances(const apsm_mesh *m)
{
    const size_t n = m->nv;
    double *D = malloc(n * n * sizeof *D);
    assert_non_null(D);
    for (size_t i = 0; i < n * n; i++) D[i] = i % (n + 1) ? INFINITY : 0;
    for (bool changed = true; changed;) {
        changed = false;
        for (size_t h = 0; h < 3 * m->nf; h++) {
            const size_t a = m->F[h], b = m->F[h % 3 == 2 ? h - 2 : h + 1];
            double l = 0;
            for (size_t k = 0; k < 3; k++)
                l += (m->V[3 * a + k] - m->V[3 * b + k]) * (m->V[3 * a + k] - m->V[3 * b + k]);
            l = sqrt(l);
            for (size_t s = 0; s < n; s++) {
                double *d = D + s * n;
                if (d[a] + l < d[b]) d[b] = d[a] + l, changed = true;
                if (d[b] + l < d[a]) d[a] = d[b] + l, changed = true;
            }
        }
    }
    return D;
}

static void check_order(const json_t *c, size_t J, const uint32_t *order, const double *radius)
{
    double *want = golden_member(c, "order", J), *r = golden_member(c, "radius", J);
    for (size_t k = 0; k < J; k++) assert_int_equal(order[k], (int)want[k]);
    assert_true(radius[0] == INFINITY);
    golden_close("radius", J - 1, radius + 1, r + 1, 1e-9);
    free(want);
    free(r);
}

static void agrees_with_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("fps");
    for (size_t i = 0; i < 2; i++) {
        const json_t *c = json_array_get(golden_get(root, "cases"), i);
        apsm_mesh mesh = golden_mesh(c);
        const size_t J = json_array_size(golden_get(c, "order"));
        const size_t first = (size_t)golden_number(c, "first");
        double *D = i == 0 ? edge_distances(&mesh) : golden_member(c, "D", mesh.nv * mesh.nv);
        double *nearest = malloc(mesh.nv * sizeof *nearest), radius[16];
        uint32_t order[16];
        assert_true(J <= 16 && nearest);
        assert_int_equal(apsm_farthest_points(mesh.nv, D, first, J, order, radius, nearest),
                         APSM_OK);
        check_order(c, J, order, radius);
        if (i == 0) {
            double *row = golden_member(c, "D_from_first", mesh.nv);
            golden_close("D_from_first", mesh.nv, D + first * mesh.nv, row, 1e-12);
            free(row);
        }
        free(D);
        free(nearest);
        apsm_mesh_free(&mesh);
    }
    json_decref(root);
}

static void ties_go_to_the_lowest_index(void **state)
{
    (void)state;
    enum { N = 5 };
    double D[N * N], nearest[N], radius[N];
    uint32_t order[N];
    for (size_t i = 0; i < N * N; i++) D[i] = i % (N + 1) ? 1 : 0;
    D[0 * N + 4] = D[4 * N + 0] = 0; /* 4 coincides with 0: last, but still a sample */
    assert_int_equal(apsm_farthest_points(N, D, 2, N, order, radius, nearest), APSM_OK);
    static const uint32_t want[N] = { 2, 0, 1, 3, 4 };
    assert_memory_equal(order, want, sizeof want);
    assert_true(radius[4] == 0);
    assert_int_equal(apsm_farthest_points(N, D, 2, N + 1, order, radius, nearest), APSM_ERR_ARG);
}

typedef struct prepared {
    apsm_topology topology;
    apsm_geodesic *g;
    apsm_geodesic_work *w;
} prepared;

static prepared prepare(const apsm_mesh *mesh, prepared *p)
{
    assert_int_equal(apsm_topology_build(mesh, &p->topology), APSM_OK);
    assert_int_equal(apsm_geodesic_build(mesh, &p->topology, &p->g), APSM_OK);
    assert_int_equal(apsm_geodesic_work_new(p->g, &p->w), APSM_OK);
    return *p;
}

static void release(prepared *p)
{
    apsm_geodesic_work_free(p->w);
    apsm_geodesic_free(p->g);
    apsm_topology_free(&p->topology);
}

/* On a flat mesh, where geodesics are straight, the mesh version picks the same points. */
static void vertices_of_a_plane_as_by_matrix(void **state)
{
    (void)state;
    json_t *root = golden_load("fps");
    const json_t *c = json_array_get(golden_get(root, "cases"), 1);
    apsm_mesh mesh = golden_mesh(c);
    prepared p;
    prepare(&mesh, &p);
    double nearest[36], radius[12];
    uint32_t order[12];
    assert_int_equal(apsm_farthest_vertices(p.g, p.w, 0, 12, order, radius, nearest), APSM_OK);
    /* Where the jittered outline is in the way, the paths bend: by a visibility graph. */
    static const double bent[11] = { 7.218829567163652,  5.164761593411951,  4.886896267134613,
                                     2.8811825112993543, 2.3013166140907613, 2.235328065751612,
                                     2.128662120098805,  1.9830244637593297, 1.5372339552935685,
                                     1.4738122488464744, 1.3828893736014682 };
    double *want = golden_member(c, "order", 12);
    for (size_t k = 0; k < 12; k++) assert_int_equal(order[k], (int)want[k]);
    golden_close("radius", 11, radius + 1, bent, 0.005);
    free(want);
    release(&p);
    apsm_mesh_free(&mesh);
    json_decref(root);
}

/* Radii fall; samples are as far apart as the radius says, and nothing is farther than that. */
static void samples_of_a_sphere_are_spread(void **state)
{
    (void)state;
    enum { J = 100 };
    apsm_mesh mesh = shape_icosphere(4);
    prepared p;
    prepare(&mesh, &p);
    double *nearest = malloc(mesh.nv * sizeof *nearest), radius[J];
    uint32_t order[J];
    assert_non_null(nearest);
    assert_int_equal(apsm_farthest_vertices(p.g, p.w, 17, J, order, radius, nearest), APSM_OK);
    assert_int_equal(order[0], 17);
    assert_true(fabs(radius[1] - 3.14159265) < 0.04);
    for (size_t k = 2; k < J; k++) assert_true(radius[k] <= radius[k - 1]);
    for (size_t v = 0; v < mesh.nv; v++) assert_true(nearest[v] <= radius[J - 1]);
    for (size_t j = 0; j < J; j++)
        for (size_t k = 0; k < j; k++) {
            const double *a = mesh.V + 3 * order[j], *b = mesh.V + 3 * order[k];
            const double arc = acos(fmin(1, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]));
            assert_true(arc >= 0.97 * radius[J - 1]);
        }
    assert_true(radius[J - 1] > 0.25 && radius[J - 1] < 0.42); /* spacing of 100 on 4 pi: 0.38 */
    free(nearest);
    release(&p);
    apsm_mesh_free(&mesh);
}

static void unused_vertices_do_not_count(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_icosphere(1);
    apsm_mesh more = shape_alloc(mesh.nv + 3, mesh.nf);
    memset(more.V, 0, 9 * sizeof *more.V); /* the first three are unused */
    memcpy(more.V + 9, mesh.V, 3 * mesh.nv * sizeof *mesh.V);
    for (size_t i = 0; i < 3 * mesh.nf; i++) more.F[i] = mesh.F[i] + 3;
    prepared p;
    prepare(&more, &p);
    double nearest[64];
    uint32_t order[64];
    assert_int_equal(apsm_farthest_vertices(p.g, p.w, 3, 43, order, NULL, nearest),
                     APSM_ERR_GEOMETRY);
    assert_int_equal(apsm_farthest_vertices(p.g, p.w, 3, 42, order, NULL, nearest), APSM_OK);
    bool seen[64] = { false };
    for (size_t k = 0; k < 42; k++) {
        assert_true(order[k] >= 3 && !seen[order[k]]);
        seen[order[k]] = true;
    }
    release(&p);
    apsm_mesh_free(&more);
    apsm_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_golden),
        cmocka_unit_test(ties_go_to_the_lowest_index),
        cmocka_unit_test(vertices_of_a_plane_as_by_matrix),
        cmocka_unit_test(samples_of_a_sphere_are_spread),
        cmocka_unit_test(unused_vertices_do_not_count),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
