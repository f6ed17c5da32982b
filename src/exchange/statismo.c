/* scalismo, statismo: one HDF5 file as statismo 0.9 defines it and Scalismo reads it: mean,
 * orthonormal basis and variances of the vertices, and the mesh as representer. */
#include "exchange/exporting.h"

#ifndef APSM_HDF5
apsm_status export_statismo(exporting *e)
{
    return apsm_fail(e->ctx, APSM_ERR_UNSUPPORTED,
                     "--to %s: this build has no HDF5; install libhdf5-dev and configure with "
                     "-DAPSM_HDF5=ON, or export to npz, csv or vtp",
                     e->settings->format);
}
#else
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "exchange/hdf5_file.h"

/* Points and cells are stored axis by axis. */
static bool put_mesh(hid_t file, const double *V, const apsm_mesh *mesh, float *x, int *cell)
{
    const size_t nv = mesh->nv, nf = mesh->nf;
    for (size_t k = 0; k < 3 * nv; k++) x[k % 3 * nv + k / 3] = (float)V[k];
    for (size_t k = 0; k < 3 * nf; k++) cell[k % 3 * nf + k / 3] = (int)mesh->F[k];
    return h5_put_floats(file, "/representer/points", 3, nv, x) &&
           h5_put_ints(file, "/representer/cells", 3, nf, cell) &&
           h5_put_attribute(file, "/representer", "name", "itkStandardMeshRepresenter") &&
           h5_put_attribute(file, "/representer", "version/majorVersion", "0") &&
           h5_put_attribute(file, "/representer", "version/minorVersion", "9") &&
           h5_put_attribute(file, "/representer", "datasetType", "POLYGON_MESH");
}

/* A row a coordinate, a column a mode. */
static bool put_model(hid_t file, const apsm_shape_model *pca, size_t modes, float *x)
{
    const size_t n = 3 * pca->J;
    const float none = 0;
    for (size_t k = 0; k < n; k++) x[k] = (float)pca->mean[k];
    if (!h5_put_floats(file, "/model/mean", n, 0, x)) return false;
    for (size_t k = 0; k < modes; k++) x[k] = (float)pca->variance[k];
    if (!h5_put_floats(file, "/model/pcaVariance", modes, 0, x)) return false;
    for (size_t k = 0; k < n * modes; k++) x[k] = (float)pca->mode[k % modes * n + k / modes];
    return h5_put_floats(file, "/model/pcaBasis", n, modes, x) &&
           h5_put_floats(file, "/model/noiseVariance", 1, 0, &none);
}

/* Scores of the shapes in standard deviations, and where they come from; no times. */
static bool put_info(hid_t file, const apsm_shape_model *pca, size_t modes, float *x)
{
    for (size_t i = 0; i < pca->I; i++)
        for (size_t k = 0; k < modes; k++)
            x[k * pca->I + i] = (float)(pca->score[i * pca->modes + k] / sqrt(pca->variance[k]));
    return h5_put_floats(file, "/modelinfo/scores", modes, pca->I, x) &&
           h5_put_text(file, "/modelinfo/build-time", "") &&
           h5_put_text(file, "/modelinfo/modelBuilder-0/buildTime", "") &&
           h5_put_text(file, "/modelinfo/modelBuilder-0/builderName", "apsm") &&
           h5_put_group(file, "/modelinfo/modelBuilder-0/parameters") &&
           h5_put_group(file, "/modelinfo/modelBuilder-0/dataInfo");
}

static bool put_catalog(hid_t file)
{
    return h5_put_int(file, "/version/majorVersion", 0) &&
           h5_put_int(file, "/version/minorVersion", 9) &&
           h5_put_text(file, "/catalog/apsm/modelPath", "/") &&
           h5_put_text(file, "/catalog/apsm/modelType", "POLYGON_MESH_MODEL");
}

static size_t largest(size_t a, size_t b)
{
    return a > b ? a : b;
}

static bool put_all(const exporting *e, const apsm_shape_model *pca, hid_t file)
{
    const apsm_mesh *mesh = &e->dense.mean;
    const size_t modes = e->modes < pca->modes ? e->modes : pca->modes;
    float *x = malloc(largest(3 * pca->J * (modes + 1), pca->I * modes) * sizeof *x);
    int *cell = malloc(3 * mesh->nf * sizeof *cell);
    const bool good = x && cell && put_mesh(file, pca->mean, mesh, x, cell) &&
                      put_model(file, pca, modes, x) && put_info(file, pca, modes, x) &&
                      put_catalog(file);
    free(x);
    free(cell);
    return good;
}

static apsm_status write_file(exporting *e, const apsm_shape_model *pca, const char *temp)
{
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL); /* failures are told by us */
    const hid_t file = H5Fcreate(temp, H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    bool good = file >= 0 && put_all(e, pca, file);
    if (file >= 0 && H5Fclose(file) < 0) good = false;
    if (good) return apsm_replace_file(e->ctx, temp, e->settings->path);
    unlink(temp);
    return apsm_fail(e->ctx, APSM_ERR_IO, "%s: cannot be written; is the disk full?",
                     e->settings->path);
}

apsm_status export_statismo(exporting *e)
{
    const size_t length = strlen(e->settings->path) + 32;
    apsm_shape_model pca;
    apsm_writer *probe;
    APSM_TRY(apsm_writer_open(e->ctx, e->settings->path, &probe));
    apsm_writer_abort(probe);
    APSM_TRY(dense_model_pca(e->ctx, &e->dense, &pca));
    char *temp = malloc(length);
    apsm_status status = APSM_ERR_MEMORY;
    if (temp) {
        snprintf(temp, length, "%s.%ld.tmp", e->settings->path, (long)getpid());
        status = write_file(e, &pca, temp);
    }
    free(temp);
    apsm_shape_model_free(&pca);
    return status;
}
#endif
