/* contour.h -- a model of curves: closed or open contours, in the plane or in space. */
#ifndef APSM_CONTOUR_H
#define APSM_CONTOUR_H

#include "apsm/run.h"

#ifdef __cplusplus
extern "C" {
#endif

/* *wanted <- whether the inputs are contours: the first is a .vtk or .vtp file (or the first of its
 * folder) with lines and without polygons. */
APSM_API apsm_status apsm_contours_wanted_sized(apsm_context *ctx,
                                                const apsm_run_settings *settings, size_t size,
                                                bool *wanted) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_contours_wanted(apsm_context *ctx,
                                                              const apsm_run_settings *settings,
                                                              bool *wanted)
{
    return apsm_contours_wanted_sized(ctx, settings, sizeof *settings, wanted);
}

/* The whole job, from contours to a folder, which must be new or empty: particles/, contours/,
 * project.swproj, model.json, scores.csv, evaluation.json and .csv.  Of the options particles,
 * adaptivity, align, definition, specificity_samples, specificity_modes, and the texts exclude,
 * pattern, template and seed count; others of the method are refused, if they are not at their
 * defaults, and so are shards: one process makes it. */
APSM_API apsm_status apsm_contours_run_sized(apsm_context *ctx, const apsm_run_settings *settings,
                                             size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_contours_run(apsm_context *ctx,
                                                           const apsm_run_settings *settings)
{
    return apsm_contours_run_sized(ctx, settings, sizeof *settings);
}

#ifdef __cplusplus
}
#endif
#endif
