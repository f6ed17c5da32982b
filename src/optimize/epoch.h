/* epoch.h -- the pieces of an epoch that concern one shape: tasks for apsm_parallel_for. */
#ifndef APSM_OPTIMIZE_EPOCH_H
#define APSM_OPTIMIZE_EPOCH_H

#include "optimize/workspace.h"

/* The unclipped step (11) of shape batch[k] from the gradients (7), (8), (10) at P: to op->step.
 * user: the optimizer. */
apsm_status gradients_of_shape(apsm_context *ctx, size_t k, int worker, void *user);

/* Takes the step of shape batch[k], shortened, and returns to the surface.  user: the optimizer. */
apsm_status move_shape(apsm_context *ctx, size_t k, int worker, void *user);

/* Particles of the rim that would come nearer to each other than both `apart` and where they were
 * (tP, J x 3) go back there, and so on until none do.  O(J^3) at worst, one pass as a rule. */
void keep_rim_apart(size_t J, const bool *on_rim, double apart, const double *tP, double *P);

/* Normals of shape i's particles, J x 3; a shape's are looked up when it has moved, while its tree
 * is at hand. */
const double *optimizer_normals(const optimizer *op, size_t i);

/* Unit normals N at P; guess as in apsm_snap_closest. */
void look_up_normals(const optimizer *op, size_t i, const double *P, uint32_t *guess, double *N);

/* Whether a factor serves for several epochs. */
bool keeps_factors(const optimizer *op);

#endif
