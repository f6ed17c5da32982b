/* joint_fit.h -- new subjects meet a joint model. */
#ifndef APSM_ASSEMBLE_JOINT_FIT_H
#define APSM_ASSEMBLE_JOINT_FIT_H

#include "assemble/job.h"
#include "fit/fit_model.h"
#include "fit/outputs.h"
#include "fit/posterior.h"
#include "fit/reading.h"
#include "folder/names.h"

#define JOINT_FIT_JSON   FOLDER_JOINT_FITS
#define JOINT_FIT_CSV    "joint_fit.csv"
#define FORMAT_JOINT_FIT "apsm-joint-fit"
enum { JOINT_FIT_VERSION = 1 };

/* A joint model with all that fits need.  Owns everything. */
typedef struct joint_model {
    model_folder folder;
    size_t n;              /* parts */
    apsm_fit_model **part; /* n: the models of the parts */
    apsm_fit_model *whole; /* the joint's: shape model, h, calibration of scores */
    double *band;          /* n: factor on the deviations of a part that is missing */
    double radius;         /* of the mean joint */
    apsm_mesh *mean;       /* n: the parts of the mean joint, world frame */
    apsm_warp *warp;       /* n: of those meshes by the mean's particles */
    apsm_joint_alignment alignment;
    size_t align_by;
    bool aligned, scale; /* whether pose, and size, are taken out */
} joint_model;
apsm_status joint_model_load(apsm_context *ctx, const char *folder, joint_model *m) APSM_NODISCARD;
void joint_model_free(joint_model *m);

/* One new subject.  Owns its arrays; J particles of all n parts. */
typedef struct joint_subject_fit {
    const char *name;   /* borrowed */
    const char **path;  /* n: of its parts, NULL: missing; borrowed */
    char (*sha256)[65]; /* n */
    apsm_fit *part;     /* n: of those that are given */
    bool *fitted;       /* n */
    bool failed, mirrored;
    char reason[APSM_FIT_REASON];
    apsm_fit_verdict verdict;
    size_t given, refused;    /* parts */
    double *M;                /* n x 16: frame of the input to the world; det < 0 if mirrored */
    double *world, *original; /* J x 3 */
    double *sd;               /* J: 0 where the part is given */
    double *score;
    double mahalanobis, tail, residual;
    apsm_contact *contact; /* n (n - 1) / 2, of the fits; not measured with a part missing */
} joint_subject_fit;

/* From the parts' fits to the rest: alignment, what is missing, scores, verdict. */
apsm_status joint_put_together(apsm_context *ctx, const joint_model *m,
                               joint_subject_fit *s) APSM_NODISCARD;

/* ---- joint_missing.c ---- */

/* Whether the pose is to be found with the scores: a part is missing, and the others did not lay
 * the world by themselves.  there: n. */
bool joint_pose_is_free(const joint_model *m, const bool *there);
/* q with modes of pose behind its own, if free; q's rows are copied.  Free rows. */
typedef struct joint_posterior {
    posterior_model q;
    double *rows;
} joint_posterior;
apsm_status joint_with_pose(const joint_model *m, bool free, const posterior_model *q,
                            joint_posterior *p) APSM_NODISCARD;
/* Lays s's fitted parts where p (with `modes` of its own, then pose) says that they are: world and
 * M. error (J): INFINITY where nothing is seen. */
apsm_status joint_find_pose(const joint_model *m, const joint_posterior *p, size_t modes,
                            const double *error, joint_subject_fit *s) APSM_NODISCARD;

/* ---- joint_fit_write.c ---- */
apsm_status joint_fit_write_subject(apsm_context *ctx, const char *folder, const joint_model *m,
                                    const joint_subject_fit *s) APSM_NODISCARD;
apsm_status joint_fit_write_tables(apsm_context *ctx, const apsm_fit_settings *o,
                                   const joint_model *m, size_t n,
                                   const joint_subject_fit *s) APSM_NODISCARD;

#endif
