/* evaluation_json.h -- evaluation.json and evaluation.csv of a model of one part, and the pieces
 * that models of several share. */
#ifndef APSM_FOLDER_EVALUATION_JSON_H
#define APSM_FOLDER_EVALUATION_JSON_H

#include <jansson.h>

#include "evaluate/landmark_error.h"
#include "evaluate/metrics.h"

#include "judge/certify.h"

/* mean, median, p95, p99 and max; NULL without memory. */
json_t *evaluation_json_distance(const apsm_distance_summary *distance);

/* All of evaluation.json.  Takes what it is given: surface distances, landmarks (null for none;
 * both NULL: without memory, and so is the answer) and the spaces of a joint (NULL: of one part).
 */
json_t *evaluation_json(const apsm_evaluation *e, const char *template_name, json_t *surface,
                        json_t *landmarks, json_t *joint_spaces);

/* What is told of one part; all borrowed. */
typedef struct evaluation_told {
    const apsm_evaluation *figures;
    const char *const *names; /* of the shapes */
    size_t template_index;
    const landmark_errors *landmarks;  /* L 0: none */
    const char *const *landmark_names; /* L */
    const char *landmark_use;          /* what they were used for */
} evaluation_told;

/* Both write atomically; the certificate is of the same shapes. */
apsm_status evaluation_json_write(apsm_context *ctx, const char *path,
                                  const evaluation_told *told) APSM_NODISCARD;
apsm_status evaluation_csv_write(apsm_context *ctx, const char *path, const evaluation_told *told,
                                 const cohort_certificate *certificate) APSM_NODISCARD;

#endif
