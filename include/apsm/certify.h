/* certify.h -- the verdict on anyone's particles: do they correspond, and does every shape lie and
 * belong as the others do?  The same as a run gives of its own model (docs/formats.md,
 * certificate.json). */
#ifndef APSM_CERTIFY_H
#define APSM_CERTIFY_H

#include "apsm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* All borrowed; particles and meshes of a shape in one frame, shapes aligned to each other. */
typedef struct apsm_certify_input {
    size_t I, J;              /* shapes, particles >= 7 */
    const char *const *names; /* I */
    const double *P;          /* I x J x 3 */
    const apsm_mesh *meshes;  /* I */
    size_t template_index;    /* whose neighbours are the right ones */
} apsm_certify_input;

/* The verdict in log lines, and as certificate.json in the file `path` (NULL: not wanted).
 * *certified (out): how many shapes are. */
APSM_API apsm_status apsm_certify_particles_sized(apsm_context *ctx,
                                                  const apsm_certify_input *input, size_t size,
                                                  const char *path,
                                                  size_t *certified) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_certify_particles(apsm_context *ctx,
                                                                const apsm_certify_input *input,
                                                                const char *path, size_t *certified)
{
    return apsm_certify_particles_sized(ctx, input, sizeof *input, path, certified);
}

#ifdef __cplusplus
}
#endif
#endif
