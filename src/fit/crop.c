/* A model of shapes that were cropped to what all of them hold (groom/common_ends.h) knows nothing
 * of what lies beyond: a new shape that is longer is cropped at the same places, which are the flat
 * ends of the template.  As for the cohort, the planes are laid in the shape with its size made the
 * template's, and the pose is then that of what is left. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/parts.h"
#include "geometry/vec3.h"
#include "groom/common_ends.h"
#include "groom/groom.h"

enum { ROUNDS = 3 };
static const double least_share = 0.02; /* of the surface: less beyond the planes is no matter */

/* The template's flat ends as planes in the frame of a shape with the pose M: n.(M x) <= d. */
static size_t planes_of(const apsm_fit_model *m, const double M[16],
                        double plane[APSM_MOST_CUTS][4])
{
    for (size_t k = 0; k < m->cloud.cuts; k++) {
        const double *n = m->cloud.cut[k];
        double p[3] = { 0 }, d = n[3];
        for (size_t r = 0; r < 3; r++) {
            d -= n[r] * M[4 * r + 3];
            for (size_t c = 0; c < 3; c++) p[c] += n[r] * M[4 * r + c];
        }
        const double scale = vec3_normalise(p);
        memcpy(plane[k], p, sizeof p);
        plane[k][3] = d / scale;
    }
    return m->cloud.cuts;
}

/* Share of the surface, by whole faces, that lies beyond one of the planes. */
static double share_beyond(const apsm_mesh *mesh, size_t n, double plane[APSM_MOST_CUTS][4])
{
    double beyond = 0, all = 0;
    for (size_t f = 0; f < mesh->nf; f++) {
        double x[3] = { 0 }, normal[3];
        const double *corner[3];
        for (size_t c = 0; c < 3; c++) {
            corner[c] = mesh->V + 3 * (size_t)mesh->F[3 * f + c];
            vec3_add_scaled(x, 1.0 / 3, corner[c]);
        }
        vec3_triangle(corner[0], corner[1], corner[2], normal);
        const double area = vec3_norm(normal);
        bool out = false;
        for (size_t k = 0; k < n; k++) out |= vec3_dot(plane[k], x) > plane[k][3];
        all += area;
        beyond += out ? area : 0;
    }
    return all > 0 ? beyond / all : 0;
}

/* The pose of what is left; the hand stays. */
static apsm_status pose_again(fit_job *job, double S[16])
{
    apsm_bvh *bvh = NULL;
    apsm_fit_options o = *job->options;
    fit_pose pose;
    o.hand = job->pose.mirrored ? APSM_HAND_OTHER : APSM_HAND_SAME;
    APSM_TRY(apsm_bvh_build_unsigned(job->mesh, &bvh));
    apsm_status status = fit_pose_find(job->m, job->mesh, bvh, &o, &pose);
    if (status == APSM_OK) status = fit_pose_sized(job->m, job->mesh, bvh, pose.M, S);
    apsm_bvh_free(bvh);
    pose.mirror_ratio = job->pose.mirror_ratio;
    if (status == APSM_OK) job->pose = pose;
    return status;
}

apsm_status fit_crop(apsm_context *ctx, fit_job *job, const apsm_mesh *given)
{
    const apsm_fit_model *m = job->m;
    const apsm_groom_options options = m->options.groom;
    double S[16], plane[APSM_MOST_CUTS][4], before = 0;
    memcpy(S, job->pose.M, sizeof S);
    for (int r = 0; m->cropped && r < ROUNDS; r++) {
        apsm_mesh cropped = { 0 };
        const size_t n = planes_of(m, S, plane);
        const double share = share_beyond(given, n, plane);
        if (share < least_share || fabs(share - before) < least_share / 4) break;
        APSM_TRY(apsm_crop_mesh(ctx, job->name, given, n, (const double(*)[4])plane, &options,
                                &cropped));
        apsm_mesh_free(&job->out->cropped);
        job->out->cropped = cropped;
        job->out->cropped_share = before = share;
        job->mesh = &job->out->cropped;
        if (job->options->aligned) break;
        APSM_TRY(pose_again(job, S));
    }
    return APSM_OK;
}
