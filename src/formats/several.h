/* several.h -- voxels that lie in several files, one after the other: a list of names, or a pattern
 * with a number that counts, as MetaImage and NRRD have them. */
#ifndef APSM_FORMATS_SEVERAL_H
#define APSM_FORMATS_SEVERAL_H

#include "formats/image.h"

typedef struct several {
    word names;   /* lines, each a name; or "slice%03d.raw FIRST LAST STEP" */
    bool pattern; /* the second of these */
    bool packed;  /* each file by gzip */
    int64_t skip; /* bytes before the voxels of each; -1: they are its last */
} several;

/* Whether a header's word for its data ("LIST", or with '%') means several files. */
bool several_files(word file);
bool several_is_pattern(word file);
/* Loads and joins them: each holds as much as any other.  Sizes and type of m are known. */
void several_load(scan *s, image *m, const several *files);

#endif
