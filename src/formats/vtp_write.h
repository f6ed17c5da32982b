/* vtp_write.h -- a VTP file, packed by zlib in base64. */
#ifndef APSM_FORMATS_VTP_WRITE_H
#define APSM_FORMATS_VTP_WRITE_H

#include "files/files.h"

/* Points P (points x 3) and `cells` triangles; cell NULL: each point is a cell.  Ends w. */
apsm_status vtp_write(apsm_context *ctx, const char *path, apsm_writer *w, size_t points,
                      const double *P, size_t cells, const uint32_t *cell) APSM_NODISCARD;

#endif
