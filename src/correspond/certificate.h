/* certificate.h -- is the correspondence of a shape sound?  docs/method.md, "Certificate":
 * mismatched particles, swapped pairs, folds, distance from the surface, coincidence; and a verdict
 * with its reasons. */
#ifndef APSM_CERTIFICATE_H
#define APSM_CERTIFICATE_H

#include "correspond/geodesic_correspondence.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One list makes bits and texts; a certificate's reasons are a sum of bits 1 << APSM_REVIEW_*. */
#define APSM_REVIEW_LIST(X)                                                                        \
    X(APSM_REVIEW_MISMATCHED, "too many particles have lost neighbours")                           \
    X(APSM_REVIEW_SWAPPED, "particles have changed places")                                        \
    X(APSM_REVIEW_FOLDED, "the surface is folded between particles")                               \
    X(APSM_REVIEW_OFF_SURFACE, "particles are off the surface")                                    \
    X(APSM_REVIEW_COINCIDENT, "particles coincide")                                                \
    X(APSM_REVIEW_NONFINITE, "particles are not finite numbers")
#define APSM_REVIEW_ENUM(name, text) name,
typedef enum apsm_review { APSM_REVIEW_LIST(APSM_REVIEW_ENUM) APSM_REVIEW_COUNT } apsm_review;
#undef APSM_REVIEW_ENUM
const char *apsm_review_text(apsm_review reason); /* constant string */

/* From where on a shape needs review.  Lengths in h. */
typedef struct apsm_certificate_options {
    double mismatched;  /* share of particles that have lost a neighbour and is still certified:
                           0.02 */
    double stretch;     /* a mismatched neighbour (1.5/2.0) is lost if it is farther than this times
                           its distance on the template, in the shape's own scale: 1.75 */
    double off_surface; /* distance of a particle from the surface: 0.01 */
    double coincident;  /* distance of two particles: 0.1 */
    double least_height; /* a triangle flatter than this, in its longest side, has no orientation:
                            0.25 */
    double least_cosine; /* nor has one whose plane leans more from the particles' normals: 0.25 */
} apsm_certificate_options;
apsm_certificate_options apsm_certificate_defaults(void);

/* What is judged; all borrowed.  Positions and normals in one unit, any frame. */
typedef struct apsm_certificate_input {
    size_t J;
    double h;                              /* mean neighbour distance of the template's particles */
    const apsm_neighbourhoods *reference;  /* template, factor 1.5 */
    const apsm_neighbourhoods *shape;      /* this shape, factor >= 2.0; what is beyond counts as
                                              lost, so that a larger one is more lenient */
    const uint32_t *N6;                    /* J x 6: neighbours on the template */
    const double *template_P, *template_N; /* J x 3: particles, unit normals */
    const double *P, *N;                   /* J x 3: the same on this shape */
    const double *distance;                /* J: of the particles from the surface, >= 0 */
} apsm_certificate_input;

/* Owns its lists; zero-initialise with {0}. */
typedef struct apsm_certificate {
    size_t J;
    size_t mismatched_strict; /* particles that miss neighbours at 1.5/1.5: 12-24 % at best */
    size_t mismatched;        /* at 1.5/2.0 */
    size_t lost;              /* of these those that have lost a neighbour; decides */
    size_t swaps, folds;
    uint32_t *mismatched_strict_list, *mismatched_list, *lost_list; /* by rising index */
    uint32_t (*swap)[2];                                            /* j < k */
    uint32_t (*fold)[3];                                            /* rising indices */
    double off_surface_mean, off_surface_max;                       /* in h */
    double min_separation;                                          /* in h */
    unsigned reasons;                                               /* 0: certified */
    bool certified;
} apsm_certificate;

/* The rows of a shape as far as its certificate needs them: what apsm_certify makes of them is what
 * it makes of apsm_geodesic_neighbourhoods with factor 2, whose work this is at most, and a
 * fraction of it where particles are matched. */
apsm_status apsm_certificate_rows(const apsm_geodesic *g, apsm_geodesic_work *w, size_t J,
                                  const apsm_surface_point *points, const double *P,
                                  const apsm_neighbourhoods *reference,
                                  apsm_neighbourhoods *rows) APSM_NODISCARD;
/* rows (resized): these (factor = 0), or those of apsm_geodesic_neighbourhoods with that factor.
 * Allocates what the search needs. */
apsm_status apsm_certificate_measure(const apsm_geodesic *g, size_t J,
                                     const apsm_surface_point *points, const double *P,
                                     const apsm_neighbourhoods *reference, double factor,
                                     apsm_neighbourhoods *rows) APSM_NODISCARD;

/* Which way the triangle of particles t looks along the surface: +1 or -1, or 0 if it has no
 * reliable orientation.  P, N (J x 3): particles and unit normals. */
int apsm_triangle_orientation(const double *P, const double *N, const uint32_t t[3],
                              const apsm_certificate_options *options);

/* O(J^2).  The lists of an earlier use are freed.  APSM_ERR_ARG if factors do not suffice. */
apsm_status apsm_certify(const apsm_certificate_input *input,
                         const apsm_certificate_options *options,
                         apsm_certificate *certificate) APSM_NODISCARD;
void apsm_certificate_free(apsm_certificate *certificate);

#ifdef __cplusplus
}
#endif
#endif
