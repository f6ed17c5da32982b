/* csv: the dense model as tables, for whatever reads tables. */
#include <math.h>
#include <stdlib.h>

#include "exchange/exporting.h"
#include "folder/model_json.h"

/* x (n rows of m), each followed by its own. */
static void put_row(apsm_writer *w, size_t m, const double *x)
{
    for (size_t k = 0; k < m; k++) {
        if (k > 0) apsm_writer_printf(w, ",");
        apsm_writer_number(w, x[k]);
    }
    apsm_writer_printf(w, "\n");
}

static apsm_status write_mean(exporting *e)
{
    apsm_writer *w;
    APSM_TRY(exporting_table(e, "mean.csv", &w));
    apsm_writer_printf(w, "x,y,z\n");
    for (size_t v = 0; v < e->dense.mean.nv; v++) put_row(w, 3, e->dense.mean.V + 3 * v);
    return apsm_writer_commit(w);
}

static apsm_status write_faces(exporting *e)
{
    const apsm_mesh *mean = &e->dense.mean;
    apsm_writer *w;
    APSM_TRY(exporting_table(e, "faces.csv", &w));
    apsm_writer_printf(w, "a,b,c\n");
    for (size_t f = 0; f < mean->nf; f++)
        apsm_writer_printf(w, "%u,%u,%u\n", mean->F[3 * f], mean->F[3 * f + 1], mean->F[3 * f + 2]);
    return apsm_writer_commit(w);
}

/* A line a vertex: its displacement by each mode at one standard deviation; Y (modes x nv x 3). */
static void put_modes(apsm_writer *w, const exporting *e, const double *Y)
{
    const size_t nv = e->dense.mean.nv;
    for (size_t k = 0; k < e->modes; k++)
        apsm_writer_printf(w, "%smode_%zu_x,mode_%zu_y,mode_%zu_z", k ? "," : "", k + 1, k + 1,
                           k + 1);
    apsm_writer_printf(w, "\n");
    for (size_t v = 0; v < nv; v++)
        for (size_t k = 0; k < 3 * e->modes; k++) {
            apsm_writer_number(w, Y[(k / 3 * nv + v) * 3 + k % 3]);
            apsm_writer_printf(w, k + 1 < 3 * e->modes ? "," : "\n");
        }
}

static apsm_status write_modes(exporting *e)
{
    const size_t n = 3 * e->dense.mean.nv;
    apsm_writer *w;
    double *Y = malloc((e->modes * n + 1) * sizeof *Y);
    if (!Y) return apsm_fail(e->ctx, APSM_ERR_MEMORY, "out of memory; give fewer --modes");
    for (size_t k = 0; k < e->modes; k++) dense_model_mode(&e->dense, k, Y + k * n);
    apsm_status status = exporting_table(e, "modes.csv", &w);
    if (status == APSM_OK) {
        put_modes(w, e, Y);
        status = apsm_writer_commit(w);
    }
    free(Y);
    return status;
}

static apsm_status write_variances(exporting *e)
{
    const apsm_shape_model *m = &e->dense.folder.model;
    double all = 0;
    apsm_writer *w;
    APSM_TRY(exporting_table(e, "variances.csv", &w));
    apsm_writer_printf(w, "mode,variance,share\n");
    for (size_t k = 0; k < m->modes; k++) all += m->variance[k];
    for (size_t k = 0; k < e->modes; k++) {
        apsm_writer_printf(w, "%zu,", k + 1);
        put_row(w, 2, (const double[]){ m->variance[k], m->variance[k] / all });
    }
    return apsm_writer_commit(w);
}

static apsm_status write_particles(exporting *e)
{
    const model_folder *m = &e->dense.folder;
    apsm_writer *w;
    APSM_TRY(exporting_table(e, "particles.csv", &w));
    apsm_writer_printf(w, "name");
    for (size_t j = 0; j < m->J; j++) apsm_writer_printf(w, ",x_%zu,y_%zu,z_%zu", j, j, j);
    apsm_writer_printf(w, "\n");
    for (size_t i = 0; i < m->I; i++) {
        apsm_writer_csv(w, m->names[i]);
        apsm_writer_printf(w, ",");
        put_row(w, 3 * m->J, m->P + i * 3 * m->J);
    }
    return apsm_writer_commit(w);
}

static apsm_status write_scores(exporting *e)
{
    char *path = NULL;
    apsm_status status = exporting_file(e, &path, "scores.csv");
    if (status == APSM_OK)
        status =
            scores_csv_write(e->ctx, path, e->dense.folder.names, "mode", &e->dense.folder.model);
    free(path);
    return status;
}

apsm_status export_tables(exporting *e)
{
    APSM_TRY(write_mean(e));
    APSM_TRY(write_faces(e));
    APSM_TRY(write_modes(e));
    APSM_TRY(write_variances(e));
    APSM_TRY(write_particles(e));
    return write_scores(e);
}
