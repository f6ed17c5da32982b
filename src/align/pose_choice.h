/* pose_choice.h -- which of the poses that a search has found is the right one: not only by how
 * near the surfaces come, but by what they look like there, compared with all other shapes. */
#ifndef APSM_ALIGN_POSE_CHOICE_H
#define APSM_ALIGN_POSE_CHOICE_H

#include "align/align.h"

enum { POSE_OPTIONS = APSM_POSE_OPTIONS, POSE_POINTS = 200 };

/* What the search of one shape has found, as it is [0] and mirrored [1]: maps to the provisional
 * template and residuals, best first; a residual of INFINITY: no option.  Doubles only. */
typedef struct pose_ballot {
    double M[2][POSE_OPTIONS][16];
    double residual[2][POSE_OPTIONS];
} pose_ballot;

/* A pose is clear if its evidence is more by this, and a hand by the second: organs that are nearly
 * their own mirror images (kidneys) differ by up to 0.4 as they are, tali by 1.5. */
#define POSE_CLEARLY 0.3
#define HAND_CLEARLY 0.5

/* The choice for one shape.  Evidence: Fisher's z of the agreement of form with the others, less
 * the logarithm of the residual. */
typedef struct pose_choice {
    size_t option[2];   /* the best of either hand */
    double evidence[2]; /* its; -INFINITY: there is none */
    double second[2];   /* that of the next best of that hand */
    bool mirrored;      /* the hand that was taken */
} pose_choice;

/* heights (cloud->n x APSM_FORM_SCALES, out) of the surface around the cloud's points.  faces:
 * scratch, apsm_form_size(nf). */
void pose_heights(const apsm_mesh *mesh, const apsm_cloud *cloud, double *faces, double *heights);

/* Whether hands usually (the median) are clear: those of organs that are alike on both sides are
 * not, and single ones differ by chance.  True of fewer than eight shapes, whose median says
 * little.  scratch: n. */
bool pose_hands_differ(size_t n, size_t base, const pose_choice *choice, double *scratch);

/* 1: clearly a mirror image; -1: clearly none; 0: undecided.  By much more evidence, or, where
 * hands usually are clear, if residuals alone differ by APSM_MIRROR_RATIO and form does not
 * contradict. */
int pose_hand(const pose_choice *choice, const pose_ballot *ballot, bool hands_differ);

/* Whether any shape but the base has more than one pose that can be chosen. */
bool pose_is_contested(size_t n, size_t base, const pose_ballot *ballots);

/* choice (n, out) of n shapes whose clouds and heights are given; that of base is as it is.  hands:
 * mirror images may be taken, if they are clearly better.  Fewer than four shapes say nothing of
 * what is usual: then residuals alone decide, as where no pose is contested (heights are not read
 * then). */
apsm_status pose_choose(apsm_context *ctx, size_t n, size_t base, const apsm_cloud *clouds,
                        double *const *heights, const pose_ballot *ballots, bool hands,
                        pose_choice *choice) APSM_NODISCARD;

#endif
