/* projection.h -- first particles by projecting the aligned reference's particles (docs/method.md,
 * "Initialisation"). */
#ifndef APSM_PROJECTION_H
#define APSM_PROJECTION_H

#include "align/registration.h"
#include "core/option.h"
#include "geometry/bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { APSM_INIT_REGISTRATION, APSM_INIT_PROJECTION, APSM_INIT_FPS };
#define APSM_PROJECTION_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                   \
    ENUM(S, initialize, "registration|projection|fps",                                             \
         "take the template's particles to every shape by non-rigid registration, project them "   \
         "as they are, or sample every shape by farthest points and match them (paper)")           \
    FIXED(S, double, min_cos, 0.5,                                                                 \
          "a face looks the same way if its normal agrees so well: 60 degrees")                    \
    FIXED(S, double, detour, 1.0,                                                                  \
          "such a face is preferred to the closest one up to so much farther, in h")               \
    FIXED(S, double, min_separation, 0.5,                                                          \
          "particles closer than this are moved apart, in h; 0: leave them")                       \
    FIXED(S, int, rounds, 20, "attempts to move them apart")
typedef struct apsm_projection_options {
    APSM_OPTION_FIELDS(APSM_PROJECTION_OPTIONS)
    double h; /* mean neighbour distance of the particles */
} apsm_projection_options;
apsm_projection_options apsm_projection_defaults(double h);

/* Where J particles X (J x 3) with unit normals N (J x 3) of the aligned reference go on a
 * surface: S (J, out) and positions P (J x 3, out).  The closest point on a face that looks the
 * same way, so that a particle stays on its side of a thin sheet; the closest point at all where
 * none is near.  Particles that look the same way and come to lie closer than min_separation h
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
