/* kept.h -- state/work.journal: what groom and initialize have finished of single shapes, so that
 * an interruption costs no more than the shapes that were being worked on.  It is there while one
 * of the two is under way, and begins with what groom was asked for: the folder need not have a
 * project yet, or has that of a model which is being replaced.  Shares of these and of evaluate
 * have a journal of their own each. */
#ifndef APSM_KEPT_H
#define APSM_KEPT_H

#include "groom/groom.h"
#include "input/input.h"
#include "session/session.h"

/* With --resume, before options are settled: if grooming was under way, its options are the
 * project's, its inputs are those of the run unless others are given, and groom is not done. */
apsm_status kept_take_up(apsm_run *run);

/* A step begins.  Pieces that an interrupted one has left are good without --resume as well; only
 * --overwrite drops them. */
apsm_status kept_begin(apsm_run *run);
/* What groom is asked for: options, inputs, and the names of the shapes that these came to. */
apsm_status kept_add_job(apsm_run *run, const apsm_input_list *list);
/* Refuses other shapes than those of the grooming that was taken up, if one was. */
apsm_status kept_compare_shapes(apsm_run *run, const apsm_input_list *list);
/* The step has ended. */
apsm_status kept_end(apsm_run *run);
void kept_close(apsm_run *run);

/* The same of evaluate, which keeps as a share alone, and else finds what shares have kept. */
apsm_status kept_begin_shares(apsm_run *run);
/* Removes what was found; what is of no use here stays. */
apsm_status kept_end_shares(apsm_run *run);
/* Whether a step that keeps its work has not ended. */
bool kept_is_there(const apsm_run *run);

/* Deals the step's loops among the run's shards, if there are any, from kept_begin on. */
void kept_deal(apsm_run *run);
/* The same where a share goes on as long as it finds what it needs of the others. */
void kept_deal_shares(apsm_run *run);
/* The dealing ends.  Of a run that helps nothing else is to follow: APSM_OK if its share is kept,
 * as far as that was possible. */
apsm_status kept_end_share(apsm_run *run, apsm_status status);

/* What is kept beside a groomed mesh. */
typedef struct kept_groomed {
    apsm_groom_report report;
    bool is_mask;
    double voxel,
        slices; /* groom_inputs.voxel ..., .notes, .picked; texts may be NULL, and are the */
    char *notes, *picked; /* caller's to free if they were found */
} kept_groomed;

/* A groomed mesh, not yet mirrored, of an input with the given SHA-256.  mesh->V is NULL if there
 * is none.  Both from any thread; both do nothing unless a step has begun. */
apsm_status kept_find_mesh(apsm_context *ctx, const apsm_run *run, const apsm_input_case *c,
                           const char sha256[65], apsm_mesh *mesh, kept_groomed *groomed);
apsm_status kept_add_mesh(apsm_context *ctx, const apsm_run *run, const apsm_input_case *c,
                          const char sha256[65], const apsm_mesh *mesh,
                          const kept_groomed *groomed);

/* From now on the context's pieces (apsm_keep) are kept: for groom those of the listed inputs, as
 * they are turned (n x 9, or NULL), for initialize those of this run_identity; of parts, after
 * constraints cut the surfaces of groom. */
void kept_pieces_of_inputs(apsm_run *run, const apsm_input_list *list, char (*sha256)[65],
                           const double *turn);
void kept_pieces_of_parts(apsm_run *run, size_t n, const apsm_mesh *const *meshes);
void kept_pieces_of_shapes(apsm_run *run, const char *identity);
/* Of evaluate: of n numbers P, the particles. */
void kept_pieces_of_particles(apsm_run *run, const char *identity, size_t n, const double *P);

#endif
