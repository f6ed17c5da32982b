#include "report/rest.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "apsm/formats.h"
#include "files/files.h"
#include "geometry/clip.h"
#include "report/template_surface.h"

/* Vertices nearer to the own surface than this, in edges of what is shown, lie on it. */
static const double near = 0.3;

static apsm_status cut_off(const apsm_mesh *whole, const apsm_bvh *own, apsm_mesh *rest)
{
    double *away = malloc(whole->nv * sizeof *away + 1);
    const double tolerance = near * apsm_mesh_mean_edge(whole);
    if (!away) return APSM_ERR_MEMORY;
    for (size_t v = 0; v < whole->nv; v++) {
        apsm_closest c;
        apsm_bvh_closest(own, whole->V + 3 * v, INFINITY, &c);
        away[v] = sqrt(c.distance2) - tolerance;
    }
    const apsm_status status = apsm_mesh_clip_field(whole, away, rest);
    free(away);
    return status;
}

static apsm_status reduce_whole(apsm_context *ctx, const model_folder *m, size_t i,
                                const char *path, size_t faces, apsm_mesh *whole)
{
    double M[16];
    apsm_mesh fine = { 0 };
    apsm_bvh *tree = NULL;
    APSM_TRY(apsm_read_mesh(ctx, path, &fine));
    model_folder_to_world(m, i, M);
    apsm_mesh_transform(&fine, M);
    apsm_status status = apsm_bvh_build_unsigned(&fine, &tree);
    if (status == APSM_OK) status = reduce_mesh(ctx, &fine, tree, faces, whole);
    apsm_bvh_free(tree);
    apsm_mesh_free(&fine);
    return status;
}

apsm_status read_rest(apsm_context *ctx, const model_folder *m, size_t i, const apsm_bvh *own,
                      size_t faces, apsm_mesh *rest)
{
    char file[300];
    apsm_mesh whole = { 0 };
    *rest = (apsm_mesh){ 0 };
    snprintf(file, sizeof file, "groomed/whole/%s.ply", m->project.subjects[i].name);
    char *path = m->parts == 1 ? apsm_path_join(m->path, file) : NULL;
    if (!path) return m->parts == 1 ? APSM_ERR_MEMORY : APSM_OK;
    apsm_status status = APSM_OK;
    if (apsm_file_exists(path)) {
        status = reduce_whole(ctx, m, i, path, faces, &whole);
        if (status == APSM_OK) status = cut_off(&whole, own, rest);
    }
    apsm_mesh_free(&whole);
    free(path);
    return status;
}
