/* Meshes and points into PLY, STL, OBJ, legacy VTK and VTP files; the same mesh gives the same
 * bytes everywhere. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "apsm/formats.h"
#include "formats/input_file.h"
#include "formats/vtp_write.h"

/* ---- values ---- */

static void put_bits(apsm_writer *w, uint64_t bits, size_t size, bool big_endian)
{
    unsigned char raw[8];
    for (size_t b = 0; b < size; b++)
        raw[big_endian ? size - 1 - b : b] = (unsigned char)(bits >> (8 * b));
    apsm_writer_write(w, raw, size);
}

static void put_float(apsm_writer *w, double value)
{
    const float x = (float)value;
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    put_bits(w, bits, sizeof bits, false);
}

static void put_doubles(apsm_writer *w, size_t n, const double *x)
{
    for (size_t k = 0; k < n; k++) {
        uint64_t bits;
        memcpy(&bits, &x[k], sizeof bits);
        put_bits(w, bits, sizeof bits, true);
    }
}

/* ---- formats ---- */

/* With a float of each of the n fields (nv each) behind every vertex. */
static void write_ply_fields(apsm_writer *w, const apsm_mesh *m, size_t n,
                             const apsm_mesh_field *field)
{
    apsm_writer_printf(w,
                       "ply\nformat binary_little_endian 1.0\nelement vertex %zu\nproperty float "
                       "x\nproperty float y\nproperty float z\n",
                       m->nv);
    for (size_t k = 0; k < n; k++) apsm_writer_printf(w, "property float %s\n", field[k].name);
    apsm_writer_printf(w, "element face %zu\nproperty list uchar int vertex_indices\nend_header\n",
                       m->nf);
    for (size_t v = 0; v < m->nv; v++) {
        for (size_t k = 0; k < 3; k++) put_float(w, m->V[3 * v + k]);
        for (size_t k = 0; k < n; k++) put_float(w, field[k].value[v]);
    }
    for (size_t f = 0; f < m->nf; f++) {
        put_bits(w, 3, 1, false);
        for (size_t k = 0; k < 3; k++) put_bits(w, m->F[3 * f + k], 4, false);
    }
}

static void write_ply(apsm_writer *w, const apsm_mesh *m)
{
    write_ply_fields(w, m, 0, NULL);
}

/* Unit normal of a triangle; (0,0,0) if it has no area. */
static void put_normal(apsm_writer *w, const double *a, const double *b, const double *c)
{
    double n[3];
    for (int k = 0; k < 3; k++) {
        const int u = (k + 1) % 3, v = (k + 2) % 3;
        n[k] = (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u]);
    }
    const double length = hypot(hypot(n[0], n[1]), n[2]);
    for (int k = 0; k < 3; k++)
        put_float(w, length > 0.0 && isfinite(length) ? n[k] / length : 0.0);
}

static void write_stl(apsm_writer *w, const apsm_mesh *m)
{
    apsm_writer_printf(w, "%80s", "");
    put_bits(w, m->nf, 4, false);
    for (size_t f = 0; f < m->nf; f++) {
        const double *corner[3];
        for (int k = 0; k < 3; k++) corner[k] = m->V + 3 * m->F[3 * f + (size_t)k];
        put_normal(w, corner[0], corner[1], corner[2]);
        for (int k = 0; k < 9; k++) put_float(w, corner[k / 3][k % 3]);
        put_bits(w, 0, 2, false);
    }
}

static void write_obj(apsm_writer *w, const apsm_mesh *m)
{
    for (size_t v = 0; v < m->nv; v++) {
        apsm_writer_write(w, "v", 1);
        for (size_t k = 0; k < 3; k++) {
            apsm_writer_write(w, " ", 1);
            apsm_writer_number(w, m->V[3 * v + k]);
        }
        apsm_writer_write(w, "\n", 1);
    }
    for (size_t f = 0; f < m->nf; f++)
        apsm_writer_printf(w, "f %llu %llu %llu\n", m->F[3 * f] + 1ull, m->F[3 * f + 1] + 1ull,
                           m->F[3 * f + 2] + 1ull);
}

/* cell NULL: each point is a cell. */
static void write_legacy_vtk(apsm_writer *w, size_t points, const double *P, size_t cells,
                             const uint32_t *cell)
{
    const uint32_t corners = cell ? 3 : 1;
    apsm_writer_printf(
        w, "# vtk DataFile Version 3.0\n%s\nBINARY\nDATASET POLYDATA\nPOINTS %zu double\n",
        cell ? "mesh" : "particles", points);
    put_doubles(w, 3 * points, P);
    apsm_writer_printf(w, "\n%s %zu %zu\n", cell ? "POLYGONS" : "VERTICES", cells,
                       (corners + 1) * cells);
    for (size_t f = 0; f < cells; f++) {
        put_bits(w, corners, 4, true);
        for (size_t k = 0; k < corners; k++) put_bits(w, cell ? cell[3 * f + k] : f, 4, true);
    }
    apsm_writer_write(w, "\n", 1);
}

static apsm_status write_vtp(apsm_context *ctx, const char *path, apsm_writer *w,
                             const apsm_mesh *mesh, size_t n, const apsm_mesh_field *field)
{
    const vtp_piece piece = { mesh->nv, mesh->nf, mesh->V, mesh->F, n, field };
    return vtp_write(ctx, path, w, &piece);
}

/* ---- faces of the library ---- */

static bool is_single(const char *path)
{
    return path_ends_in(path, ".ply") || path_ends_in(path, ".stl");
}

static apsm_status check_points(apsm_context *ctx, const char *path, size_t n, const double *P)
{
    for (size_t k = 0; k < 3 * n; k++) {
        if (!isfinite(P[k]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE,
                             "%s: point %zu is not finite; nothing is written", path, k / 3);
        if (fabs(P[k]) > (double)FLT_MAX && is_single(path))
            return apsm_fail(ctx, APSM_ERR_NONFINITE,
                             "%s: a coordinate is too large for float32; use .vtp", path);
    }
    return APSM_OK;
}

apsm_status apsm_write_mesh(apsm_context *ctx, const char *path, const apsm_mesh *mesh)
{
    const bool vtk = path_ends_in(path, ".vtk"), vtp = path_ends_in(path, ".vtp"),
               obj = path_ends_in(path, ".obj");
    apsm_writer *w;
    if (!vtk && !vtp && !obj && !is_single(path))
        return apsm_fail(
            ctx, APSM_ERR_UNSUPPORTED,
            "%s: '%s' is not a mesh format known here; use .ply, .stl, .obj, .vtk or .vtp", path,
            path_extension(path));
    APSM_TRY(check_points(ctx, path, mesh->nv, mesh->V));
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    if (vtk)
        write_legacy_vtk(w, mesh->nv, mesh->V, mesh->nf, mesh->F);
    else if (vtp)
        return write_vtp(ctx, path, w, mesh, 0, NULL);
    else if (obj)
        write_obj(w, mesh);
    else if (path_ends_in(path, ".stl"))
        write_stl(w, mesh);
    else
        write_ply(w, mesh);
    return apsm_writer_commit(w);
}

apsm_status apsm_write_mesh_fields(apsm_context *ctx, const char *path, const apsm_mesh *mesh,
                                   size_t n, const apsm_mesh_field *field)
{
    apsm_writer *w;
    const bool vtp = path_ends_in(path, ".vtp");
    if (!vtp && !path_ends_in(path, ".ply"))
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED, "%s: fields are written to .ply and .vtp only",
                         path);
    APSM_TRY(check_points(ctx, path, mesh->nv, mesh->V));
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    if (vtp) return write_vtp(ctx, path, w, mesh, n, field);
    write_ply_fields(w, mesh, n, field);
    return apsm_writer_commit(w);
}

apsm_status apsm_write_mesh_points(apsm_context *ctx, const char *path, size_t n, const double *P)
{
    apsm_writer *w;
    const bool vtk = path_ends_in(path, ".vtk");
    if (!vtk && !path_ends_in(path, ".vtp"))
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "%s: '%s' does not hold points here; use .vtk or .vtp", path,
                         path_extension(path));
    if (n > 1u << 30)
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: more than 2^30 points; nothing is written", path);
    APSM_TRY(check_points(ctx, path, n, P));
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    if (!vtk) return vtp_write(ctx, path, w, &(vtp_piece){ .points = n, .cells = n, .P = P });
    write_legacy_vtk(w, n, P, n, NULL);
    return apsm_writer_commit(w);
}
