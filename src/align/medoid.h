/* medoid.h -- choosing the shape that is closest to the others. */
#ifndef APSM_ALIGN_MEDOID_H
#define APSM_ALIGN_MEDOID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { APSM_MEDOID_CANDIDATES = 32, APSM_MEDOID_SHAPES = 64 };

/* Who is compared with whom: every candidate with every shape, by index, ascending. */
typedef struct apsm_medoid_plan {
    size_t candidates, shapes;
    size_t candidate[APSM_MEDOID_CANDIDATES], shape[APSM_MEDOID_SHAPES];
    bool out[APSM_MEDOID_CANDIDATES]; /* cannot win any more */
} apsm_medoid_plan;

/* Candidates are compared part by part, so that those that cannot win are left out of the rest.
 * Shape b belongs to part b % APSM_MEDOID_PARTS. */
enum { APSM_MEDOID_PARTS = 8 };

/* Of the eligible shapes (n >= 1 ascending indices): all, if there are at most
 * APSM_MEDOID_CANDIDATES, and seeded draws otherwise.  eligible is reordered. */
void apsm_medoid_draw(size_t n, size_t *eligible, uint64_t seed, apsm_medoid_plan *plan);

/* After parts 0 to `parts` - 1 of R: out goes who is worse than the best so far by more than
 * chance. */
void apsm_medoid_drop(apsm_medoid_plan *plan, size_t parts, const double *R);

/* Of those that are not out, the candidate of least mean residual to the other shapes.  R:
 * candidates x shapes. */
size_t apsm_medoid_pick(const apsm_medoid_plan *plan, const double *R);

#endif
