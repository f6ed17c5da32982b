#include "exchange/dense.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

apsm_status dense_model_read(apsm_context *ctx, const char *path, dense_model *m)
{
    const unsigned parts = FOLDER_PARTICLES | FOLDER_SCORES | FOLDER_EVALUATED | FOLDER_CERTIFIED;
    *m = (dense_model){ 0 };
    APSM_TRY(model_folder_read(ctx, path, parts, &m->folder));
    apsm_status status = template_surface_make(ctx, &m->folder, 0, &m->surface);
    if (status == APSM_OK) status = template_surface_mesh(&m->surface, &m->mean);
    if (status == APSM_OK) template_surface_warp(&m->surface, m->folder.model.mean, m->mean.V);
    if (status != APSM_OK) dense_model_free(m);
    return status;
}

void dense_model_free(dense_model *m)
{
    template_surface_free(&m->surface);
    apsm_mesh_free(&m->mean);
    model_folder_free(&m->folder);
}

void dense_model_mode(const dense_model *m, size_t k, double *y)
{
    const double sd = sqrt(m->folder.model.variance[k]);
    template_surface_warp(&m->surface, m->folder.model.mode + k * 3 * m->folder.J, y);
    for (size_t x = 0; x < 3 * m->mean.nv; x++) y[x] *= sd;
}

void dense_model_shape(const dense_model *m, size_t i, double *y)
{
    template_surface_warp(&m->surface, m->folder.P + i * 3 * m->folder.J, y);
}

apsm_status dense_model_pca(apsm_context *ctx, const dense_model *m, apsm_shape_model *pca)
{
    const size_t I = m->folder.I, n = 3 * m->mean.nv;
    double *Y = malloc(I * n * sizeof *Y);
    *pca = (apsm_shape_model){ 0 };
    if (!Y) return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for %zu dense shapes", I);
    for (size_t i = 0; i < I; i++) dense_model_shape(m, i, Y + i * n);
    const apsm_status status = apsm_shape_model_fit(ctx, I, m->mean.nv, Y, pca);
    free(Y);
    return status;
}

size_t dense_model_main_modes(const dense_model *m)
{
    static const double enough = 0.95;
    enum { MOST = 10 };
    const apsm_shape_model *s = &m->folder.model;
    double all = 0, so_far = 0;
    size_t n = 0;
    for (size_t k = 0; k < s->modes; k++) all += s->variance[k];
    while (n < s->modes && n < MOST && (n == 0 || so_far < enough * all))
        so_far += s->variance[n++];
    return n;
}
