/* Masks drawn by hand have ragged surfaces: single voxels and slabs of one voxel that stick out.
 * Smoothing may take them off, but not sheets, fingers, gaps and necks, which are as thin.
 *
 * A part is thick where a cube of 3^3 voxels fits in; what no such cube covers (the residue of
 * the morphological opening) is thin.  Pieces of the residue of fewer than `least_piece` voxels
 * count as raggedness, unless the label would fall apart without them.  Voxels of thick parts
 * and ragged pieces may change sides if they face the other side; all others are firm.  The
 * same holds for the background. */
#include "groom/thin.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { LEAST_PIECE = 12 };

/* to[i] <- whether any (all) of a[i], b[i], c[i] are set, for a row. */
static void merge_rows(size_t n, bool all, const unsigned char *restrict a,
                       const unsigned char *restrict b, const unsigned char *restrict c,
                       unsigned char *restrict to)
{
    if (all)
        for (size_t i = 0; i < n; i++) to[i] = a[i] & b[i] & c[i];
    else
        for (size_t i = 0; i < n; i++) to[i] = a[i] | b[i] | c[i];
}

/* to <- whether any (all) of a node of `from` and its two neighbours along an axis are set; beyond
 * the grid is as at its border. */
static void spread(const size_t n[3], int axis, bool all, const unsigned char *from,
                   unsigned char *to)
{
    const size_t nx = n[0], rows = n[1] * n[2], step = axis == 1 ? nx : nx * n[1];
    for (size_t r = 0; r < rows; r++) {
        const unsigned char *p = from + nx * r;
        unsigned char *q = to + nx * r;
        if (axis == 0) {
            merge_rows(nx > 2 ? nx - 2 : 0, all, p, p + 1, p + 2, q + 1);
            q[0] = p[0];
            q[nx - 1] = p[nx - 1];
            continue;
        }
        const size_t at = axis == 1 ? r % n[1] : r / n[1];
        merge_rows(nx, all, at > 0 ? p - step : p, p, at + 1 < n[axis] ? p + step : p, q);
    }
}

/* x <- erosion (all) or dilation by the cube; t scratch. */
static void cube(const size_t n[3], bool all, unsigned char *x, unsigned char *t)
{
    spread(n, 0, all, x, t);
    spread(n, 1, all, t, x);
    spread(n, 2, all, x, t);
    memcpy(x, t, n[0] * n[1] * n[2]);
}

/* Collects what is joined (26 neighbours) to seed and has piece[] == from into queue; sets it to
 * `to`.  Returns the count. */
static size_t flood(const size_t n[3], unsigned char *piece, size_t seed, unsigned char from,
                    unsigned char to, size_t *queue)
{
    const ptrdiff_t nx = (ptrdiff_t)n[0], ny = (ptrdiff_t)n[1], nz = (ptrdiff_t)n[2];
    size_t count = 0;
    piece[seed] = to;
    queue[count++] = seed;
    for (size_t i = 0; i < count; i++) {
        const ptrdiff_t p = (ptrdiff_t)queue[i], x = p % nx, y = p / nx % ny, z = p / (nx * ny);
        for (int k = 0; k < 27; k++) {
            const int dx = k % 3 - 1, dy = k / 3 % 3 - 1, dz = k / 9 - 1;
            if (x + dx < 0 || y + dy < 0 || z + dz < 0 || x + dx >= nx || y + dy >= ny ||
                z + dz >= nz)
                continue;
            const size_t q = (size_t)(p + dx + nx * (dy + ny * dz));
            if (piece[q] != from) continue;
            piece[q] = to;
            queue[count++] = q;
        }
    }
    return count;
}

enum { OTHER, THICK, THIN, RAGGED, SEEN };

/* piece (n, out): THICK, THIN or RAGGED for voxels of `side`, OTHER elsewhere. */
static void sort_pieces(const size_t n[3], const unsigned char *mask, unsigned char side,
                        unsigned char *piece, unsigned char *t, size_t *queue)
{
    const size_t total = n[0] * n[1] * n[2];
    for (size_t i = 0; i < total; i++) piece[i] = mask[i] == side;
    cube(n, true, piece, t);
    cube(n, false, piece, t);
    for (size_t i = 0; i < total; i++) piece[i] = mask[i] != side ? OTHER : piece[i] ? THICK : SEEN;
    for (size_t i = 0; i < total; i++) {
        if (piece[i] != SEEN) continue;
        const size_t count = flood(n, piece, i, SEEN, THIN, queue);
        if (count < LEAST_PIECE)
            for (size_t k = 0; k < count; k++) piece[queue[k]] = RAGGED;
    }
}

/* Whether the label without its ragged pieces is one part (26-connected). */
static bool holds_together(const size_t n[3], const unsigned char *piece, unsigned char *t,
                           size_t *queue)
{
    const size_t total = n[0] * n[1] * n[2];
    size_t parts = 0;
    for (size_t i = 0; i < total; i++) t[i] = piece[i] == THICK || piece[i] == THIN;
    for (size_t i = 0; i < total && parts < 2; i++)
        if (t[i] == 1) {
            (void)flood(n, t, i, 1, 2, queue);
            parts++;
        }
    return parts == 1;
}

/* Voxels of `side` that face the other side and are not thin lose their firmness; ragged ones only
 * if that is allowed.  The border of the grid stays firm. */
static void loosen(const size_t n[3], const unsigned char *mask, unsigned char side,
                   const unsigned char *piece, bool ragged, unsigned char *firm)
{
    const size_t row = n[0], plane = n[0] * n[1];
    for (size_t z = 1; z + 1 < n[2]; z++)
        for (size_t y = 1; y + 1 < n[1]; y++)
            for (size_t i = 1 + row * y + plane * z, end = i + row - 2; i < end; i++)
                if (mask[i] == side && (piece[i] == THICK || (piece[i] == RAGGED && ragged)) &&
                    (mask[i - 1] != side || mask[i + 1] != side || mask[i - row] != side ||
                     mask[i + row] != side || mask[i - plane] != side || mask[i + plane] != side))
                    firm[i] = 0;
}

apsm_status thin_mark(const size_t n[3], const unsigned char *mask, unsigned char *firm)
{
    const size_t total = n[0] * n[1] * n[2];
    unsigned char *piece = malloc(total), *t = malloc(total);
    size_t *queue = malloc(total * sizeof *queue);
    const bool ok = piece && t && queue;
    if (ok) {
        memset(firm, 1, total);
        for (unsigned char side = 0; side < 2; side++) {
            sort_pieces(n, mask, side, piece, t, queue);
            const bool loose = side == 0 || holds_together(n, piece, t, queue);
            loosen(n, mask, side, piece, loose, firm);
        }
    }
    free(piece);
    free(t);
    free(queue);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}
