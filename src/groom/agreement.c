/* Voxels whose centres a closed surface encloses, and what of them the mask has:
 *
 *   A         voxels of the mask,  B: voxels whose centres lie inside the surface
 *   dice      2 |A and B| / (|A| + |B|)
 *   departure largest distance to the surface of a centre that is in A or in B, but not in both
 *
 * B is found row by row (along x): every crossing of a row with a face toggles the voxels beyond
 * it.  Whether a row passes through a face is decided edge by edge, and of an edge in one and the
 * same way for both of its faces, so that no row slips through between two. */
#include "groom/agreement.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"
#include "geometry/bvh.h"

/* Whether the row at y, z has the projected edge a b (of vertices i, j) on its right. */
static bool is_left_of(const double *V, uint32_t i, uint32_t j, double y, double z)
{
    const double *a = V + 3 * (i < j ? i : j), *b = V + 3 * (i < j ? j : i);
    if ((a[2] <= z) == (b[2] <= z)) return false;
    return y < a[1] + (z - a[2]) / (b[2] - a[2]) * (b[1] - a[1]);
}

/* The least and largest whole number within lo..hi and 0..n-1; false if there is none. */
static bool whole_numbers(double lo, double hi, size_t n, size_t *from, size_t *to)
{
    const double first = fmax(ceil(lo), 0.0), last = fmin(floor(hi), (double)n - 1.0);
    if (!(first <= last)) return false;
    *from = (size_t)first;
    *to = (size_t)last;
    return true;
}

/* Where the row at y, z meets the plane of a, b, c, along x. */
static double meets(const double *a, const double *b, const double *c, double y, double z)
{
    const double by = b[1] - a[1], bz = b[2] - a[2], cy = c[1] - a[1], cz = c[2] - a[2];
    const double area = by * cz - bz * cy;
    if (area == 0.0) return a[0];
    const double s = ((y - a[1]) * cz - (z - a[2]) * cy) / area;
    const double t = ((z - a[2]) * by - (y - a[1]) * bz) / area;
    return a[0] + s * (b[0] - a[0]) + t * (c[0] - a[0]);
}

/* Toggles the first voxel beyond face f in every row through it. */
static void cross_rows(const size_t n[3], const double *V, const uint32_t *F, unsigned char *in)
{
    const double *a = V + 3 * F[0], *b = V + 3 * F[1], *c = V + 3 * F[2];
    size_t y0, y1, z0, z1;
    if (!whole_numbers(fmin(a[1], fmin(b[1], c[1])), fmax(a[1], fmax(b[1], c[1])), n[1], &y0, &y1))
        return;
    if (!whole_numbers(fmin(a[2], fmin(b[2], c[2])), fmax(a[2], fmax(b[2], c[2])), n[2], &z0, &z1))
        return;
    for (size_t z = z0; z <= z1; z++)
        for (size_t y = y0; y <= y1; y++) {
            const double Y = (double)y, Z = (double)z;
            if (!(is_left_of(V, F[0], F[1], Y, Z) ^ is_left_of(V, F[1], F[2], Y, Z) ^
                  is_left_of(V, F[2], F[0], Y, Z)))
                continue;
            const double x = fmax(ceil(meets(a, b, c, Y, Z)), 0.0);
            if (x < (double)n[0]) in[(size_t)x + n[0] * (y + n[1] * z)] ^= 1;
        }
}

/* in (n, out): 1 where the surface, in the frame of the crop's voxels, encloses the centre. */
static void rasterise(const apsm_mesh *surface, const size_t n[3], unsigned char *in)
{
    memset(in, 0, n[0] * n[1] * n[2]);
    for (size_t f = 0; f < surface->nf; f++) cross_rows(n, surface->V, surface->F + 3 * f, in);
    for (size_t row = 0; row < n[1] * n[2]; row++)
        for (size_t x = 1; x < n[0]; x++) in[row * n[0] + x] ^= in[row * n[0] + x - 1];
}

/* Largest distance to the surface of the centres that differ. */
static double departure_of(const double to_lps[16], const mask *m, const unsigned char *in,
                           const apsm_bvh *tree)
{
    const unsigned char *const given = mask_given(m);
    double most2 = 0.0;
    size_t i = 0;
    for (size_t z = 0; z < m->n[2]; z++)
        for (size_t y = 0; y < m->n[1]; y++)
            for (size_t x = 0; x < m->n[0]; x++, i++) {
                if (in[i] == given[i]) continue;
                double at[3] = { (double)x, (double)y, (double)z };
                apsm_closest hit;
                apsm_affine_apply(to_lps, 1, at, at);
                apsm_bvh_closest(tree, at, INFINITY, &hit);
                most2 = fmax(most2, hit.distance2);
            }
    return sqrt(most2);
}

static double dice_of(const mask *m, const unsigned char *in)
{
    const unsigned char *const given = mask_given(m);
    size_t both = 0, all = 0;
    for (size_t i = 0; i < m->n[0] * m->n[1] * m->n[2]; i++) {
        both += in[i] & given[i];
        all += (size_t)in[i] + given[i];
    }
    return all > 0 ? 2.0 * (double)both / (double)all : 0.0;
}

/* Voxels of the crop to the volume's frame. */
static void crop_to_lps(const apsm_volume *v, const mask *m, double M[16])
{
    apsm_volume_index_to_lps(v, M);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) M[4 * r + 3] += M[4 * r + c] * (double)m->origin[c];
}

apsm_status mask_agreement(const apsm_volume *volume, const mask *m, const apsm_mesh *surface,
                           apsm_groom_report *report)
{
    double to_lps[16], to_crop[16];
    apsm_mesh moved = { 0 };
    apsm_bvh *tree = NULL;
    crop_to_lps(volume, m, to_lps);
    APSM_TRY(apsm_affine_invert(to_lps, to_crop));
    unsigned char *in = malloc(m->n[0] * m->n[1] * m->n[2]);
    apsm_status status = in ? apsm_mesh_copy(surface, &moved) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_bvh_build_unsigned(surface, &tree);
    if (status == APSM_OK) {
        apsm_affine_apply(to_crop, moved.nv, moved.V, moved.V);
        rasterise(&moved, m->n, in);
        report->dice = dice_of(m, in);
        report->departure = departure_of(to_lps, m, in, tree);
    }
    apsm_bvh_free(tree);
    apsm_mesh_free(&moved);
    free(in);
    return status;
}
