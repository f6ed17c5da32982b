/* NRRD: .nrrd, and .nhdr with the voxels in a file of their own; Slicer's .seg.nrrd names its
 * labels, in one layer or several.
 *
 * Axes without a space direction, or of a kind that is no domain, hold components: one is passed
 * over, a list of them is the layers of a segmentation, everything else is refused. */
#include <math.h>
#include <stdlib.h>

#include "formats/header_line.h"
#include "formats/nrrd_segments.h"
#include "formats/several.h"

enum { MOST_AXES = 4 };

typedef enum packed_as { RAW, TEXT, GZIP } packed_as;

typedef struct nrrd {
    int64_t dimension, sizes[MOST_AXES], line_skip, byte_skip;
    bool has_type, has_sizes, has_encoding, has_space, has_directions, has_spacings, has_endian;
    bool component[MOST_AXES];
    packed_as encoding;
    double flip[3]; /* of the space, to LPS */
    double direction[MOST_AXES][3], spacing[MOST_AXES], minimum[MOST_AXES], origin[3], unit;
    word file;
} nrrd;

/* ---- single fields ---- */

static void read_type(scan *s, word value, nrrd *h, image *m)
{
    static const struct {
        const char *names[7];
        scalar type;
    } known[] = {
        { { "signed char", "int8", "int8_t", "char" }, SCALAR_I8 },
        { { "uchar", "unsigned char", "uint8", "uint8_t" }, SCALAR_U8 },
        { { "short", "short int", "signed short", "signed short int", "int16", "int16_t" },
          SCALAR_I16 },
        { { "ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t" }, SCALAR_U16 },
        { { "int", "signed int", "int32", "int32_t" }, SCALAR_I32 },
        { { "uint", "unsigned int", "uint32", "uint32_t" }, SCALAR_U32 },
        { { "longlong", "long long", "long long int", "signed long long", "signed long long int",
            "int64", "int64_t" },
          SCALAR_I64 },
        { { "ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t" },
          SCALAR_U64 },
        { { "float" }, SCALAR_F32 },
        { { "double" }, SCALAR_F64 }
    };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        for (size_t i = 0; i < 7 && known[k].names[i]; i++)
            if (word_is_any_case(value, known[k].names[i])) {
                m->type = known[k].type;
                h->has_type = true;
            }
    if (!h->has_type) scan_expected(s, "a type of NRRD", value);
}

/* The format knows more encodings than these. */
static void refuse_encoding(scan *s, word value)
{
    static const char *const others[] = { "bzip2", "bz2", "hex", "zrl" };
    char shown[WORD_SHOWN];
    bool known = false;
    for (size_t k = 0; k < sizeof others / sizeof *others; k++)
        known = known || word_is_any_case(value, others[k]);
    if (!known) scan_expected(s, "the encoding raw, gzip or ascii", value);
    scan_refuse(s, APSM_ERR_UNSUPPORTED,
                "its voxels are encoded as '%s', which is not read here; save it as gzip or raw "
                "(`unu save -f nrrd -e gzip -i IN -o OUT`)",
                word_show(value, shown));
}

static void read_encoding(scan *s, word value, nrrd *h)
{
    h->has_encoding = true;
    if (word_is_any_case(value, "raw"))
        h->encoding = RAW;
    else if (word_is_any_case(value, "gzip") || word_is_any_case(value, "gz"))
        h->encoding = GZIP;
    else if (word_is_any_case(value, "ascii") || word_is_any_case(value, "text") ||
             word_is_any_case(value, "txt"))
        h->encoding = TEXT;
    else
        refuse_encoding(s, value);
}

/* The anatomical ones; others are taken as they are. */
static void read_space(scan *s, word value, nrrd *h, image *m)
{
    static const struct {
        const char *names[2];
        double x, y;
    } known[] = { { { "right-anterior-superior", "RAS" }, -1, -1 },
                  { { "left-anterior-superior", "LAS" }, 1, -1 },
                  { { "left-posterior-superior", "LPS" }, 1, 1 },
                  { { "right-anterior-superior-time", "RAST" }, -1, -1 },
                  { { "left-anterior-superior-time", "LAST" }, 1, -1 },
                  { { "left-posterior-superior-time", "LPST" }, 1, 1 } };
    char shown[WORD_SHOWN];
    h->has_space = true;
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        for (int i = 0; i < 2; i++)
            if (word_is_any_case(value, known[k].names[i])) {
                h->flip[0] = known[k].x;
                h->flip[1] = known[k].y;
                return;
            }
    image_note(s, m, "its space '%s' does not tell left from right; taken for LPS",
               word_show(value, shown));
}

static void read_dimension(scan *s, word value, nrrd *h)
{
    char shown[WORD_SHOWN];
    if (!word_integer(value, &h->dimension) || h->dimension < 1)
        scan_fail(s, "has %s dimensions; export it again", word_show(value, shown));
    else if (h->dimension > MOST_AXES)
        scan_fail(s, "is not 3-D but has %lld dimensions; extract one volume of it",
                  (long long)h->dimension);
    else if (h->dimension < 3)
        scan_fail(s, "is a flat image, not 3-D; give the whole stack of slices");
}

static void read_sizes(scan *s, word value, nrrd *h)
{
    h->has_sizes = true;
    for (int64_t a = 0; a < h->dimension; a++)
        if (!word_integer(word_next(&value), &h->sizes[a]) || h->sizes[a] < 1)
            scan_fail(s, "sizes are not %lld positive integers; export it again",
                      (long long)h->dimension);
}

/* "(1,0,0) none (0,1,0) ...". */
static void read_directions(scan *s, word value, nrrd *h)
{
    h->has_directions = true;
    for (int64_t a = 0; a < h->dimension; a++) {
        word next = word_next(&value);
        h->component[a] = word_is_any_case(next, "none");
        for (int c = 0; c < 3 && !h->component[a]; c++) {
            if (!word_number(next, &h->direction[a][c]))
                scan_fail(s, "space directions are not vectors of 3 numbers; export it again");
            if (c < 2) next = word_next(&value);
        }
    }
}

static void read_axis_numbers(scan *s, word value, const nrrd *h, double *x)
{
    for (int64_t a = 0; a < h->dimension; a++)
        if (!word_number(word_next(&value), &x[a])) /* "nan" counts as a number here */
            scan_fail(s, "expected %lld numbers; export it again", (long long)h->dimension);
}

/* The axes that are no domain of space. */
static void read_kinds(word value, nrrd *h)
{
    static const char *const domains[] = { "domain", "space", "none", "???" };
    for (int64_t a = 0; a < h->dimension; a++) {
        const word kind = word_next(&value);
        bool domain = kind.length == 0;
        for (size_t k = 0; k < sizeof domains / sizeof *domains; k++)
            domain = domain || word_is_any_case(kind, domains[k]);
        if (!domain) h->component[a] = true;
    }
}

static void read_unit(word value, nrrd *h)
{
    word first = word_next(&value);
    if (first.length > 2 && first.text[0] == '"') first.text++, first.length -= 2;
    const double unit = unit_in_mm(first);
    if (unit > 0.0) h->unit = unit;
}

/* ---- the header ---- */

static void read_field(scan *s, const header_line *l, nrrd *h, image *m)
{
    if (h->dimension == 0 &&
        (word_is(l->key, "sizes") || word_is(l->key, "kinds") || word_is(l->key, "spacings") ||
         word_is(l->key, "space directions") || word_is(l->key, "axis mins")))
        scan_fail(s, "dimension has to come first; export it again");
    else if (word_is(l->key, "dimension"))
        read_dimension(s, l->value, h);
    else if (word_is(l->key, "type"))
        read_type(s, l->value, h, m);
    else if (word_is(l->key, "sizes"))
        read_sizes(s, l->value, h);
    else if (word_is(l->key, "encoding"))
        read_encoding(s, l->value, h);
    else if (word_is(l->key, "endian"))
        m->big_endian = word_is_any_case(l->value, "big"), h->has_endian = true;
    else if (word_is(l->key, "space"))
        read_space(s, l->value, h, m);
    else if (word_is(l->key, "space directions"))
        read_directions(s, l->value, h);
    else if (word_is(l->key, "kinds"))
        read_kinds(l->value, h);
    else if (word_is(l->key, "spacings")) {
        read_axis_numbers(s, l->value, h, h->spacing);
        h->has_spacings = true;
    } else if (word_is(l->key, "axis mins") || word_is(l->key, "axismins"))
        read_axis_numbers(s, l->value, h, h->minimum);
    else if (word_is(l->key, "space units") || word_is(l->key, "units"))
        read_unit(l->value, h);
    else if (word_is(l->key, "data file") || word_is(l->key, "datafile"))
        h->file = l->value;
    else if (word_is(l->key, "line skip") || word_is(l->key, "lineskip"))
        (void)word_integer(l->value, &h->line_skip);
    else if (word_is(l->key, "byte skip") || word_is(l->key, "byteskip"))
        (void)word_integer(l->value, &h->byte_skip);
    else if (word_is(l->key, "space origin") && !word_numbers(l->value, 3, h->origin))
        scan_fail(s, "space origin is not a vector of 3 numbers; export it again");
}

/* Up to an empty line, or to the end of a header in a file of its own. */
static void read_lines(scan *s, nrrd *h, image *m)
{
    const word first = scan_rest_of_line(s);
    if (first.length < 8 || memcmp(first.text, "NRRD000", 7) != 0) {
        scan_refuse(s, APSM_ERR_FORMAT,
                    "is not a NRRD file, whatever its name says; export it "
                    "again");
        return;
    }
    while (scan_ok(s) && scan_left(s)) {
        header_line l;
        const word line = scan_rest_of_line(s);
        if (!line.length) break;
        if (line.text[0] == '#' || !header_split(line, ":", &l)) continue;
        if (l.value.length && l.value.text[0] == '=') { /* key:=value, free of rules */
            l.value = word_trim((word){ l.value.text + 1, l.value.length - 1 });
            read_segment_line(s, &l, &m->volume);
            continue;
        }
        read_field(s, &l, h, m);
        if (name_series_is(h->file) && !name_series_is_pattern(h->file)) break; /* names follow */
    }
    if (!h->dimension || !h->has_type || !h->has_sizes || !h->has_encoding)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "its header lacks %s; it is cut short or damaged: copy or export it again",
                    !h->dimension   ? "dimension"
                    : !h->has_type  ? "type"
                    : !h->has_sizes ? "sizes"
                                    : "encoding");
}

/* ---- the grid ---- */

/* axis[0..2] <- the axes of space; *list <- the one that is none, or -1. */
static void sort_axes(scan *s, nrrd *h, image *m, int axis[3], int *list)
{
    int found = 0;
    *list = -1;
    if (h->dimension == 3) /* a kind that we do not know is no reason to lose an axis */
        for (int a = 0; a < 3; a++)
            h->component[a] = h->has_directions && h->component[a] && h->sizes[a] > 1;
    for (int a = 0; a < (int)h->dimension; a++) {
        if (h->component[a] || found == 3)
            *list = a;
        else
            axis[found++] = a;
    }
    if (found < 3) {
        scan_refuse(s, APSM_ERR_FORMAT, "is a flat image, not 3-D; give the whole stack of slices");
        return;
    }
    if (*list >= 0 && h->sizes[*list] > 1 && (!h->component[*list] || !m->volume.segments))
        scan_refuse(s, APSM_ERR_FORMAT,
                    h->component[*list]
                        ? "has %lld components per voxel; save it with one label per voxel"
                        : "is not 3-D: it has %lld volumes; extract one of them",
                    (long long)h->sizes[*list]);
}

static void stride(const nrrd *h, image *m, const int axis[3], int list)
{
    size_t step = 1;
    double values = 1.0;
    m->layers = 1;
    for (int a = 0; a < (int)h->dimension; a++) {
        values *= (double)h->sizes[a];
        if (values > 1e18) step = 0; /* refused later by its size */
        for (int c = 0; c < 3; c++)
            if (axis[c] == a) {
                m->n[c] = (size_t)h->sizes[a];
                m->stride[c] = step;
            }
        if (a == list) {
            m->layers = (size_t)h->sizes[a];
            m->layer_stride = step;
        }
        step *= (size_t)h->sizes[a];
    }
}

static void place(scan *s, const nrrd *h, image *m, const int axis[3])
{
    for (int c = 0; c < 3; c++) {
        const double spacing =
            h->has_spacings && isfinite(h->spacing[axis[c]]) ? h->spacing[axis[c]] : 1.0;
        for (int r = 0; r < 3; r++)
            m->step[3 * r + c] = h->unit * h->flip[r] *
                                 (h->has_directions ? h->direction[axis[c]][r]
                                  : r == c          ? fabs(spacing)
                                                    : 0.0);
        m->origin[c] = h->unit * h->flip[c] * h->origin[c];
        if (!h->has_directions && isfinite(h->minimum[axis[c]]))
            m->origin[c] += h->unit * h->flip[c] * h->minimum[axis[c]];
    }
    if (!h->has_directions && !h->has_spacings)
        image_note(s, m,
                   "its header has neither spacings nor space directions; voxels of 1 mm "
                   "were taken");
    else if (!h->has_directions &&
             !(isfinite(h->spacing[axis[0]]) && isfinite(h->spacing[axis[1]]) &&
               isfinite(h->spacing[axis[2]])))
        image_note(s, m,
                   "its header does not say the spacing of every axis; where it does not, voxels "
                   "of 1 mm were taken");
    if (!h->has_endian && h->encoding != TEXT && scalar_size(m->type) > 1)
        image_note(s, m,
                   "its header does not say the order of bytes (endian); the smaller first was "
                   "taken");
    if (h->unit < 1.0 || h->unit > 1.0)
        image_note(s, m, "its lengths are in units of %g mm; turned into mm", h->unit);
}

/* ---- data ---- */

/* "LIST", and the names in what follows; or a pattern. */
static void load_several(scan *s, const nrrd *h, image *m)
{
    several files = { .names = { s->bytes + s->at, scan_left(s) },
                      .packed = h->encoding == GZIP,
                      .skip = h->byte_skip };
    files.pattern = name_series_is_pattern(h->file);
    if (files.pattern) files.names = h->file;
    if (h->encoding == TEXT || h->line_skip > 0 || (files.packed && h->byte_skip != 0))
        scan_refuse(s, APSM_ERR_UNSUPPORTED,
                    "its slices are in many files, as text or with something before the voxels; "
                    "save it as one file (3D Slicer does)");
    else
        several_load(s, m, &files);
}

static void load(scan *s, const nrrd *h, image *m)
{
    static const packing as[] = { PLAIN, WRITTEN, PACKED };
    m->data = (const unsigned char *)s->bytes + s->at;
    m->size = scan_left(s);
    m->packing = as[h->encoding];
    if (name_series_is(h->file)) {
        load_several(s, h, m);
        return;
    }
    if (h->file.length) image_load_word(s, m, h->file);
    for (int64_t k = 0; scan_ok(s) && k < h->line_skip; k++) {
        const unsigned char *const end = memchr(m->data, '\n', m->size);
        const size_t line = end ? (size_t)(end - m->data) + 1 : m->size;
        m->data += line;
        m->size -= line;
        if (!end) break;
    }
    if (h->byte_skip > 0) m->lead = (size_t)h->byte_skip;
    if (h->byte_skip == -1 && m->packing == PLAIN) { /* the voxels are the last bytes */
        const double bytes = (double)m->layers * (double)m->n[0] * (double)m->n[1] *
                             (double)m->n[2] * (double)scalar_size(m->type);
        if (bytes <= (double)m->size) m->lead = m->size - (size_t)bytes;
    }
}

void read_nrrd(scan *s, image *m)
{
    nrrd h = { .flip = { 1, 1, 1 }, .unit = 1.0, .file = { "", 0 } };
    int axis[3] = { 0, 1, 2 }, list = -1;
    read_lines(s, &h, m);
    if (scan_ok(s)) sort_axes(s, &h, m, axis, &list);
    if (scan_ok(s)) stride(&h, m, axis, list);
    if (scan_ok(s)) place(s, &h, m, axis);
    if (scan_ok(s)) load(s, &h, m);
}
