/* several.h -- voxels that lie in several files, one after the other, as MetaImage and NRRD have
 * them. */
#ifndef APSM_FORMATS_SEVERAL_H
#define APSM_FORMATS_SEVERAL_H

#include "formats/image.h"
#include "formats/name_series.h"

typedef struct several {
    word names;   /* lines, or a pattern: see name_series.h */
    bool pattern; /* the second of these */
    bool packed;  /* each file by gzip */
    int64_t skip; /* bytes before the voxels of each; -1: they are its last */
} several;

/* Loads and joins them: each holds as much as any other.  Sizes and type of m are known. */
void several_load(scan *s, image *m, const several *files);

#endif
