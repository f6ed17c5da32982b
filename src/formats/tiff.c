/* TIFF stacks, a slice a page, as ImageJ and Fiji write them (or, after one page, all slices in a
 * row): plain, PackBits or deflated, one 8-, 16- or 32-bit value a voxel.
 *
 * A TIFF has no place in space.  Its voxel sizes are those of ImageJ's description and of the
 * resolution tags in the description's unit; what has no such sizes is refused, not guessed.  Axes
 * are taken for LPS: columns to the left, rows to the back, slices upward. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "formats/header_line.h"
#include "formats/image.h"
#include "formats/inflate.h"
#include "formats/packbits.h"

enum { ENTRY = 12, MOST_PAGES = 65535 };
enum { PLAIN_STRIPS = 1, DEFLATED = 8, OLD_DEFLATED = 32946, PACKBITS = 32773 };

/* What of a page counts. */
typedef struct page {
    uint64_t width, height, bits, compression, samples, format, predictor, photometric,
        rows; /* of a strip */
    bool tiled;
    double resolution[2];                            /* of columns and rows; voxels a unit */
    uint64_t offset_type, size_type, offsets, sizes; /* where these arrays are */
    uint64_t offset_count, size_count;
    word description;
} page;

/* What ImageJ says. */
typedef struct imagej {
    double slices, several, spacing, unit; /* several: channels times frames; unit in mm, or 0 */
    double c[2];                           /* what is meant is c[0] + c[1] times what is stored, */
    bool straight;                         /* if so */
} imagej;

typedef struct tiff {
    bool big_endian;
    page first, last; /* last: the one at hand */
    unsigned char *voxels;
    size_t have, room;
} tiff;

static uint64_t number_at(const scan *s, const tiff *t, uint64_t at, size_t size)
{
    if (at > s->size || s->size - at < size) return 0;
    return scalar_bits((const unsigned char *)s->bytes + at, size, t->big_endian);
}

static size_t size_of(uint64_t type)
{
    return type == 3   ? 2
           : type == 4 ? 4
           : type == 5 ? 8
                       : 1; /* short, long, rational, else bytes */
}

/* Entry k of an array of shorts or longs, which stands in the entry itself if it fits. */
static uint64_t element(const scan *s, const tiff *t, uint64_t base, uint64_t type, uint64_t k)
{
    return number_at(s, t, base + k * size_of(type), size_of(type));
}

static double rational_at(const scan *s, const tiff *t, uint64_t at)
{
    const double a = (double)number_at(s, t, at, 4), b = (double)number_at(s, t, at + 4, 4);
    return b > 0.0 ? a / b : 0.0;
}

static void take_array(page *p, uint64_t tag, uint64_t type, uint64_t count, uint64_t base)
{
    if (tag == 273) p->offset_type = type, p->offset_count = count, p->offsets = base;
    if (tag == 279) p->size_type = type, p->size_count = count, p->sizes = base;
}

static void take_entry(const scan *s, const tiff *t, uint64_t at, page *p)
{
    const uint64_t tag = number_at(s, t, at, 2), type = number_at(s, t, at + 2, 2);
    const uint64_t count = number_at(s, t, at + 4, 4);
    const bool inside = count <= 4 / size_of(type);
    const uint64_t base = inside ? at + 8 : number_at(s, t, at + 8, 4);
    const struct {
        uint64_t tag, *value;
    } numbers[] = { { 256, &p->width },       { 257, &p->height },      { 258, &p->bits },
                    { 259, &p->compression }, { 277, &p->samples },     { 339, &p->format },
                    { 317, &p->predictor },   { 262, &p->photometric }, { 278, &p->rows } };
    for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++)
        if (numbers[k].tag == tag) *numbers[k].value = element(s, t, base, type, 0);
    take_array(p, tag, type, count, base);
    if (tag == 322) p->tiled = true;
    if (tag == 282 || tag == 283) p->resolution[tag - 282] = rational_at(s, t, base);
    if (tag == 270 && base < s->size && count <= s->size - base)
        p->description = (word){ s->bytes + base, (size_t)count };
}

/* *next <- where the page after that at `at` begins, or 0. */
static void read_page(scan *s, const tiff *t, uint64_t at, page *p, uint64_t *next)
{
    const uint64_t entries = number_at(s, t, at, 2);
    *p =
        (page){ .bits = 1, .compression = PLAIN_STRIPS, .samples = 1, .format = 1, .predictor = 1 };
    if (at < 8 || at >= s->size || entries == 0 || s->size - at < 6 + ENTRY * entries) {
        scan_refuse(
            s, APSM_ERR_FORMAT,
            "is cut short or damaged (a page lies beyond its end); copy or export it again");
        return;
    }
    for (uint64_t k = 0; k < entries; k++) take_entry(s, t, at + 2 + ENTRY * k, p);
    *next = number_at(s, t, at + 2 + ENTRY * entries, 4);
}

/* ---- what can be read ---- */

static void refuse_bits(scan *s, const page *p)
{
    scan_refuse(s, APSM_ERR_FORMAT, "has voxels of %llu bits; save it with 8 or 16 bits a voxel",
                (unsigned long long)p->bits);
}

static void read_type(scan *s, const page *p, image *m)
{
    static const struct {
        uint64_t bits, format;
        scalar type;
    } known[] = { { 8, 1, SCALAR_U8 },   { 8, 2, SCALAR_I8 },   { 16, 1, SCALAR_U16 },
                  { 16, 2, SCALAR_I16 }, { 32, 1, SCALAR_U32 }, { 32, 2, SCALAR_I32 },
                  { 32, 3, SCALAR_F32 } };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (known[k].bits == p->bits && known[k].format == p->format) {
            m->type = known[k].type;
            return;
        }
    refuse_bits(s, p);
}

/* What of a page's coding is not read here; NULL: it is. */
static const char *strange_coding(const page *p)
{
    const bool packed = p->compression == DEFLATED || p->compression == OLD_DEFLATED;
    if (p->tiled) return "tiles";
    if (p->compression == 5) return "LZW compression";
    if (p->compression == 6 || p->compression == 7) return "JPEG compression";
    if (p->compression != PLAIN_STRIPS && p->compression != PACKBITS && !packed)
        return "an unusual compression";
    return p->predictor != 1 ? "differences of voxels (a predictor)" : NULL;
}

static void check_page(scan *s, const tiff *t, const page *p)
{
    if (p->samples != 1 || p->photometric == 2)
        scan_refuse(s, APSM_ERR_FORMAT, "has colours; save it with one label per voxel");
    if (p->bits != 8 && p->bits != 16 && p->bits != 32) refuse_bits(s, p);
    if (strange_coding(p))
        scan_refuse(s, APSM_ERR_UNSUPPORTED,
                    "is written with %s, which is not read here; save it without compression, or "
                    "as .nrrd (Fiji does)",
                    strange_coding(p));
    if (p->width != t->first.width || p->height != t->first.height || p->bits != t->first.bits ||
        p->format != t->first.format)
        scan_refuse(s, APSM_ERR_FORMAT, "has pages of different sizes; give one stack of slices");
    if (p->width < 1 || p->height < 1 || p->width > 65535 || p->height > 65535)
        scan_refuse(s, APSM_ERR_FORMAT, "has %llu x %llu pixels; export it again",
                    (unsigned long long)p->width, (unsigned long long)p->height);
}

/* ---- voxels ---- */

static void refuse_short(scan *s)
{
    scan_refuse(s, APSM_ERR_FORMAT, "ends before its last voxel; copy or export it again");
}

/* Room for so many more bytes. */
static unsigned char *more(scan *s, tiff *t, size_t bytes)
{
    if (t->room - t->have < bytes) {
        const size_t room = t->have + bytes > 2 * t->room ? t->have + bytes : 2 * t->room;
        unsigned char *const larger = realloc(t->voxels, room);
        if (!larger) {
            scan_no_memory(s);
            return NULL;
        }
        t->voxels = larger;
        t->room = room;
    }
    return t->voxels + t->have;
}

/* The next `wanted` bytes from a strip. */
static void unpack_strip(scan *s, tiff *t, uint64_t compression, const unsigned char *packed,
                         size_t size, size_t wanted)
{
    const bool deflated = compression == DEFLATED || compression == OLD_DEFLATED;
    const size_t factor = deflated ? 1040 : compression == PACKBITS ? 64 : 1;
    /* also of all pages together, which may share strips */
    const bool possible = wanted <= factor * size + 64 && t->have + wanted <= factor * s->size;
    unsigned char *const out = possible ? more(s, t, wanted) : NULL, *whole = NULL;
    if (!possible) refuse_short(s);
    if (!out) return;
    if (deflated) {
        const inflated result = inflate_bytes(packed, size, wanted, &whole);
        if (result == INFLATE_NO_MEMORY)
            scan_no_memory(s);
        else if (result != INFLATED)
            refuse_short(s);
        if (whole) memcpy(out, whole, wanted);
        free(whole);
    } else if (compression == PACKBITS) {
        if (!packbits_unpack(packed, size, out, wanted, 1)) refuse_short(s);
    } else if (wanted > size) {
        refuse_short(s);
    } else {
        memcpy(out, packed, wanted);
    }
    if (scan_ok(s)) t->have += wanted;
}

static void read_strip(scan *s, tiff *t, const page *p, uint64_t k, size_t wanted)
{
    const uint64_t at = element(s, t, p->offsets, p->offset_type, k);
    const uint64_t size = element(s, t, p->sizes, p->size_type, k);
    if (at >= s->size || size > s->size - at || size == 0)
        refuse_short(s);
    else
        unpack_strip(s, t, p->compression, (const unsigned char *)s->bytes + at, (size_t)size,
                     wanted);
}

static void read_voxels(scan *s, tiff *t, const page *p)
{
    const uint64_t row = p->width * (p->bits / 8);
    const uint64_t rows = p->rows && p->rows < p->height ? p->rows : p->height;
    const uint64_t strips = (p->height + rows - 1) / rows;
    if (p->offset_count < strips || p->size_count < strips) refuse_short(s);
    for (uint64_t k = 0; k < strips && scan_ok(s); k++) {
        const uint64_t left = p->height - k * rows;
        read_strip(s, t, p, k, (size_t)(row * (left < rows ? left : rows)));
    }
}

/* ---- what ImageJ says ---- */

static double number_of(word w)
{
    double x;
    return word_number(w, &x) && isfinite(x) ? x : 0.0;
}

/* "micron", "um", "mm", and the sign for micro as ImageJ writes it, \\u00B5m. */
static double unit_of(word name)
{
    const double mm = unit_in_mm(name);
    return mm > 0.0 ? mm : word_is_any_case(name, "\\u00B5m") ? 1e-3 : 0.0;
}

static imagej read_description(scan *s, word text)
{
    /* a spacing of 1 is not written */
    imagej j = { .slices = 0, .several = 1, .spacing = 1, .c = { 0, 1 } };
    if (text.length < 7 || memcmp(text.text, "ImageJ=", 7) != 0) return j;
    while (text.length && text.text[text.length - 1] == '\0') text.length--;
    scan lines = scan_begin(s->ctx, s->path, text.text, text.length);
    while (scan_left(&lines)) {
        header_line l;
        if (!header_split(scan_rest_of_line(&lines), "=", &l)) continue;
        if (word_is(l.key, "images")) j.slices = number_of(l.value);
        if (word_is(l.key, "spacing")) j.spacing = fabs(number_of(l.value));
        if (word_is(l.key, "unit")) j.unit = unit_of(l.value);
        if ((word_is(l.key, "yunit") || word_is(l.key, "zunit")) &&
            fabs(unit_of(l.value) - j.unit) > 0.0)
            j.unit = 0.0; /* said only where it is another one: none for all */
        if (word_is(l.key, "cf")) j.straight = word_is(l.value, "0");
        if (word_is(l.key, "c0")) j.c[0] = number_of(l.value);
        if (word_is(l.key, "c1")) j.c[1] = number_of(l.value);
        if (word_is(l.key, "channels") || word_is(l.key, "frames")) j.several *= number_of(l.value);
    }
    return j;
}

static void place(scan *s, const tiff *t, const imagej *j, image *m)
{
    double size[3] = { 0, 0, j->unit * j->spacing };
    for (int c = 0; c < 2; c++)
        if (t->first.resolution[c] > 0.0) size[c] = j->unit / t->first.resolution[c];
    for (int c = 0; c < 3; c++) m->step[4 * c] = size[c];
    if (!(size[0] > 0.0 && size[1] > 0.0 && size[2] > 0.0))
        scan_refuse(s, APSM_ERR_FORMAT,
                    "does not say how large its voxels are; set width, height, depth and unit in "
                    "Fiji (Image > Properties) and save it again, or save it as .nrrd");
    image_note(s, m,
               "voxels of %.6g x %.6g x %.6g mm, as its description says; columns were taken to "
               "run to the left, rows to the back, slices upward: check left and right",
               size[0], size[1], size[2]);
}

/* All slices behind the first, of which alone there is a page. */
static void read_row_of_slices(scan *s, tiff *t, const imagej *j)
{
    const page *const p = &t->first;
    const uint64_t at = element(s, t, p->offsets, p->offset_type, 0);
    const double bytes = j->slices * (double)p->width * (double)p->height * (double)(p->bits / 8);
    if (p->compression != PLAIN_STRIPS || at >= s->size || !(bytes <= (double)(s->size - at))) {
        refuse_short(s);
        return;
    }
    unsigned char *const out = more(s, t, (size_t)bytes);
    if (out) memcpy(out, s->bytes + at, (size_t)bytes);
    if (out) t->have = (size_t)bytes;
}

static uint64_t read_header(scan *s, tiff *t)
{
    const char *const b = s->bytes;
    const bool little = s->size > 8 && memcmp(b, "II", 2) == 0;
    const bool big = s->size > 8 && memcmp(b, "MM", 2) == 0;
    t->big_endian = big;
    if (!little && !big)
        scan_refuse(s, APSM_ERR_FORMAT, "is no TIFF, whatever its name says; export it again");
    else if (number_at(s, t, 2, 2) == 43)
        scan_refuse(s, APSM_ERR_UNSUPPORTED, "is a BigTIFF; save it as .nrrd or .nii.gz");
    else if (number_at(s, t, 2, 2) != 42)
        scan_refuse(s, APSM_ERR_FORMAT, "is a damaged TIFF; copy or export it again");
    return number_at(s, t, 4, 4);
}

static size_t read_pages(scan *s, tiff *t, uint64_t at)
{
    size_t pages = 0;
    while (at && scan_ok(s)) {
        if (++pages > MOST_PAGES || pages * (6 + ENTRY) > s->size)
            scan_refuse(s, APSM_ERR_FORMAT, "its pages run in a circle; export it again");
        else
            read_page(s, t, at, &t->last, &at);
        if (!scan_ok(s)) break;
        if (pages == 1) t->first = t->last;
        check_page(s, t, &t->last);
        if (scan_ok(s)) read_voxels(s, t, &t->last);
    }
    return pages;
}

void read_tiff(scan *s, image *m)
{
    tiff t = { .voxels = NULL };
    const uint64_t first = read_header(s, &t);
    if (scan_ok(s) && first < 8) scan_refuse(s, APSM_ERR_FORMAT, "is a TIFF without a page");
    size_t pages = scan_ok(s) ? read_pages(s, &t, first) : 0;
    const imagej j = read_description(s, t.first.description);
    if (scan_ok(s)) read_type(s, &t.first, m);
    if (scan_ok(s) && j.several > 1.0)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "has several channels or frames; save the one of the labels alone");
    if (scan_ok(s) && pages == 1 && j.slices > 1.0 && j.slices <= MOST_PAGES) {
        t.have = 0;
        read_row_of_slices(s, &t, &j);
        pages = (size_t)j.slices;
    }
    if (scan_ok(s) && pages < 2)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "is a flat picture; give all slices as one stack (Fiji: Images to Stack), or "
                    "leave it out with --exclude");
    if (scan_ok(s)) place(s, &t, &j, m);
    if (j.straight && fabs(j.c[1]) > 0.0) { /* signed voxels, which ImageJ stores 32768 higher */
        m->intercept = j.c[0];
        m->slope = j.c[1];
    }
    m->n[0] = (size_t)t.first.width;
    m->n[1] = (size_t)t.first.height;
    m->n[2] = pages;
    image_simple(m);
    m->big_endian = t.big_endian;
    m->detached = (char *)t.voxels;
    m->data = t.voxels;
    m->size = t.have;
}
