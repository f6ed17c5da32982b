/* features.h -- scalar fields of the shapes, from the vertices of meshes or from images, through
 * grooming to the objective and to the results. */
#ifndef APSM_RUN_FEATURES_H
#define APSM_RUN_FEATURES_H

#include "model/warp.h"
#include "run/groom_inputs.h"

/* Whether text is a value of "features": NAME[:WEIGHT],... ; normals is the normals' name. */
apsm_status features_check_text(apsm_context *ctx, const char *text);

/* Tells which fields the project asks for, and refuses shapes that have not all: before the long
 * part. */
apsm_status features_check(apsm_run *run, const groom_inputs *in);
/* The same of shapes that a finished model is to take by their form alone: refused where scalar
 * fields had a say in its correspondence. */
apsm_status features_check_added(apsm_run *run, const groom_inputs *in);
/* The groomed mesh of shape i with its fields, into the file. */
apsm_status features_write_mesh(apsm_context *ctx, const apsm_run *run, const groom_inputs *in,
                                size_t i, const char *path);
/* Reads the fields of the groomed meshes and gives them to the cohort. */
apsm_status features_load(apsm_run *run);
void features_free(run_features *f);

/* features.csv: every field at every particle of every shape (P: I x J x 3, world). */
apsm_status features_write_table(apsm_run *run, size_t J, const double *P);
/* Fields of the mean, of the mesh that the warp carries: their means over the shapes; *mean (S x
 * nv) is malloc'ed, NULL if there are none. */
apsm_status features_mean(apsm_run *run, const apsm_warp *warp, size_t J, const double *P,
                          double **mean);

#endif
