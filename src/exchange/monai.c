/* monai: MONAI Physio's statistical model, pca_mean_surface.vtp and pca_model.json: orthonormal
 * components of the flattened vertices, their variances and shares. */
#include <jansson.h>
#include <stdlib.h>

#include "apsm/formats.h"
#include "exchange/exporting.h"

static apsm_status write_surface(exporting *e, const apsm_shape_model *pca)
{
    char *path = NULL;
    const apsm_mesh mean = { e->dense.mean.nv, e->dense.mean.nf, pca->mean, e->dense.mean.F };
    apsm_status status = exporting_file(e, &path, "pca_mean_surface.vtp");
    if (status == APSM_OK) status = apsm_write_mesh(e->ctx, path, &mean);
    free(path);
    return status;
}

static apsm_status write_components(exporting *e, const apsm_shape_model *pca, double *share)
{
    const size_t modes = e->modes < pca->modes ? e->modes : pca->modes;
    double all = 0;
    for (size_t k = 0; k < pca->modes; k++) all += pca->variance[k];
    for (size_t k = 0; k < modes; k++) share[k] = pca->variance[k] / all;
    json_t *root =
        json_pack("{s:o, s:o, s:o}", "explained_variance_ratio", apsm_json_vector(modes, share),
                  "eigenvalues", apsm_json_vector(modes, pca->variance), "components",
                  apsm_json_matrix(modes, 3 * pca->J, pca->mode));
    return exporting_json(e, "pca_model.json", root);
}

apsm_status export_monai(exporting *e)
{
    apsm_shape_model pca;
    APSM_TRY(dense_model_pca(e->ctx, &e->dense, &pca));
    double *share = malloc((pca.modes + 1) * sizeof *share);
    apsm_status status = share ? write_surface(e, &pca) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = write_components(e, &pca, share);
    free(share);
    apsm_shape_model_free(&pca);
    return status;
}
