/* psm_sweep.h -- one pass over the particles of one shape (Gauss-Seidel): every particle in turn
 * steps along its gradient, judged by its energy. */
#ifndef APSM_PSM_SWEEP_H
#define APSM_PSM_SWEEP_H

#include "initialize/cohort.h"

/* The particles of one shape, all in/out. */
typedef struct psm_particles {
    size_t J;
    double *P;     /* J x 3, on the surface */
    double *N;     /* J x 3: unit normals there */
    double *sigma; /* J: kernel widths; 0: not known yet */
    double *step;  /* J: time steps, squared length */
} psm_particles;

/* What the correspondence term asks (psm_entropy.h).  A particle that has moved by d since the pass
 * began has the energy  rel y' C y,  y = Y + L d. */
typedef struct psm_pull {
    double rel;
    const double *g; /* J x 3: rel times the gradient, in the shape's frame and unit */
    const double *Y; /* J x 3: deviations from the mean, in the common frame and unit */
    const double *C; /* J x 9: symmetric */
    double L[9];     /* from the shape's frame and unit to the common ones */
} psm_pull;

/* What a pass came to: mean of log(p sigma^-3), and the mean move. */
typedef struct psm_sweep_record {
    double log_density, move;
} psm_sweep_record;

/* What the moves are measured by. */
typedef struct psm_measure {
    double longest;    /* no kernel reaches farther: the size of the shapes */
    double unit;       /* length of energies and steps */
    double least_step; /* in unit^2: a step no longer than this is made even uphill */
    double sampling;   /* factor of the sampling gradient */
} psm_measure;

size_t psm_sweep_work_size(size_t J); /* in doubles */

/* O(J (J + neighbours)). */
psm_sweep_record psm_sweep(const apsm_shape *shape, const psm_measure *measure,
                           const psm_pull *pull, const psm_particles *particles, double *work);

/* The width sigma > 0 at which n >= 1 neighbours at squared distances d2 with weights w give the
 * greatest density sum_j w_j exp(-d_j^2 / 2 sigma^2) / sigma^3: the root of sigma^2 = <d^2> / 3, by
 * Newton's method from `start`, or by the fixed point where that is not concave.  Returns 0 if from
 * there the neighbours are out of sight. */
double psm_kernel_width(size_t n, const double *d2, const double *w, double start);

#endif
