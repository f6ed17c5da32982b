/* verdict.h -- from findings to grades: what passes, what needs review and why. */
#ifndef APSM_JUDGE_VERDICT_H
#define APSM_JUDGE_VERDICT_H

#include "judge/judge.h"

/* Fewer shapes than this have nobody to be compared with. */
enum { APSM_LEAST_JUDGED = 5 };

/* What is graded.  Of neighbours and surface the certificate of the correspondence tells
 * (correspond/certificate.h). */
#define APSM_ASPECT_LIST(X)                                                                        \
    X(APSM_ASPECT_NEIGHBOURS, "neighbours")                                                        \
    X(APSM_ASPECT_SURFACE, "surface")                                                              \
    X(APSM_ASPECT_SLIP, "slip")                                                                    \
    X(APSM_ASPECT_COVERAGE, "coverage")                                                            \
    X(APSM_ASPECT_SIDE, "side")                                                                    \
    X(APSM_ASPECT_POSE, "pose")                                                                    \
    X(APSM_ASPECT_HAND, "hand")                                                                    \
    X(APSM_ASPECT_BELONGING, "belonging")
#define APSM_ASPECT_ENUM(name, text) name,
typedef enum apsm_aspect { APSM_ASPECT_LIST(APSM_ASPECT_ENUM) APSM_ASPECT_COUNT } apsm_aspect;
#undef APSM_ASPECT_ENUM
const char *apsm_aspect_name(apsm_aspect aspect); /* constant string */

/* Why a shape needs review; bits 1 << APSM_DOUBT_*. */
#define APSM_DOUBT_LIST(X)                                                                         \
    X(APSM_DOUBT_SLIP, APSM_ASPECT_SLIP, "a region has slipped along the surface")                 \
    X(APSM_DOUBT_ENDS, APSM_ASPECT_COVERAGE, "particles miss a part of the surface")               \
    X(APSM_DOUBT_SIDE, APSM_ASPECT_SIDE, "particles are on the other side of a sheet")             \
    X(APSM_DOUBT_TURNED, APSM_ASPECT_POSE,                                                         \
      "looks turned: its surface agrees with the others' in "                                      \
      "another pose")                                                                              \
    X(APSM_DOUBT_POSE, APSM_ASPECT_POSE, "another pose is as likely")                              \
    X(APSM_DOUBT_MIRRORED, APSM_ASPECT_HAND,                                                       \
      "looks mirrored: name the sides with --reflect-match, "                                      \
      "or use --mirror-check fix")                                                                 \
    X(APSM_DOUBT_HAND, APSM_ASPECT_HAND, "its mirror image is as likely")                          \
    X(APSM_DOUBT_FORM, APSM_ASPECT_BELONGING,                                                      \
      "its form is unlike the others'; leave it out with "                                         \
      "--exclude if it does not belong")                                                           \
    X(APSM_DOUBT_SIZE, APSM_ASPECT_BELONGING,                                                      \
      "its size is unlike the others'; leave it out with "                                         \
      "--exclude if it does not belong")                                                           \
    X(APSM_DOUBT_PART, APSM_ASPECT_BELONGING,                                                      \
      "a part of its surface is unlike the others': missing, grown, or joined to something; "      \
      "correct it, or leave the shape out with --exclude")
#define APSM_DOUBT_ENUM(name, aspect, text) name,
typedef enum apsm_doubt { APSM_DOUBT_LIST(APSM_DOUBT_ENUM) APSM_DOUBT_COUNT } apsm_doubt;
#undef APSM_DOUBT_ENUM
const char *apsm_doubt_text(apsm_doubt doubt); /* constant string */
apsm_aspect apsm_doubt_aspect(apsm_doubt doubt);

/* From where on a shape needs review.  Excesses are in standard deviations above the others'
 * median, as in judge.h. */
typedef struct apsm_verdict_options {
    double slip, slip_size;          /* both: 2.25 times the others', 0.03 h */
    double clear_slip, clear_size;   /* or both: 3.5 times, 0.01 h */
    double reach_excess, reach_size; /* both: 4.5, 0.35 h */
    double farthest;                 /* or this, whatever is usual: 1.4 h */
    double off, off_excess;          /* both: 2.25 times the others', 5 */
    double size, size_excess;        /* both: 1.4 times the others' or less than that part, 6 */
    double part, part_excess;        /* all three: 2.25 times the others' worst, 4, */
    double part_size;                /* 0.2 h; */
    double large_excess, large_size; /* or part and these: 2.5, 0.4 h */
    double against; /* evidence against a pose or hand from where it is taken for wrong: 0.2 */
    double told;    /* evidence for it below which the surface cannot tell: 0.3 */
} apsm_verdict_options;
apsm_verdict_options apsm_verdict_defaults(void);

/* The doubts about a shape of which this was found. */
unsigned apsm_verdict_doubts(const apsm_findings *findings, const apsm_verdict_options *options);

/* The part of the surface that is unlike the others' the most: one that is doubted, if any is. */
const apsm_departure *apsm_verdict_part(const apsm_findings *findings,
                                        const apsm_verdict_options *options);

/* Whether what the surface looks like decides between the shape as it lies and other ways to lay it
 * (APSM_ASPECT_POSE), or its mirror image (APSM_ASPECT_HAND): nearly symmetric surfaces do not. */
bool apsm_verdict_tells(const apsm_findings *findings, apsm_aspect aspect,
                        const apsm_verdict_options *options);

/* How likely more than a tenth of the shape's particles are over two spacings from where they
 * belong (J6); never less than .04, nor more than .96; NAN where the surface does not tell how it
 * lies. */
double apsm_verdict_probability(const apsm_findings *findings, const apsm_verdict_options *options);

/* The doubt that grooming's note of a hand comes to (findings NULL: there are none).  None where
 * they speak clearly for the shape as it is, beside the usual evidence (the median), or where the
 * surface does not usually tell hands: then nobody is singled out, unless hands were to be found
 * (undecided) or the surface speaks for the other hand, since half of either look symmetric. */
unsigned apsm_verdict_note_hand(const apsm_findings *findings, double usual, bool undecided,
                                const apsm_verdict_options *options);

/* What grooming may say of a pose: another one is as likely; only the surface tells it; or it is
 * turned against an orientation that the others share. */
typedef enum apsm_pose_note {
    APSM_POSE_AMBIGUOUS,
    APSM_POSE_SOUGHT,
    APSM_POSE_AGAINST
} apsm_pose_note;

/* And its note of a pose: of one that only the surface tells the doubt is that it does not tell,
 * here or usually; what stands against the others' orientation has to be told clearly. */
unsigned apsm_verdict_note_pose(const apsm_findings *findings, double usual, apsm_pose_note note,
                                const apsm_verdict_options *options);

#endif
