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

#include "groom/parts.h"

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

enum { OTHER, THICK, THIN, RAGGED, SEEN };

/* piece (n, out): THICK, THIN or RAGGED for voxels of `side`, OTHER elsewhere. */
static apsm_status sort_pieces(const size_t n[3], const unsigned char *mask, unsigned char side,
                               unsigned char *piece, unsigned char *t)
{
    const size_t total = n[0] * n[1] * n[2];
    parts p;
    for (size_t i = 0; i < total; i++) piece[i] = mask[i] == side;
    cube(n, true, piece, t);
    cube(n, false, piece, t);
    for (size_t i = 0; i < total; i++) piece[i] = mask[i] != side ? OTHER : piece[i] ? THICK : SEEN;
    APSM_TRY(parts_find(n, piece, SEEN, true, &p));
    for (size_t row = 0; row < n[1] * n[2]; row++)
        for (size_t i = p.first[row]; i < p.first[row + 1]; i++) {
            const part_run *r = &p.run[i];
            const unsigned char to = p.size[r->part] < LEAST_PIECE ? RAGGED : THIN;
            memset(piece + n[0] * row + r->from, to, r->to - r->from);
        }
    parts_free(&p);
    return APSM_OK;
}

/* Whether the label without its ragged pieces is one part (26-connected). */
static apsm_status holds_together(const size_t n[3], const unsigned char *piece, unsigned char *t,
                                  bool *together)
{
    parts p;
    for (size_t i = 0; i < n[0] * n[1] * n[2]; i++) t[i] = piece[i] == THICK || piece[i] == THIN;
    APSM_TRY(parts_find(n, t, 1, true, &p));
    *together = p.n == 1;
    parts_free(&p);
    return APSM_OK;
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
                    firm[i] = piece[i] == RAGGED ? THIN_RAGGED : THIN_LOOSE;
}

static apsm_status mark_side(const size_t n[3], const unsigned char *mask, unsigned char side,
                             unsigned char *piece, unsigned char *t, unsigned char *firm)
{
    bool loose = true;
    APSM_TRY(sort_pieces(n, mask, side, piece, t));
    if (side == 1) APSM_TRY(holds_together(n, piece, t, &loose));
    loosen(n, mask, side, piece, loose, firm);
    return APSM_OK;
}

apsm_status thin_mark(const size_t n[3], const unsigned char *mask, unsigned char *firm)
{
    const size_t total = n[0] * n[1] * n[2];
    unsigned char *piece = malloc(total), *t = malloc(total);
    apsm_status status = piece && t ? APSM_OK : APSM_ERR_MEMORY;
    memset(firm, THIN_FIRM, total);
    for (unsigned char side = 0; side < 2 && status == APSM_OK; side++)
        status = mark_side(n, mask, side, piece, t, firm);
    free(piece);
    free(t);
    return status;
}
