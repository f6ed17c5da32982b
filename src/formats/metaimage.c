/* MetaImage: .mha with the voxels behind the header, .mhd with the voxels in a file of their own.
 * Row a of TransformMatrix is the direction of axis a. */
#include <math.h>
#include <stdlib.h>

#include "formats/header_line.h"
#include "formats/several.h"

enum { MOST_DIMENSIONS = 4 };

typedef struct meta {
    int64_t dimensions, channels, header_size;
    double size[MOST_DIMENSIONS], spacing[MOST_DIMENSIONS], offset[MOST_DIMENSIONS];
    double matrix[MOST_DIMENSIONS * MOST_DIMENSIONS];
    bool has_size, has_spacing, has_matrix, binary, compressed;
    double compressed_size, unit;
    word file, orientation; /* orientation: three letters, or empty */
} meta;

static bool is_yes(word w)
{
    return w.length && strchr("Tt1", w.text[0]);
}

static scalar read_type(scan *s, word name)
{
    static const struct {
        const char *name;
        scalar type;
    } known[] = { { "MET_CHAR", SCALAR_I8 },       { "MET_UCHAR", SCALAR_U8 },
                  { "MET_SHORT", SCALAR_I16 },     { "MET_USHORT", SCALAR_U16 },
                  { "MET_INT", SCALAR_I32 },       { "MET_UINT", SCALAR_U32 },
                  { "MET_LONG", SCALAR_I32 },      { "MET_ULONG", SCALAR_U32 },
                  { "MET_LONG_LONG", SCALAR_I64 }, { "MET_ULONG_LONG", SCALAR_U64 },
                  { "MET_FLOAT", SCALAR_F32 },     { "MET_DOUBLE", SCALAR_F64 } };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (word_is(name, known[k].name)) return known[k].type;
    scan_expected(s, "a type of voxels (MET_UCHAR, ...)", name);
    return SCALAR_U8;
}

static void read_dimensions(scan *s, word value, meta *h)
{
    char shown[WORD_SHOWN];
    if (!word_integer(value, &h->dimensions) || h->dimensions < 1 ||
        h->dimensions > MOST_DIMENSIONS)
        scan_fail(s, "has %s dimensions; export it again", word_show(value, shown));
}

/* As many numbers as the image has dimensions, times `each`. */
static void read_list(scan *s, const header_line *l, const meta *h, size_t each, double *x)
{
    char shown[WORD_SHOWN];
    if (h->dimensions == 0)
        scan_fail(s, "NDims has to come before %s; export it again", word_show(l->key, shown));
    else if (!word_numbers(l->value, (size_t)h->dimensions * each, x))
        scan_fail(s, "%s is not a list of %zu numbers; export it again", word_show(l->key, shown),
                  (size_t)h->dimensions * each);
}

static bool key_is(const header_line *l, const char *a, const char *b, const char *c)
{
    return word_is(l->key, a) || (b && word_is(l->key, b)) || (c && word_is(l->key, c));
}

/* What says where the voxels lie; false if the key is another. */
static bool read_grid_line(scan *s, const header_line *l, meta *h)
{
    if (key_is(l, "TransformMatrix", "Rotation", "Orientation")) {
        read_list(s, l, h, (size_t)h->dimensions, h->matrix);
        h->has_matrix = true;
    } else if (key_is(l, "Offset", "Position", "Origin")) {
        read_list(s, l, h, 1, h->offset);
    } else if (word_is(l->key, "ElementSpacing") ||
               (word_is(l->key, "ElementSize") && !h->has_spacing)) {
        read_list(s, l, h, 1, h->spacing);
        h->has_spacing = true;
    } else if (word_is(l->key, "DimSize")) {
        read_list(s, l, h, 1, h->size);
        h->has_size = true;
    } else if (word_is(l->key, "AnatomicalOrientation")) {
        h->orientation = l->value;
    } else if (word_is(l->key, "DistanceUnits")) {
        if (!word_is(l->value, "?")) h->unit = unit_in_mm(l->value); /* ?: not known */
    } else {
        return false;
    }
    return true;
}

static void read_line(scan *s, const header_line *l, meta *h, image *m)
{
    int64_t number = 0;
    if (read_grid_line(s, l, h)) return;
    if (word_is(l->key, "NDims")) read_dimensions(s, l->value, h);
    if (word_is(l->key, "BinaryData")) h->binary = is_yes(l->value);
    if (key_is(l, "BinaryDataByteOrderMSB", "ElementByteOrderMSB", NULL))
        m->big_endian = is_yes(l->value);
    if (word_is(l->key, "CompressedData")) h->compressed = is_yes(l->value);
    if (word_is(l->key, "CompressedDataSize")) word_number(l->value, &h->compressed_size);
    if (word_is(l->key, "HeaderSize") && word_integer(l->value, &number)) h->header_size = number;
    if (word_is(l->key, "ElementNumberOfChannels") && word_integer(l->value, &number))
        h->channels = number;
    if (word_is(l->key, "ElementType")) m->type = read_type(s, l->value);
    if (word_is(l->key, "ElementDataFile")) h->file = l->value;
}

/* Up to ElementDataFile, which is the last line. */
static void read_lines(scan *s, meta *h, image *m)
{
    bool any = false;
    while (scan_ok(s) && !h->file.length) {
        header_line l;
        if (!scan_left(s)) {
            scan_refuse(s, APSM_ERR_FORMAT, "%s; copy or export it again",
                        any ? "its header has no ElementDataFile; it is cut short"
                            : "is not a MetaImage, whatever its name says");
            return;
        }
        const word line = scan_rest_of_line(s);
        if (!header_split(line, "=:", &l)) continue;
        any = any || word_is(l.key, "NDims");
        read_line(s, &l, h, m);
    }
    if (!any || !h->has_size)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "is not a MetaImage, whatever its name says: it has no %s; export it again",
                    any ? "DimSize" : "NDims");
}

/* The letter of the side that axis c runs to (from: that it comes from). */
static char side_of(const double step[9], int c, bool from)
{
    static const char to[] = "LPS", back[] = "RAI";
    int r = 0;
    for (int k = 1; k < 3; k++)
        if (fabs(step[3 * k + c]) > fabs(step[3 * r + c])) r = k;
    return (step[3 * r + c] > 0.0) != from ? to[r] : back[r];
}

/* AnatomicalOrientation repeats the matrix in letters, which some programs mean as the sides that
 * axes come from, others as those that they run to. */
static void tell_orientation(scan *s, const meta *h, image *m)
{
    const word w = h->orientation;
    bool from = w.length == 3, to = from;
    char shown[WORD_SHOWN];
    for (int c = 0; c < 3 && w.length == 3; c++) {
        if (!strchr("RLAPIS", w.text[c])) return;
        from = from && w.text[c] == side_of(m->step, c, true);
        to = to && w.text[c] == side_of(m->step, c, false);
    }
    if (w.length == 3 && !from && !to)
        image_note(s, m,
                   "its AnatomicalOrientation %s is not that of its TransformMatrix, which was "
                   "taken: check left and right",
                   word_show(w, shown));
}

static void place(scan *s, const meta *h, image *m)
{
    const size_t n = (size_t)h->dimensions;
    for (size_t c = 0; c < 3; c++) {
        const double spacing = h->has_spacing ? h->spacing[c] : 1.0;
        m->origin[c] = h->unit * h->offset[c];
        if (!(spacing > 0.0) || !isfinite(spacing))
            scan_refuse(s, APSM_ERR_FORMAT,
                        "spacing %g along axis %zu is not a positive number; correct it in the "
                        "file's header",
                        spacing, c);
        double length = 0.0;
        for (size_t r = 0; r < 3; r++) {
            const double d = h->has_matrix ? h->matrix[n * c + r] : r == c;
            m->step[3 * r + c] = d;
            length += d * d;
        }
        length = length > 0.0 ? sqrt(length) : 1.0;
        for (size_t r = 0; r < 3; r++) m->step[3 * r + c] *= h->unit * spacing / length;
    }
    if (!h->has_spacing)
        image_note(s, m, "its header has no ElementSpacing; voxels of 1 mm were taken");
    if (h->unit < 1.0 || h->unit > 1.0)
        image_note(s, m, "its lengths are in units of %g mm; turned into mm", h->unit);
    tell_orientation(s, h, m);
}

static void check_sizes(scan *s, meta *h, image *m)
{
    if (h->dimensions == 2)
        scan_refuse(s, APSM_ERR_FORMAT, "is a flat image, not 3-D; give the whole stack of slices");
    if (h->dimensions < 3 || (h->dimensions == 4 && (h->size[3] < 1.0 || h->size[3] > 1.0)))
        scan_refuse(s, APSM_ERR_FORMAT, "is not 3-D; extract one volume of the series");
    if (h->channels != 1)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "has %lld components per voxel; save it with one label per voxel",
                    (long long)h->channels);
    for (int c = 0; c < 3; c++) {
        if (!(h->size[c] >= 1.0 && h->size[c] <= 1e15 && floor(h->size[c]) == h->size[c])) {
            scan_refuse(s, APSM_ERR_FORMAT, "has %g voxels along an axis; export it again",
                        h->size[c]);
            return;
        }
        m->n[c] = (size_t)h->size[c];
    }
    if (!(h->unit > 0.0)) h->unit = 1.0;
    image_simple(m);
}

/* "LIST", and lines with names; or a pattern. */
static void load_several(scan *s, const meta *h, image *m)
{
    several files = { .names = { s->bytes + s->at, scan_left(s) }, .skip = h->header_size };
    files.pattern = name_series_is_pattern(h->file);
    if (files.pattern) files.names = h->file;
    if (!h->binary || h->compressed)
        scan_refuse(s, APSM_ERR_UNSUPPORTED,
                    "its slices are in many files, as text or compressed; save it as one file (3D "
                    "Slicer does)");
    else
        several_load(s, m, &files);
}

static void load(scan *s, const meta *h, image *m)
{
    m->data = (const unsigned char *)s->bytes + s->at;
    m->size = scan_left(s);
    if (name_series_is(h->file)) {
        load_several(s, h, m);
        return;
    }
    if (!word_is_any_case(h->file, "LOCAL")) image_load_word(s, m, h->file);
    if (!scan_ok(s)) return;
    m->packing = !h->binary ? WRITTEN : h->compressed ? PACKED : PLAIN;
    if (!(h->compressed_size >= 0.0) || h->compressed_size > (double)m->size)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "its header promises more data than there are; copy or export it again");
    if (h->header_size > 0) m->lead = (size_t)h->header_size;
    if (h->header_size == -1) { /* the voxels are the last bytes */
        const double bytes =
            (double)m->n[0] * (double)m->n[1] * (double)m->n[2] * (double)scalar_size(m->type);
        if (bytes <= (double)m->size) m->lead = m->size - (size_t)bytes;
    }
}

void read_metaimage(scan *s, image *m)
{
    meta h = {
        .channels = 1, .binary = true, .unit = 1.0, .file = { "", 0 }, .orientation = { "", 0 }
    };
    m->type = SCALAR_U8;
    read_lines(s, &h, m);
    if (scan_ok(s)) check_sizes(s, &h, m);
    if (scan_ok(s)) place(s, &h, m);
    if (scan_ok(s)) load(s, &h, m);
}
