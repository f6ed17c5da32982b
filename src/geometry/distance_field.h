/* distance_field.h -- signed distance D to a surface in a narrow band, sparse, float32.
 *
 * Samples of the exact distance (negative inside) at the nodes of a regular grid, kept only in
 * bricks of 8 x 8 x 8 nodes that meet the band |D| <= band (and 1.75 voxels more, for the
 * cells at its rim): memory O(surface area / voxel^2 * band / voxel), not O(volume).
 * Between nodes D is trilinear; N = grad D is by central differences at the nodes, each component
 * interpolated trilinearly, then normalised (docs/method.md, "Step, snapping, schedule").
 *
 * Accuracy: values are rounded to float32 in units of the voxel, so D differs from the same
 * interpolation in float64 by at most 2^-24 (band + 1.75 voxel), N by about
 * 2^-22 (band / voxel + 1.75).  From the exact distance D differs by up to 3/8 voxel^2 times the
 * curvature, and by up to a voxel at edges and where the sheet is thinner than the voxel.
 * The grid hangs on the lower corner of the mesh's box: the field depends on mesh, voxel and band
 * only; a shift of the mesh changes no more than rounding, a factor 2^k exactly the scale. */
#ifndef APSM_DISTANCE_FIELD_H
#define APSM_DISTANCE_FIELD_H

#include "core/random.h"
#include "geometry/bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_field apsm_field;

/* voxel, band > 0 in the mesh's unit.  bvh is borrowed and must outlive the field.  The mesh must
 * be closed and face outward (apsm_mesh_inspect tells), or open: then the sign is that of the side
 * which the nearest face shows, and means little beyond the border.  APSM_ERR_ARG: voxel or band
 * not positive, or more than 2^20 voxels along an axis; APSM_ERR_MEMORY; APSM_ERR_INTERRUPTED. Time
 * as memory: about 0.3 us a node in the band. */
apsm_status apsm_field_build(apsm_context *ctx, const apsm_bvh *bvh, double voxel, double band,
                             apsm_field **field) APSM_NODISCARD;
void apsm_field_free(apsm_field *field);
size_t apsm_field_bytes(const apsm_field *field); /* memory held */
double apsm_field_voxel(const apsm_field *field);
double apsm_field_band(const apsm_field *field);

/* D (n) and unit N (n x 3) at X (n x 3); either may be NULL.  Where the nodes that they need are
 * not stored (D outside the band, N within 0.7 voxels of its rim too) they are exact, from the tree
 * (slower, never wrong). */
void apsm_field_sample(const apsm_field *field, size_t n, const double *X, double *D, double *N);

/* n points B (n x 3) drawn uniformly from the volume {|D| <= band}, band > 0, but what lies beyond
 * the border of an open mesh, and their D
 * (n; NULL if not wanted; as sampled, or exact where a sheet is too thin for the voxels to show it;
 * a band wider than the field's own takes a hundred times as long): rejection of places in the
 * mesh's box, which are taken in steps of 2^-21 of it.  About 5 ns times box over band volume, and
 * 50 ns, a point. */
void apsm_field_draw(const apsm_field *field, apsm_random *rng, double band, size_t n, double *B,
                     double *D);

/* The same interpolation on a dense float64 grid of n[0] x n[1] x n[2] nodes (x fastest) at
 * origin + spacing * (i,j,k): the reference for tests and for images.  One-sided second-order
 * differences at the rim; X outside is clamped to it.  D or N may be NULL; N is (0,0,1) where the
 * gradient vanishes. */
void apsm_grid_sample(const size_t n[3], const double origin[3], double spacing,
                      const double *values, size_t nx, const double *X, double *D, double *N);

#ifdef __cplusplus
}
#endif
#endif
