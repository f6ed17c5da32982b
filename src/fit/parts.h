/* parts.h -- the steps of a fit, in the order of their use. */
#ifndef APSM_FIT_PARTS_H
#define APSM_FIT_PARTS_H

#include <stdarg.h>

#include "fit/fit_model.h"
#include "fit/pose.h"

/* One fit under way.  Borrowed but for shape. */
typedef struct fit_job {
    const apsm_fit_model *m;
    const char *name;
    const apsm_mesh *mesh; /* as given */
    const apsm_fit_options *options;
    fit_pose pose;
    apsm_shape shape;     /* in the world frame; {0} until posed */
    unsigned faults;      /* the certificate's reasons */
    double pose_evidence; /* of a part: log of how much likelier its pose is than another */
    struct {
        size_t which, farthest;  /* the worst, and the farthest from the mean's surface */
        const char *const *name; /* NULL: they have none */
        double off, deviations;  /* of which from where the others say it is: in h, and in theirs */
        double off_mean;         /* of farthest */
    } landmark;
    apsm_fit *out;
} fit_job;

/* Arrays of out, sized for the model. */
apsm_status fit_alloc(const apsm_fit_model *m, apsm_fit *out) APSM_NODISCARD;

/* If the model's shapes were cropped: job->mesh becomes what of `given` lies where the template
 * does (out->cropped), with its pose. */
apsm_status fit_crop(apsm_context *ctx, fit_job *job, const apsm_mesh *given) APSM_NODISCARD;

/* Particles of a whole shape (job->shape) to out->world, with their certificate: registration, then
 * (12). */
apsm_status fit_whole_particles(apsm_context *ctx, fit_job *job) APSM_NODISCARD;

/* From out->world and job->pose to all frames, and the warped mesh. */
apsm_status fit_frames(fit_job *job) APSM_NODISCARD;
/* Scores, distance from the mean, miss by the modes. */
apsm_status fit_scores(fit_job *job) APSM_NODISCARD;
/* Standard deviations of particles and vertices, all of them observed. */
apsm_status fit_whole_deviations(fit_job *job) APSM_NODISCARD;
/* Deviations of particle j from its covariance, times factor; n: unit normal. */
void fit_set_deviation(apsm_fit *out, size_t j, const double block[9], const double n[3],
                       double factor);
/* The certificate's part of out, for particles out->world on job->shape. */
apsm_status fit_certify(fit_job *job) APSM_NODISCARD;

/* The verdict so far worsens to this, with a reason unless a worse one is known. */
void fit_object(apsm_fit *out, apsm_fit_verdict verdict, const char *format, ...) APSM_PRINTF(3, 4);
/* The same for a verdict and reason that stand elsewhere. */
void fit_worsen(apsm_fit_verdict *worst, char reason[APSM_FIT_REASON], apsm_fit_verdict verdict,
                const char *format, va_list args);
/* What size and pose say, before particles are looked for. */
void fit_judge_pose(fit_job *job);
/* What can be said of a part. */
void fit_judge_part(fit_job *job);
void fit_judge_landmarks(fit_job *job);
/* What all figures say. */
void fit_judge(fit_job *job);

#endif
