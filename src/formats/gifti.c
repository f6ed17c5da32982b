/* GIFTI (.gii), XML with one array of points and one of triangles, through expat: as text, in
 * base64, packed or not.  Points are taken as right, anterior, superior and come out as LPS; the
 * matrices to other spaces that a file may hold are not applied. */
#include <math.h>

#include "formats/inflate.h"
#include "formats/soup.h"
#include "formats/vtp_data.h"
#include "formats/xml_parts.h"

typedef enum encoding { NO_ENCODING, TEXT, BASE64, PACKED64 } encoding;

typedef struct array {
    bool there, big_endian, by_columns;
    encoding encoding;
    scalar type;
    size_t n; /* rows of three */
    xml_text data;
} array;

enum { POINTS, CORNERS, ARRAYS };

typedef struct gifti {
    scan *s;
    XML_Parser parser;
    bool root, in_data;
    array array[ARRAYS], *open;
} gifti;

/* ---- attributes ---- */

static scalar type_of(gifti *g, const char *name)
{
    static const struct {
        const char *name;
        scalar type;
    } known[] = { { "NIFTI_TYPE_FLOAT32", SCALAR_F32 }, { "NIFTI_TYPE_FLOAT64", SCALAR_F64 },
                  { "NIFTI_TYPE_INT32", SCALAR_I32 },   { "NIFTI_TYPE_UINT32", SCALAR_U32 },
                  { "NIFTI_TYPE_INT64", SCALAR_I64 },   { "NIFTI_TYPE_UINT64", SCALAR_U64 },
                  { "NIFTI_TYPE_INT16", SCALAR_I16 },   { "NIFTI_TYPE_UINT16", SCALAR_U16 },
                  { "NIFTI_TYPE_INT8", SCALAR_I8 },     { "NIFTI_TYPE_UINT8", SCALAR_U8 } };
    char shown[WORD_SHOWN];
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (xml_is(name, known[k].name)) return known[k].type;
    scan_refuse(g->s, APSM_ERR_FORMAT, "'%s' is not a number type of GIFTI; export it again",
                word_show(xml_word(name), shown));
    return SCALAR_U8;
}

static encoding encoding_of(gifti *g, const char *name)
{
    char shown[WORD_SHOWN];
    if (xml_is(name, "ASCII")) return TEXT;
    if (xml_is(name, "Base64Binary")) return BASE64;
    if (xml_is(name, "GZipBase64Binary")) return PACKED64;
    scan_refuse(g->s, APSM_ERR_UNSUPPORTED,
                "its values are written as '%s', which is not read here; save it with "
                "GZipBase64Binary (`wb_command -gifti-convert GZIP_BASE64_BINARY IN OUT`)",
                word_show(xml_word(name), shown));
    return NO_ENCODING;
}

/* Rows of three; packed data grow at most 1032 times. */
static size_t rows_of(gifti *g, const char **attributes)
{
    int64_t rows = 0, columns = 0;
    const char *const first = xml_attribute(attributes, "Dim0"), *const second = xml_attribute(
                                                                     attributes, "Dim1");
    const bool good = word_integer(xml_word(first), &rows) &&
                      word_integer(xml_word(second), &columns) && columns == 3 && rows > 0;
    if (!good || (double)rows > 1032.0 * (double)g->s->size)
        scan_refuse(g->s, APSM_ERR_FORMAT,
                    "an array of points or triangles is not n x 3; it is damaged: copy or export "
                    "it again");
    return good ? (size_t)rows : 0;
}

static void open_array(gifti *g, const char **attributes)
{
    const char *const intent = xml_attribute(attributes, "Intent");
    array *const a = xml_is(intent, "NIFTI_INTENT_POINTSET")   ? &g->array[POINTS]
                     : xml_is(intent, "NIFTI_INTENT_TRIANGLE") ? &g->array[CORNERS]
                                                               : NULL;
    g->open = a;
    if (!a) return;
    if (a->there)
        scan_refuse(g->s, APSM_ERR_FORMAT,
                    "holds several surfaces; save each in a file of its "
                    "own");
    a->there = true;
    a->type = type_of(g, xml_attribute(attributes, "DataType"));
    a->encoding = encoding_of(g, xml_attribute(attributes, "Encoding"));
    a->big_endian = xml_is(xml_attribute(attributes, "Endian"), "BigEndian");
    a->by_columns = xml_is(xml_attribute(attributes, "ArrayIndexingOrder"), "ColumnMajorOrder");
    a->n = rows_of(g, attributes);
}

/* ---- values ---- */

static void refuse_short(scan *s)
{
    scan_refuse(
        s, APSM_ERR_FORMAT,
        "an array holds fewer values than it should; the file is damaged: copy or export it "
        "again");
}

/* The bytes of an array in base64, malloc'ed; NULL on failure, which is recorded. */
static unsigned char *bytes_of(scan *s, const array *a)
{
    const char *const text = a->data.text;
    vtp_source from = { .at = text, .end = text + a->data.length, .base64 = true };
    const size_t wanted = 3 * a->n * scalar_size(a->type), most = a->data.length / 4 * 3 + 3;
    const size_t held = a->encoding == BASE64 ? wanted : most;
    unsigned char *out = NULL, *const packed = held <= most ? malloc(held + 1) : NULL;
    size_t n = 0;
    if (!packed) {
        if (held <= most)
            scan_no_memory(s);
        else
            refuse_short(s);
        return NULL;
    }
    while (n < held && vtp_take(&from, 1, packed + n)) n++;
    if (a->encoding == BASE64 && n == wanted) return packed;
    const inflated result =
        a->encoding == BASE64 ? INFLATE_SHORT : inflate_bytes(packed, n, wanted, &out);
    free(packed);
    if (result == INFLATE_NO_MEMORY)
        scan_no_memory(s);
    else if (result != INFLATED)
        refuse_short(s);
    return out;
}

/* Value c of row k. */
static size_t place_of(const array *a, size_t k, size_t c)
{
    return a->by_columns ? k + a->n * c : 3 * k + c;
}

/* *out <- 3 n values, by rows, as doubles, which hold every index that can be. */
static double *values_of(scan *s, const array *a)
{
    const size_t size = scalar_size(a->type), n = 3 * a->n;
    if (a->encoding == TEXT && n > (a->data.length + 1) / 2) refuse_short(s);
    unsigned char *const bytes =
        scan_ok(s) && a->encoding != TEXT && a->data.text ? bytes_of(s, a) : NULL;
    if (scan_ok(s) && a->encoding != TEXT && !bytes) refuse_short(s);
    double *const x = scan_ok(s) ? malloc(n * sizeof *x) : NULL;
    scan text = scan_begin(s->ctx, s->path, a->data.text, a->data.length);
    if (!x) scan_no_memory(s);
    for (size_t k = 0; x && k < n && scan_ok(&text); k++)
        x[place_of(a, 0, 0) + k] = bytes ? scalar_real(a->type, bytes + k * size, a->big_endian)
                                         : scan_number(&text, "a number");
    if (scan_ok(s)) s->status = text.status;
    free(bytes);
    return x;
}

static void add_points(scan *s, soup *m, const array *a)
{
    static const double centre[3] = { 0, 0, 0 };
    double *const x = values_of(s, a);
    soup_reserve_points(s, m, a->n);
    for (size_t k = 0; k < a->n && scan_ok(s); k++) {
        const double p[3] = { x[place_of(a, k, 0)], x[place_of(a, k, 1)], x[place_of(a, k, 2)] };
        if (!isfinite(p[0]) || !isfinite(p[1]) || !isfinite(p[2]))
            scan_refuse(s, APSM_ERR_FORMAT,
                        "a coordinate of point %zu is not finite; export the mesh again", k);
        soup_add_point(s, m, p);
    }
    free(x);
    if (scan_ok(s)) soup_ras_to_lps(m, centre);
}

static void add_faces(scan *s, soup *m, const array *a)
{
    double *const x = values_of(s, a);
    soup_reserve_faces(s, m, a->n, 3 * a->n);
    for (size_t k = 0; k < a->n && scan_ok(s); k++) {
        for (size_t c = 0; c < 3; c++) {
            const double i = x[place_of(a, k, c)];
            soup_add_corner(s, m, i >= 0.0 && i < 4e9 ? (int64_t)i : -1, m->points);
        }
        soup_end_polygon(s, m);
    }
    free(x);
}

/* ---- XML ---- */

static void XMLCALL on_start(void *user, const XML_Char *name, const XML_Char **attributes)
{
    gifti *const g = user;
    if (!g->root && !xml_is(name, "GIFTI"))
        scan_refuse(g->s, APSM_ERR_FORMAT,
                    "is not a GIFTI file, whatever its name says; export it again");
    g->root = true;
    if (xml_is(name, "DataArray")) open_array(g, attributes);
    g->in_data = g->open && xml_is(name, "Data");
    if (!scan_ok(g->s)) XML_StopParser(g->parser, XML_FALSE);
}

static void XMLCALL on_end(void *user, const XML_Char *name)
{
    gifti *const g = user;
    g->in_data = false;
    if (xml_is(name, "DataArray")) g->open = NULL;
}

static void XMLCALL on_text(void *user, const XML_Char *text, int length)
{
    gifti *const g = user;
    if (!g->in_data || !scan_ok(g->s)) return;
    xml_text_add(g->s, &g->open->data, text, (size_t)length);
    if (!scan_ok(g->s)) XML_StopParser(g->parser, XML_FALSE);
}

/* GIFTI's own document type is named; entities within the file may only want to blow it up. */
static void XMLCALL on_doctype(void *user, const XML_Char *name, const XML_Char *system,
                               const XML_Char *public_id, int internal)
{
    gifti *const g = user;
    (void)name, (void)system, (void)public_id;
    if (!internal) return;
    scan_refuse(g->s, APSM_ERR_FORMAT,
                "declares a document type of its own, which GIFTI has not; export it again");
    XML_StopParser(g->parser, XML_FALSE);
}

static void parse(gifti *g)
{
    scan *const s = g->s;
    XML_SetUserData(g->parser, g);
    XML_SetElementHandler(g->parser, on_start, on_end);
    XML_SetCharacterDataHandler(g->parser, on_text);
    XML_SetStartDoctypeDeclHandler(g->parser, on_doctype);
    if (xml_feed(g->parser, s->bytes + s->at, scan_left(s), true) != XML_STATUS_OK)
        xml_refuse(s, g->parser);
}

void read_gifti(scan *s, soup *m)
{
    gifti g = { .s = s, .parser = XML_ParserCreate(NULL) };
    const array *const points = &g.array[POINTS], *const corners = &g.array[CORNERS];
    if (!g.parser) {
        scan_no_memory(s);
        return;
    }
    parse(&g);
    if (!points->there)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "has no points: labels or values on a surface? give the surface (.surf.gii)");
    if (scan_ok(s)) add_points(s, m, points);
    if (scan_ok(s) && corners->there) add_faces(s, m, corners);
    for (int k = 0; k < ARRAYS; k++) free(g.array[k].data.text);
    XML_ParserFree(g.parser);
}
