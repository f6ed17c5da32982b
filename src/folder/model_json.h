/* model_json.h -- model.json (mean, modes, variances) and scores.csv (of the shapes, by name). */
#ifndef APSM_FOLDER_MODEL_JSON_H
#define APSM_FOLDER_MODEL_JSON_H

#include "model/shape_model.h"

/* Both write atomically; the scores of the model's shapes are named in its order,
 * their columns COLUMN_1, COLUMN_2, ... ("mode" in scores.csv). */
apsm_status model_json_write(apsm_context *ctx, const char *path,
                             const apsm_shape_model *model) APSM_NODISCARD;
apsm_status scores_csv_write(apsm_context *ctx, const char *path, const char *const *names,
                             const char *column, const apsm_shape_model *model) APSM_NODISCARD;

/* model (out, {0} on failure) <- all but the scores.  Refused, with a line: another format or a
 * newer version, parts that do not fit each other, variances that are not positive and descending.
 */
apsm_status model_json_read(apsm_context *ctx, const char *path,
                            apsm_shape_model *model) APSM_NODISCARD;
/* model->score (malloc'ed) <- the scores; refused unless the file has the model's modes and the
 * I shapes of these names, in this order. */
apsm_status scores_csv_read(apsm_context *ctx, const char *path, const char *const *names,
                            apsm_shape_model *model) APSM_NODISCARD;

/* hex <- SHA-256 of mean, modes, variances and the template's particles T (J x 3): fits name the
 * model that they are of by it. */
void model_sha256(const apsm_shape_model *model, const double *T, char hex[65]);

#endif
