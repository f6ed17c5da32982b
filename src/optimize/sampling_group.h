/* sampling_group.h -- a group of near-surface points against the particles that it has found, in
 * single precision: what sampling_loss.c does a point at a time in double. */
#ifndef APSM_OPTIMIZE_SAMPLING_GROUP_H
#define APSM_OPTIMIZE_SAMPLING_GROUP_H

#include <stddef.h>
#include <stdint.h>

enum { SAMPLING_GROUP = 16 };

/* Coordinates are relative to the group's centre, so that single precision is spent on distances
 * and not on where the group lies.  Unused places of a group have weight 0. */
typedef struct sampling_group {
    size_t found;               /* particles */
    float x[3][SAMPLING_GROUP]; /* points */
    float g[SAMPLING_GROUP];    /* their weights */
    float kbar[SAMPLING_GROUP]; /* out: soft distances */
    float tau, reach;           /* softness; weights beyond kmin + reach are 0 */
    float (*p)[3];              /* found */
    float (*grad)[4];           /* found, out: sums of (7) and of the mass */
    float (*k)[SAMPLING_GROUP]; /* found, scratch: squared distances, then distances */
    float (*e)[SAMPLING_GROUP]; /* found, scratch: weights, not normalised */
    uint32_t *near;             /* found, scratch: those with weight for any of the points */
} sampling_group;

/* Binds the arrays for up to J particles to work (NULL: only asks); returns its size in doubles. */
size_t sampling_group_lay_out(size_t J, sampling_group *s, double *work);

void sampling_group_run(sampling_group *s);

#endif
