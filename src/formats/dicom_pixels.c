/* The pixels of one frame of a DICOM file as labels. */
#include <math.h>
#include <stdlib.h>

#include "formats/dicom.h"
#include "formats/packbits.h"

static void refuse_short(scan *s)
{
    scan_refuse(s, APSM_ERR_FORMAT, "its pixels are cut short or damaged; copy or export it again");
}

static bool is_supported(const dicom *d)
{
    const bool bits =
        d->allocated == 1 || d->allocated == 8 || d->allocated == 16 || d->allocated == 32;
    return bits && d->stored >= 1 && d->stored <= d->allocated && d->high < d->allocated &&
           d->high + 1 >= d->stored;
}

/* ---- run lengths ---- */

/* Fragment f: after the table of offsets, one for each frame.  NULL if there is none. */
static const unsigned char *find_fragment(const dicom *d, size_t f, size_t *size)
{
    size_t at = 0;
    for (size_t k = 0; at + 8 <= d->pixel_size; k++) {
        const size_t length = (size_t)scalar_bits(d->pixels + at + 4, 4, false);
        at += 8;
        if (length > d->pixel_size - at) return NULL;
        if (k == f + 1) {
            *size = length;
            return d->pixels + at;
        }
        at += length;
    }
    return NULL;
}

/* A plane for each byte of a pixel, the highest first; out is little endian. */
static unsigned char *unpack_frame(scan *s, const dicom *d, size_t f, size_t pixels, size_t bytes)
{
    size_t size = 0;
    const unsigned char *const p = find_fragment(d, f, &size);
    const bool possible =
        p && size >= 64 && pixels * bytes <= 64 * size && scalar_bits(p, 4, false) == bytes;
    unsigned char *const out = possible ? malloc(pixels * bytes) : NULL;
    if (!possible)
        refuse_short(s);
    else if (!out)
        scan_no_memory(s);
    for (size_t b = 0; out && b < bytes; b++) {
        const size_t from = (size_t)scalar_bits(p + 4 + 4 * b, 4, false);
        const size_t next = b + 1 < bytes ? (size_t)scalar_bits(p + 8 + 4 * b, 4, false) : size;
        if (from > next || next > size ||
            !packbits_unpack(p + from, next - from, out + (bytes - 1 - b), pixels, bytes)) {
            refuse_short(s);
            free(out);
            return NULL;
        }
    }
    return out;
}

/* ---- values ---- */

static int64_t pixel(const dicom *d, const unsigned char *p, size_t k)
{
    if (d->allocated == 1) return p[k / 8] >> (k % 8) & 1;
    const size_t bytes = (size_t)d->allocated / 8;
    uint64_t bits = scalar_bits(p + k * bytes, bytes, d->big_endian && !d->rle);
    bits = bits >> (d->high + 1 - d->stored) & ((UINT64_C(1) << d->stored) - 1);
    const uint64_t sign = UINT64_C(1) << (d->stored - 1);
    return d->is_signed && (bits & sign) ? (int64_t)bits - (int64_t)(2 * sign) : (int64_t)bits;
}

static void convert(scan *s, const dicom *d, const unsigned char *p, size_t first, size_t pixels,
                    int32_t *label)
{
    for (size_t k = 0; k < pixels && scan_ok(s); k++) {
        const double x = d->slope * (double)pixel(d, p, first + k) + d->intercept;
        if (!(x >= -2147483648.0 && x < 2147483648.0 && floor(x) == x))
            scan_refuse(s, APSM_ERR_FORMAT,
                        "pixel (%zu, %zu) holds %g, which is not a label; give a segmentation "
                        "with integer values",
                        k % (size_t)d->columns, k / (size_t)d->columns, x);
        else
            label[k] = (int32_t)x;
    }
}

void dicom_frame_labels(scan *s, const dicom *d, size_t f, int32_t *label)
{
    const size_t pixels = (size_t)d->rows * (size_t)d->columns;
    if (!is_supported(d)) {
        scan_refuse(s, APSM_ERR_UNSUPPORTED,
                    "its pixels have %lld of %lld bits, which is not read here; convert it to "
                    "NRRD or NIfTI",
                    (long long)d->stored, (long long)d->allocated);
        return;
    }
    if (d->rle) {
        unsigned char *const p = unpack_frame(s, d, f, pixels, (size_t)(d->allocated + 7) / 8);
        if (p) convert(s, d, p, 0, pixels, label);
        free(p);
        return;
    }
    const double bits = (double)(f + 1) * (double)pixels * (double)d->allocated;
    if (!d->pixels || bits > 8.0 * (double)d->pixel_size) {
        refuse_short(s);
        return;
    }
    if (d->allocated == 1)
        convert(s, d, d->pixels, f * pixels, pixels, label);
    else
        convert(s, d, d->pixels + f * pixels * (size_t)d->allocated / 8, 0, pixels, label);
}
