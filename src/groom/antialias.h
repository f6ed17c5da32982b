/* antialias.h -- a smooth function whose zero level is the surface of a binary mask. */
#ifndef APSM_GROOM_ANTIALIAS_H
#define APSM_GROOM_ANTIALIAS_H

#include <stddef.h>

#include "apsm/status.h"

/* What is smoothed.  The mask's nodes are voxel centres; the fine grid has refine[c] steps from
 * one to the next along axis c: fine[c] = (n[c] - 1) refine[c] + 1 nodes. */
typedef struct antialias_input {
    size_t n[3];
    const unsigned char *mask; /* n, x fastest: 1 inside, 0 outside; borrowed */
    int refine[3];             /* >= 1 */
    double spacing[3];         /* of the mask's nodes; only ratios matter */
    double smoothing;          /* reach relative to the default; 0: only interpolate */
} antialias_input;

/* Nodes of background the mask needs around the label along each axis. */
void antialias_rim(const antialias_input *in, size_t rim[3]);
/* Size of the fine grid. */
void antialias_fine(const antialias_input *in, size_t fine[3]);

/* values (fine, out) is negative inside; its zero level encloses the mask's volume, as far as
 * that leaves firm inner nodes (thin.h) inside.  *inward (out): by how much the level may be
 * lowered before one gets out.  O(nodes near the surface) time beside clearing values and memory
 * beside 2 bytes a node of the mask. */
apsm_status antialias(const antialias_input *in, float *values, double *inward) APSM_NODISCARD;

#endif
