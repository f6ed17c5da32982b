#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "formats/dicom.h"
#include "formats/header_line.h"
#include "formats/inflate.h"

enum { PREAMBLE = 132, DEEPEST = 12, UNDEFINED = -1 };
#define TAG(group, element) ((uint32_t)(group) << 16 | (element))

/* Where in the tree of sequences an element is. */
typedef struct path {
    int depth;
    uint32_t sequence[DEEPEST];
    size_t item[DEEPEST];
} path;

typedef struct element {
    uint32_t tag;
    char vr[3];
    int64_t length; /* UNDEFINED: up to a delimiter */
} element;

bool is_dicom(const unsigned char *bytes, size_t size)
{
    return size > PREAMBLE && memcmp(bytes + 128, "DICM", 4) == 0;
}

void dicom_free(dicom *d)
{
    free(d->frame);
    free(d->segment);
    free(d->inflated);
    *d = (dicom){ 0 };
}

/* ---- values ---- */

static int64_t whole(const dicom *d, const unsigned char *p, size_t n)
{
    return n == 4   ? scalar_integer(SCALAR_U32, p, d->big_endian)
           : n >= 2 ? scalar_integer(SCALAR_U16, p, d->big_endian)
                    : 0;
}

static word trimmed(const unsigned char *p, size_t n)
{
    word w = { (const char *)p, n };
    while (w.length && (w.text[w.length - 1] == '\0' || w.text[w.length - 1] == ' ')) w.length--;
    return word_trim(w);
}

static void copy_text(char *out, size_t room, const unsigned char *p, size_t n)
{
    const word w = trimmed(p, n);
    snprintf(out, room, "%.*s", (int)(w.length < room ? w.length : room - 1), w.text);
    for (; *out; out++)
        if ((unsigned char)*out < ' ' || *out == '\x7f') *out = '?'; /* it may be shown */
}

/* Decimal strings, "1.5\0.5\2"; false if there are not n numbers. */
static bool decimals(const unsigned char *p, size_t length, size_t n, double *x)
{
    word rest = { (const char *)p, length };
    for (size_t k = 0; k < n; k++) {
        const char *const end = memchr(rest.text, '\\', rest.length);
        const size_t used = end ? (size_t)(end - rest.text) : rest.length;
        if (!word_number(trimmed((const unsigned char *)rest.text, used), &x[k]) || !isfinite(x[k]))
            return false;
        rest.text += used + (end != NULL);
        rest.length -= used + (end != NULL);
    }
    return true;
}

static dicom_frame *frame_at(scan *s, dicom *d, size_t f)
{
    if (f >= d->frame_room) {
        const size_t room = f < 2 * d->frame_room ? 2 * d->frame_room : f + 1;
        dicom_frame *const larger = realloc(d->frame, room * sizeof *larger);
        if (!larger) {
            scan_no_memory(s);
            return NULL;
        }
        memset(larger + d->frame_room, 0, (room - d->frame_room) * sizeof *larger);
        d->frame = larger;
        d->frame_room = room;
    }
    return &d->frame[f];
}

static dicom_segment *segment_at(scan *s, dicom *d, size_t k)
{
    for (; k >= d->segments && scan_ok(s); d->segments++) {
        dicom_segment *const larger = realloc(d->segment, (d->segments + 1) * sizeof *larger);
        if (!larger) {
            scan_no_memory(s);
            return NULL;
        }
        d->segment = larger;
        larger[d->segments] = (dicom_segment){ .number = (int64_t)d->segments + 1 };
    }
    return &d->segment[k];
}

/* ---- elements ---- */

static bool take_numbers(dicom *d, uint32_t tag, const unsigned char *p, size_t n)
{
    const struct {
        uint32_t tag;
        int64_t *value;
    } known[] = { { TAG(0x28, 0x02), &d->samples },    { TAG(0x28, 0x10), &d->rows },
                  { TAG(0x28, 0x11), &d->columns },    { TAG(0x28, 0x100), &d->allocated },
                  { TAG(0x28, 0x101), &d->stored },    { TAG(0x28, 0x102), &d->high },
                  { TAG(0x28, 0x103), &d->is_signed }, { TAG(0x62, 0x0e), &d->most } };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (known[k].tag == tag) {
            *known[k].value = whole(d, p, n);
            return true;
        }
    return false;
}

static void take_top(scan *s, dicom *d, uint32_t tag, const unsigned char *p, size_t n)
{
    if (take_numbers(d, tag, p, n)) return;
    if (tag == TAG(0x20, 0x0e)) copy_text(d->series, sizeof d->series, p, n);
    if (tag == TAG(0x08, 0x60)) copy_text(d->modality, sizeof d->modality, p, n);
    if (tag == TAG(0x62, 0x01)) copy_text(d->kind, sizeof d->kind, p, n);
    if (tag == TAG(0x28, 0x08) && !word_integer(trimmed(p, n), &d->frames))
        scan_fail(s, "the number of frames is no number; export it again");
}

/* In the file itself, in the groups that all frames share, or in those of one frame. */
static void take_geometry(scan *s, dicom *d, uint32_t tag, size_t f, const unsigned char *p,
                          size_t n)
{
    bool good = true;
    double x;
    if (tag == TAG(0x20, 0x32)) {
        dicom_frame *const frame = frame_at(s, d, f);
        good = frame && decimals(p, n, 3, frame->position);
        if (frame) frame->has_position = good;
    } else if (tag == TAG(0x20, 0x37)) {
        double next[6];
        good = decimals(p, n, 6, next);
        for (int k = 0; k < 6 && good && d->has_orientation; k++)
            if (fabs(next[k] - d->orientation[k]) > 1e-3)
                scan_fail(s, "its frames have different orientations; give one stack of slices");
        if (good && !d->has_orientation) memcpy(d->orientation, next, sizeof next);
        d->has_orientation = good;
    } else if (tag == TAG(0x28, 0x30)) {
        d->has_between = good = decimals(p, n, 2, d->between);
    } else if (tag == TAG(0x18, 0x88) && decimals(p, n, 1, &x)) {
        d->gap = fabs(x);
    } else if (tag == TAG(0x28, 0x1053) && decimals(p, n, 1, &x)) {
        d->slope = x;
    } else if (tag == TAG(0x28, 0x1052) && decimals(p, n, 1, &x)) {
        d->intercept = x;
    }
    if (!good)
        scan_fail(s, "element (%04x,%04x) is not a list of finite numbers; export it again",
                  tag >> 16, tag & 0xffff);
}

static void take(scan *s, dicom *d, const path *at, uint32_t tag, const unsigned char *p, size_t n)
{
    const uint32_t top = at->depth ? at->sequence[0] : 0;
    if (at->depth && at->item[0] == SIZE_MAX) return; /* in a sequence, but in none of its items */
    if (at->depth == 0) take_top(s, d, tag, p, n);
    if (at->depth == 0 || top == TAG(0x5200, 0x9229)) take_geometry(s, d, tag, 0, p, n);
    if (top == TAG(0x5200, 0x9230)) {
        const size_t f = at->item[0];
        take_geometry(s, d, tag, f, p, n);
        dicom_frame *const frame = tag == TAG(0x62, 0x0b) ? frame_at(s, d, f) : NULL;
        if (frame) frame->segment = whole(d, p, n);
    }
    if (top == TAG(0x62, 0x02) && at->depth == 1 && (tag == TAG(0x62, 4) || tag == TAG(0x62, 5))) {
        dicom_segment *const segment = segment_at(s, d, at->item[0]);
        if (segment && tag == TAG(0x62, 4)) segment->number = whole(d, p, n);
        if (segment && tag == TAG(0x62, 5)) copy_text(segment->label, DICOM_LABEL, p, n);
    }
}

/* ---- the tree ---- */

static bool has_long_length(const char vr[3])
{
    static const char *const names[] = { "OB", "OD", "OF", "OL", "OV", "OW", "SQ",
                                         "SV", "UC", "UN", "UR", "UT", "UV" };
    for (size_t k = 0; k < sizeof names / sizeof *names; k++)
        if (memcmp(vr, names[k], 2) == 0) return true;
    return false;
}

static int64_t take_length(scan *s, const dicom *d, size_t size)
{
    const int64_t n = scan_whole(s, size == 2 ? SCALAR_U16 : SCALAR_U32, d->big_endian);
    return size == 4 && n == UINT32_MAX ? UNDEFINED : n;
}

static element next_element(scan *s, const dicom *d)
{
    element e = { 0 };
    const uint32_t group = (uint32_t)scan_whole(s, SCALAR_U16, d->big_endian);
    e.tag = TAG(group, (uint32_t)scan_whole(s, SCALAR_U16, d->big_endian));
    if (group == 0xfffe || d->implicit) {
        e.length = take_length(s, d, 4);
        return e;
    }
    const unsigned char *const vr = scan_bytes(s, 2);
    if (vr) memcpy(e.vr, vr, 2);
    const bool is_long = has_long_length(e.vr);
    if (is_long) scan_bytes(s, 2);
    e.length = take_length(s, d, is_long ? 4 : 2);
    return e;
}

static bool is_sequence(const element *e, bool implicit)
{
    static const uint32_t needed[] = { TAG(0x5200, 0x9229), TAG(0x5200, 0x9230), TAG(0x20, 0x9113),
                                       TAG(0x20, 0x9116),   TAG(0x28, 0x9110),   TAG(0x62, 0x0a),
                                       TAG(0x62, 0x02),     TAG(0x28, 0x9145) };
    if (memcmp(e->vr, "SQ", 2) == 0) return true;
    if (e->length == UNDEFINED) return e->tag != TAG(0x7fe0, 0x10);
    for (size_t k = 0; implicit && k < sizeof needed / sizeof *needed; k++)
        if (needed[k] == e->tag) return true;
    return false;
}

/* Fragments, each an item, up to a delimiter; they stay as they are.  Those of an icon within a
 * sequence are passed. */
static void take_fragments(scan *s, dicom *d, bool icon)
{
    const unsigned char *const first = (const unsigned char *)s->bytes + s->at;
    while (scan_ok(s)) {
        const element e = next_element(s, d);
        if (e.tag == TAG(0xfffe, 0xe0dd)) break;
        if (e.tag != TAG(0xfffe, 0xe000) || e.length == UNDEFINED)
            scan_fail(s, "its packed pixels are damaged; copy or export it again");
        scan_bytes(s, (size_t)e.length);
    }
    if (icon) return;
    d->pixels = first;
    d->pixel_size = (size_t)((const unsigned char *)s->bytes + s->at - first);
}

/* A stack of where sequences and items end; recursion would be as deep as a file says. */
typedef struct level {
    size_t end; /* SIZE_MAX: at a delimiter */
    bool item;  /* of an item, else of a sequence */
} level;

typedef struct walk {
    path at;
    int levels;
    level level[2 * DEEPEST];
} walk;

static void open_sequence(scan *s, walk *w, const element *e)
{
    if (w->at.depth == DEEPEST) {
        scan_fail(s, "sequences are nested deeper than %d; export it again", DEEPEST);
        return;
    }
    w->at.sequence[w->at.depth] = e->tag;
    w->at.item[w->at.depth++] = SIZE_MAX; /* before the first */
    w->level[w->levels++] =
        (level){ e->length == UNDEFINED ? SIZE_MAX : s->at + (size_t)e->length, false };
}

static void close_level(walk *w)
{
    if (!w->level[--w->levels].item) w->at.depth--;
}

static void open_item(scan *s, walk *w, const element *e)
{
    if (!w->levels || w->level[w->levels - 1].item) {
        scan_fail(s, "an item outside of a sequence; export it again");
        return;
    }
    w->at.item[w->at.depth - 1]++;
    w->level[w->levels++] =
        (level){ e->length == UNDEFINED ? SIZE_MAX : s->at + (size_t)e->length, true };
}

static void take_element(scan *s, dicom *d, walk *w, const element *e)
{
    if (e->tag == TAG(0xfffe, 0xe000)) {
        open_item(s, w, e);
    } else if (e->tag == TAG(0xfffe, 0xe00d) || e->tag == TAG(0xfffe, 0xe0dd)) {
        if (w->levels) close_level(w);
    } else if (is_sequence(e, d->implicit)) {
        open_sequence(s, w, e);
    } else if (e->tag == TAG(0x7fe0, 0x10) && e->length == UNDEFINED) {
        take_fragments(s, d, w->levels > 0);
    } else {
        const unsigned char *const p = scan_bytes(s, (size_t)e->length);
        if (p && e->tag == TAG(0x7fe0, 0x10) && w->levels == 0) {
            d->pixels = p;
            d->pixel_size = (size_t)e->length;
        } else if (p) {
            take(s, d, &w->at, e->tag, p, (size_t)e->length);
        }
    }
}

static void parse_elements(scan *s, dicom *d)
{
    walk w = { .levels = 0 };
    while (scan_ok(s)) {
        while (w.levels && w.level[w.levels - 1].end <= s->at) close_level(&w);
        if (scan_left(s) < 8 || (d->pixels && w.levels == 0)) break;
        const element e = next_element(s, d);
        if (scan_ok(s)) take_element(s, d, &w, &e);
    }
}

/* ---- the file ---- */

static void refuse_syntax(scan *s, const char *syntax)
{
    if (!*syntax)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "does not say how its data are written (0002,0010); it is damaged: copy or "
                    "export it again");
    scan_refuse(s, APSM_ERR_UNSUPPORTED,
                "its pixels are compressed (%s, transfer syntax %s), which is not read here; "
                "decompress it (gdcmconv --raw, dcmdjpeg) or convert the series to NRRD or NIfTI",
                strncmp(syntax, "1.2.840.10008.1.2.4.9", 21) == 0    ? "JPEG 2000"
                : strncmp(syntax, "1.2.840.10008.1.2.4.8", 21) == 0  ? "JPEG-LS"
                : strncmp(syntax, "1.2.840.10008.1.2.4.10", 22) == 0 ? "video"
                : strncmp(syntax, "1.2.840.10008.1.2.4.", 20) == 0   ? "JPEG"
                                                                     : "unknown",
                syntax);
}

/* Group 2, explicit little endian whatever follows; *syntax <- the transfer syntax. */
static void parse_meta(scan *s, char syntax[DICOM_UID])
{
    const dicom meta = { .allocated = 0 };
    syntax[0] = '\0';
    while (scan_ok(s) && scan_left(s) >= 8 &&
           scalar_bits((const unsigned char *)s->bytes + s->at, 2, false) == 2) {
        const element e = next_element(s, &meta);
        const unsigned char *const p = e.length >= 0 ? scan_bytes(s, (size_t)e.length) : NULL;
        if (p && e.tag == TAG(2, 0x10)) copy_text(syntax, DICOM_UID, p, (size_t)e.length);
        if (!p) scan_fail(s, "its header is damaged; copy or export it again");
    }
}

/* The deflated rest of the file; as large as deflate can make it, but memory grows with it. */
static void inflate_rest(scan *s, dicom *d)
{
    size_t size;
    const inflated result =
        inflate_raw((const unsigned char *)s->bytes + s->at, scan_left(s), &d->inflated, &size);
    if (result == INFLATE_NO_MEMORY) scan_no_memory(s);
    if (result == INFLATE_DAMAGED)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "its compressed data are cut short or wrong; copy or export it again");
    if (!scan_ok(s)) return;
    s->bytes = (const char *)d->inflated;
    s->size = size;
    s->at = 0;
}

void dicom_parse(scan *s, dicom *d)
{
    char syntax[DICOM_UID];
    *d = (dicom){ .samples = 1, .slope = 1.0, .frames = 1 };
    s->binary = true;
    s->at = PREAMBLE;
    parse_meta(s, syntax);
    d->implicit = strcmp(syntax, "1.2.840.10008.1.2") == 0;
    d->big_endian = strcmp(syntax, "1.2.840.10008.1.2.2") == 0;
    d->rle = strcmp(syntax, "1.2.840.10008.1.2.5") == 0;
    const bool deflated = strcmp(syntax, "1.2.840.10008.1.2.1.99") == 0;
    if (scan_ok(s) && !d->implicit && !d->big_endian && !d->rle && !deflated &&
        strcmp(syntax, "1.2.840.10008.1.2.1") != 0)
        refuse_syntax(s, syntax);
    if (scan_ok(s) && deflated) inflate_rest(s, d);
    parse_elements(s, d);
    if (d->frames < 1 || d->frames > (1 << 24))
        scan_refuse(s, APSM_ERR_FORMAT, "has %lld frames; export it again", (long long)d->frames);
    if (d->high == 0 && d->stored > 0) d->high = d->stored - 1;
    if (scan_ok(s)) frame_at(s, d, 0);
}
