/* dense.h -- the model on the vertices of the template's mesh: y = W p, linear in the particles, so
 * mean and modes of the vertices are those of the particles times W. */
#ifndef APSM_EXCHANGE_DENSE_H
#define APSM_EXCHANGE_DENSE_H

#include "folder/model_folder.h"
#include "report/template_surface.h"

/* Owns everything.  Zero-initialise with {0}; dense_model_free leaves it so. */
typedef struct dense_model {
    model_folder folder; /* with particles and scores */
    template_surface surface;
    apsm_mesh mean; /* of all parts, one after the other */
} dense_model;

apsm_status dense_model_read(apsm_context *ctx, const char *path, dense_model *m) APSM_NODISCARD;
void dense_model_free(dense_model *m);

/* y (mean.nv x 3, out): displacement of the vertices by mode k at one standard deviation. */
void dense_model_mode(const dense_model *m, size_t k, double *y);
/* y (mean.nv x 3, out): the vertices of shape i. */
void dense_model_shape(const dense_model *m, size_t i, double *y);

/* Orthonormal modes of the vertices, as other programs want them: the PCA of the dense shapes, the
 * same distribution turned.  I nv x 3 doubles twice, O(I^2 nv). */
apsm_status dense_model_pca(apsm_context *ctx, const dense_model *m,
                            apsm_shape_model *pca) APSM_NODISCARD;

/* Modes that make up 95 % of the variance, 10 at most: those that are looked at. */
size_t dense_model_main_modes(const dense_model *m);

#endif
