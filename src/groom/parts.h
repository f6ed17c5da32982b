/* parts.h -- connected parts of the voxels of one value, as runs along the rows: much less memory
 * than a queue of voxels. */
#ifndef APSM_GROOM_PARTS_H
#define APSM_GROOM_PARTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "apsm/status.h"

/* Voxels [from, to) of a row. */
typedef struct part_run {
    uint32_t from, to, part;
} part_run;

typedef struct parts {
    size_t *first; /* n[1] n[2] + 1: where a row's runs begin; owned */
    part_run *run; /* in the order of the rows; owned */
    size_t n;      /* parts, in the order of their first voxels */
    size_t *size;  /* n: voxels; owned */
} parts;

/* Parts of in == value, joined through faces, or through edges and corners as well.  Free them with
 * parts_free.  O(voxels) time, O(rows + runs) memory. */
apsm_status parts_find(const size_t n[3], const unsigned char *in, unsigned char value,
                       bool corners, parts *p) APSM_NODISCARD;
/* in <- to at the voxels of a part. */
void parts_paint(const size_t n[3], const parts *p, size_t part, unsigned char to,
                 unsigned char *in);
void parts_free(parts *p);

#endif
