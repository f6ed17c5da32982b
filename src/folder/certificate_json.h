/* certificate_json.h -- certificate.json: what is certified, what needs review, and why. */
#ifndef APSM_FOLDER_CERTIFICATE_JSON_H
#define APSM_FOLDER_CERTIFICATE_JSON_H

#include "judge/certify.h"

/* Writes atomically. */
apsm_status certificate_json_write(apsm_context *ctx, const char *path, const apsm_cohort *cohort,
                                   const cohort_certificate *certificate) APSM_NODISCARD;

#endif
