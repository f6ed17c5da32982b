/* packbits.h -- run lengths, as TIFF and DICOM have them. */
#ifndef APSM_FORMATS_PACKBITS_H
#define APSM_FORMATS_PACKBITS_H

#include <stdbool.h>
#include <stddef.h>

/* out[k * step], k < n, <- the first n bytes of what p[0..size) unpacks to: n + 1 bytes as they
 * are, or one byte 1 - n times.  False if there are fewer. */
bool packbits_unpack(const unsigned char *p, size_t size, unsigned char *out, size_t n,
                     size_t step);

#endif
