/* cloud.h -- points that stand for a surface, in alignment and registration. */
#ifndef APSM_ALIGN_CLOUD_H
#define APSM_ALIGN_CLOUD_H

#include <stddef.h>
#include <stdint.h>

#include "apsm/context.h"
#include "apsm/mesh.h"

/* A shape cut off at more places than this counts as whole. */
#define APSM_MOST_CUTS 2

/* Points that stand for a surface.  They are drawn on the faces, so a moved mesh gets the moved
 * points.  Owns x, normal and w; zero-initialise with {0}. */
typedef struct apsm_cloud {
    size_t n;
    double *x;        /* n x 3, in farthest-point order: the first m of them are spread, too */
    double *normal;   /* n x 3: unit normals of their faces */
    double *w;        /* n: share of the surface each stands for, sum 1 */
    double centre[3]; /* of the surface */
    double radius;    /* root mean square distance from the centre, > 0 */
    double axes[9];   /* rows: principal axes by decreasing variance, right-handed, turned to the
                         heavier tail */
    size_t cuts;      /* planes in which the surface was cut off, by the edge of an image, say */
    double cut[APSM_MOST_CUTS][4]; /* n, d: the shape lies where n.x <= d */
} apsm_cloud;

/* n >= 4 points of the mesh from the stream (seed, index).  APSM_ERR_GEOMETRY if its area is
 * zero or not finite.  O(nf + n^2). */
apsm_status apsm_cloud_sample(const apsm_mesh *mesh, size_t n, uint64_t seed, uint64_t index,
                              apsm_cloud *cloud) APSM_NODISCARD;
/* The n vertices (at most all) that are farthest from those before, without chance: unlike drawn
 * points they are the same, but for a few, if an edge is flipped somewhere or rounding differs.  Of
 * more than 16,384 vertices every second, third, ... is looked at.  No axes. */
apsm_status apsm_cloud_spread(const apsm_mesh *mesh, size_t n, apsm_cloud *cloud) APSM_NODISCARD;
void apsm_cloud_free(apsm_cloud *cloud);

#endif
