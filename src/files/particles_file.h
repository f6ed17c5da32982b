/* particles_file.h -- the particles of one shape as text: one "x y z" a line, no header, the
 * order is the correspondence.  ShapeWorks reads and writes the same (.particles, .lpts, .wpts). */
#ifndef APSM_FILES_PARTICLES_FILE_H
#define APSM_FILES_PARTICLES_FILE_H

#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* *P (n x 3, malloc'ed) <- the particles of path.  Spaces, tabs, CR LF and a missing final newline
 * are harmless, blank lines are skipped; anything but three finite numbers on a line is refused
 * with file:line, an empty file too.  Warned of: no newline after the last number, and six digits
 * where that is coarse against the extent of the particles. */
apsm_status apsm_particles_read(apsm_context *ctx, const char *path, size_t *n,
                                double **P) APSM_NODISCARD;
/* As above, and refuses a file that does not hold exactly n particles.  P is caller's, n x 3. */
apsm_status apsm_particles_read_n(apsm_context *ctx, const char *path, size_t n,
                                  double *P) APSM_NODISCARD;
/* P (n x 3) <- what apsm_particles_read makes of what apsm_particles_write writes.
 * APSM_ERR_NONFINITE names the particle. */
apsm_status apsm_particles_round(apsm_context *ctx, size_t n, double *P) APSM_NODISCARD;
/* Writes P (n x 3) atomically at 9 significant digits, with a final newline (without it
 * ShapeWorks loses the last particle).  APSM_ERR_NONFINITE names the particle. */
apsm_status apsm_particles_write(apsm_context *ctx, const char *path, size_t n,
                                 const double *P) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
