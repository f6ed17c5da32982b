/* vtp_write.h -- a VTP file, packed by zlib in base64. */
#ifndef APSM_FORMATS_VTP_WRITE_H
#define APSM_FORMATS_VTP_WRITE_H

#include "apsm/formats.h"
#include "files/files.h"

/* Points and `cells` triangles; cell NULL: each point is a cell.  All borrowed. */
typedef struct vtp_piece {
    size_t points, cells;
    const double *P;      /* points x 3 */
    const uint32_t *cell; /* cells x 3 */
    size_t fields;
    const apsm_mesh_field *field; /* numbers at the points */
} vtp_piece;

/* Ends w. */
apsm_status vtp_write(apsm_context *ctx, const char *path, apsm_writer *w,
                      const vtp_piece *piece) APSM_NODISCARD;

#endif
