/* Is the shape one of the model's kind?  By size, by the pose's residual, by the miss of the modes,
 * by the surface's distance and by the scores, each against what the cohort and left-out shapes
 * have.  Wide bounds refuse, narrower ones ask for a look. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "core/number.h"
#include "correspond/certificate.h"
#include "fit/parts.h"
#include "fit/tail.h"

static const double other_size = 1.35;      /* beyond the cohort's sizes by this factor */
static const double pose_refused = 0.25;    /* of the radius: another shape altogether */
static const double residual_refused = 2.5; /* times the worst left-out shape's */
static const double residual_review = 1.5;
static const double distance_refused = 4; /* times the worst of the cohort */
static const double distance_review = 2;
static const double distance_unmeasured = 0.2; /* h: what is taken for that where it is not known */
static const double form_refused = 4; /* product of three ratios; of left-out shapes at most 1.9 */
static const double form_review = 2.5;
static const double own_mirror = 1.5; /* usual residuals: a kind that differs less from its mirror
                                         image does not show its side */
static const double tail_review = 1e-3;
static const double pose_told = 3;    /* log of how much likelier the pose of a part has to be */
static const double landmark_off = 6; /* deviations, of three coordinates together */
static const double landmark_off_mean = 0.25;              /* of the radius */
static const double part_refused = 0.5, part_review = 0.8; /* of a part, what fits */

const char *apsm_fit_verdict_text(apsm_fit_verdict verdict)
{
    static const char *const text[] = { "good", "needs review", "refused" };
    return text[verdict];
}

void fit_worsen(apsm_fit_verdict *worst, char reason[APSM_FIT_REASON], apsm_fit_verdict verdict,
                const char *format, va_list args)
{
    if (verdict <= *worst) return;
    *worst = verdict;
    apsm_vprint(reason, APSM_FIT_REASON, format, args);
}

void fit_object(apsm_fit *out, apsm_fit_verdict verdict, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fit_worsen(&out->verdict, out->reason, verdict, format, args);
    va_end(args);
}

/* Of a kind that is nearly its own mirror image (vertebrae, ribs) the pose does not tell the side
 * unless shapes come in one orientation, and this one does. */
static bool is_side_shown(const fit_job *job)
{
    const apsm_fit_model *m = job->m;
    const apsm_fit_options *o = job->options;
    if (o->aligned || o->hand != APSM_HAND_AUTO || job->pose.usual) return true;
    return m->options.align.align == APSM_ALIGN_NONE ||
           m->mirror > own_mirror * m->calibration.pose;
}

void fit_judge_pose(fit_job *job)
{
    const fit_calibration *c = &job->m->calibration;
    const fit_pose *p = &job->pose;
    apsm_fit *out = job->out;
    const bool any_size = job->m->options.align.align == APSM_ALIGN_SIMILARITY;
    if (!any_size && (p->size * other_size < c->size_least || p->size > other_size * c->size_most))
        fit_object(out, APSM_FIT_REFUSED,
                   "is %.3g times as large as the mean; the model's shapes are %.3g to %.3g times",
                   p->size, c->size_least, c->size_most);
    if (p->residual > pose_refused)
        fit_object(out, APSM_FIT_REFUSED,
                   "another shape: the surfaces are %.2f radii apart in the best pose",
                   p->residual);
    if (p->runner_up < 1.005)
        fit_object(out, APSM_FIT_REVIEW, "ambiguous pose: another one fits as well");
    else if (p->runner_up < APSM_AMBIGUOUS_RATIO)
        fit_object(out, APSM_FIT_REVIEW, "ambiguous pose: another one fits within %.0f %%",
                   100 * (p->runner_up - 1));
    if (!is_side_shown(job))
        fit_object(out, APSM_FIT_REVIEW,
                   "its side is not known: shapes of this kind are nearly their own mirror images; "
                   "say which, --hand same or --hand other");
}

static void judge_distance(const fit_job *job)
{
    const fit_calibration *c = &job->m->calibration;
    const double usual = c->distance_most > 0 ? c->distance_most : distance_unmeasured;
    const double distance = job->out->distance.two_way.mean / job->m->h;
    if (!job->out->has_distance) return;
    if (distance > distance_review * usual)
        fit_object(
            job->out, distance > distance_refused * usual ? APSM_FIT_REFUSED : APSM_FIT_REVIEW,
            "its surface is %.2g times as far from the fit as that of the model's worst shape",
            distance / usual);
}

static void judge_scores(const fit_job *job)
{
    apsm_fit *out = job->out;
    if (out->tail < tail_review)
        fit_object(
            out, APSM_FIT_REVIEW,
            "far from the mean: Mahalanobis distance %.3g, beyond which one shape in %.0f lies",
            out->mahalanobis, fmin(1 / fmax(out->tail, 1e-12), 1e12));
}

static void judge_part_pose(fit_job *job)
{
    if (job->pose_evidence < pose_told)
        fit_object(job->out, APSM_FIT_REVIEW,
                   "ambiguous pose: what is given fits in another place nearly as well");
}

void fit_judge_part(fit_job *job)
{
    apsm_fit *out = job->out;
    if (out->counted_share < part_refused)
        fit_object(out, APSM_FIT_REFUSED, "another shape: only %.0f %% of what is given fits",
                   100 * out->counted_share);
    else if (out->counted_share < part_review)
        fit_object(out, APSM_FIT_REVIEW, "only %.0f %% of what is given fits",
                   100 * out->counted_share);
    judge_part_pose(job);
    judge_distance(job);
    judge_scores(job);
}

/* How landmark k is called. */
static const char *name_of(const fit_job *job, size_t k, char number[32])
{
    snprintf(number, 32, "%zu", k + 1);
    return job->landmark.name ? job->landmark.name[k] : number;
}

/* What one of them says against the others. */
static void judge_worst_landmark(fit_job *job)
{
    const double band = fmax(job->m->calibration.band[FIT_BANDS - 1], 1);
    char number[32];
    if (job->landmark.deviations > landmark_off * band)
        fit_object(job->out, APSM_FIT_REVIEW,
                   "landmark %.60s is %.2g h from where the others say it is, %.2g standard "
                   "deviations: is it misplaced, or another one of that name?",
                   name_of(job, job->landmark.which, number), job->landmark.off,
                   job->landmark.deviations);
}

/* Landmarks of another mean, or of this one in another frame, fit well and say nothing. */
static void judge_mean_landmarks(fit_job *job)
{
    char number[32];
    const double off = job->landmark.off_mean / job->m->radius;
    if (off > landmark_off_mean)
        fit_object(
            job->out, APSM_FIT_REVIEW,
            "landmark %.60s is %.2g radii off the mean's surface: are those of the mean shape "
            "placed on this model's (meshes/mean.ply of its fits)?",
            name_of(job, job->landmark.farthest, number), off);
}

/* A point a spacing off is in the wrong place, or of another shape. */
void fit_judge_landmarks(fit_job *job)
{
    apsm_fit *out = job->out;
    if (out->counted_share < part_refused)
        fit_object(out, APSM_FIT_REFUSED, "another shape: only %.0f %% of the landmarks fit",
                   100 * out->counted_share);
    judge_mean_landmarks(job);
    judge_worst_landmark(job);
    if (out->counted_share < 1)
        fit_object(out, APSM_FIT_REVIEW, "landmarks do not fit: one is %.3g h off",
                   out->distance.two_way.max / job->m->h);
    judge_scores(job);
}

/* Strangers of simple form pass every bound alone: of tali as large as kidneys the pose's residual
 * is 1.6 to 1.9 times the usual, the surface's distance 3.3 to 3.7 and the modes' miss 1.1 to 1.4
 * times the worst.  Shapes left out of six models have products below 1.9. */
static void judge_form(const fit_job *job, double miss)
{
    const fit_calibration *c = &job->m->calibration;
    const double pose = job->pose.residual / c->pose;
    const double distance = job->out->distance.two_way.mean / (job->m->h * c->distance_most);
    if (!(c->pose > 0) || !(pose > 0) || !(c->distance_most > 0) || !job->out->has_distance) return;
    const double form = pose * distance * miss;
    if (form > form_review)
        fit_object(job->out, form > form_refused ? APSM_FIT_REFUSED : APSM_FIT_REVIEW,
                   "another form: in the best pose it is %.2g times as far from the template as is "
                   "usual, from the fit %.2g times as far and from the modes %.2g times as far as "
                   "the model's worst shapes",
                   pose, distance, miss);
}

void fit_judge(fit_job *job)
{
    const fit_calibration *c = &job->m->calibration;
    apsm_fit *out = job->out;
    const double miss = out->residual / (c->residual_most * job->m->h);
    if (miss > residual_review)
        fit_object(out, miss > residual_refused ? APSM_FIT_REFUSED : APSM_FIT_REVIEW,
                   "the modes miss it by %.2g times as much as the worst left-out shape", miss);
    judge_form(job, miss);
    judge_distance(job);
    for (int r = 0; r < APSM_REVIEW_COUNT; r++)
        if (job->faults & (1u << r))
            fit_object(out, APSM_FIT_REVIEW, "%s", apsm_review_text((apsm_review)r));
    judge_scores(job);
}
