/* Contours: the lines of legacy VTK and VTP files, chained to one polyline. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "formats/input_file.h"
#include "formats/mesh_io.h"
#include "formats/soup.h"

static bool has_lines(const char *path)
{
    return path_ends_in(path, ".vtk") || path_ends_in(path, ".vtp");
}

static apsm_status read_soup(apsm_context *ctx, const char *path, soup *m)
{
    char *bytes;
    size_t size;
    *m = (soup){ .want_lines = true };
    APSM_TRY(input_file_read(ctx, path, &bytes, &size));
    scan s = scan_begin(ctx, path, bytes, size);
    (path_ends_in(path, ".vtp") ? read_vtp : read_legacy_vtk)(&s, m);
    free(bytes);
    if (s.status != APSM_OK) soup_free(m);
    return s.status;
}

bool contour_is_one(const char *path)
{
    soup m;
    apsm_context *quiet = has_lines(path) ? apsm_context_new() : NULL; /* no failure is told */
    if (!quiet) return false;
    const bool is = read_soup(quiet, path, &m) == APSM_OK && m.lines > 0 && m.polygons == 0;
    soup_free(&m);
    apsm_context_free(quiet);
    return is;
}

/* next (points x 2): whom each point is joined to; SIZE_MAX: nobody.  False if one has three. */
static bool join(const soup *m, size_t *next)
{
    for (size_t k = 0; k < 2 * m->points; k++) next[k] = SIZE_MAX;
    for (size_t e = 0; e < m->edges; e++)
        for (size_t side = 0; side < 2; side++) {
            const int64_t a = m->edge[2 * e + side], b = m->edge[2 * e + 1 - side];
            if (a < 0 || b < 0 || (uint64_t)a >= m->points || (uint64_t)b >= m->points)
                return false;
            size_t *slot = next + 2 * a;
            if (a == b || slot[0] == (size_t)b) continue; /* twice the same edge */
            if (slot[0] != SIZE_MAX) slot++;
            if (*slot != SIZE_MAX && *slot != (size_t)b) return false;
            *slot = (size_t)b;
        }
    return true;
}

/* From an end, or of a closed one from its first point, along; returns how many points. */
static size_t walk(const soup *m, const size_t *next, double *P, bool *closed)
{
    size_t first = 0, n = 0, before = SIZE_MAX;
    while (first < m->points && (next[2 * first] == SIZE_MAX || next[2 * first + 1] != SIZE_MAX))
        first++;
    *closed = first == m->points;
    if (*closed)
        for (first = 0; first + 1 < m->points && next[2 * first] == SIZE_MAX;) first++;
    for (size_t at = first; at != SIZE_MAX && n <= m->points;) {
        memcpy(P + 3 * n++, m->point + 3 * at, 3 * sizeof *P);
        const size_t a = next[2 * at], b = next[2 * at + 1], to = a == before ? b : a;
        before = at;
        at = to == first ? SIZE_MAX : to;
    }
    return n;
}

static apsm_status chain(apsm_context *ctx, const char *path, const soup *m, size_t *n, double **P,
                         bool *closed)
{
    size_t used = 0, *next = malloc((2 * m->points + 1) * sizeof *next);
    *P = malloc((3 * m->points + 3) * sizeof **P);
    if (!next || !*P) return free(next), APSM_ERR_MEMORY;
    const bool simple = join(m, next);
    for (size_t k = 0; k < m->points; k++) used += next[2 * k] != SIZE_MAX;
    *n = simple && used > 2 ? walk(m, next, *P, closed) : 0;
    free(next);
    if (*n == used && used > 2) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: its lines are not one contour: they branch, or are several; keep one",
                     path);
}

apsm_status contour_read(apsm_context *ctx, const char *path, size_t *n, double **P, bool *closed)
{
    soup m;
    *n = 0;
    *P = NULL;
    if (!has_lines(path))
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED, "%s: contours are read from .vtk and .vtp",
                         path);
    APSM_TRY(read_soup(ctx, path, &m));
    apsm_status status = APSM_OK;
    if (m.lines == 0 || m.polygons > 0)
        status = apsm_fail(ctx, APSM_ERR_FORMAT, "%s: holds no lines: no contour", path);
    if (status == APSM_OK) status = chain(ctx, path, &m, n, P, closed);
    soup_free(&m);
    if (status == APSM_OK) return APSM_OK;
    free(*P);
    *P = NULL;
    *n = 0;
    return status;
}
