/* job.h -- what the steps of a job of several parts share. */
#ifndef APSM_ASSEMBLE_JOB_H
#define APSM_ASSEMBLE_JOB_H

#include "apsm/joint.h"
#include "evaluate/metrics.h"
#include "folder/model_folder.h"
#include "input/input.h"
#include "joint/contact.h"
#include "joint/pose_shape.h"

/* What the job is asked for: of all parts, and of how they are one (apsm/joint.h). */
typedef struct joint_settings {
    apsm_run_settings run;
    const char *parts, *align, *shared;
} joint_settings;

/* A part as the user names it.  Owned. */
typedef struct joint_part {
    char *name;
    char *what;   /* expression, or labels "1,2" */
    char *folder; /* MODEL_DIR/parts/NAME */
    bool open;    /* an open surface, of the shared boundary */
} joint_part;

/* A subject: of every part the index of its case, or APSM_NO_CASE.  Owned. */
#define APSM_NO_CASE SIZE_MAX
typedef struct joint_subject {
    char *name;
    size_t *input; /* n parts */
} joint_subject;

typedef struct joint_job {
    apsm_context *ctx;
    const joint_settings *settings;
    bool by_label;
    bool by_project; /* the parts are domains of the one input, a project */
    size_t n;        /* parts */
    joint_part *part;
    apsm_joint_alignment alignment;
    size_t align_by;
    apsm_input_list list;
    bool fits;                 /* new subjects: one part may be given, and one subject */
    size_t subjects, complete; /* complete ones come first, either sort by name */
    joint_subject *subject;
} joint_job;

/* The last value of an option among those that were set; NULL if it was not. */
const char *joint_setting(const joint_job *job, const char *key);

/* ---- spec.c: settings->parts and ->align ---- */
apsm_status joint_parse(joint_job *job);

/* Adds a part; what is what the user says that it is. */
apsm_status joint_add_part(joint_job *job, const char *name, const char *what);

/* ---- group.c: inputs to subjects ---- */
apsm_status joint_group(joint_job *job);
void joint_job_free(joint_job *job);

/* ---- labels.c ---- */

/* Of parts that are labels: takes those from subjects whose image does not have them. */
apsm_status joint_find_labels(joint_job *job);

/* ---- shared.c: settings->shared, in the folder, which is there ---- */
apsm_status joint_share(joint_job *job);

/* ---- paths.c: cases by their files ---- */

typedef struct joint_path {
    char *path; /* resolved; owned */
    size_t row;
} joint_path;
/* Sorted by path.  Zero-initialise with {0}; joint_paths_free leaves it so. */
typedef struct joint_paths {
    size_t n;
    joint_path *path;
} joint_paths;
apsm_status joint_paths_of_project(const apsm_project *project, joint_paths *list);
/* Of part d: rows are subjects. */
apsm_status joint_paths_of_subjects(const joint_job *job, size_t d, joint_paths *list);
size_t joint_paths_find(const joint_paths *list, const char *path); /* SIZE_MAX: not there */
void joint_paths_free(joint_paths *list);

/* ---- around.c ---- */

/* Owns all but job. */
typedef struct joint_around {
    const joint_job *job;
    size_t of;                  /* the part that is asked about */
    apsm_project *project;      /* n: of the parts, groomed */
    joint_paths *row, *subject; /* n: rows of project, subjects of job */
    double *turn;               /* subjects x 9: see joint_orient; NULL: it had nothing to do */
    bool *told;                 /* subjects: whether turn is known */
} joint_around;
apsm_status joint_around_read(const joint_job *job, joint_around *around);
void joint_around_free(joint_around *around);
/* Subject i as part d's project has it; NULL: it has no such part. */
const apsm_subject *joint_around_part(const joint_around *around, size_t i, size_t d);
/* apsm_surroundings of part around->of; user is the joint_around. */
apsm_status joint_around_of(void *user, apsm_context *ctx, const char *path, size_t *n,
                            apsm_mesh **meshes);

/* ---- orient.c ---- */

/* again (n, out): parts whose poses grooming doubts, which are to be groomed once more with what
 * all parts together tell of how subjects are turned (joint_around_turn, for apsm_surroundings). */
apsm_status joint_orient(joint_around *around, bool *again);
bool joint_around_turn(void *user, const char *path, double R[9]);

/* ---- load.c ---- */

/* From the groomed mesh of a part to the frame that the subject's parts share. */
apsm_status joint_place(apsm_context *ctx, const apsm_subject *subject, double place[16]);

/* The complete subjects' particles in the frame of their inputs, mirrored ones turned to the side
 * of the others, as they lie to each other; then in one frame.  Owns everything. */
typedef struct joint_cohort {
    size_t I, n, J;
    size_t *first;        /* n + 1 */
    model_folder *folder; /* n: the parts' models */
    size_t *row;          /* I x n: the subject's place in the part's model */
    double *place;        /* I x n x 16: groomed mesh of the part to the input's frame (mirrored) */
    double *align;        /* I x n x 16: from there to the world */
    double *P;            /* I x J x 3: there */
    double *Q;            /* I x J x 3: world */
    bool *mirrored;       /* I */
} joint_cohort;
apsm_status joint_load(joint_job *job, joint_cohort *cohort);
void joint_cohort_free(joint_cohort *cohort);
/* The groomed mesh of part d of subject i in the world frame. */
apsm_status joint_mesh(apsm_context *ctx, const joint_cohort *c, size_t i, size_t d,
                       apsm_mesh *mesh);
apsm_parts joint_parts(const joint_cohort *cohort);

/* ---- figures.c ---- */

/* How a pair of parts meets in a subject, on its own surfaces and on the reconstructed ones. */
typedef struct joint_contact {
    apsm_contact own, rebuilt;
} joint_contact;

/* Owns everything. */
typedef struct joint_figures {
    size_t pairs; /* n (n - 1) / 2: (0,1), (0,2), ..., (1,2), ... */
    apsm_shape_model model;
    apsm_evaluation evaluation;
    apsm_pose_shape poses;
    size_t *like;    /* n: the subject whose mesh stands for the part's */
    apsm_warp *warp; /* n: of the meshes of the parts' templates */
    apsm_mesh *mesh; /* n: those, in the world frame of the part's template subject */
    apsm_surface_distance *surface; /* I x n */
    joint_contact *contact;         /* I x pairs */
    size_t made;          /* joints of the model: the mean, modes at two standard deviations */
    apsm_contact *spaces; /* made x pairs: theirs */
} joint_figures;

/* Modes of all particles at once, of the poses (the shapes rest), of the shapes (the poses rest).
 */
typedef enum joint_modes { JOINT_MODES, JOINT_POSE_MODES, JOINT_SHAPE_MODES } joint_modes;
enum { JOINT_MADE_LENGTH = 64 };
apsm_status joint_measure(joint_job *job, const joint_cohort *cohort, joint_figures *figures);
void joint_figures_free(joint_figures *figures, size_t n);
/* x (J x 3, out): the joint of mode k at sd standard deviations, in the world. */
apsm_status joint_of_mode(const joint_cohort *cohort, const joint_figures *figures, joint_modes of,
                          size_t k, double sd, double *x);
/* What the model's joint `made` is called: "mean of the cohort", "pose mode 1 -2sd". */
void joint_made_name(const joint_figures *figures, size_t made, char name[JOINT_MADE_LENGTH]);
/* Whether its parts of that pair lie deeper in each other than twice any subject's or the mean's.
 */
bool joint_made_closes(const joint_cohort *cohort, const joint_figures *figures, size_t made,
                       size_t pair);
/* Whether it is of poses or of shapes alone, which no subject needs to look like: where bones are
 * large they lie farther apart. */
bool joint_made_is_apart(const joint_figures *figures, size_t made);

/* ---- verdict.c ---- */

/* certificate.json of the joint, from those of the parts and the contacts: a new reference, NULL if
 * out of memory.  Logs what it says. */
struct json_t *joint_certificate(const joint_job *job, const joint_cohort *cohort,
                                 const joint_figures *figures);

/* ---- merge.c: what the parts' folders say, for all parts ---- */

/* "landmarks" of evaluation.json: a new reference, null without landmarks; NULL if out of memory.
 */
struct json_t *joint_landmarks(const joint_job *job, const joint_cohort *cohort);
/* features.csv at path, if every part has one. */
apsm_status joint_write_fields(const joint_job *job, const joint_cohort *cohort, const char *path,
                               bool *wrote);

/* ---- write.c ---- */

/* All files of the joint; manifest.json, which lists them, last. */
apsm_status joint_write(const joint_job *job, const joint_cohort *cohort,
                        const joint_figures *figures);

#endif
