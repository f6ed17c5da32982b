#include "cmocka_all.h"

#include "geometry/topology.h"
#include "shapes.h"

static apsm_mesh_defects inspect(const apsm_mesh *mesh)
{
    apsm_mesh_defects d;
    assert_ok(apsm_mesh_inspect(mesh, &d));
    return d;
}

static long euler(const apsm_mesh *mesh)
{
    apsm_topology t;
    assert_ok(apsm_topology_build(mesh, &t));
    const long chi = apsm_mesh_euler(mesh, &t);
    apsm_topology_free(&t);
    return chi;
}

/* A mesh with room for more vertices and faces after those of `mesh`, which is freed. */
static apsm_mesh extended(apsm_mesh *mesh, size_t nv, size_t nf)
{
    apsm_mesh out = shape_alloc(mesh->nv + nv, mesh->nf + nf);
    memcpy(out.V, mesh->V, 3 * mesh->nv * sizeof *out.V);
    memcpy(out.F, mesh->F, 3 * mesh->nf * sizeof *out.F);
    apsm_mesh_free(mesh);
    return out;
}

static void twins_and_corners_are_consistent(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_torus(12, 8, 3.0, 1.0);
    apsm_topology t;
    assert_ok(apsm_topology_build(&mesh, &t));
    for (uint32_t h = 0; h < 3 * mesh.nf; h++) {
        const uint32_t g = t.twin[h], end = h % 3 == 2 ? h - 2 : h + 1;
        assert_int_not_equal(g, APSM_NONE);
        assert_int_equal(t.twin[g], h);
        assert_int_equal(mesh.F[g], mesh.F[end]);
    }
    size_t seen = 0;
    for (uint32_t v = 0; v < mesh.nv; v++)
        for (uint32_t i = t.corner_start[v]; i < t.corner_start[v + 1]; i++, seen++) {
            assert_int_equal(mesh.F[t.corner[i]], v);
            if (i > t.corner_start[v]) assert_true(t.corner[i] > t.corner[i - 1]);
        }
    assert_int_equal(seen, 3 * mesh.nf);
    apsm_topology_free(&t);
    apsm_mesh_free(&mesh);
}

static void sound_meshes_pass(void **state)
{
    (void)state;
    apsm_mesh meshes[] = { shape_icosphere(3), shape_torus(10, 7, 3, 1), shape_cube(4, 1.0),
                           shape_box((size_t[3]){ 8, 5, 1 }, (double[3]){ 8, 5, 0.01 }) };
    const long chi[] = { 2, 0, 2, 2 };
    for (size_t i = 0; i < 4; i++) {
        const apsm_mesh_defects d = inspect(&meshes[i]);
        assert_true(apsm_mesh_is_closed_manifold(&d));
        assert_int_equal(d.components, 1);
        assert_int_equal(euler(&meshes[i]), chi[i]);
        assert_true(apsm_mesh_volume(&meshes[i]) > 0.0);
        apsm_mesh_free(&meshes[i]);
    }
}

static void hole_is_found(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_icosphere(2);
    const uint32_t *F = mesh.F + 3 * (mesh.nf - 1);
    double near = INFINITY;
    mesh.nf--;
    const apsm_mesh_defects d = inspect(&mesh);
    assert_int_equal(d.border_edges, 3);
    for (int k = 0; k < 3; k++) { /* the place is the middle of one of the lost face's edges */
        const double *a = mesh.V + 3 * F[k], *b = mesh.V + 3 * F[(k + 1) % 3];
        near = fmin(near, fabs(d.border_at[0] - 0.5 * (a[0] + b[0])) +
                              fabs(d.border_at[1] - 0.5 * (a[1] + b[1])) +
                              fabs(d.border_at[2] - 0.5 * (a[2] + b[2])));
    }
    assert_near(near, 0.0, 1e-15);
    assert_int_equal(d.components, 1);
    assert_false(apsm_mesh_is_closed_manifold(&d));
    assert_int_equal(euler(&mesh), 1);
    apsm_mesh_free(&mesh);
}

static void open_plane_has_a_border(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_plane(4, 3, 1, 1);
    const apsm_mesh_defects d = inspect(&mesh);
    assert_int_equal(d.border_edges, 14);
    assert_int_equal(d.nonmanifold_vertices, 0);
    assert_int_equal(euler(&mesh), 1);
    apsm_mesh_free(&mesh);
}

static void flipped_face_is_found(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_cube(2, 1.0);
    const uint32_t swap = mesh.F[31];
    mesh.F[31] = mesh.F[32];
    mesh.F[32] = swap;
    const apsm_mesh_defects d = inspect(&mesh);
    assert_int_equal(d.flipped_edges, 3);
    assert_int_equal(d.border_edges, 0);
    assert_false(apsm_mesh_is_closed_manifold(&d));
    apsm_mesh_free(&mesh);
}

/* Whichever way the fin runs along the edge. */
static void fin_makes_a_nonmanifold_edge(void **state)
{
    (void)state;
    for (int turn = 0; turn < 2; turn++) {
        apsm_mesh mesh = shape_icosphere(1);
        const uint32_t a = mesh.F[turn], b = mesh.F[1 - turn];
        mesh = extended(&mesh, 1, 1);
        shape_set3(mesh.V + 3 * (mesh.nv - 1), 5, 5, 5);
        size_t f = mesh.nf - 1;
        shape_face(&mesh, &f, a, b, mesh.nv - 1);
        const apsm_mesh_defects d = inspect(&mesh);
        assert_int_equal(d.nonmanifold_edges, 1);
        assert_int_equal(d.border_edges, 2);
        assert_int_equal(d.nonmanifold_vertices, 0); /* all faces still hang together there */
        for (uint32_t k = 0; k < 3; k++)
            assert_near(d.nonmanifold_at[k], 0.5 * (mesh.V[3 * a + k] + mesh.V[3 * b + k]), 1e-15);
        apsm_topology t;
        assert_ok(apsm_topology_build(&mesh, &t));
        assert_int_equal(t.twin[0], APSM_NONE);
        apsm_topology_free(&t);
        apsm_mesh_free(&mesh);
    }
}

/* Two tetrahedra that touch in a vertex. */
static void bow_tie_vertex_is_found(void **state)
{
    (void)state;
    static const uint8_t faces[8][3] = { { 0, 2, 1 }, { 0, 1, 3 }, { 1, 2, 3 }, { 2, 0, 3 },
                                         { 3, 5, 4 }, { 3, 4, 6 }, { 4, 5, 6 }, { 5, 3, 6 } };
    apsm_mesh mesh = shape_alloc(7, 8);
    const double V[21] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0.2, 0.2, 1, 1, 0, 2, 0, 1, 2, -1, -1, 2 };
    memcpy(mesh.V, V, sizeof V);
    for (size_t f = 0; f < 8;) shape_face(&mesh, &f, faces[f][0], faces[f][1], faces[f][2]);
    const apsm_mesh_defects d = inspect(&mesh);
    assert_int_equal(d.nonmanifold_vertices, 1);
    assert_int_equal(d.nonmanifold_edges, 0);
    assert_int_equal(d.border_edges, 0);
    assert_int_equal(d.flipped_edges, 0);
    assert_int_equal(d.components, 2);
    assert_memory_equal(d.nonmanifold_at, V + 9, 3 * sizeof(double));
    assert_false(apsm_mesh_is_closed_manifold(&d));
    apsm_mesh_free(&mesh);
}

static void degenerate_faces_are_counted_not_stumbled_over(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_cube(1, 1.0);
    const uint32_t a = mesh.F[0], b = mesh.F[1];
    mesh = extended(&mesh, 0, 1);
    size_t f = mesh.nf - 1;
    shape_face(&mesh, &f, a, b, b); /* a folded sliver on an edge */
    apsm_mesh_defects d = inspect(&mesh);
    assert_int_equal(d.degenerate_faces, 1);
    assert_int_equal(d.nonmanifold_edges, 0);
    assert_int_equal(d.border_edges, 0);
    assert_false(apsm_mesh_is_closed_manifold(&d));
    assert_int_equal(euler(&mesh), 2);
    apsm_mesh_free(&mesh);

    mesh = shape_cube(2, 1.0); /* an edge's middle drawn into its end: area 0, corners differ */
    memcpy(mesh.V + 3 * mesh.F[1], mesh.V + 3 * mesh.F[0], 3 * sizeof(double));
    d = inspect(&mesh);
    assert_true(d.degenerate_faces >= 1);
    assert_int_equal(d.border_edges, 0);
    apsm_mesh_free(&mesh);
}

static void components_and_unused_vertices_are_counted(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_cube(1, 1.0);
    const size_t nv = mesh.nv, nf = mesh.nf;
    mesh = extended(&mesh, nv + 2, nf);
    for (size_t i = 0; i < 3 * nv; i++) mesh.V[3 * nv + i] = mesh.V[i] + 3.0;
    for (size_t i = 0; i < 3 * nf; i++) mesh.F[3 * nf + i] = mesh.F[i] + (uint32_t)nv;
    memset(mesh.V + 6 * nv, 0, 6 * sizeof(double));
    const apsm_mesh_defects d = inspect(&mesh);
    assert_int_equal(d.components, 2);
    assert_int_equal(d.unused_vertices, 2);
    assert_true(apsm_mesh_is_closed_manifold(&d));
    assert_int_equal(euler(&mesh), 4);
    apsm_mesh_free(&mesh);
}

static void bad_index_is_refused(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_cube(1, 1.0);
    apsm_mesh_defects d;
    apsm_topology t;
    mesh.F[5] = 8;
    assert_int_equal(apsm_mesh_inspect(&mesh, &d), APSM_ERR_GEOMETRY);
    assert_int_equal(apsm_topology_build(&mesh, &t), APSM_ERR_GEOMETRY);
    apsm_mesh_free(&mesh);
}

static void empty_mesh_is_no_surface(void **state)
{
    (void)state;
    apsm_mesh mesh = { 0 };
    const apsm_mesh_defects d = inspect(&mesh);
    assert_false(apsm_mesh_is_closed_manifold(&d));
    assert_int_equal(euler(&mesh), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(twins_and_corners_are_consistent),
        cmocka_unit_test(sound_meshes_pass),
        cmocka_unit_test(hole_is_found),
        cmocka_unit_test(open_plane_has_a_border),
        cmocka_unit_test(flipped_face_is_found),
        cmocka_unit_test(fin_makes_a_nonmanifold_edge),
        cmocka_unit_test(bow_tie_vertex_is_found),
        cmocka_unit_test(degenerate_faces_are_counted_not_stumbled_over),
        cmocka_unit_test(components_and_unused_vertices_are_counted),
        cmocka_unit_test(bad_index_is_refused),
        cmocka_unit_test(empty_mesh_is_no_surface),
    };
    return cmocka_run_group_tests_name("topology", tests, NULL, NULL);
}
