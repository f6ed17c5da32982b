/* scalismo, statismo: one HDF5 file as statismo 0.9 defines it and Scalismo reads it: mean,
 * orthonormal basis and variances of the vertices, and the mesh as representer. */
#include <math.h>
#include <stdlib.h>

#include "exchange/exporting.h"
#include "exchange/hdf5.h"

/* Points and cells are stored axis by axis. */
static void put_mesh(h5_out *o, const double *V, const apsm_mesh *mesh, float *x, int *cell)
{
    const size_t nv = mesh->nv, nf = mesh->nf;
    for (size_t k = 0; k < 3 * nv; k++) x[k % 3 * nv + k / 3] = (float)V[k];
    for (size_t k = 0; k < 3 * nf; k++) cell[k % 3 * nf + k / 3] = (int)mesh->F[k];
    h5_put_floats(o, "/representer/points", 3, nv, x);
    h5_put_ints(o, "/representer/cells", 3, nf, cell);
    h5_put_attribute(o, "/representer", "name", "itkStandardMeshRepresenter");
    h5_put_attribute(o, "/representer", "version/majorVersion", "0");
    h5_put_attribute(o, "/representer", "version/minorVersion", "9");
    h5_put_attribute(o, "/representer", "datasetType", "POLYGON_MESH");
}

/* A row a coordinate, a column a mode. */
static void put_model(h5_out *o, const apsm_shape_model *pca, size_t modes, float *x)
{
    const size_t n = 3 * pca->J;
    const float none = 0;
    for (size_t k = 0; k < n; k++) x[k] = (float)pca->mean[k];
    h5_put_floats(o, "/model/mean", n, 0, x);
    for (size_t k = 0; k < modes; k++) x[k] = (float)pca->variance[k];
    h5_put_floats(o, "/model/pcaVariance", modes, 0, x);
    for (size_t k = 0; k < n * modes; k++) x[k] = (float)pca->mode[k % modes * n + k / modes];
    h5_put_floats(o, "/model/pcaBasis", n, modes, x);
    h5_put_floats(o, "/model/noiseVariance", 1, 0, &none);
}

/* Scores of the shapes in standard deviations, and where they come from; no times. */
static void put_info(h5_out *o, const apsm_shape_model *pca, size_t modes, float *x)
{
    for (size_t i = 0; i < pca->I; i++)
        for (size_t k = 0; k < modes; k++)
            x[k * pca->I + i] = (float)(pca->score[i * pca->modes + k] / sqrt(pca->variance[k]));
    h5_put_floats(o, "/modelinfo/scores", modes, pca->I, x);
    h5_put_text(o, "/modelinfo/build-time", "");
    h5_put_text(o, "/modelinfo/modelBuilder-0/buildTime", "");
    h5_put_text(o, "/modelinfo/modelBuilder-0/builderName", "apsm");
    h5_put_group(o, "/modelinfo/modelBuilder-0/parameters");
    h5_put_group(o, "/modelinfo/modelBuilder-0/dataInfo");
}

static void put_catalog(h5_out *o)
{
    h5_put_int(o, "/version/majorVersion", 0);
    h5_put_int(o, "/version/minorVersion", 9);
    h5_put_text(o, "/catalog/apsm/modelPath", "/");
    h5_put_text(o, "/catalog/apsm/modelType", "POLYGON_MESH_MODEL");
}

static size_t largest(size_t a, size_t b)
{
    return a > b ? a : b;
}

static bool put_all(const exporting *e, const apsm_shape_model *pca, h5_out *o)
{
    const apsm_mesh *mesh = &e->dense.mean;
    const size_t modes = e->modes < pca->modes ? e->modes : pca->modes;
    float *x = malloc(largest(3 * pca->J * (modes + 1), pca->I * modes) * sizeof *x);
    int *cell = malloc(3 * mesh->nf * sizeof *cell);
    const bool good = x && cell;
    if (good) {
        put_mesh(o, pca->mean, mesh, x, cell);
        put_model(o, pca, modes, x);
        put_info(o, pca, modes, x);
        put_catalog(o);
    }
    free(x);
    free(cell);
    return good;
}

static bool write_model(const exporting *e, const apsm_shape_model *pca, apsm_writer *w)
{
    h5_out *const o = h5_begin();
    if (!o) return false;
    const bool good = put_all(e, pca, o);
    return h5_end(o, w) && good;
}

apsm_status export_statismo(exporting *e)
{
    apsm_shape_model pca;
    apsm_writer *w;
    APSM_TRY(apsm_writer_open(e->ctx, e->settings->path, &w));
    apsm_status status = dense_model_pca(e->ctx, &e->dense, &pca);
    if (status == APSM_OK) {
        if (!write_model(e, &pca, w)) status = APSM_ERR_MEMORY;
        apsm_shape_model_free(&pca);
    }
    if (status == APSM_OK) return apsm_writer_commit(w);
    apsm_writer_abort(w);
    return status;
}
