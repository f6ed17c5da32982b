/* A model of shapes that were cropped to what all of them hold (align/common_ends.h) knows nothing
 * of what lies beyond: a new shape that is longer is cropped at the same places, which are the flat
 * ends of the template.  As for the cohort, the planes are laid in the shape with its size made the
 * template's, and the pose is then that of what is left. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/common_ends.h"
#include "fit/parts.h"
#include "groom/groom.h"

enum { ROUNDS = 3 };
static const double least_share = 0.02; /* of the surface: less beyond the planes is no matter */

/* The template's flat ends, in the world. */
static apsm_common_ends ends_of(const apsm_fit_model *m)
{
    apsm_common_ends ends = { .n = m->cloud.cuts };
    for (size_t k = 0; k < ends.n; k++)
        memcpy(ends.end[k].plane, m->cloud.cut[k], sizeof ends.end[k].plane);
    return ends;
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
    const apsm_common_ends ends = ends_of(m);
    double S[16], plane[APSM_MOST_ENDS][4], before = 0;
    memcpy(S, job->pose.M, sizeof S);
    for (int r = 0; m->cropped && r < ROUNDS; r++) {
        apsm_mesh cropped = { 0 };
        const double share = apsm_common_ends_loss(given, S, &ends);
        if (share < least_share || fabs(share - before) < least_share / 4) break;
        apsm_common_ends_planes(&ends, S, plane);
        APSM_TRY(apsm_crop_mesh(ctx, job->name, given, ends.n, (const double(*)[4])plane, &options,
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
