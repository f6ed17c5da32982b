/* contour_job.h -- what the steps of a job on contours share. */
#ifndef APSM_ASSEMBLE_CONTOUR_JOB_H
#define APSM_ASSEMBLE_CONTOUR_JOB_H

#include <jansson.h>

#include "apsm/contour.h"
#include "contour/contours.h"
#include "evaluate/metrics.h"
#include "files/project.h"
#include "input/input.h"
#include "options/options.h"

typedef struct contour_job {
    apsm_context *ctx;
    const apsm_run_settings *settings;
    const char *folder;
    apsm_options o;
    const char *template_name, *exclude, *pattern, *ignore;
    bool by_project;
    size_t template_index;
    apsm_input_list list;
    size_t *n;  /* points of each */
    double **P; /* list.n */
    bool closed;
    contour_cohort c;
    const char **names;
    apsm_shape_model model;
    apsm_evaluation e;
    double *mean, *most; /* list.n: distance between the curve and what its particles stand for */
    apsm_project project;
    json_t *files; /* names: what in the folder is the job's */
} contour_job;

/* ---- contour_job.c ---- */

/* Another start or direction that lies within this factor is as likely; a rebuilt curve is off if
 * it leaves its own by this share of the particles' distance. */
#define CONTOUR_AS_LIKELY 1.1
#define CONTOUR_OFF       0.5
double contour_spacing(const contour_job *j, size_t i);
/* What speaks against curve i, a new reference; certified: nothing does. */
json_t *contour_reasons(const contour_job *j, size_t i);
bool contour_is_certified(const contour_job *j, size_t i);
size_t contour_count_certified(const contour_job *j);

/* ---- contour_folder.c: manifest.json ---- */

/* Whether the folder may be written to: a job that has ended is only replaced (overwrite), one that
 * has not is gone on with (resume: options and inputs must be the same) or replaced.  *done: it has
 * ended, and is to be gone on with. */
apsm_status contour_look_at_folder(contour_job *j, bool *done);
/* Before the first file is written: no file of another is in the way, and the manifest says which
 * are ours. */
apsm_status contour_begin_folder(contour_job *j);
/* All files are written: the manifest lists them, and what else a model before had is removed. */
apsm_status contour_end_folder(const contour_job *j);
/* Whether the folder's manifest is of contours. */
apsm_status contour_folder_is_ours(apsm_context *ctx, const char *folder, bool *ours);

/* ---- contour_write.c ---- */

char *contour_path(const contour_job *j, const char *name); /* malloc'ed */
/* *names: a new array of all files but the manifest, from the folder on. */
apsm_status contour_names(const contour_job *j, json_t **names);
bool contour_may_name(const char *name); /* whether a job of contours can have such a file */
apsm_status contour_write(contour_job *j);

/* ---- contour_page.c ---- */

apsm_status contour_write_page(const contour_job *j);

#endif
