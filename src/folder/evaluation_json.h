/* evaluation_json.h -- pieces of evaluation.json that models of one part and of several share. */
#ifndef APSM_FOLDER_EVALUATION_JSON_H
#define APSM_FOLDER_EVALUATION_JSON_H

#include <jansson.h>

#include "apsm/evaluate.h"

/* mean, median, p95, p99 and max; NULL without memory. */
json_t *evaluation_json_distance(const apsm_distance_summary *distance);

#endif
