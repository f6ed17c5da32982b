/* Surface meshes and points from files, by extension. */
#include "formats/mesh_io.h"

#include <math.h>
#include <stdlib.h>

#include "apsm/formats.h"
#include "formats/inflate.h"
#include "formats/input_file.h"
#include "formats/soup.h"

/* Half-edges (3 per face) must be countable in 32 bits. */
enum { MOST = 1 << 30 };

typedef void (*reader)(scan *, soup *);

static reader reader_of(const char *path)
{
    static const struct {
        const char *extension;
        reader read;
    } known[] = { { ".ply", read_ply },
                  { ".stl", read_stl },
                  { ".obj", read_obj },
                  { ".vtk", read_legacy_vtk },
                  { ".vtp", read_vtp },
                  { ".off", read_off },
                  { ".gii", read_gifti },
                  { ".white", read_freesurfer },
                  { ".pial", read_freesurfer },
                  { ".pial.T1", read_freesurfer },
                  { ".pial.T2", read_freesurfer },
                  { ".smoothwm", read_freesurfer },
                  { ".surf", read_freesurfer } };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (path_ends_in(path, known[k].extension)) return known[k].read;
    return NULL;
}

bool mesh_is_known(const char *path)
{
    return reader_of(path) != NULL;
}

static apsm_status refuse_extension(apsm_context *ctx, const char *path)
{
    return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                     "%s: '%s' is not a mesh format known here; use .ply, .stl, .obj, .vtk, .vtp, "
                     ".off or .gii",
                     path, path_extension(path));
}

static void refuse_no_faces(scan *s, const soup *m)
{
    if (m->polygons) return;
    if (m->lines)
        scan_refuse(
            s, APSM_ERR_FORMAT,
            "has no faces but %zu lines: contours? `apsm run` takes them, by themselves; else "
            "make a surface of them",
            m->lines);
    else if (m->points)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "has no faces but %zu points: a point cloud? export it as a surface",
                    m->points);
    else
        scan_refuse(s, APSM_ERR_FORMAT, "has no faces; export it as a surface");
}

static void *shrunk(scan *s, void *array, size_t size)
{
    void *smaller = realloc(array, size);
    if (!smaller) {
        scan_no_memory(s);
        smaller = array;
    }
    return smaller;
}

/* The arrays move over. */
static void make_mesh(scan *s, soup *m, apsm_mesh *mesh)
{
    if (m->points > MOST || m->polygons > MOST)
        scan_refuse(s, APSM_ERR_FORMAT, "is larger than 2^30 points or faces; decimate it first");
    if (scan_ok(s)) m->point = shrunk(s, m->point, 3 * m->points * sizeof *m->point);
    if (scan_ok(s)) m->corner = shrunk(s, m->corner, m->corners * sizeof *m->corner);
    if (!scan_ok(s)) return;
    *mesh = (apsm_mesh){ .nv = m->points, .nf = m->polygons, .V = m->point, .F = m->corner };
    m->point = NULL;
    m->corner = NULL;
}

apsm_status mesh_from_bytes(apsm_context *ctx, const char *path, const char *bytes, size_t size,
                            apsm_mesh *mesh)
{
    const reader read = reader_of(path);
    scan s = scan_begin(ctx, path, bytes, size);
    soup m = { 0 };
    *mesh = (apsm_mesh){ 0 };
    if (!read) return refuse_extension(ctx, path);
    if (apsm_is_utf16(bytes, size))
        scan_refuse(&s, APSM_ERR_FORMAT, "is text in UTF-16; save it as UTF-8");
    if (is_gzip((const unsigned char *)bytes, size))
        scan_refuse(&s, APSM_ERR_FORMAT, "is packed by gzip; unpack it (`gunzip`)");
    if (scan_ok(&s)) read(&s, &m);
    if (read == read_stl) soup_merge_points(&s, &m);
    refuse_no_faces(&s, &m);
    soup_triangulate(&s, &m);
    make_mesh(&s, &m, mesh);
    soup_free(&m);
    return s.status;
}

apsm_status apsm_read_mesh(apsm_context *ctx, const char *path, apsm_mesh *mesh)
{
    char *bytes;
    size_t size;
    *mesh = (apsm_mesh){ 0 };
    if (!reader_of(path) && !apsm_is_folder(path)) return refuse_extension(ctx, path);
    APSM_TRY(input_file_read(ctx, path, &bytes, &size));
    const apsm_status status = mesh_from_bytes(ctx, path, bytes, size, mesh);
    free(bytes);
    return status;
}

apsm_status apsm_read_mesh_points(apsm_context *ctx, const char *path, size_t *n, double **P)
{
    const reader read = reader_of(path);
    char *bytes;
    size_t size;
    soup m = { 0 };
    *n = 0;
    *P = NULL;
    if (read != read_legacy_vtk && read != read_vtp)
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "%s: '%s' does not hold points here; use .vtk or .vtp", path,
                         path_extension(path));
    APSM_TRY(input_file_read(ctx, path, &bytes, &size));
    scan s = scan_begin(ctx, path, bytes, size);
    read(&s, &m);
    if (m.polygons)
        scan_refuse(&s, APSM_ERR_FORMAT,
                    "holds %zu polygons: a mesh, not particles; give a file of points", m.polygons);
    soup_reserve_points(&s, &m, 1); /* never NULL */
    if (scan_ok(&s)) {
        *n = m.points;
        *P = m.point;
        m.point = NULL;
    }
    soup_free(&m);
    free(bytes);
    return s.status;
}

apsm_status apsm_read_mesh_field(apsm_context *ctx, const char *path, const char *name, size_t n,
                                 double *value)
{
    char *bytes;
    size_t size, found = 0;
    const reader read = reader_of(path);
    if (read != read_ply && read != read_legacy_vtk && read != read_vtp)
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "%s: fields of vertices are read from .ply, .vtk and .vtp; convert it",
                         path);
    APSM_TRY(input_file_read(ctx, path, &bytes, &size));
    scan s = scan_begin(ctx, path, bytes, size);
    soup m = { .want_field = name };
    if (read != read_ply) {
        read(&s, &m);
        found = m.fields;
    }
    double *const all = read == read_ply ? read_ply_field(&s, name, &found) : m.field;
    m.field = NULL;
    soup_free(&m);
    if (s.status == APSM_OK && (!all || found != n))
        s.status =
            apsm_fail(ctx, APSM_ERR_FORMAT, "%s: its vertices have no field '%s'", path, name);
    for (size_t k = 0; k < n && s.status == APSM_OK; k++) {
        value[k] = all[k];
        if (!isfinite(value[k]))
            s.status = apsm_fail(ctx, APSM_ERR_NONFINITE,
                                 "%s: '%s' of vertex %zu is no finite number", path, name, k);
    }
    free(all);
    free(bytes);
    return s.status;
}
