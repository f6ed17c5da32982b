/* sampling_patch.h -- a patch of near-surface points, in groups that lie close together, against
 * the particles near it, in single precision: what sampling_loss.c does a point at a time in
 * double.
 *
 * Lengths are in units of tau ln 2, so that weights are powers of 2, and coordinates relative to
 * the patch's centre, so that single precision is spent on distances and not on where it lies. */
#ifndef APSM_OPTIMIZE_SAMPLING_PATCH_H
#define APSM_OPTIMIZE_SAMPLING_PATCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SAMPLING_LANES = 8, SAMPLING_GROUP = 16, SAMPLING_PATCH = 64 };

typedef struct sampling_patch {
    size_t count;               /* points; filled up to whole groups by such of weight 0 */
    float x[3][SAMPLING_PATCH]; /* points */
    float g[SAMPLING_PATCH];    /* their weights */
    float kbar[SAMPLING_PATCH]; /* out: soft distances */
    float reach;                /* weights beyond kmin + reach need not be added */
    float bound;                /* no kmin is thought to be greater */
    float most;                 /* out: the greatest kmin */
    size_t found;               /* particles, all within bound + reach of any point at least */
    float *p[3];                /* found: coordinates by columns */
    float (*grad)[4];           /* found, out: sums of (7), and of the mass */
    /* scratch, for as many as found */
    float *d2;              /* squared distances from a group's centre */
    uint32_t *first, *near; /* numbers of particles */
    float *q[3];            /* the near ones, by columns */
    float *k, *behind, *e;  /* as many for each point of a group: distances, kmin less distances,
                               weights */
} sampling_patch;

/* Binds the arrays for up to J particles to work (NULL: only asks); returns its size in doubles. */
size_t sampling_patch_lay_out(size_t J, sampling_patch *s, double *work);

/* False: a kmin is greater than bound, and nothing else is known. */
bool sampling_patch_run(sampling_patch *s);

#endif
