/* meshes/ of a joint: subjects from their particles, mean and modes. */
#include "assemble/writing.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "geometry/affine.h"

static apsm_status write_warped(writing *w, size_t d, const double *x, const double *M, char *path)
{
    apsm_mesh mesh = { 0 };
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = apsm_mesh_copy(&w->f->mesh[d], &mesh);
    if (status == APSM_OK) {
        apsm_warp_apply(&w->f->warp[d], x + 3 * w->c->first[d], mesh.V);
        if (M) apsm_mesh_transform(&mesh, M);
        status = apsm_write_mesh(w->job->ctx, path, &mesh);
    }
    apsm_mesh_free(&mesh);
    free(path);
    return status;
}

/* In the frame of the groomed meshes, as for a single part. */
static apsm_status write_rebuilt(writing *w, size_t i)
{
    for (size_t d = 0; d < w->c->n; d++) {
        const size_t k = 16 * (i * w->c->n + d);
        double M[16];
        apsm_affine_multiply(w->c->align + k, w->c->place + k, M);
        APSM_TRY(apsm_affine_invert(M, M));
        APSM_TRY(write_warped(w, d, w->c->Q + 3 * i * w->c->J, M,
                              writing_path(w, "meshes/%s_%s_reconstructed.ply",
                                           writing_subject(w, i), writing_part(w, d))));
    }
    return APSM_OK;
}

static apsm_status write_shown(writing *w, const double *x, const char *label)
{
    for (size_t d = 0; d < w->c->n; d++)
        APSM_TRY(write_warped(w, d, x, NULL,
                              writing_path(w, "meshes/%s_%s.ply", label, writing_part(w, d))));
    return APSM_OK;
}

static apsm_status write_mode(writing *w, joint_modes of, size_t k, double sd, double *x)
{
    char label[64];
    snprintf(label, sizeof label, "%s_mode_%02zu_%s2sd", of == JOINT_POSE_MODES ? "pose" : "shape",
             k + 1, sd < 0 ? "minus" : "plus");
    APSM_TRY(joint_of_mode(w->c, w->f, of, k, sd, x));
    return write_shown(w, x, label);
}

static apsm_status write_modes(writing *w)
{
    enum { SHOWN = 3 };
    double *x = malloc(w->c->J * 3 * sizeof *x);
    if (!x) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    for (joint_modes of = JOINT_POSE_MODES; of <= JOINT_SHAPE_MODES; of++) {
        const bool of_poses = of == JOINT_POSE_MODES;
        const size_t modes = of_poses ? w->f->poses.poses.modes : w->f->poses.shapes.modes;
        for (size_t k = 0; k < modes && k < SHOWN && status == APSM_OK; k++) {
            status = write_mode(w, of, k, -2, x);
            if (status == APSM_OK) status = write_mode(w, of, k, 2, x);
        }
    }
    free(x);
    return status;
}

apsm_status joint_write_meshes(writing *w)
{
    APSM_TRY(write_shown(w, w->f->model.mean, "mean"));
    APSM_TRY(write_modes(w));
    for (size_t i = 0; i < w->c->I; i++) APSM_TRY(write_rebuilt(w, i));
    return APSM_OK;
}
