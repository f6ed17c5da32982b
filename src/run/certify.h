/* certify.h -- the certificate of a whole cohort. */
#ifndef APSM_RUN_CERTIFY_H
#define APSM_RUN_CERTIFY_H

#include "initialize/cohort.h"
#include "optimize/certificate.h"

struct json_t;

/* Owns its array; zero-initialise with {0}. */
typedef struct cohort_certificate {
    size_t I;
    double h;                /* mean neighbour distance on the template */
    apsm_certificate *shape; /* I; the template's is that of the template against itself */
} cohort_certificate;

/* Judges particles P (I x J x 3, world frame) of the cohort. */
apsm_status certify_cohort(apsm_context *ctx, const apsm_cohort *cohort, size_t J, const double *P,
                           cohort_certificate *certificate);
void certify_free(cohort_certificate *certificate);

/* A new reference, NULL if out of memory. */
struct json_t *certify_json(const apsm_cohort *cohort, const cohort_certificate *certificate);

/* The verdict in log lines: what is certified, what needs review and why. */
void certify_tell(apsm_context *ctx, const apsm_cohort *cohort,
                  const cohort_certificate *certificate);

#endif
