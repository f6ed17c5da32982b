#include <stdlib.h>
#include <string.h>

#include "apsm/certify.h"
#include "core/sized.h"
#include "folder/certificate_json.h"
#include "geometry/affine.h"
#include "judge/certify.h"
#include "optimize/correspondence_loss.h"

static apsm_status certify(apsm_context *ctx, const apsm_certify_input *in,
                           const apsm_cohort *cohort, const char *path, size_t *certified)
{
    cohort_certificate c = { 0 };
    APSM_TRY(certify_cohort(ctx, cohort, in->J, in->P, NULL, &c));
    *certified = 0;
    for (size_t i = 0; i < in->I; i++)
        *certified += strcmp(certify_verdict_of(&c, i), "certified") == 0;
    const apsm_status status = path ? certificate_json_write(ctx, path, cohort, &c) : APSM_OK;
    if (status == APSM_OK) certify_tell(ctx, cohort, &c);
    certify_free(&c);
    return status;
}

/* Normals are made before anything else looks at the faces. */
static apsm_status check_meshes(apsm_context *ctx, const apsm_certify_input *in)
{
    if (!in->names || !in->P || !in->meshes)
        return apsm_fail(ctx, APSM_ERR_ARG, "apsm_certify_particles: an argument is missing");
    for (size_t i = 0; i < in->I; i++)
        for (size_t k = 0; k < 3 * in->meshes[i].nf; k++)
            if (in->meshes[i].F[k] >= in->meshes[i].nv)
                return apsm_fail(ctx, APSM_ERR_ARG,
                                 "%s: a face names a vertex that is not there; vertices are "
                                 "counted from 0 on",
                                 in->names[i]);
    return APSM_OK;
}

apsm_status apsm_certify_particles_sized(apsm_context *ctx, const apsm_certify_input *given,
                                         size_t size, const char *path, size_t *certified)
{
    apsm_cohort cohort = { 0 };
    apsm_certify_input known = { 0 }, *const in = &known;
    *certified = 0;
    APSM_TRY(apsm_take_settings(ctx, "apsm_certify_particles", given, size, in, sizeof known));
    if (in->I == 0 || in->template_index >= in->I || in->J <= APSM_NEIGHBOURS)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "certify: %zu shapes with %zu particles; at least %d particles are needed",
                         in->I, in->J, APSM_NEIGHBOURS + 1);
    APSM_TRY(check_meshes(ctx, in));
    double *M = malloc(16 * in->I * sizeof *M);
    if (!M) return apsm_fail(ctx, APSM_ERR_MEMORY, "certify: out of memory");
    for (size_t i = 0; i < in->I; i++) apsm_affine_identity(M + 16 * i);
    const apsm_cohort_input made = { in->I, in->names, in->meshes, M, in->template_index };
    apsm_status status = apsm_cohort_build(ctx, &made, 0.0, 0.0, &cohort);
    free(M);
    if (status == APSM_OK) status = certify(ctx, in, &cohort, path, certified);
    apsm_cohort_free(&cohort);
    return status;
}
