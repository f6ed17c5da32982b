/* contact.h -- how near two surfaces come, and how deep one goes into the other. */
#ifndef APSM_JOINT_CONTACT_H
#define APSM_JOINT_CONTACT_H

#include "geometry/bvh.h"

typedef struct apsm_contact {
    double gap; /* least distance of a vertex of either from the other's surface; 0 if they touch */
    double depth;   /* deepest that a vertex of either lies in the other; 0 if none does */
    double overlap; /* share of the area of both that lies in the other */
} apsm_contact;

/* Of two meshes that face outward, by their trees (apsm_bvh_build); in an open one nothing lies.
 * Vertices speak for the surface: exact to about an edge.  O((nv_a + nv_b) log nf). */
void apsm_contact_measure(const apsm_bvh *a, const apsm_bvh *b, apsm_contact *contact);

#endif
