/* model_folder.h -- what evaluate left in a model folder, as the report needs it. */
#ifndef APSM_REPORT_MODEL_FOLDER_H
#define APSM_REPORT_MODEL_FOLDER_H

#include "apsm/mesh.h"
#include "apsm/project.h"

struct json_t;

/* Owns everything.  Zero-initialise with {0}; model_folder_free leaves it so. */
typedef struct model_folder {
    const char *path; /* borrowed */
    apsm_project project;
    size_t I, J, modes, template_index;
    double *P;                                          /* I x J x 3, world */
    double *mean, *mode;                                /* J x 3, modes x J x 3 */
    double *variance;                                   /* modes */
    struct json_t *evaluation, *certificate, *manifest; /* the files */
} model_folder;

apsm_status model_folder_read(apsm_context *ctx, const char *path, model_folder *m);
void model_folder_free(model_folder *m);

/* The groomed mesh of shape i, in the world frame. */
apsm_status model_folder_mesh(apsm_context *ctx, const model_folder *m, size_t i, apsm_mesh *mesh);

#endif
