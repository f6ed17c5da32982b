/* report.h -- a model folder as one HTML page: mean and modes, cohort, fidelity, quality,
 * certificate, provenance.  The page needs no network and no other file. */
#ifndef APSM_REPORT_H
#define APSM_REPORT_H

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes FOLDER/report.html, atomically, from what evaluate left in the folder; nothing is judged
 * anew.  Meshes are shown with about 450,000 faces together, each with 2,500 at least and 11,000 at
 * most: finer ones are remeshed; heat maps are distances of the shown vertices to the other surface
 * at full resolution.
 *
 * APSM_ERR_STATE if the folder has not been evaluated, or was changed since.  Parallel over shapes;
 * the page does not depend on the threads.  O(I V (J + log V)) time, O(I V + V J) memory for I
 * shapes of V vertices and J particles. */
APSM_API apsm_status apsm_report_write(apsm_context *ctx, const char *folder) APSM_NODISCARD;

/* Writes FOLDER/report.html for a folder of apsm_fit_run: the new shapes beside the mean, how they
 * differ, how sure that is.  Of more than 150 shapes with a surface that many are drawn, those that
 * need review first; the table has all. */
APSM_API apsm_status apsm_fit_report_write(apsm_context *ctx, const char *folder) APSM_NODISCARD;

/* Writes FOLDER/norm.html for what apsm_statistics_norm has left in folder (NULL: statistics/ in
 * the model folder) about new shapes and that model: each shape coloured by how unusual it is,
 * beside the shape that the norm expects, with its figures and how sure they are.  Surfaces of the
 * first 60 shapes are on the page. */
APSM_API apsm_status apsm_norm_report_write(apsm_context *ctx, const char *model,
                                            const char *folder) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
