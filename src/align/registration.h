/* registration.h -- non-rigid registration of aligned surfaces, for first particles on shapes that
 * differ too much for projection.  Method: src/align/registration.c. */
#ifndef APSM_REGISTRATION_H
#define APSM_REGISTRATION_H

#include "align/cloud.h" /* apsm_cloud */

#ifdef __cplusplus
extern "C" {
#endif

/* Points of either surface that registration is made for: apsm_cloud_spread. */
#define APSM_REGISTRATION_POINTS 400

/* A reference surface from which others are reached.  Read-only once made. */
typedef struct apsm_registration apsm_registration;

/* Copies what it needs of the reference's cloud.  O(points^3), once for a cohort.
 * APSM_ERR_GEOMETRY: the cloud lies in a point. */
apsm_status apsm_registration_new(const apsm_cloud *reference,
                                  apsm_registration **registration) APSM_NODISCARD;
void apsm_registration_free(apsm_registration *registration);

/* The prior (14) of a displacement: K (n x n, out) is its covariance at points y (n x 3) in radii
 * about their centre, lengths in radii. */
void apsm_registration_covariance(size_t n, const double *y, double *K);

/* Scratch in doubles for shapes with clouds of at most n points. */
size_t apsm_registration_work_size(const apsm_registration *registration, size_t n);

/* Registers the reference to the shape of the cloud (in the same frame, roughly aligned) and moves
 * J points X (J x 3) of the reference with their unit normals N (J x 3) along, in place. */
apsm_status apsm_registration_move(const apsm_registration *registration, const apsm_cloud *shape,
                                   size_t J, double *X, double *N, double *work) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
