/* VTP, VTK's XML format of poly data, through expat: points, polygons and strips of all pieces.
 * What follows <AppendedData> need not be XML, so it is cut off before. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/soup.h"
#include "formats/vtp_data.h"
#include "formats/xml_parts.h"

typedef enum place { NOWHERE, POINTS, POLYS, STRIPS, LINES, POINT_DATA } place;
typedef enum kind { TEXT, BINARY, APPENDED } kind;

typedef struct array {
    bool there;
    scalar type;
    kind format;
    size_t offset; /* in the appended data */
    xml_text text; /* in the file's own encoding */
} array;

enum {
    A_POINTS,
    A_POLY_CORNERS,
    A_POLY_ENDS,
    A_STRIP_CORNERS,
    A_STRIP_ENDS,
    A_LINE_CORNERS,
    A_LINE_ENDS,
    A_FIELD,
    ARRAYS
};

typedef struct vtp {
    scan *s;
    soup *m;
    XML_Parser parser;
    bool root;
    vtp_encoding encoding;
    vtp_source appended;
    place place;
    array array[ARRAYS], *open; /* of the present piece; the one whose text comes */
    size_t points, polys, strips, lines;
} vtp;

/* ---- attributes ---- */

/* NumberOf...: packed data grow at most 1032 times. */
static size_t read_count(vtp *v, const XML_Char **attributes, const char *name)
{
    const char *const text = xml_attribute(attributes, name);
    char shown[WORD_SHOWN];
    int64_t n = 0;
    word w = xml_word(text);
    while (w.length && (*w.text == ' ' || *w.text == '\n')) w.text++, w.length--;
    while (w.length && (w.text[w.length - 1] == ' ' || w.text[w.length - 1] == '\n')) w.length--;
    if (text && (!word_integer(w, &n) || n < 0 || (double)n > 1032.0 * (double)v->s->size))
        scan_refuse(v->s, APSM_ERR_FORMAT,
                    "%s=\"%s\" cannot be; it is damaged: copy or export it again", name,
                    word_show(w, shown));
    return scan_ok(v->s) ? (size_t)n : 0;
}

static void open_file(vtp *v, const XML_Char **attributes)
{
    const char *const type = xml_attribute(attributes, "type"), *const packer = xml_attribute(
                                                                    attributes, "compressor");
    char shown[WORD_SHOWN];
    v->root = true;
    if (!xml_is(type, "PolyData"))
        scan_refuse(v->s, APSM_ERR_FORMAT,
                    "is not a VTP file but holds %s; extract the surface and save it as poly data",
                    word_show(xml_word(type), shown));
    v->encoding.big_endian = xml_is(xml_attribute(attributes, "byte_order"), "BigEndian");
    v->encoding.header = xml_is(xml_attribute(attributes, "header_type"), "UInt64") ? 8 : 4;
    v->encoding.packed = packer && *packer;
    if (v->encoding.packed && !xml_is(packer, "vtkZLibDataCompressor"))
        scan_refuse(v->s, APSM_ERR_UNSUPPORTED,
                    "is packed by %s; save it with zlib's compression or none",
                    word_show(xml_word(packer), shown));
}

static scalar read_type(vtp *v, const char *name)
{
    static const char *const names[] = { "Int8",   "UInt8", "Int16",  "UInt16",  "Int32",
                                         "UInt32", "Int64", "UInt64", "Float32", "Float64" };
    char shown[WORD_SHOWN];
    for (int k = 0; k < 10; k++)
        if (xml_is(name, names[k])) return (scalar)k;
    scan_refuse(v->s, APSM_ERR_FORMAT, "'%s' is not a number type of VTP; export it again",
                word_show(xml_word(name), shown));
    return SCALAR_U8;
}

static array *array_named(vtp *v, const char *name)
{
    if (v->place == POINTS) return &v->array[A_POINTS];
    if (v->place == POINT_DATA)
        return v->m->want_field && xml_is(name, v->m->want_field) ? &v->array[A_FIELD] : NULL;
    if (v->place == NOWHERE || (v->place == LINES && !v->m->want_lines)) return NULL;
    const int first = v->place == POLYS    ? A_POLY_CORNERS
                      : v->place == STRIPS ? A_STRIP_CORNERS
                                           : A_LINE_CORNERS;
    if (xml_is(name, "connectivity")) return &v->array[first];
    return xml_is(name, "offsets") ? &v->array[first + 1] : NULL;
}

static void open_array(vtp *v, const XML_Char **attributes)
{
    array *const a = array_named(v, xml_attribute(attributes, "Name"));
    const char *const format = xml_attribute(attributes, "format"), *const components =
                                                                        xml_attribute(
                                                                            attributes,
                                                                            "NumberOfComponents");
    int64_t offset = 0;
    if (!a || a->there) return;
    if (v->place == POINT_DATA && components && !xml_is(components, "1")) return;
    a->there = true;
    a->type = read_type(v, xml_attribute(attributes, "type"));
    a->format = xml_is(format, "appended") ? APPENDED : xml_is(format, "binary") ? BINARY : TEXT;
    if (v->place == POINTS && components && !xml_is(components, "3"))
        scan_refuse(v->s, APSM_ERR_FORMAT, "points are not 3-D; export it again");
    if (a->format == APPENDED &&
        (!word_integer(xml_word(xml_attribute(attributes, "offset")), &offset) || offset < 0 ||
         offset > v->appended.end - v->appended.at))
        scan_refuse(v->s, APSM_ERR_FORMAT,
                    "an array lies beyond the end of the file; it is cut short: copy or export it "
                    "again");
    a->offset = (size_t)offset;
    if (a->format != APPENDED) v->open = a;
}

/* ---- values ---- */

static vtp_source source_of(const vtp *v, const array *a)
{
    if (a->format == BINARY)
        return (
            vtp_source){ .at = a->text.text, .end = a->text.text + a->text.length, .base64 = true };
    vtp_source from = v->appended;
    from.at += a->offset;
    return from;
}

/* n numbers as int64_t or double: exactly one of integers and reals is not NULL. */
static void convert(scan *s, const array *a, const unsigned char *bytes, bool big_endian, size_t n,
                    int64_t *integers, double *reals)
{
    scan text = scan_begin(s->ctx, s->path, a->text.text, a->text.length);
    const size_t size = scalar_size(a->type);
    for (size_t k = 0; k < n && scan_ok(&text); k++) {
        if (a->format == TEXT && integers)
            integers[k] = scan_integer(&text, "an integer");
        else if (a->format == TEXT)
            reals[k] = scan_number(&text, "a number");
        else if (integers)
            integers[k] = scalar_integer(a->type, bytes + k * size, big_endian);
        else
            reals[k] = scalar_real(a->type, bytes + k * size, big_endian);
    }
    s->status = scan_ok(s) ? text.status : s->status;
}

/* The first n values of an array, malloc'ed; NULL on failure, which is recorded. */
static void *values(vtp *v, const array *a, const char *name, bool integers, size_t n)
{
    unsigned char *bytes = NULL;
    if (!a->there || (a->format == TEXT && n > (a->text.length + 1) / 2) ||
        (integers && scalar_is_real(a->type)))
        scan_refuse(v->s, APSM_ERR_FORMAT,
                    "its array '%s' is missing or holds fewer values than it should; copy or "
                    "export it again",
                    name);
    else if (a->format != TEXT)
        bytes = vtp_bytes(v->s, name, &v->encoding, source_of(v, a), n * scalar_size(a->type));
    void *out = scan_ok(v->s) ? malloc((n + 1) * 8) : NULL;
    if (!out) scan_no_memory(v->s);
    if (out)
        convert(v->s, a, bytes, v->encoding.big_endian, n, integers ? out : NULL,
                integers ? NULL : out);
    free(bytes);
    if (scan_ok(v->s)) return out;
    free(out);
    return NULL;
}

static void add_points(vtp *v)
{
    double *const x = values(v, &v->array[A_POINTS], "Points", false, 3 * v->points);
    if (!x) return;
    for (size_t k = 0; k < 3 * v->points; k++)
        if (!isfinite(x[k]))
            scan_refuse(v->s, APSM_ERR_FORMAT,
                        "a coordinate of point %zu is not finite; export the mesh again", k / 3);
    soup_reserve_points(v->s, v->m, v->points);
    for (size_t p = 0; p < v->points && scan_ok(v->s); p++) soup_add_point(v->s, v->m, x + 3 * p);
    free(x);
}

/* n polygons, strips or lines: the ends of their corners, and the corners, counted from the first
 * point of the piece. */
static void add_cells(vtp *v, size_t n, int first, size_t base)
{
    int64_t *const end = n ? values(v, &v->array[first + 1], "offsets", true, n) : NULL;
    if (!end) return;
    for (size_t k = 0; k < n; k++)
        if (end[k] < (k ? end[k - 1] : 0) || (uint64_t)end[k] > 1032 * (uint64_t)v->s->size)
            scan_refuse(v->s, APSM_ERR_FORMAT,
                        "polygon %zu has no proper corners; export the mesh again", k);
    int64_t *const corner =
        scan_ok(v->s) ? values(v, &v->array[first], "connectivity", true, (size_t)end[n - 1])
                      : NULL;
    for (size_t k = 0; corner && k < n && scan_ok(v->s); k++) {
        const int64_t from = k ? end[k - 1] : 0;
        for (int64_t c = from; c < end[k]; c++) {
            if (corner[c] < 0 || (uint64_t)corner[c] >= v->points)
                scan_refuse(v->s, APSM_ERR_FORMAT,
                            "polygon %zu refers to a point that does not exist; export the mesh "
                            "again",
                            k);
            corner[c] = (int64_t)((uint64_t)corner[c] + base);
        }
        if (first == A_LINE_CORNERS)
            soup_add_line(v->s, v->m, corner + from, (size_t)(end[k] - from));
        else
            soup_add_cell(v->s, v->m, corner + from, (size_t)(end[k] - from),
                          first == A_STRIP_CORNERS);
    }
    free(corner);
    free(end);
}

/* The field of the piece's points, behind those before. */
static void add_field(vtp *v)
{
    double *const x = values(v, &v->array[A_FIELD], v->m->want_field, false, v->points);
    double *const all = x ? realloc(v->m->field, (v->m->fields + v->points) * sizeof *all) : NULL;
    if (x && !all) scan_no_memory(v->s);
    if (all) {
        memcpy(all + v->m->fields, x, v->points * sizeof *all);
        v->m->field = all;
        v->m->fields += v->points;
    }
    free(x);
}

static void close_piece(vtp *v)
{
    const size_t base = v->m->points;
    if (v->points) {
        add_points(v);
        if (scan_ok(v->s) && v->array[A_FIELD].there) add_field(v);
        if (scan_ok(v->s)) add_cells(v, v->polys, A_POLY_CORNERS, base);
        if (scan_ok(v->s)) add_cells(v, v->strips, A_STRIP_CORNERS, base);
        if (scan_ok(v->s) && v->m->want_lines) add_cells(v, v->lines, A_LINE_CORNERS, base);
    }
    for (int k = 0; k < ARRAYS; k++) {
        free(v->array[k].text.text);
        v->array[k] = (array){ 0 };
    }
}

/* ---- XML ---- */

static void stop_after_failure(vtp *v)
{
    if (!scan_ok(v->s)) XML_StopParser(v->parser, XML_FALSE);
}

static void on_start(void *user, const XML_Char *name, const XML_Char **attributes)
{
    static const char *const places[] = { "", "Points", "Polys", "Strips", "Lines", "PointData" };
    vtp *const v = user;
    if (!v->root && !xml_is(name, "VTKFile"))
        scan_refuse(v->s, APSM_ERR_FORMAT,
                    "is not a VTP file, whatever its name says; export it as poly data");
    if (xml_is(name, "VTKFile")) open_file(v, attributes);
    if (xml_is(name, "Piece")) {
        v->points = read_count(v, attributes, "NumberOfPoints");
        v->polys = read_count(v, attributes, "NumberOfPolys");
        v->strips = read_count(v, attributes, "NumberOfStrips");
        v->lines = read_count(v, attributes, "NumberOfLines");
        v->m->lines += v->lines;
    }
    for (int k = POINTS; k <= POINT_DATA; k++)
        if (xml_is(name, places[k])) v->place = (place)k;
    if (xml_is(name, "DataArray")) open_array(v, attributes);
    stop_after_failure(v);
}

static void on_end(void *user, const XML_Char *name)
{
    vtp *const v = user;
    if (xml_is(name, "DataArray")) v->open = NULL;
    if (xml_is(name, "Points") || xml_is(name, "Polys") || xml_is(name, "Strips") ||
        xml_is(name, "Lines") || xml_is(name, "PointData"))
        v->place = NOWHERE;
    if (xml_is(name, "Piece")) close_piece(v);
    stop_after_failure(v);
}

static void on_text(void *user, const XML_Char *text, int length)
{
    vtp *const v = user;
    array *const a = v->open;
    if (!a || !scan_ok(v->s)) return;
    xml_text_add(v->s, &a->text, text, (size_t)length);
    stop_after_failure(v);
}

/* No file of VTK declares a document type; one that does may only want to blow itself up. */
static void on_doctype(void *user, const XML_Char *name, const XML_Char *system,
                       const XML_Char *public_id, int internal)
{
    vtp *const v = user;
    (void)name, (void)system, (void)public_id, (void)internal;
    scan_refuse(v->s, APSM_ERR_FORMAT,
                "declares a document type, which VTP has not; export it "
                "again");
    stop_after_failure(v);
}

/* Where "<AppendedData" begins, and its data behind '_'; the end of the file if there is none. */
static size_t find_appended(vtp *v)
{
    static const char tag[] = "<AppendedData";
    const scan *const s = v->s;
    const size_t length = sizeof tag - 1;
    size_t at = s->at;
    v->appended = (vtp_source){ .at = s->bytes + s->size, .end = s->bytes + s->size };
    for (;; at++) {
        const char *const open = at < s->size ? memchr(s->bytes + at, '<', s->size - at) : NULL;
        if (!open || s->size - (size_t)(open - s->bytes) < length) return s->size;
        at = (size_t)(open - s->bytes);
        if (memcmp(open, tag, length) == 0) break;
    }
    const char *const start = s->bytes + at, *const end = s->bytes + s->size;
    const char *const close = memchr(start, '>', (size_t)(end - start));
    const char *const mark = close ? memchr(close, '_', (size_t)(end - close)) : NULL;
    for (const char *c = start; close && c + 6 < close; c++)
        v->appended.base64 = v->appended.base64 || memcmp(c, "base64", 6) == 0;
    if (mark) v->appended.at = mark + 1;
    return at;
}

static void parse(vtp *v)
{
    const size_t first = v->s->at, end = find_appended(v);
    const bool whole = end == v->s->size;
    if (xml_feed(v->parser, v->s->bytes + first, end - first, whole) == XML_STATUS_OK) return;
    if (scan_ok(v->s) && !v->root)
        scan_refuse(v->s, APSM_ERR_FORMAT,
                    "is not a VTP file, whatever its name says; export it as poly data");
    xml_refuse(v->s, v->parser);
}

void read_vtp(scan *s, soup *m)
{
    vtp v = { .s = s, .m = m, .parser = XML_ParserCreate(NULL) };
    if (!v.parser) {
        scan_no_memory(s);
        return;
    }
    XML_SetUserData(v.parser, &v);
    XML_SetElementHandler(v.parser, on_start, on_end);
    XML_SetCharacterDataHandler(v.parser, on_text);
    XML_SetStartDoctypeDeclHandler(v.parser, on_doctype);
    parse(&v);
    if (!v.root)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "is not a VTP file, whatever its name says; export it as poly data");
    for (int k = 0; k < ARRAYS; k++) free(v.array[k].text.text);
    XML_ParserFree(v.parser);
}
