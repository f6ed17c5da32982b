/* dicom.h -- one DICOM file: what of its elements is needed to make a volume of its frames.
 *
 * Read are files of part 10 (explicit or implicit VR, little or big endian, deflated), with pixel
 * data that are plain or run-length encoded; other compressions are refused by name. */
#ifndef APSM_FORMATS_DICOM_H
#define APSM_FORMATS_DICOM_H

#include "apsm/volume.h"
#include "formats/scan.h"

enum { DICOM_UID = 65, DICOM_LABEL = 65 };

typedef struct dicom_frame {
    double position[3]; /* of the centre of the first voxel; LPS, mm */
    bool has_position;
    int64_t segment; /* 0: none */
} dicom_frame;

typedef struct dicom_segment {
    int64_t number;
    char label[DICOM_LABEL];
} dicom_segment;

typedef struct dicom {
    bool big_endian, implicit, rle;
    char series[DICOM_UID], modality[17], kind[17]; /* kind: SegmentationType */
    int64_t most; /* of a fractional segmentation: what stands for 1 */
    int64_t rows, columns, samples, allocated, stored, high, is_signed, frames;
    double slope, intercept;
    double orientation[6], between[2], gap; /* between rows, columns; given between slices or 0 */
    bool has_orientation, has_between;
    dicom_frame *frame; /* owned: frames */
    size_t frame_room, segments;
    dicom_segment *segment;      /* owned */
    const unsigned char *pixels; /* borrowed; NULL: no image */
    size_t pixel_size;
    unsigned char *inflated; /* owned */
} dicom;

/* Whether the bytes are a DICOM file. */
bool is_dicom(const unsigned char *bytes, size_t size);
/* d (out) borrows from s->bytes.  Freed by dicom_free whatever happens. */
void dicom_parse(scan *s, dicom *d);
void dicom_free(dicom *d);
/* label (rows x columns) <- the stored values of frame f, times the slope. */
void dicom_frame_labels(scan *s, const dicom *d, size_t f, int32_t *label);

#endif
