/* anchors.h -- landmarks that guide the particles: places that must correspond. */
#ifndef APSM_INITIALIZE_ANCHORS_H
#define APSM_INITIALIZE_ANCHORS_H

#include "initialize/cohort.h"
#include "landmarks/landmark_table.h"

/* Gives the cohort the landmarks that its template has; t is in the world, of the cohort's shapes.
 * With hold they are brought onto the surfaces.  APSM_ERR_ARG: the template has none. */
apsm_status apsm_cohort_anchor(apsm_context *ctx, apsm_cohort *cohort, const landmark_table *t,
                               bool hold, double weight) APSM_NODISCARD;

/* P (J x 3, in/out, on shape i): registered particles are drawn along by what is left between the
 * registered places X (L x 3) of the template's anchors and the shape's own, more the nearer they
 * are; with hold the first particles are then put on the anchors.  N (J x 3): which way the surface
 * looks at the particles.  reach: how far a pull is felt. */
apsm_status apsm_anchors_pull(const apsm_cohort *cohort, size_t i, size_t J, const double *X,
                              const double *N, double reach, double *P) APSM_NODISCARD;

/* Puts the particles P (J x 3) of shape i that are held where they belong. */
void apsm_anchors_hold(const apsm_cohort *cohort, size_t i, double *P);

/* Anchors that both the template and shape i have. */
static inline bool anchor_is_there(const apsm_cohort *c, size_t i, size_t l)
{
    return c->anchors.has[i * c->anchors.L + l];
}
static inline const double *anchor_at(const apsm_cohort *c, size_t i, size_t l)
{
    return c->anchors.x + 3 * (i * c->anchors.L + l);
}
/* Whether particle j of shape i has its place given. */
static inline bool anchor_holds(const apsm_cohort *c, size_t i, size_t j)
{
    return c->anchors.hold && j < c->anchors.L && anchor_is_there(c, i, j);
}

#endif
