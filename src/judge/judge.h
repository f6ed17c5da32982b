/* judge.h -- does every shape lie, belong and correspond as the others do?  Every shape is compared
 * with what is usual in the others, by figures that no stage of the optimisation minimises
 * (docs/method.md, "Judging"). */
#ifndef APSM_JUDGE_JUDGE_H
#define APSM_JUDGE_JUDGE_H

#include "initialize/cohort.h"
#include "judge/depart.h"
#include "judge/turns.h"

/* What was found of one shape.  "Excess": standard deviations above the median of the others. */
typedef struct apsm_findings {
    double agreement;  /* of form with the others, see form.h */
    apsm_turn turn[2]; /* the best other pose, as it is and mirrored */
    double fit;        /* distance of the particles from usual ones, in h */
    double slip; /* how many times as far, relative to what is usual in a place, a region has gone
                    along the surface as the worst regions of the other shapes have (their third
                    quartile) */
    double slip_size; /* how far, in h, beyond what is usual: the mean over the region */
    uint32_t slip_at; /* the particle in its middle */
    double reach; /* how far the surface reaches beyond the particles, in h beyond what is usual */
    double reach_excess;
    uint32_t reach_at;
    double farthest;    /* of its surface from the particle next to it, in the shape's own h */
    double area, size;  /* over the median of the others */
    double area_excess; /* of its logarithm, either way */
    double size_excess;
    double long_excess, flat_excess; /* of the proportions of the principal axes */
    size_t opposed;                  /* particles that look the other way than all others there */
    double off; /* root mean square distance from where the others say, over the others' */
    double off_excess;
    apsm_departure part[APSM_DEPART_LOOKS]; /* of its surface that is unlike the others' */
} apsm_findings;

typedef struct apsm_judgement {
    size_t I, J;
    double h;
    size_t looks; /* for slips, of APSM_SLIP_LOOKS; 0: too few particles, no slip is known */
    apsm_findings *shape; /* I */
    double *slip;         /* I x J: of the patch around each particle, over what is usual there */
    double *uncovered;    /* I x J: how far the surface reaches beyond, in h beyond what is usual */
    double *departs;      /* I x J: of the surface around each particle, over what is usual there */
    bool *opposed;        /* I x J */
    uint32_t *N6;         /* J x 6: neighbours of each particle on the template */
    uint32_t *twin;       /* I: a shape before it that is nearly the same; or itself */
} apsm_judgement;

/* Judges particles P (I x J x 3, world frame) of I >= 3 shapes. */
apsm_status apsm_judge(apsm_context *ctx, const apsm_cohort *cohort, size_t J, const double *P,
                       apsm_judgement *judgement) APSM_NODISCARD;
/* in (J, out) <- the particles around `at` where the surface of shape i departs half as much as
 * there, from neighbour to neighbour.  queue: J. */
void apsm_judgement_around(const apsm_judgement *judgement, size_t i, uint32_t at, bool *in,
                           uint32_t *queue);
void apsm_judgement_free(apsm_judgement *judgement);

#endif
