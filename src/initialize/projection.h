/* projection.h -- first particles by projecting the aligned reference's particles (docs/method.md,
 * "Initialisation"). */
#ifndef APSM_PROJECTION_H
#define APSM_PROJECTION_H

#include "geometry/bvh.h"
#include "groom/registration.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_projection_options {
    double min_cos; /* a face counts as facing if its normal agrees so well; 0.5: 60 degrees */
    double detour;  /* a facing face is preferred to the closest one up to so much farther */
    double min_separation; /* particles closer than this are moved apart; 0: leave them */
    int rounds;            /* attempts to move them apart */
} apsm_projection_options;

/* Lengths for particles with mean neighbour distance h: detour 1 h, min_separation 0.5 h. */
apsm_projection_options apsm_projection_defaults(double h);

/* Where J particles X (J x 3) with unit normals N (J x 3) of the aligned reference go on a
 * surface: S (J, out) and positions P (J x 3, out).  The closest point on a face that looks the
 * same way, so that a particle stays on its side of a thin sheet; the closest point at all where
 * none is near.  Particles that look the same way and come to lie closer than min_separation
 * are moved apart along the surface, in order of index.  *close (NULL if not wanted): pairs still
 * closer afterwards.  O(J log nf + J^2). */
void apsm_project_particles(const apsm_bvh *bvh, size_t J, const double *X, const double *N,
                            const apsm_projection_options *options, apsm_surface_point *S,
                            double *P, size_t *close);

/* Where J particles X (J x 3) of a reference, with unit normals N (J x 3) and mean neighbour
 * distance h, go on another surface (mesh and its tree): registered to it without rigidity, then
 * projected as above.  P (J x 3, out).  APSM_ERR_GEOMETRY: the surface lies in a point. */
apsm_status apsm_register_particles(const apsm_registration *registration, const apsm_mesh *mesh,
                                    const apsm_bvh *bvh, size_t J, const double *X, const double *N,
                                    double h, double *P) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
