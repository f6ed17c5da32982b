/* image.h -- an image as its header tells it, before it becomes a volume of labels, and the
 * readers of headers. */
#ifndef APSM_FORMATS_IMAGE_H
#define APSM_FORMATS_IMAGE_H

#include "apsm/formats.h"
#include "apsm/volume.h"
#include "formats/scan.h"

typedef enum packing { PLAIN, PACKED, WRITTEN } packing; /* raw, zlib or gzip, as text */

typedef struct image {
    size_t n[3], layers;
    size_t stride[3], layer_stride; /* in values */
    double step[9];                 /* column a: from a voxel to the next along axis a; LPS, mm */
    double origin[3];               /* LPS, mm */
    scalar type;
    bool big_endian;
    double slope, intercept; /* what is meant is slope * what is stored + intercept */
    packing packing;
    const unsigned char *data; /* borrowed: where the packed, plain or written values are */
    size_t size, lead;         /* lead: bytes before the first voxel, once unpacked */
    char *detached;            /* the bytes of a data file; owned */
    bool foreground;           /* set by who wants no more than what is around the labels */
    apsm_volume volume;        /* gets segments, notes, labels */
} image;

/* Strides of an image without layers, x fastest. */
void image_simple(image *m);
/* The data of an attached or detached header: `name` is taken from the folder of path. */
void image_load_data(scan *s, image *m, const char *name);
/* The same by a word of the header. */
void image_load_word(scan *s, image *m, word name);
/* The volume's sizes, spacing, origin and directions; axes that are not at right angles are kept,
 * and noted. */
apsm_status image_place(apsm_context *ctx, const char *path, image *m) APSM_NODISCARD;
/* Labels or values, checked; *volume <- all of it.  Frees m whatever happens. */
apsm_status image_finish(scan *s, image *m, apsm_volume *volume) APSM_NODISCARD;
/* As apsm_volume_note. */
void image_note(scan *s, image *m, const char *format, ...) APSM_PRINTF(3, 4);

void read_nifti(scan *s, image *m);
void read_nrrd(scan *s, image *m);
void read_metaimage(scan *s, image *m);
void read_tiff(scan *s, image *m);
void read_mgh(scan *s, image *m);
void read_vtk_image(scan *s, image *m); /* DATASET STRUCTURED_POINTS */

/* Whether the extension is that of an image. */
bool volume_is_known(const char *path);
/* "um", "mm", "m" ... in mm; 0 if it is none of them. */
double unit_in_mm(word name);

/* As apsm_read_volume, but of an image that is empty around its labels only the part with them, and
 * a voxel around, where there is one: see apsm_volume. */
apsm_status volume_read_foreground(apsm_context *ctx, const char *path,
                                   apsm_volume *volume) APSM_NODISCARD;
/* An image from bytes in memory, by path's extension: what apsm_read_volume does with them. */
apsm_status volume_from_bytes(apsm_context *ctx, const char *path, const char *bytes, size_t size,
                              apsm_volume *volume) APSM_NODISCARD;

#endif
