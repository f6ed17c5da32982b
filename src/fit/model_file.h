/* model_file.h -- a model in one file: docs/formats.md, "A model in one file". */
#ifndef APSM_FIT_MODEL_FILE_H
#define APSM_FIT_MODEL_FILE_H

#include "fit/fit_model.h"

/* m->path to everything that fit_model_prepare starts from. */
apsm_status fit_model_read_file(apsm_context *ctx, apsm_fit_model *m) APSM_NODISCARD;

#endif
