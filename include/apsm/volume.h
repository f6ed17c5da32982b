/* volume.h -- a segmentation: labels on an oriented grid. */
#ifndef APSM_VOLUME_H
#define APSM_VOLUME_H

#include "apsm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a file says of one of its labels: its name, and the layer that it is in. */
typedef struct apsm_segment {
    char *name; /* owned */
    int32_t label;
    size_t layer;
} apsm_segment;

/* Voxel (i,j,k) has label[i + n[0] * (j + n[1] * k)] and its centre at
 * origin + direction * (spacing[0] i, spacing[1] j, spacing[2] k) in LPS mm.  direction is
 * row-major; its columns are the grid's axes as unit vectors (det may be -1; a tilted gantry makes
 * axes that are not at right angles).  Of an image that is empty around its shape only a part may
 * be held: voxel (i,j,k) is then number first + (i,j,k) of `whole` voxels, and origin is the place
 * of the image's first.  Owns its arrays; zero-initialise with {0}. */
typedef struct apsm_volume {
    size_t n[3];
    double origin[3], spacing[3], direction[9];
    int32_t *label;        /* of each layer in turn; NULL if value or small is not */
    size_t layers;         /* segments may overlap in different layers; 0 counts as 1 */
    size_t segments;       /* 0: labels have no names */
    apsm_segment *segment; /* segments */
    float *value;          /* instead of labels: a function, such as a distance or a probability */
    char *picked; /* names of the labels that a mask was made of: "1 talus, 2 tibia", or NULL */
    char *notes;  /* what of the header had to be decided: lines, or NULL */
    size_t first[3], whole[3]; /* of a part; whole 0: all of the image is held */
    unsigned char *small;      /* where files are groomed, labels of one layer that are all 0 to 255
                                  are held in bytes, in the place of label; else NULL */
} apsm_volume;

APSM_API void apsm_volume_free(apsm_volume *volume);
/* Logs "PATH: text" as a warning and adds it to the notes. */
APSM_API apsm_status apsm_volume_note(apsm_context *ctx, const char *path, apsm_volume *volume,
                                      const char *format, ...) APSM_PRINTF(4, 5) APSM_NODISCARD;
/* to is overwritten, not freed; {0} on failure. */
APSM_API apsm_status apsm_volume_copy(const apsm_volume *from, apsm_volume *to) APSM_NODISCARD;
/* Row-major 4 x 4 map from (i,j,k), counted from the image's first voxel, to LPS. */
APSM_API void apsm_volume_index_to_lps(const apsm_volume *volume, double M[16]);

#ifdef __cplusplus
}
#endif
#endif
