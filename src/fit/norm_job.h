/* norm_job.h -- what the files of `apsm norm` share. */
#ifndef APSM_FIT_NORM_JOB_H
#define APSM_FIT_NORM_JOB_H

#include "apsm/statistics.h"
#include "fit/norm_model.h"
#include "folder/model_folder.h"
#include "statistics/formula.h"
#include "statistics/particle_files.h"

#define FORMAT_NORM "apsm-norm"
enum { NORM_VERSION = 1 };

/* What is said of one new shape. */
typedef struct norm_result {
    double distance, percentile, low, high, p, z; /* of the whole shape */
    double halves_low, halves_high;               /* of the percentile, over halves */
    double p_particles;                           /* of the most unusual particle, familywise */
    double *t;                                    /* modes */
    double *T2, *p_of, *q_of;                     /* J */
    double *along;                                /* J: t along the normal; NULL: no normals */
} norm_result;

/* A number of every shape that is judged, too: the size, or a column of the table. */
typedef struct norm_value {
    const char *name;          /* borrowed */
    size_t N;                  /* shapes of the model that have it */
    double *value;             /* n: of the new shapes, NAN where unknown */
    double *expected, *t, *nu; /* n; NAN with value */
} norm_value;

typedef struct norm_job {
    apsm_context *ctx;
    const apsm_norm_settings *s;
    model_folder m;
    particle_files files;
    const char **names; /* I + n, borrowed */
    apsm_table table;
    apsm_formula formula;
    size_t N, n, q, modes; /* shapes used, new ones, coefficients */
    size_t *row;           /* N + n, of the table */
    double *X;             /* N + n x q */
    double *Y;             /* N x J x 3 */
    double *normal;        /* J x 3, of the mean; NULL: not known */
    double *Z;             /* N + n x V: what is judged, along the normals where they are known */
    norm_model model, judged, score_model;
    double *least;        /* N: smallest p of the particles of every shape, left out */
    struct json_t *notes; /* texts of the whole: what is left out, what is not judged */
    norm_result *result;
    size_t values;
    norm_value *value;
} norm_job;

/* Logs it, and keeps it for the results. */
apsm_status norm_note(norm_job *w, const char *format, ...) APSM_PRINTF(2, 3) APSM_NODISCARD;
bool norm_allows_for(const norm_job *w, const apsm_column *c); /* by its formula */

/* job->normal from the mean's surface, if evaluate has written it. */
apsm_status norm_find_normals(norm_job *w) APSM_NODISCARD;
/* job->value: the size, and columns of numbers that the formula does not have. */
apsm_status norm_judge_values(norm_job *w) APSM_NODISCARD;
void norm_values_free(norm_job *w);

/* Share of Student's t with nu degrees of freedom below t. */
double norm_student(double t, double nu);

/* norm.json, norm.csv, of every shape NAME_norm.csv; and the log. */
apsm_status norm_write_results(const norm_job *w) APSM_NODISCARD;
void norm_tell(const norm_job *w);

#endif
