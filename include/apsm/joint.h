/* joint.h -- one model of several parts a subject: the bones of a joint, the chambers of a heart.
 *
 * Every part is modelled for itself, with all steps of run.h, in MODEL_DIR/parts/NAME; so its
 * correspondence knows nothing of how the parts lie to each other.  Then the parts are put together
 * again as they lie in each subject, and mean, modes, poses and gaps are made of all of them
 * (docs/method.md, "Several parts").  docs/formats.md says what the folder holds. */
#ifndef APSM_JOINT_H
#define APSM_JOINT_H

#include <stdbool.h>

#include "apsm/fit.h"
#include "apsm/run.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Beside apsm_run_settings: inputs and options as for a single part, folder is MODEL_DIR.  Each
 * option holds for every part; resume and overwrite hold for the whole.  All borrowed during the
 * call. */
typedef struct apsm_joint_settings {
    /* "NAME=WHAT,NAME=WHAT,...", two parts at least.  WHAT is a POSIX extended regular expression
     * without commas, searched in the names of the shapes (what is left of a name when the match is
     * taken out names the subject), or for all parts the numbers of labels, joined by + where a
     * part has several: then every input is a subject.  NULL: the one input is a project, and its
     * domains (shape_NAME, ...) are the parts. */
    const char *parts;
    /* "global": all parts of a subject move together, relative pose stays; "apart": every part for
     * itself; or the name of a part by which the others are aligned.  NULL: global. */
    const char *align;
    /* "A,B" or "A,B,T": what parts A and B, which touch, share (nearer than T spacings; 0.1)
     * becomes a part A-B of its own, and they keep the rest; all three are open surfaces.  NULL:
     * nothing. Not for parts that are domains of a project. */
    const char *shared;
} apsm_joint_settings;

/* Whether these settings ask for this job: there are parts, or the one input is a project with
 * several domains of which none was chosen ("domain") and that are not to be ignored ("ignore"). */
APSM_API apsm_status apsm_joint_wanted_sized(apsm_context *ctx, const apsm_run_settings *run,
                                             size_t run_size, const apsm_joint_settings *settings,
                                             size_t size, bool *wanted) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_joint_wanted(apsm_context *ctx,
                                                           const apsm_run_settings *run,
                                                           const apsm_joint_settings *settings,
                                                           bool *wanted)
{
    return apsm_joint_wanted_sized(ctx, run, sizeof *run, settings, sizeof *settings, wanted);
}

/* The whole job.  Subjects that miss a part are left out of the joint model, with a warning that
 * names them; their other parts still take part in those parts' models.  A folder that holds files,
 * but no joint model of ours, is refused.  Several processes (shard, company) all call this; shards
 * without a company groom the parts, as apsm_run_groom does. */
APSM_API apsm_status apsm_joint_run_sized(apsm_context *ctx, const apsm_run_settings *run,
                                          size_t run_size, const apsm_joint_settings *settings,
                                          size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_joint_run(apsm_context *ctx,
                                                        const apsm_run_settings *run,
                                                        const apsm_joint_settings *settings)
{
    return apsm_joint_run_sized(ctx, run, sizeof *run, settings, sizeof *settings);
}

/* Whether the folder holds a joint model. */
APSM_API bool apsm_joint_is(apsm_context *ctx, const char *folder);

/* New subjects by a finished joint model (settings->model, a folder).  Every part that a subject
 * has is fitted by the model of that part (apsm/fit.h); all parts of a subject are of one side; put
 * together they give the scores of the joint model and how unusual the joint is.  Parts that a
 * subject misses are told by those that it has, with their deviations.  parts: as in
 * apsm_joint_settings, by the names of the model's parts, one at least; NULL: as the model was
 * made. Writes joint_fit.json, joint_fit.csv, and of each subject particles and meshes of all
 * parts (docs/formats.md). */
APSM_API apsm_status apsm_joint_fit_sized(apsm_context *ctx, const apsm_fit_settings *settings,
                                          size_t size, const char *parts, apsm_fit_totals *totals,
                                          size_t totals_size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_joint_fit(apsm_context *ctx,
                                                        const apsm_fit_settings *settings,
                                                        const char *parts, apsm_fit_totals *totals)
{
    return apsm_joint_fit_sized(ctx, settings, sizeof *settings, parts, totals, sizeof *totals);
}

#ifdef __cplusplus
}
#endif
#endif
