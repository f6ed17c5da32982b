/* dicom_stack.h -- the slices of a DICOM series, and what its readers share. */
#ifndef APSM_FORMATS_DICOM_STACK_H
#define APSM_FORMATS_DICOM_STACK_H

#include "files/files.h"
#include "formats/dicom.h"
#include "formats/image.h"

typedef struct dicom_slice {
    size_t file, frame;
    int64_t segment;
    double position[3], height; /* height: along the normal of the stack */
} dicom_slice;

typedef struct dicom_stack {
    const char *folder;
    apsm_file_list files;
    size_t images; /* files that hold pixels */
    dicom shared;  /* the first of them, without its pixels */
    size_t n;
    dicom_slice *slice; /* n, ascending by height */
} dicom_stack;

void dicom_stack_free(dicom_stack *k);
const char *dicom_slice_name(const dicom_stack *k, size_t i); /* of its file, without folder */
/* Whether position lies where slice i of a straight stack should, within a tenth of the gap. */
bool dicom_on_line(const double first[3], const double step[3], double i, double gap,
                   const double position[3]);
/* m (out): all of the grid but the number of slices. */
void dicom_grid(apsm_context *ctx, const dicom_stack *k, const double step[3], image *m);

/* Calls fn for each slice i with its parsed file; files are read once. */
typedef void (*dicom_slice_fn)(scan *s, const dicom *d, const dicom_stack *k, size_t i, void *user);
apsm_status dicom_read_slices(apsm_context *ctx, const dicom_stack *k, dicom_slice_fn fn,
                              void *user) APSM_NODISCARD;

/* A DICOM SEG: m->volume gets a label for each segment, with its name. */
apsm_status dicom_read_segments(apsm_context *ctx, dicom_stack *k, image *m) APSM_NODISCARD;

#endif
