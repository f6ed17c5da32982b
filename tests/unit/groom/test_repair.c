/* Repair: every planted defect is mended, counted, and nothing else is touched. */
#include "cmocka_all.h"

#include <stdio.h>

#include "geometry/topology.h"
#include "geometry/vec3.h"
#include "groom/groom.h"
#include "shapes.h"

/* Room for `more` vertices and faces behind the mesh's own. */
static void grow(apsm_mesh *mesh, size_t more)
{
    mesh->V = realloc(mesh->V, 3 * (mesh->nv + more) * sizeof *mesh->V);
    mesh->F = realloc(mesh->F, 3 * (mesh->nf + more) * sizeof *mesh->F);
    if (!mesh->V || !mesh->F) abort();
}

static uint32_t add_vertex(apsm_mesh *mesh, double x, double y, double z)
{
    shape_set3(mesh->V + 3 * mesh->nv, x, y, z);
    return (uint32_t)mesh->nv++;
}

/* b's vertices and faces behind a's, moved by (dx, 0, 0); b is freed. */
static void append(apsm_mesh *a, apsm_mesh b, double dx)
{
    grow(a, b.nv + b.nf);
    for (size_t i = 0; i < 3 * b.nf; i++) a->F[3 * a->nf + i] = b.F[i] + (uint32_t)a->nv;
    for (size_t i = 0; i < 3 * b.nv; i++) a->V[3 * a->nv + i] = b.V[i] + (i % 3 == 0 ? dx : 0.0);
    a->nv += b.nv;
    a->nf += b.nf;
    apsm_mesh_free(&b);
}

static void flip(apsm_mesh *mesh, size_t f)
{
    const uint32_t t = mesh->F[3 * f];
    mesh->F[3 * f] = mesh->F[3 * f + 1];
    mesh->F[3 * f + 1] = t;
}

/* Repairs mesh (freed); fails the test unless a closed outward surface comes out. */
static apsm_groom_report mended(apsm_mesh *mesh, apsm_mesh *out)
{
    apsm_context *ctx = apsm_context_new();
    apsm_groom_report r = { 0 };
    apsm_mesh_defects d;
    if (apsm_repair(ctx, "shape", mesh, NULL, out, &r) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    assert_ok(apsm_mesh_inspect(out, &d));
    assert_true(apsm_mesh_is_closed_manifold(&d));
    assert_int_equal(d.components, 1);
    assert_true(apsm_mesh_volume(out) > 0.0);
    apsm_mesh_free(mesh);
    apsm_context_free(ctx);
    return r;
}

/* Repair must fail, and its line must contain `word`. */
static void assert_refused(apsm_mesh *mesh, const char *word)
{
    apsm_context *ctx = apsm_context_new();
    apsm_mesh out;
    assert_int_equal(apsm_repair(ctx, "shape", mesh, NULL, &out, NULL), APSM_ERR_GEOMETRY);
    if (!strstr(apsm_error_text(ctx), word) || !strstr(apsm_error_text(ctx), "shape"))
        fail_msg("\"%s\" does not say \"%s\"", apsm_error_text(ctx), word);
    assert_null(out.V);
    apsm_mesh_free(mesh);
    apsm_context_free(ctx);
}

static const double ball = 4.0 / 3.0 * 3.14159265358979323846;

static void sound_mesh_is_left_alone(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(4, 1.0), copy, out;
    assert_ok(apsm_mesh_copy(&mesh, &copy));
    const apsm_groom_report r = mended(&mesh, &out), zero = { 0 };
    assert_memory_equal(&r, &zero, sizeof r);
    assert_int_equal(out.nv, copy.nv);
    assert_int_equal(out.nf, copy.nf);
    assert_memory_equal(out.V, copy.V, 3 * copy.nv * sizeof *copy.V);
    assert_memory_equal(out.F, copy.F, 3 * copy.nf * sizeof *copy.F);
    apsm_mesh_free(&copy);
    apsm_mesh_free(&out);
}

static void triangle_soup_is_welded(void **state)
{
    (void)state;
    apsm_mesh ball3 = shape_sphere(3, 1.0), soup = shape_alloc(3 * ball3.nf, ball3.nf), out;
    for (size_t h = 0; h < 3 * ball3.nf; h++) {
        for (size_t c = 0; c < 3; c++) /* corners differ by up to 6e-8 */
            soup.V[3 * h + c] = ball3.V[3 * ball3.F[h] + c] * (1.0 + 1e-8 * (double)(h % 7));
        soup.F[h] = (uint32_t)h;
    }
    const size_t vertices = ball3.nv, corners = soup.nv;
    const apsm_groom_report r = mended(&soup, &out);
    assert_int_equal(out.nv, vertices);
    assert_int_equal(r.merged_vertices, corners - vertices);
    apsm_mesh_free(&ball3);
    apsm_mesh_free(&out);
}

static void holes_are_closed(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(4, 1.0), out;
    size_t n = 0;
    for (size_t f = 0; f < mesh.nf; f++) { /* a polar cap, and one face elsewhere */
        double z = 0.0;
        for (size_t k = 0; k < 3; k++) z += mesh.V[3 * mesh.F[3 * f + k] + 2] / 3.0;
        if (z > 0.9 || f == mesh.nf / 2) continue;
        memmove(mesh.F + 3 * n++, mesh.F + 3 * f, 3 * sizeof *mesh.F);
    }
    mesh.nf = n;
    const apsm_groom_report r = mended(&mesh, &out);
    assert_int_equal(r.holes, 2);
    assert_true(r.hole_faces > 20);
    assert_near(r.largest_cap, 0.05, 0.01); /* a tenth of the radius: 0.05 of the sphere */
    assert_near(r.largest_cap_at[2], 0.9, 0.02);
    assert_near(apsm_mesh_volume(&out), ball, 0.02 * ball);
    apsm_mesh_free(&out);
}

/* A ball without its top beyond z and without one face elsewhere. */
static apsm_mesh opened_ball(double z_most)
{
    apsm_mesh mesh = shape_sphere(4, 1.0);
    size_t n = 0;
    for (size_t f = 0; f < mesh.nf; f++) {
        double z = 0.0;
        for (size_t k = 0; k < 3; k++) z += mesh.V[3 * mesh.F[3 * f + k] + 2] / 3.0;
        if (z > z_most || f == mesh.nf / 2) continue;
        memmove(mesh.F + 3 * n++, mesh.F + 3 * f, 3 * sizeof *mesh.F);
    }
    mesh.nf = n;
    return mesh;
}

/* Status of repair with an option set; the report is that of the result, or left zero. */
static apsm_status repaired(bool open, bool fill, bool inside_out, apsm_groom_report *r)
{
    apsm_context *ctx = apsm_context_new();
    apsm_groom_options opt = apsm_groom_defaults();
    apsm_mesh mesh = opened_ball(0.4), out = { 0 };
    for (size_t f = 0; inside_out && f < mesh.nf; f++) {
        const uint32_t a = mesh.F[3 * f];
        mesh.F[3 * f] = mesh.F[3 * f + 1];
        mesh.F[3 * f + 1] = a;
    }
    opt.open = open;
    opt.fill = fill;
    *r = (apsm_groom_report){ 0 };
    const apsm_status status = apsm_repair(ctx, "shape", &mesh, &opt, &out, r);
    if (status != APSM_OK) {
        assert_non_null(strstr(apsm_error_text(ctx), "--open"));
        assert_non_null(strstr(apsm_error_text(ctx), "--fill"));
    } else if (open) {
        const double *V = out.V;
        double n[3];
        vec3_triangle(V + 3 * out.F[0], V + 3 * out.F[1], V + 3 * out.F[2], n);
        assert_true(vec3_dot(n, V + 3 * out.F[0]) > 0.0); /* outward, whatever it was */
    }
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&out);
    apsm_context_free(ctx);
    return status;
}

/* Two faces on one line enclose nothing and have no share to compare. */
static void faces_on_a_line_are_refused(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_mesh mesh = shape_alloc(4, 2), out = { 0 };
    static const uint32_t F[6] = { 0, 1, 2, 1, 3, 2 };
    for (size_t v = 0; v < 4; v++) shape_set3(mesh.V + 3 * v, (double)v, 0.0, 0.0);
    memcpy(mesh.F, F, sizeof F);
    const apsm_groom_options opt = apsm_groom_defaults();
    apsm_groom_report r = { 0 };
    assert_int_equal(apsm_repair(ctx, "line", &mesh, &opt, &out, &r), APSM_ERR_GEOMETRY);
    assert_non_null(strstr(apsm_error_text(ctx), "no area"));
    assert_null(strstr(apsm_error_text(ctx), "nan"));
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&out);
    apsm_context_free(ctx);
}

static void large_opening_is_a_question(void **state)
{
    (void)state;
    apsm_groom_report r;
    assert_int_equal(repaired(false, false, false, &r), APSM_ERR_GEOMETRY);
    assert_int_equal(repaired(false, true, false, &r), APSM_OK);
    assert_int_equal(r.holes, 2);
    assert_int_equal(r.openings, 0);
    for (int inside_out = 0; inside_out < 2; inside_out++) {
        assert_int_equal(repaired(true, false, inside_out, &r), APSM_OK);
        assert_int_equal(r.holes, 1); /* the face */
        assert_int_equal(r.openings, 1);
        assert_int_equal(r.genus, 0);
        assert_int_equal(r.inverted, inside_out);
        const double rim = 2.0 * 3.14159265358979323846 * sqrt(1.0 - 0.4 * 0.4);
        assert_near(r.open_length, rim / sqrt(0.7 * 4.0 * 3.14159265358979323846),
                    0.45); /* jagged */
    }
}

enum { ROUND = 400, ALONG = 40 };

/* Open tube of length 8 with the section r = 1 + wave cos 5u. */
static apsm_mesh open_tube(double wave)
{
    apsm_mesh mesh = shape_alloc(ROUND * (ALONG + 1), 2 * ROUND * ALONG);
    size_t f = 0;
    for (size_t j = 0; j <= ALONG; j++)
        for (size_t i = 0; i < ROUND; i++) {
            const double u = 2.0 * 3.14159265358979323846 * (double)i / ROUND;
            const double r = 1.0 + wave * cos(5.0 * u);
            shape_set3(mesh.V + 3 * (j * ROUND + i), r * cos(u), r * sin(u),
                       8.0 * (double)j / ALONG);
            const size_t a = j * ROUND + i, b = j * ROUND + (i + 1) % ROUND;
            if (j == ALONG) continue;
            shape_face(&mesh, &f, a, b, b + ROUND);
            shape_face(&mesh, &f, a, b + ROUND, a + ROUND);
        }
    return mesh;
}

/* Least 4 sqrt(3) area / (sum of squared sides) of the faces from `first` on: 1 equilateral. */
static double worst_face(const apsm_mesh *m, size_t first)
{
    double worst = 1.0;
    for (size_t f = first; f < m->nf; f++) {
        double n[3], sum = 0.0;
        const uint32_t *c = m->F + 3 * f;
        vec3_triangle(m->V + 3 * c[0], m->V + 3 * c[1], m->V + 3 * c[2], n);
        for (int k = 0; k < 3; k++)
            sum += vec3_distance2(m->V + 3 * c[k], m->V + 3 * c[(k + 1) % 3]);
        worst = fmin(worst, 2.0 * sqrt(3.0) * vec3_norm(n) / sum);
    }
    return worst;
}

/* A bone cut off at both ends, round or grooved: more corners than the least-area table takes.
 * The ends are not made of needles from rim to rim. */
static void open_tubes_get_flat_ends(void **state)
{
    (void)state;
    const double pi = 3.14159265358979323846, waves[2] = { 0.0, 0.4 };
    for (int k = 0; k < 2; k++) {
        apsm_mesh mesh = open_tube(waves[k]), out;
        const double side = apsm_mesh_area(&mesh);
        const size_t vertices = mesh.nv, faces = mesh.nf;
        const double section = pi * (1.0 + 0.5 * waves[k] * waves[k]);
        const apsm_groom_report r = mended(&mesh, &out);
        assert_int_equal(r.holes, 2);
        assert_int_equal(r.hole_faces, 2 * (ROUND - 2) + 2 * (out.nv - vertices));
        assert_true(out.nv > vertices);
        assert_true(worst_face(&out, faces) > 0.04); /* a needle from rim to rim has 0.007 */
        assert_near(apsm_mesh_volume(&out), 8.0 * section, 0.002 * 8.0 * section);
        assert_near(apsm_mesh_area(&out) - side, 2.0 * section, 0.002 * section);
        apsm_mesh_free(&out);
    }
}

static void duplicate_and_degenerate_faces_go(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(3, 1.0), out;
    const size_t faces = mesh.nf;
    grow(&mesh, 4);
    memcpy(mesh.F + 3 * mesh.nf, mesh.F + 30, 3 * sizeof *mesh.F);
    mesh.nf++;
    memcpy(mesh.F + 3 * mesh.nf, mesh.F + 60, 3 * sizeof *mesh.F);
    flip(&mesh, mesh.nf++);
    shape_set3(mesh.V + 3 * mesh.nv++, 9, 9, 9);
    size_t f = mesh.nf;
    shape_face(&mesh, &f, 5, 5, 8);
    mesh.nf = f;
    const apsm_groom_report r = mended(&mesh, &out);
    assert_int_equal(out.nf, faces);
    assert_int_equal(r.duplicate_faces, 2);
    assert_int_equal(r.degenerate_faces, 1);
    assert_int_equal(r.unused_vertices, 1);
    assert_int_equal(r.holes, 0);
    apsm_mesh_free(&out);
}

/* The first n faces of a ball are there on both sides, up to all of them: the ball remains. */
static void faces_on_both_sides_count_once(void **state)
{
    (void)state;
    const apsm_mesh round = shape_sphere(3, 1.0);
    for (size_t n = 1; n <= round.nf; n += n < 300 ? 61 : round.nf - n > 0 ? round.nf - n : 1) {
        apsm_mesh mesh, out;
        assert_ok(apsm_mesh_copy(&round, &mesh));
        grow(&mesh, n);
        for (size_t f = 0; f < n; f++) {
            memcpy(mesh.F + 3 * mesh.nf, mesh.F + 3 * f, 3 * sizeof *mesh.F);
            flip(&mesh, n % 2 ? mesh.nf : f); /* the copy, or the original */
            mesh.nf++;
        }
        const apsm_groom_report r = mended(&mesh, &out);
        assert_int_equal(r.duplicate_faces, n);
        assert_int_equal(out.nf, round.nf);
        assert_near(apsm_mesh_volume(&out), apsm_mesh_volume(&round), 1e-12);
        apsm_mesh_free(&out);
    }
    apsm_mesh kept = round;
    apsm_mesh_free(&kept);
}

/* Two boxes that meet in a whole wall, which both have: one body, without it. */
static void wall_between_two_bodies_goes(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_cube(4, 1.0), out;
    append(&mesh, shape_cube(4, 1.0), 1.0);
    const apsm_groom_report r = mended(&mesh, &out);
    assert_int_equal(r.duplicate_faces, 64);
    assert_near(apsm_mesh_volume(&out), 2.0, 1e-9);
    assert_near(apsm_mesh_area(&out), 10.0, 1e-9);
    apsm_mesh_free(&out);
}

/* Two balls that share one vertex; the smaller is dropped after the vertex is split. */
static void bow_tie_is_split(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(3, 1.0), out;
    size_t right = 0, left = 0;
    for (size_t v = 0; v < mesh.nv; v++)
        if (mesh.V[3 * v] > mesh.V[3 * right]) right = v;
    apsm_mesh small = shape_sphere(2, 0.3);
    for (size_t v = 0; v < small.nv; v++)
        if (small.V[3 * v] < small.V[3 * left]) left = v;
    const size_t first = mesh.nv;
    append(&mesh, small, 1.5);
    memcpy(mesh.V + 3 * (first + left), mesh.V + 3 * right, 3 * sizeof *mesh.V);
    const apsm_groom_report r = mended(&mesh, &out);
    assert_int_equal(r.merged_vertices, 1);
    assert_int_equal(r.split_vertices, 1);
    assert_int_equal(r.dropped_components, 1);
    assert_int_equal(r.dropped_faces, 320);
    assert_near(r.dropped_area, 0.083, 0.01);
    apsm_mesh_free(&out);
}

static void flipped_patch_is_turned_back(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(3, 1.0), out;
    for (size_t f = 100; f < 250; f++) flip(&mesh, f);
    apsm_groom_report r = mended(&mesh, &out);
    assert_int_equal(r.flipped_faces, 150);
    assert_false(r.inverted);
    apsm_mesh_free(&out);
    mesh = shape_sphere(3, 1.0);
    for (size_t f = 0; f < mesh.nf; f++) flip(&mesh, f);
    r = mended(&mesh, &out);
    assert_int_equal(r.flipped_faces, 0);
    assert_true(r.inverted);
    apsm_mesh_free(&out);
}

static void fin_is_cut_off(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(3, 1.0), out;
    const size_t faces = mesh.nf;
    grow(&mesh, 2);
    const uint32_t tip = add_vertex(&mesh, 2, 2, 2);
    size_t f = mesh.nf;
    shape_face(&mesh, &f, mesh.F[0], mesh.F[1], tip);
    mesh.nf = f;
    const apsm_groom_report r = mended(&mesh, &out);
    assert_int_equal(r.fin_faces, 1);
    assert_int_equal(out.nf, faces);
    apsm_mesh_free(&out);
}

/* A wall across a box: three faces meet at each edge of its rim. */
static void inner_wall_is_taken_out(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_box((const size_t[3]){ 4, 1, 1 }, (const double[3]){ 4, 1, 1 }), out;
    uint32_t ring[4];
    const double corner[4][2] = { { -.5, -.5 }, { .5, -.5 }, { .5, .5 }, { -.5, .5 } };
    for (int k = 0; k < 4; k++)
        for (uint32_t v = 0; v < mesh.nv; v++)
            if (mesh.V[3 * v] == 1.0 && mesh.V[3 * v + 1] == corner[k][0] &&
                mesh.V[3 * v + 2] == corner[k][1])
                ring[k] = v;
    grow(&mesh, 2);
    size_t f = mesh.nf;
    shape_face(&mesh, &f, ring[0], ring[1], ring[2]);
    shape_face(&mesh, &f, ring[0], ring[2], ring[3]);
    mesh.nf = f;
    const apsm_groom_report r = mended(&mesh, &out);
    assert_int_equal(r.fin_faces, 2);
    assert_near(apsm_mesh_volume(&out), 4.0, 1e-12);
    apsm_mesh_free(&out);
}

/* Two boxes that touch along one edge, by which four faces meet. */
static void bodies_touching_along_an_edge_come_apart(void **state)
{
    (void)state;
    const size_t n[3] = { 2, 2, 2 }, m[3] = { 1, 1, 2 };
    apsm_mesh mesh = shape_box(n, (const double[3]){ 4, 4, 4 }), out;
    apsm_mesh small = shape_box(m, (const double[3]){ 0.5, 0.5, 4 });
    for (size_t v = 0; v < small.nv; v++) small.V[3 * v + 1] += 2.25;
    append(&mesh, small, 2.25);
    const apsm_groom_report r = mended(&mesh, &out);
    assert_int_equal(r.merged_vertices, 3);
    assert_int_equal(r.split_vertices, 3);
    assert_int_equal(r.dropped_components, 1);
    assert_near(apsm_mesh_volume(&out), 64.0, 1e-12);
    apsm_mesh_free(&out);
}

static void parts_of_similar_size_are_refused(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(3, 1.0);
    append(&mesh, shape_sphere(3, 0.9), 5.0);
    assert_refused(&mesh, "separate parts");
}

/* The wall of a cavity may have more area than the body: the body is kept. */
static void cavity_is_dropped(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(4, 1.0), inner = shape_sphere(4, 0.9), out;
    for (size_t f = 0; f < inner.nf; f++) flip(&inner, f);
    for (size_t v = 0; v < inner.nv; v++)
        for (size_t c = 0; c < 3; c++) inner.V[3 * v + c] *= v % 3 ? 1.0 : 0.6; /* crumpled */
    append(&mesh, inner, 0.0);
    const apsm_groom_report r = mended(&mesh, &out);
    assert_int_equal(r.dropped_components, 1);
    assert_near(apsm_mesh_volume(&out), ball, 0.01 * ball);
    apsm_mesh_free(&out);
}

static void handle_is_kept(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_torus(40, 20, 3.0, 1.0), out;
    mesh.nf--;
    const apsm_groom_report r = mended(&mesh, &out);
    assert_int_equal(r.genus, 1);
    assert_int_equal(r.holes, 1);
    apsm_mesh_free(&out);
}

/* A vertex on the opposite side: a face without area that cannot simply be dropped. */
static void flat_face_is_edited_away(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_box((const size_t[3]){ 2, 2, 2 }, (const double[3]){ 2, 2, 2 }), out;
    const double top[3] = { 0, 0, 1 };
    for (size_t v = 0; v < mesh.nv; v++)
        if (!memcmp(mesh.V + 3 * v, top, sizeof top)) mesh.V[3 * v] = 1.0, mesh.V[3 * v + 1] = 0.5;
    (void)mended(&mesh, &out);
    assert_near(apsm_mesh_volume(&out), 8.0, 1e-9);
    apsm_mesh_free(&out);
}

static void surfaces_without_inside_are_refused(void **state)
{
    (void)state;
    apsm_mesh sheet = shape_plane(10, 10, 1.0, 1.0);
    assert_refused(&sheet, "cap");
    apsm_mesh one = shape_plane(1, 1, 1.0, 1.0);
    one.nf = 1;
    assert_refused(&one, "cap");
    apsm_mesh doubled = shape_plane(10, 10, 1.0, 1.0);
    append(&doubled, shape_plane(10, 10, 1.0, 1.0), 0.0);
    for (size_t f = 200; f < 400; f++) flip(&doubled, f);
    assert_refused(&doubled, "cap");
    apsm_mesh empty = shape_plane(1, 1, 1.0, 1.0);
    empty.nf = 0;
    assert_refused(&empty, "empty");
}

/* A vertex far away: refused by repair, or, at 40 radii, by remeshing, which may not go on for
 * ever.
 */
static void stray_vertices_are_refused(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_mesh mesh = shape_sphere(3, 1.0);
    mesh.V[0] = 1e5;
    assert_refused(&mesh, "vertex 0");
    apsm_mesh near = shape_sphere(3, 1.0), out;
    near.V[0] = 40.0;
    assert_int_equal(apsm_groom_mesh(ctx, "shape", &near, NULL, &out, NULL), APSM_ERR_GEOMETRY);
    assert_non_null(strstr(apsm_error_text(ctx), "stray vertex"));
    apsm_mesh needles = shape_box((size_t[3]){ 1, 60, 60 }, (double[3]){ 4000.0, 1.0, 1.0 });
    assert_int_equal(apsm_groom_mesh(ctx, "shape", &needles, NULL, &out, NULL), APSM_ERR_GEOMETRY);
    assert_non_null(strstr(apsm_error_text(ctx), "needles"));
    apsm_mesh_free(&near);
    apsm_mesh_free(&needles);
    apsm_context_free(ctx);
}

/* A strip of n quads closed with a twist. */
static void moebius_band_is_refused(void **state)
{
    (void)state;
    enum { N = 30 };
    apsm_mesh mesh = shape_alloc(2 * N, 2 * N);
    size_t f = 0;
    for (size_t i = 0; i < N; i++) {
        const double u = 2.0 * 3.14159265358979323846 * (double)i / N;
        for (size_t s = 0; s < 2; s++) {
            const double w = 0.3 * (s ? 1 : -1), rho = 1.0 + w * cos(0.5 * u);
            shape_set3(mesh.V + 3 * (2 * i + s), rho * cos(u), rho * sin(u), w * sin(0.5 * u));
        }
        const size_t a = 2 * i, b = a + 1, c = i + 1 < N ? a + 2 : 1, d = i + 1 < N ? a + 3 : 0;
        shape_face(&mesh, &f, a, c, d);
        shape_face(&mesh, &f, a, d, b);
    }
    assert_refused(&mesh, "one side");
}

static void bad_numbers_are_refused(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(1, 1.0), out;
    mesh.V[10] = NAN;
    assert_int_equal(apsm_repair(NULL, "x", &mesh, NULL, &out, NULL), APSM_ERR_NONFINITE);
    mesh.V[10] = 0.0;
    mesh.F[7] = 4000;
    assert_int_equal(apsm_repair(NULL, "x", &mesh, NULL, &out, NULL), APSM_ERR_FORMAT);
    apsm_mesh_free(&mesh);
}

static void keep_line(void *user, apsm_log_level level, const char *text)
{
    (void)level;
    snprintf(user, 500, "%s", text);
}

/* The whole path, and what it says. */
static void groomed_mesh_is_told_of(void **state)
{
    (void)state;
    char text[500] = "";
    apsm_context *ctx = apsm_context_new();
    apsm_context_set_log(ctx, keep_line, text);
    apsm_mesh mesh = shape_sphere(5, 10.0), out;
    apsm_groom_options opt = apsm_groom_defaults();
    apsm_groom_report r;
    opt.remesh_options.faces = 3000;
    mesh.nf -= 3;
    assert_ok(apsm_groom_mesh(ctx, "a.ply", &mesh, &opt, &out, &r));
    assert_non_null(strstr(text, "a.ply: "));
    assert_non_null(strstr(text, "closed"));
    assert_in_range(out.nf, 2700, 3300);
    assert_in_range(r.remesh.faces_after, 2700, 3300);
    assert_near(apsm_mesh_volume(&out), ball * 1000.0, 0.01 * ball * 1000.0);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&out);
    apsm_context_free(ctx);
}

static void reflection_is_its_own_inverse(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_ellipsoid(3, 3, 2, 1), was;
    for (size_t v = 0; v < mesh.nv; v++) mesh.V[3 * v] += 50.0;
    assert_ok(apsm_mesh_copy(&mesh, &was));
    double M[16], N[16];
    apsm_reflect(&mesh, M);
    assert_near(apsm_mesh_volume(&mesh), apsm_mesh_volume(&was), 1e-9);
    assert_near(M[0], -1.0, 0.0);
    assert_near(mesh.V[0], 100.0 - was.V[0], 1e-4);
    assert_near(mesh.V[1], was.V[1], 0.0);
    apsm_reflect(&mesh, N);
    for (size_t i = 0; i < 3 * mesh.nv; i++) assert_near(mesh.V[i], was.V[i], 1e-12);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&was);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sound_mesh_is_left_alone),
        cmocka_unit_test(triangle_soup_is_welded),
        cmocka_unit_test(holes_are_closed),
        cmocka_unit_test(faces_on_a_line_are_refused),
        cmocka_unit_test(large_opening_is_a_question),
        cmocka_unit_test(open_tubes_get_flat_ends),
        cmocka_unit_test(duplicate_and_degenerate_faces_go),
        cmocka_unit_test(faces_on_both_sides_count_once),
        cmocka_unit_test(wall_between_two_bodies_goes),
        cmocka_unit_test(bow_tie_is_split),
        cmocka_unit_test(flipped_patch_is_turned_back),
        cmocka_unit_test(fin_is_cut_off),
        cmocka_unit_test(inner_wall_is_taken_out),
        cmocka_unit_test(bodies_touching_along_an_edge_come_apart),
        cmocka_unit_test(parts_of_similar_size_are_refused),
        cmocka_unit_test(cavity_is_dropped),
        cmocka_unit_test(handle_is_kept),
        cmocka_unit_test(flat_face_is_edited_away),
        cmocka_unit_test(surfaces_without_inside_are_refused),
        cmocka_unit_test(moebius_band_is_refused),
        cmocka_unit_test(stray_vertices_are_refused),
        cmocka_unit_test(bad_numbers_are_refused),
        cmocka_unit_test(groomed_mesh_is_told_of),
        cmocka_unit_test(reflection_is_its_own_inverse),
    };
    return cmocka_run_group_tests_name("repair", tests, NULL, NULL);
}
