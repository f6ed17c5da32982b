/* medoid.h -- choosing the shape that is closest to the others. */
#ifndef APSM_GROOM_MEDOID_H
#define APSM_GROOM_MEDOID_H

#include <stddef.h>
#include <stdint.h>

enum { APSM_MEDOID_CANDIDATES = 32, APSM_MEDOID_SHAPES = 64 };

/* Who is compared with whom: every candidate with every shape, by index, ascending. */
typedef struct apsm_medoid_plan {
    size_t candidates, shapes;
    size_t candidate[APSM_MEDOID_CANDIDATES], shape[APSM_MEDOID_SHAPES];
} apsm_medoid_plan;

/* Of the eligible shapes (n >= 1 ascending indices): all, if there are at most
 * APSM_MEDOID_CANDIDATES, and seeded draws otherwise.  eligible is reordered. */
void apsm_medoid_draw(size_t n, size_t *eligible, uint64_t seed, apsm_medoid_plan *plan);

/* The candidate of least mean residual to the other shapes.  R: candidates x shapes. */
size_t apsm_medoid_pick(const apsm_medoid_plan *plan, const double *R);

#endif
