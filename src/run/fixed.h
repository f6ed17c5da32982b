/* fixed.h -- shapes of a project whose particles it gives and that stay, byte for byte: column
 * "fixed", or option fixed.  The others are optimised against them. */
#ifndef APSM_RUN_FIXED_H
#define APSM_RUN_FIXED_H

#include "align/align.h"
#include "run/groom_inputs.h"

/* Finds them among in's shapes and reads their files.  Refused, before anything is groomed: one
 * without particles, numbers that differ, poses or world particles that contradict each other, what
 * would move them, a template that is none of them, nothing left to be optimised.  ignored: the
 * column is not to be followed. */
apsm_status fixed_find(apsm_run *run, groom_inputs *in, const apsm_project *source, bool ignored);
void fixed_free(struct fixed_shapes *fixed); /* NULL is allowed */

/* The template must be one: unfit (I) <- the others, too. */
void fixed_prefer(const groom_inputs *in, bool *unfit);
/* What alignment doubts of shapes whose poses are given is no doubt. */
void fixed_trust(const groom_inputs *in, apsm_alignment *a);
/* Poses once all are aligned: the fixed ones' as given, the others relative to the template's.
 * Refused: a shape that was cropped or mirrored since, particles that are not on its surface. */
apsm_status fixed_settle(apsm_run *run, const groom_inputs *in, bool cropped, apsm_alignment *a);
/* Their files to fixed/, if there are any, and away with those of others. */
apsm_status fixed_write(apsm_run *run, const groom_inputs *in, const apsm_alignment *a);
/* The mark in the run's project that subject i is one, or is none. */
apsm_status fixed_mark(const groom_inputs *in, size_t i, apsm_subject *s);

/* ---- of a run whose shapes are groomed ---- */

bool fixed_is(const apsm_subject *s);
/* Gives the run's cohort its flags. */
apsm_status fixed_flag(apsm_run *run);
/* P (I x J x 3, world): the rows of the fixed shapes, from their files. */
apsm_status fixed_load(apsm_run *run, size_t J, double *P);
/* Copies the file of subject s in frame "local" or "world" to path. */
apsm_status fixed_copy(apsm_context *ctx, const apsm_run *run, const apsm_subject *s,
                       const char *frame, const char *path);
/* Adds what is fixed to what decides the particles. */
apsm_status fixed_hash(const apsm_run *run, apsm_sha256 *sha);

#endif
