/* icp.h -- what the other files of alignment share. */
#ifndef APSM_ALIGN_ICP_H
#define APSM_ALIGN_ICP_H

#include "align/align.h"

/* Finds where the mesh has been cut off flat: cuts and cut of its cloud.  O(n^2 + nf). */
void apsm_cloud_find_cuts(const apsm_mesh *mesh, apsm_cloud *cloud);

/* Forgets the cuts that no border of the image explains. */
void apsm_cloud_keep_cuts(const apsm_borders *borders, apsm_cloud *cloud);

/* Inverse of a similarity, proper or not. */
void apsm_similarity_invert(const double M[16], double inverse[16]);

/* How many points apsm_cloud_of_vertices gives: all vertices, or of a great many every second,
 * third, ... */
size_t apsm_cloud_vertices(const apsm_mesh *mesh);

/* Vertices as a cloud without normals, weighted by the area around them; centre, radius and axes
 * are those of sample.  Drawn points would be others if one edge were flipped or rounding moved
 * one of them to the next face; sums over the vertices hardly change. */
apsm_status apsm_cloud_of_vertices(const apsm_mesh *mesh, const apsm_cloud *sample,
                                   apsm_cloud *cloud) APSM_NODISCARD;

/* The same of vertices of which no two are neighbours, a quarter of all, which stand for the areas
 * beside them, too. */
apsm_status apsm_cloud_of_some_vertices(const apsm_mesh *mesh, const apsm_cloud *sample,
                                        apsm_cloud *cloud) APSM_NODISCARD;

/* The pose that is reached from the rotation R, centres (or whole ends) brought together. */
void apsm_pose_from(const apsm_surface *moving, const apsm_surface *fixed, const double R[9],
                    const apsm_icp_options *opt, apsm_pose *pose, double *work);

/* As apsm_icp, but from a pose near the end, to where what is left is smaller than the tolerance,
 * which may be far below what apsm_icp can tell by the sum of squares.  moving, fixed: the same
 * surfaces `levels` times, by few points first.  residual: before the last step, which is shorter
 * than the tolerance. */
void apsm_icp_to_rest(size_t levels, const apsm_surface *moving, const apsm_surface *fixed,
                      const apsm_icp_options *opt, double M[16], double *residual, double *work);

/* As apsm_icp, but with closest cloud points for closest points: rough and fast, for clouds of
 * about a hundred points. */
void apsm_icp_coarse(const apsm_surface *moving, const apsm_surface *fixed,
                     const apsm_icp_options *opt, double M[16], double *residual, double *work);

#endif
