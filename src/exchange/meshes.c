/* vtp, ply, stl, obj: mean, modes to both sides, every shape; with numbers at the vertices where
 * the format holds them. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "evaluate/surface_distance.h"
#include "exchange/exporting.h"
#include "geometry/vec3.h"

typedef struct mesh_work {
    exporting *e;
    apsm_mesh mesh; /* its vertices change */
    double *normal; /* nv x 3, of the mean */
    double *y;      /* nv x 3 */
    double *value;  /* nv */
} mesh_work;

static bool holds_fields(const exporting *e)
{
    return strcmp(e->settings->format, "ply") == 0 || strcmp(e->settings->format, "vtp") == 0;
}

static apsm_status write_mesh(mesh_work *w, const char *field, char *path)
{
    const apsm_mesh_field f = { field, w->value };
    const apsm_status status = holds_fields(w->e)
                                   ? apsm_write_mesh_fields(w->e->ctx, path, &w->mesh, 1, &f)
                                   : apsm_write_mesh(w->e->ctx, path, &w->mesh);
    return status;
}

/* With the standard deviation of the vertices along their normals. */
static apsm_status write_mean(mesh_work *w)
{
    const dense_model *d = &w->e->dense;
    char *path = NULL;
    for (size_t v = 0; v < d->mean.nv; v++) w->value[v] = 0;
    for (size_t k = 0; k < d->folder.model.modes; k++) {
        dense_model_mode(d, k, w->y);
        for (size_t v = 0; v < d->mean.nv; v++) {
            const double along = vec3_dot(w->y + 3 * v, w->normal + 3 * v);
            w->value[v] += along * along;
        }
    }
    for (size_t v = 0; v < d->mean.nv; v++) w->value[v] = sqrt(w->value[v]);
    apsm_status status = exporting_file(w->e, &path, "mean.%s", w->e->settings->format);
    if (status == APSM_OK) status = write_mesh(w, "sd_along_normal", path);
    free(path);
    return status;
}

/* The mean moved by sd times mode k (y), with the displacement along the mean's normals. */
static apsm_status write_mode(mesh_work *w, size_t k, double sd)
{
    const apsm_mesh *mean = &w->e->dense.mean;
    char *path = NULL, number[APSM_NUMBER_LENGTH];
    for (size_t x = 0; x < 3 * mean->nv; x++) w->mesh.V[x] = mean->V[x] + sd * w->y[x];
    for (size_t v = 0; v < mean->nv; v++)
        w->value[v] = sd * vec3_dot(w->y + 3 * v, w->normal + 3 * v);
    apsm_format_number(fabs(sd), number);
    apsm_status status = exporting_file(w->e, &path, "modes/mode_%02zu_%s%ssd.%s", k + 1,
                                        sd < 0 ? "minus" : "plus", number, w->e->settings->format);
    if (status == APSM_OK) status = write_mesh(w, "displacement", path);
    free(path);
    return status;
}

static apsm_status write_modes(mesh_work *w)
{
    const exporting *e = w->e;
    for (size_t k = 0; k < e->modes; k++) {
        dense_model_mode(&e->dense, k, w->y);
        for (size_t s = 0; s < e->n_sd; s++) {
            APSM_TRY(write_mode(w, k, -e->sd[s]));
            APSM_TRY(write_mode(w, k, e->sd[s]));
        }
    }
    return APSM_OK;
}

/* How far the vertices are from the shape's own surface. */
static apsm_status measure_shape(mesh_work *w, size_t i)
{
    apsm_mesh own = { 0 };
    apsm_bvh *tree = NULL;
    APSM_TRY(model_folder_mesh(w->e->ctx, &w->e->dense.folder, i, &own));
    const apsm_status status = apsm_bvh_build_unsigned(&own, &tree);
    if (status == APSM_OK) apsm_point_distances(tree, w->mesh.nv, w->mesh.V, w->value, NULL);
    apsm_bvh_free(tree);
    apsm_mesh_free(&own);
    return status;
}

static apsm_status write_shape(mesh_work *w, size_t i)
{
    exporting *e = w->e;
    char *path = NULL;
    dense_model_shape(&e->dense, i, w->mesh.V);
    if (holds_fields(e)) APSM_TRY(measure_shape(w, i));
    apsm_status status =
        exporting_file(e, &path, "shapes/%s.%s", e->dense.folder.names[i], e->settings->format);
    if (status == APSM_OK) status = write_mesh(w, "surface_distance", path);
    free(path);
    return status;
}

static apsm_status write_all(mesh_work *w)
{
    APSM_TRY(write_mean(w));
    APSM_TRY(write_modes(w));
    for (size_t i = 0; i < w->e->dense.folder.I; i++) APSM_TRY(write_shape(w, i));
    return export_scene(w->e);
}

apsm_status export_meshes(exporting *e)
{
    const apsm_mesh *mean = &e->dense.mean;
    mesh_work w = { .e = e,
                    .normal = malloc(3 * mean->nv * sizeof *w.normal),
                    .y = malloc(3 * mean->nv * sizeof *w.y),
                    .value = malloc(mean->nv * sizeof *w.value) };
    apsm_status status = w.normal && w.y && w.value ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_mesh_copy(mean, &w.mesh);
    if (status == APSM_OK) {
        apsm_mesh_vertex_normals(mean, w.normal);
        status = write_all(&w);
    }
    apsm_mesh_free(&w.mesh);
    free(w.normal);
    free(w.y);
    free(w.value);
    return status;
}
