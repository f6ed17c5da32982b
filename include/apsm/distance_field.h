/* distance_field.h -- signed distance D to a surface in a narrow band, sparse, float32.
 *
 * Samples of the exact distance (negative inside) at the nodes of a regular grid, kept only in
 * bricks of 8 x 8 x 8 nodes that meet the band |D| <= band: memory O(surface area / voxel^2 *
 * band / voxel), not O(volume).  Between nodes D is trilinear; N = grad D is by central
 * differences at the nodes, each component interpolated trilinearly, then normalised. */
#ifndef APSM_DISTANCE_FIELD_H
#define APSM_DISTANCE_FIELD_H

#include "apsm/bvh.h"
#include "apsm/random.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_field apsm_field;

/* voxel, band > 0 in the mesh's unit.  bvh is borrowed and must outlive the field.  The mesh must
 * be closed. */
apsm_status apsm_field_build(apsm_context *ctx, const apsm_bvh *bvh, double voxel, double band,
                             apsm_field **field) APSM_NODISCARD;
void apsm_field_free(apsm_field *field);
size_t apsm_field_bytes(const apsm_field *field); /* memory held */
double apsm_field_voxel(const apsm_field *field);
double apsm_field_band(const apsm_field *field);

/* D (n) and unit N (n x 3) at X (n x 3); either may be NULL.  Outside the stored band both are
 * exact, from the tree (slower, never wrong). */
void apsm_field_sample(const apsm_field *field, size_t n, const double *X, double *D, double *N);

/* n points B (n x 3) drawn uniformly from the volume {|D| <= band}, band <= the field's, and
 * their D (n; NULL if not wanted): rejection from the band's voxels. */
void apsm_field_draw(const apsm_field *field, apsm_random *rng, double band, size_t n, double *B,
                     double *D);

/* The same interpolation on a dense float64 grid of n[0] x n[1] x n[2] nodes (x fastest) at
 * origin + spacing * (i,j,k): the reference for tests and for images.  One-sided second-order
 * differences at the rim; X outside is clamped to it. */
void apsm_grid_sample(const size_t n[3], const double origin[3], double spacing,
                      const double *values, size_t nx, const double *X, double *D, double *N);

#ifdef __cplusplus
}
#endif
#endif
