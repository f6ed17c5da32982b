/* Writes one mesh of a known shape, for tests of the command line; or a moved or scaled copy of a
 * mesh file:
 *
 *   make_synthetic SHAPE OUT.ply [OPTION VALUE...]
 *   make_synthetic IN.ply OUT.ply [OPTION VALUE...]
 *   make_synthetic supershape OUT.vtk [index I] [count N]    a closed contour of one mode
 *   make_synthetic joint OUT_DIR [OPTION VALUE...]   joints of two ellipsoids with planted pose and
 * shape make_synthetic KIND OUT_DIR [OPTION VALUE...]    a cohort with truth: make_cohort.c
 *
 * SHAPE: ellipsoid, bump or plate (shape `index` of `count` of a cohort, synthetic.h), sphere,
 * torus, sheet (a thin box).  Options: level (of the icosphere), index, count, hole (faces left
 * out), open (what lies above so much of the height is missing; -s: what lies below), wobble (root
 * mean square of a smooth random deformation as a share of the box's diagonal) with its seed,
 * mirror (1: x is negated), turn (degrees about (1, 2, 3)), shift (along (1, -2, 0.5)), lift (along
 * z), scale, patch (degrees about z: a field "heat" of the vertices, a bell about the direction
 * there, 30 degrees wide); applied in this order whatever their order on the command line.
 *
 * Options of joints: count, level, seed (of the motions), angle (the second part turns about a
 * point between both, from -angle to angle degrees, evenly), form (and is longer by from -form to
 * form of itself, along its principal axis), away (between the parts' centres), gap (else, if not
 * 0, between their surfaces), rough (as wobble, other for every subject and part), move (0:
 * subjects lie as they were made, else each is moved as a whole). OUT_DIR/shapes/sNN_a.ply,
 * sNN_b.ply; OUT_DIR/truth.csv, OUT_DIR/landmarks.csv (true ones). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/context.h"
#include "apsm/formats.h"
#include "core/random.h"
#include "files/files.h"
#include "geometry/affine.h"
#include "geometry/clip.h"
#include "joint/contact.h"
#include "make_cohort.h"
#include "option_words.h"
#include "synthetic.h"

enum {
    LEVEL,
    INDEX,
    COUNT,
    HOLE,
    OPEN,
    WOBBLE,
    SEED,
    MIRROR,
    TURN,
    SHIFT,
    SCALE,
    PATCH,
    LIFT,
    OPTIONS
};
static const char *const names[OPTIONS] = { "level",  "index", "count",  "hole", "open",
                                            "wobble", "seed",  "mirror", "turn", "shift",
                                            "scale",  "patch", "lift" };

static apsm_status make(apsm_context *ctx, const char *shape, const double v[OPTIONS],
                        apsm_mesh *mesh)
{
    static const char *const kinds[] = { "ellipsoid", "bump", "plate" };
    const int level = (int)v[LEVEL];
    const size_t cells = (size_t)4 << level;
    for (int k = 0; k < 3; k++)
        if (strcmp(shape, kinds[k]) == 0) {
            *mesh = synthetic_shape((synthetic_kind)k, (size_t)v[INDEX], (size_t)v[COUNT], level);
            return APSM_OK;
        }
    if (strcmp(shape, "sphere") == 0)
        *mesh = shape_sphere(level, 20 + v[INDEX]);
    else if (strcmp(shape, "torus") == 0)
        *mesh = shape_torus(2 * cells, cells, 30, 8 + v[INDEX]);
    else if (strcmp(shape, "sheet") == 0)
        *mesh = shape_box((size_t[3]){ cells, cells, 1 }, (double[3]){ 40 + v[INDEX], 30, 1 });
    else
        return apsm_read_mesh(ctx, shape, mesh);
    return APSM_OK;
}

static apsm_status open_top(double share, apsm_mesh *mesh)
{
    double lo[3], hi[3], *below = malloc(mesh->nv * sizeof *below);
    apsm_mesh open;
    if (!below) return APSM_ERR_MEMORY;
    apsm_mesh_bounds(mesh, lo, hi);
    const double on = 0.1 * apsm_mesh_mean_edge(mesh); /* no needles */
    for (size_t i = 0; i < mesh->nv; i++) {
        const double up = mesh->V[3 * i + 2] - (lo[2] + fabs(share) * (hi[2] - lo[2]));
        below[i] = fabs(up) < on ? 0 : share < 0 ? up : -up;
    }
    const apsm_status status = apsm_mesh_clip_field(mesh, below, &open);
    free(below);
    if (status != APSM_OK) return status;
    apsm_mesh_free(mesh);
    *mesh = open;
    return APSM_OK;
}

/* A few waves in random directions, half to one and a half in the box's diagonal: at a wobble of
 * 0.03 the gradient stays well below 1, so that the surface does not run into itself. */
static void wobble(double share, uint64_t seed, apsm_mesh *mesh)
{
    enum { WAVES = 8 };
    apsm_random rng = apsm_random_stream(seed, APSM_STREAM_TEST, 0, 0);
    double lo[3], hi[3], diagonal = 0, k[WAVES][3], a[WAVES][3], phase[WAVES];
    apsm_mesh_bounds(mesh, lo, hi);
    for (int c = 0; c < 3; c++) diagonal += (hi[c] - lo[c]) * (hi[c] - lo[c]);
    diagonal = sqrt(diagonal);
    for (int w = 0; w < WAVES; w++) {
        double norm = 0;
        for (int c = 0; c < 3; c++) k[w][c] = apsm_random_normal(&rng), norm += k[w][c] * k[w][c];
        const double waves = 0.5 + apsm_random_uniform(&rng);
        for (int c = 0; c < 3; c++) {
            k[w][c] *= 2 * M_PI * waves / (sqrt(norm) * diagonal);
            a[w][c] = share * diagonal * sqrt(2.0 / (3 * WAVES)) * apsm_random_normal(&rng);
        }
        phase[w] = 2 * M_PI * apsm_random_uniform(&rng);
    }
    for (size_t i = 0; i < mesh->nv; i++) {
        double *x = mesh->V + 3 * i, u[3] = { 0 };
        for (int w = 0; w < WAVES; w++) {
            const double s = cos(k[w][0] * x[0] + k[w][1] * x[1] + k[w][2] * x[2] + phase[w]);
            for (int c = 0; c < 3; c++) u[c] += s * a[w][c];
        }
        for (int c = 0; c < 3; c++) x[c] += u[c];
    }
}

/* Rodrigues' formula about the unit vector u. */
static void turn(const double u[3], double angle, double x[3])
{
    const double c = cos(angle), s = sin(angle);
    const double along = (u[0] * x[0] + u[1] * x[1] + u[2] * x[2]) * (1 - c);
    const double across[3] = { u[1] * x[2] - u[2] * x[1], u[2] * x[0] - u[0] * x[2],
                               u[0] * x[1] - u[1] * x[0] };
    for (int k = 0; k < 3; k++) x[k] = c * x[k] + s * across[k] + along * u[k];
}

static void move(const double v[OPTIONS], apsm_mesh *mesh)
{
    const double n = sqrt(14), u[3] = { 1 / n, 2 / n, 3 / n }, way[3] = { 1, -2, 0.5 };
    for (size_t i = 0; i < mesh->nv; i++) {
        double *x = mesh->V + 3 * i;
        if (v[MIRROR] != 0) x[0] = -x[0];
        if (v[TURN] != 0) turn(u, v[TURN] * M_PI / 180, x);
        for (int k = 0; k < 3; k++)
            x[k] = v[SCALE] * (x[k] + v[SHIFT] * way[k] + (k == 2 ? v[LIFT] : 0));
    }
    for (size_t f = 0; v[MIRROR] != 0 && f < mesh->nf; f++) { /* outward again */
        const uint32_t b = mesh->F[3 * f + 1];
        mesh->F[3 * f + 1] = mesh->F[3 * f + 2];
        mesh->F[3 * f + 2] = b;
    }
}

/* The field moves over the surface as the shapes differ, which are equal otherwise. */
static apsm_status write_patch(apsm_context *ctx, const char *path, const apsm_mesh *mesh,
                               double degrees)
{
    double *heat = malloc(mesh->nv * sizeof *heat);
    const double a = degrees * M_PI / 180, width = 30 * M_PI / 180;
    if (!heat) return APSM_ERR_MEMORY;
    for (size_t v = 0; v < mesh->nv; v++) {
        const double *x = mesh->V + 3 * v, r = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        const double angle = acos((x[0] * cos(a) + x[1] * sin(a)) / r);
        heat[v] = 100 * exp(-0.5 * angle * angle / (width * width / 4));
    }
    const apsm_mesh_field field = { "heat", heat };
    const apsm_status status = apsm_write_mesh_fields(ctx, path, mesh, 1, &field);
    free(heat);
    return status;
}

/* Gielis' superformula in the plane with six lobes, whose sharpness alone varies. */
static int make_contour(apsm_context *ctx, const char *path, double share)
{
    enum { POINTS = 180 };
    apsm_writer *w = NULL;
    if (apsm_writer_open(ctx, path, &w) != APSM_OK) return 1;
    apsm_writer_printf(w, "# vtk DataFile Version 3.0\nsupershape\nASCII\nDATASET POLYDATA\n");
    apsm_writer_printf(w, "POINTS %d double\n", POINTS);
    for (int k = 0; k < POINTS; k++) {
        const double phi = 2 * M_PI * k / POINTS, n1 = 4 + 4 * share;
        const double c = pow(fabs(cos(1.5 * phi)), 3), s = pow(fabs(sin(1.5 * phi)), 3);
        const double r = 50 * pow(c + s, -1 / n1);
        apsm_writer_printf(w, "%.9f %.9f 0\n", r * cos(phi), r * sin(phi));
    }
    apsm_writer_printf(w, "LINES %d %d\n", POINTS, 3 * POINTS);
    for (int k = 0; k < POINTS; k++) apsm_writer_printf(w, "2 %d %d\n", k, (k + 1) % POINTS);
    return apsm_writer_commit(w) != APSM_OK;
}

/* ---- joints ---- */

enum { J_COUNT, J_LEVEL, J_SEED, J_ANGLE, J_FORM, J_AWAY, J_MOVE, J_GAP, J_ROUGH, J_OPTIONS };
static const char *const joint_names[J_OPTIONS] = { "count", "level", "seed", "angle", "form",
                                                    "away",  "move",  "gap",  "rough" };

/* An ellipsoid that has no symmetry: always the same. */
static apsm_mesh make_part(int d, int level)
{
    apsm_mesh mesh = synthetic_shape((synthetic_kind)0, d == 0 ? 1 : 3, 6, level);
    wobble(0.04, d == 0 ? 3 : 8, &mesh);
    return mesh;
}

/* The mesh is longer by form along its first principal axis: about its centroid, so that the rigid
 * motion that fits it to itself best is none. */
static void lengthen(double form, apsm_mesh *mesh)
{
    double c[3] = { 0 }, A[9] = { 0 }, U[9], s[3], V[9];
    for (size_t k = 0; k < 3 * mesh->nv; k++) c[k % 3] += mesh->V[k] / (double)mesh->nv;
    for (size_t k = 0; k < mesh->nv; k++)
        for (size_t a = 0; a < 9; a++)
            A[a] += (mesh->V[3 * k + a / 3] - c[a / 3]) * (mesh->V[3 * k + a % 3] - c[a % 3]);
    apsm_svd3(A, U, s, V);
    for (size_t k = 0; k < mesh->nv; k++) {
        double *x = mesh->V + 3 * k, along = 0;
        for (size_t a = 0; a < 3; a++) along += (x[a] - c[a]) * U[3 * a];
        for (size_t a = 0; a < 3; a++) x[a] += form * along * U[3 * a];
    }
}

/* Part b: longer by form, away from a, turned about the middle between both. */
static void pose_part(const double v[J_OPTIONS], double angle, double form, apsm_mesh *b)
{
    const double n = sqrt(14), u[3] = { 1 / n, 2 / n, 3 / n };
    lengthen(form, b);
    for (size_t k = 0; k < b->nv; k++) {
        double *x = b->V + 3 * k;
        x[0] += v[J_AWAY] / 2;
        turn(u, angle * M_PI / 180, x);
        x[0] += v[J_AWAY] / 2;
    }
}

/* Moves b along x until it is gap away from a. */
static apsm_status bring_near(double gap, const apsm_mesh *a, apsm_mesh *b)
{
    enum { STEPS = 40 };
    apsm_bvh *tree = NULL;
    APSM_TRY(apsm_bvh_build(a, &tree));
    apsm_status status = APSM_OK;
    for (int k = 0; k < STEPS && status == APSM_OK; k++) {
        apsm_bvh *other = NULL;
        apsm_contact c = { 0 };
        status = apsm_bvh_build(b, &other);
        if (status == APSM_OK) apsm_contact_measure(tree, other, &c);
        apsm_bvh_free(other);
        const double way = c.depth > 0 ? c.depth + gap : gap - c.gap;
        for (size_t v = 0; v < b->nv; v++) b->V[3 * v] += way;
    }
    apsm_bvh_free(tree);
    return status;
}

static void move_subject(apsm_random *rng, apsm_mesh mesh[2])
{
    double u[3], t[3], norm = 0;
    for (int c = 0; c < 3; c++) u[c] = apsm_random_normal(rng), norm += u[c] * u[c];
    for (int c = 0; c < 3; c++) u[c] /= sqrt(norm), t[c] = 20 * apsm_random_normal(rng);
    const double angle = 0.3 * apsm_random_normal(rng);
    for (int d = 0; d < 2; d++)
        for (size_t k = 0; k < mesh[d].nv; k++) {
            turn(u, angle, mesh[d].V + 3 * k);
            for (int c = 0; c < 3; c++) mesh[d].V[3 * k + (size_t)c] += t[c];
        }
}

/* Vertices correspond: a few of them are true landmarks. */
static void write_marks(apsm_writer *marks, size_t i, int d, const apsm_mesh *mesh)
{
    for (size_t k = 0; k < 4; k++) {
        const double *x = mesh->V + 3 * (k * 37 % mesh->nv);
        apsm_writer_printf(marks, "s%02zu_%c,v%zu,%.9g,%.9g,%.9g\n", i, 'a' + d, k, x[0], x[1],
                           x[2]);
    }
}

static apsm_status write_joint(apsm_context *ctx, const char *folder, const double v[J_OPTIONS],
                               size_t i, apsm_writer *const out[2])
{
    const size_t n = (size_t)v[J_COUNT];
    const double at = n > 1 ? 2 * (double)i / (double)(n - 1) - 1 : 0;
    const double other = cos(2.5 * M_PI * at); /* even: has no correlation with the turn */
    const double angle = v[J_ANGLE] * at, form = v[J_FORM] * other;
    apsm_random rng = apsm_random_stream((uint64_t)v[J_SEED], APSM_STREAM_TEST, i, 0);
    apsm_mesh mesh[2] = { make_part(0, (int)v[J_LEVEL]), make_part(1, (int)v[J_LEVEL]) };
    apsm_status status = APSM_OK;
    for (int d = 0; d < 2 && v[J_ROUGH] > 0; d++)
        wobble(v[J_ROUGH], 1000 * (uint64_t)v[J_SEED] + 2 * i + (uint64_t)d, &mesh[d]);
    pose_part(v, angle, form, &mesh[1]);
    if (v[J_GAP] > 0) status = bring_near(v[J_GAP], &mesh[0], &mesh[1]);
    if (v[J_MOVE] != 0) move_subject(&rng, mesh);
    for (int d = 0; d < 2; d++) {
        char path[1024];
        snprintf(path, sizeof path, "%s/shapes/s%02zu_%c.ply", folder, i, 'a' + d);
        if (status == APSM_OK) status = apsm_write_mesh(ctx, path, &mesh[d]);
        write_marks(out[1], i, d, &mesh[d]);
        apsm_mesh_free(&mesh[d]);
    }
    apsm_writer_printf(out[0], "s%02zu,%.9g,%.9g\n", i, angle, form);
    return status;
}

static int make_joint(apsm_context *ctx, int argc, char **argv)
{
    double v[J_OPTIONS] = { [J_COUNT] = 8, [J_LEVEL] = 3, [J_AWAY] = 100, [J_MOVE] = 1 };
    char path[1024];
    static const char *const files[2] = { "truth.csv", "landmarks.csv" };
    static const char *const heads[2] = { "name,angle,form\n", "shape,name,x,y,z\n" };
    apsm_writer *out[2] = { NULL, NULL };
    if (!option_words(argc - 3, argv + 3, J_OPTIONS, joint_names, v)) return 2;
    snprintf(path, sizeof path, "%s/shapes", argv[2]);
    apsm_status status = apsm_make_folder(ctx, path);
    for (int k = 0; k < 2 && status == APSM_OK; k++) {
        snprintf(path, sizeof path, "%s/%s", argv[2], files[k]);
        status = apsm_writer_open(ctx, path, &out[k]);
        if (status == APSM_OK) apsm_writer_printf(out[k], "%s", heads[k]);
    }
    for (size_t i = 0; i < (size_t)v[J_COUNT] && status == APSM_OK; i++)
        status = write_joint(ctx, argv[2], v, i, out);
    for (int k = 0; k < 2; k++)
        if (status == APSM_OK)
            status = apsm_writer_commit(out[k]);
        else if (out[k])
            apsm_writer_abort(out[k]);
    if (status != APSM_OK) fprintf(stderr, "make_synthetic: %s\n", apsm_error_text(ctx));
    return status != APSM_OK;
}

static int make_one(apsm_context *ctx, int argc, char **argv)
{
    double v[OPTIONS] = { [LEVEL] = 3, [COUNT] = 5, [SCALE] = 1, [OPEN] = 1, [PATCH] = NAN };
    apsm_mesh mesh = { 0 };
    if (!option_words(argc - 3, argv + 3, OPTIONS, names, v)) return 2;
    if (strcmp(argv[1], "supershape") == 0) return make_contour(ctx, argv[2], v[INDEX] / v[COUNT]);
    apsm_status status = make(ctx, argv[1], v, &mesh);
    if (status == APSM_OK) {
        mesh.nf -= (size_t)v[HOLE] < mesh.nf ? (size_t)v[HOLE] : 0;
        if (v[OPEN] < 1) status = open_top(v[OPEN], &mesh);
    }
    if (status == APSM_OK) {
        if (v[WOBBLE] > 0) wobble(v[WOBBLE], (uint64_t)v[SEED], &mesh);
        move(v, &mesh);
        status = isnan(v[PATCH]) ? apsm_write_mesh(ctx, argv[2], &mesh)
                                 : write_patch(ctx, argv[2], &mesh, v[PATCH]);
    }
    if (status != APSM_OK) fprintf(stderr, "make_synthetic: %s\n", apsm_error_text(ctx));
    apsm_mesh_free(&mesh);
    return status != APSM_OK;
}

static int usage(void)
{
    fprintf(stderr, "usage: make_synthetic SHAPE|IN.ply OUT.ply [OPTION VALUE...]\n"
                    "       make_synthetic KIND OUT_DIR [OPTION VALUE...]\n");
    return 2;
}

int main(int argc, char **argv)
{
    if (argc < 3) return usage();
    apsm_context *ctx = apsm_context_new();
    if (!ctx) return 1;
    const int code = is_cohort(argv[1])              ? make_cohort(ctx, argc, argv)
                     : strcmp(argv[1], "joint") == 0 ? make_joint(ctx, argc, argv)
                                                     : make_one(ctx, argc, argv);
    apsm_context_free(ctx);
    return code == 2 ? usage() : code;
}
