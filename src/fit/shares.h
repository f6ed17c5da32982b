/* shares.h -- fits that the shares of a job keep in state/ of its folder, until the job without
 * --shard writes them: docs/formats.md, "Journals". */
#ifndef APSM_FIT_SHARES_H
#define APSM_FIT_SHARES_H

#include "files/shards.h"
#include "fit/outputs.h"
#include "input/input.h"
#include "landmarks/landmark_file.h"

/* Zero-initialise with {0}. */
typedef struct fit_shares {
    const apsm_fit_model *model; /* borrowed, as folder */
    const char *folder;
    journal *own;      /* of a share; NULL: of the job that gathers */
    journal_set kept;  /* by all shares */
    journal_key scope; /* SHA-256 of what decides all fits of the job but their inputs */
    size_t found;      /* fits that were kept */
} fit_shares;

/* What a job is asked for, on top of its model; all borrowed. */
typedef struct fit_share_job {
    const apsm_fit_settings *settings;
    const apsm_fit_options *options;
    const landmark_list *landmarks;
} fit_share_job;

/* Opens the share's journal (settings->shards > 0), which is begun anew if it is of another job, or
 * those of all shares.  APSM_ERR_STATE: one of these is of another job. */
apsm_status fit_shares_open(apsm_context *ctx, const apsm_fit_model *model,
                            const fit_share_job *job, fit_shares *s) APSM_NODISCARD;
/* A fit that is kept of this input (row->sha256 is known): the rest of the row, and fit (of the
 * caller).  Any thread. */
apsm_status fit_shares_find(apsm_context *ctx, fit_shares *s, const apsm_input_case *c,
                            fit_row *row, apsm_fit *fit, bool *found) APSM_NODISCARD;
/* One that was made, by a share.  Any thread. */
apsm_status fit_shares_keep(apsm_context *ctx, const fit_shares *s, const apsm_input_case *c,
                            const fit_row *row) APSM_NODISCARD;
/* The job has gathered them: removes the journals, unless nothing in them was of use. */
apsm_status fit_shares_end(apsm_context *ctx, fit_shares *s) APSM_NODISCARD;
void fit_shares_close(fit_shares *s);

#endif
