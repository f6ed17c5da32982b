/* primitive.h -- planes, spheres, cylinders through points, and what a plane cuts of a mesh.
 * Arrays in, numbers out; nothing is allocated. */
#ifndef APSM_STATISTICS_PRIMITIVE_H
#define APSM_STATISTICS_PRIMITIVE_H

#include "apsm/mesh.h"

/* The plane nearest to points P (n x 3), n >= 3: their centroid and the unit normal about which the
 * points turn as they are listed.  APSM_ERR_GEOMETRY: they lie on a line. */
apsm_status primitive_plane(size_t n, const double *P, double centre[3],
                            double normal[3]) APSM_NODISCARD;

/* The sphere nearest to points P (n x 3), n >= 4: least sum of squared distances from it.
 * APSM_ERR_GEOMETRY: they lie in a plane, or it does not converge.  residual: the root of the mean
 * squared distance.  O(n) an iteration. */
apsm_status primitive_sphere(size_t n, const double *P, double centre[3], double *radius,
                             double *residual) APSM_NODISCARD;

/* The same for a cylinder without ends through points P with unit normals N (n x 3), n >= 6: the
 * normals give its first axis. */
apsm_status primitive_cylinder(size_t n, const double *P, const double *N, double on_axis[3],
                               double axis[3], double *radius, double *residual) APSM_NODISCARD;

/* Segments in which the plane cuts the faces first_face .. end - 1 of a closed mesh: segment (n x
 * 6: from, to) with the inside on the left as seen against the normal; corners that two faces share
 * have the same bits.  Returns n; segment may be NULL, to count. */
size_t primitive_cut(const apsm_mesh *mesh, size_t first_face, size_t end, const double centre[3],
                     const double normal[3], double *segment);
/* loop (n, out) <- which closed curve every segment belongs to, named by one of its segments.
 * O(n^2). */
void primitive_loops(size_t n, const double *segment, size_t *loop);
/* The area that the segments of one curve (or of all: which = SIZE_MAX) enclose; holes count
 * against it. */
double primitive_enclosed(size_t n, const double *segment, const size_t *loop, size_t which,
                          const double normal[3]);

#endif
