/* certify.h -- the certificate of a whole cohort. */
#ifndef APSM_JUDGE_CERTIFY_H
#define APSM_JUDGE_CERTIFY_H

#include "correspond/certificate.h"
#include "initialize/cohort.h"
#include "judge/verdict.h"

struct json_t;

/* Owns its arrays; zero-initialise with {0}. */
typedef struct cohort_certificate {
    size_t I;
    double h;         /* mean neighbour distance on the template */
    size_t reference; /* whose neighbours are the right ones: the template, or, if most shapes
                         disagree with it, the most usual of them */
    apsm_certificate *shape;  /* I; the reference's is that of the reference against itself */
    bool judged;              /* by the other shapes: they are enough */
    apsm_judgement judgement; /* if so */
    unsigned *doubts;         /* I: bits 1 << APSM_DOUBT_* */
    struct json_t *notes;     /* of grooming, see session/notes.h; NULL: none */
} cohort_certificate;

/* Judges particles P (I x J x 3, world frame) of the cohort, of one part.  notes (NULL: none) are
 * what grooming has said of its shapes; some of it is a doubt, too. */
apsm_status certify_cohort(apsm_context *ctx, const apsm_cohort *cohort, size_t J, const double *P,
                           struct json_t *notes, cohort_certificate *certificate);
/* Of subjects of several parts each part on its own: certificate (cohort_parts, out). */
apsm_status certify_parts(apsm_context *ctx, const apsm_cohort *cohort, size_t J, const double *P,
                          cohort_certificate *certificate);
void certify_free(cohort_certificate *certificate);

/* "certified", "needs review" or "not judged" (too few shapes, or particles, to look for every
 * fault): of one shape, of all. */
const char *certify_verdict_of(const cohort_certificate *certificate, size_t i);
const char *certify_verdict(const cohort_certificate *certificate);

/* "pass", "review", "cannot be told" (pose, hand), "not judged" or "not looked for" (slips, with
 * too few particles): one aspect of one shape. */
const char *certify_grade(const cohort_certificate *certificate, size_t i, apsm_aspect aspect);
/* How likely more than a tenth of a shape's particles are over two spacings off; NAN: not told. */
double certify_probability(const cohort_certificate *certificate, size_t i);
/* The sum over the shapes of which it is told: so many of these can be expected to be.  A shape
 * whose pose is doubted is none of them, so that its doubt lowers the sum. */
double certify_expected_lost(const cohort_certificate *certificate);
/* How many shapes pass in pose or hand only because their surface cannot tell. */
size_t certify_untold(const cohort_certificate *certificate, apsm_aspect aspect);
/* How many shapes have this verdict. */
size_t certify_count(const cohort_certificate *certificate, const char *verdict);
/* Mean share of mismatched particles, at 1.5/1.5 (strict) or 1.5/2.0. */
double certify_mean_mismatched(const cohort_certificate *certificate, bool strict);

/* The verdict in log lines: what is certified, what needs review and why. */
void certify_tell(apsm_context *ctx, const apsm_cohort *cohort,
                  const cohort_certificate *certificate);

#endif
