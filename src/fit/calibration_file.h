/* calibration_file.h -- calibration.json of a model folder (docs/formats.md). */
#ifndef APSM_FIT_CALIBRATION_FILE_H
#define APSM_FIT_CALIBRATION_FILE_H

#include "fit/fit_model.h"

/* SHA-256 of what a calibration is made from; before it is, distances not yet in h. */
void fit_calibration_of(const apsm_fit_model *m, char hex[65]);
/* Numbers that a calibration may have. */
bool fit_calibration_makes_sense(const fit_calibration *c);

/* m->calibration <- what m's folder holds, if that is of this model; else it stays. */
apsm_status fit_calibration_read(apsm_context *ctx, apsm_fit_model *m) APSM_NODISCARD;
apsm_status fit_calibration_write(apsm_context *ctx, const char *path, const fit_calibration *c,
                                  const char *of) APSM_NODISCARD;

/* Calibrates the model of a folder that has just been evaluated, and writes it.  A model by which
 * no shape can be fitted has none (made: false), which is no failure. */
apsm_status fit_calibrate_folder(apsm_context *ctx, const char *folder, bool *made) APSM_NODISCARD;

#endif
