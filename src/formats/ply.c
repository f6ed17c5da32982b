/* PLY (Turk 1994), ASCII and binary.  Elements may come in any order and hold anything beside x, y,
 * z and the list of corners; what is not needed is passed over, and what follows the last needed
 * element is not looked at (Amira puts materials there). */
#include <math.h>
#include <stdlib.h>

#include "formats/soup.h"

enum { MOST_ELEMENTS = 32, MOST_PROPERTIES = 256, NO_PROPERTY = -1 };

typedef struct property {
    word name;
    bool list;
    scalar length, type;
} property;

typedef struct element {
    word name;
    size_t count, line; /* line of its declaration */
    int first, end;     /* its properties */
} element;

typedef enum encoding { ASCII, LITTLE, BIG } encoding;

typedef struct header {
    encoding format;
    int elements, properties;
    element element[MOST_ELEMENTS];
    property property[MOST_PROPERTIES];
} header;

/* ---- the header ---- */

static scalar read_type(scan *s, word name)
{
    static const struct {
        const char *names[2];
        scalar type;
    } known[] = { { { "char", "int8" }, SCALAR_I8 },      { { "uchar", "uint8" }, SCALAR_U8 },
                  { { "short", "int16" }, SCALAR_I16 },   { { "ushort", "uint16" }, SCALAR_U16 },
                  { { "int", "int32" }, SCALAR_I32 },     { { "uint", "uint32" }, SCALAR_U32 },
                  { { "float", "float32" }, SCALAR_F32 }, { { "double", "float64" }, SCALAR_F64 } };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (word_is(name, known[k].names[0]) || word_is(name, known[k].names[1]))
            return known[k].type;
    scan_expected(s, "a type of PLY", name);
    return SCALAR_U8;
}

static encoding read_format(scan *s)
{
    const word name = scan_word_in_line(s);
    if (word_is(name, "ascii")) return ASCII;
    if (word_is(name, "binary_little_endian")) return LITTLE;
    if (!word_is(name, "binary_big_endian"))
        scan_expected(s, "ascii, binary_little_endian or binary_big_endian", name);
    return BIG;
}

static void read_element(scan *s, header *h)
{
    if (h->elements == MOST_ELEMENTS) {
        scan_fail(s, "more than %d elements; export the mesh again", MOST_ELEMENTS);
        return;
    }
    element *const e = &h->element[h->elements++];
    e->name = scan_word_in_line(s);
    e->line = s->line;
    e->first = e->end = h->properties;
    e->count = scan_count(s, "a number of elements", 1);
}

static void read_property(scan *s, header *h)
{
    if (h->elements == 0 || h->properties == MOST_PROPERTIES) {
        scan_fail(s, "%s; export the mesh again",
                  h->elements ? "too many properties" : "a property without element");
        return;
    }
    property *const p = &h->property[h->properties++];
    word type = scan_word_in_line(s);
    p->list = word_is(type, "list");
    if (p->list) {
        p->length = read_type(s, scan_word_in_line(s));
        if (scalar_is_real(p->length))
            scan_fail(s, "the length of a list is not an integer; export the mesh again");
        type = scan_word_in_line(s);
    }
    p->type = read_type(s, type);
    p->name = scan_word_in_line(s);
    if (!p->name.length) scan_fail(s, "a property without name; export the mesh again");
    h->element[h->elements - 1].end = h->properties;
}

static void read_header(scan *s, header *h)
{
    bool has_format = false;
    if (!word_is(scan_word(s), "ply")) {
        scan_refuse(s, APSM_ERR_FORMAT,
                    "does not begin with 'ply': not a PLY file, whatever its name says");
        return;
    }
    for (scan_rest_of_line(s); scan_ok(s); scan_rest_of_line(s)) {
        const word w = scan_word(s);
        if (word_is(w, "format")) {
            h->format = read_format(s);
            has_format = true;
        } else if (word_is(w, "element")) {
            read_element(s, h);
        } else if (word_is(w, "property")) {
            read_property(s, h);
        } else if (word_is(w, "end_header")) {
            scan_rest_of_line(s);
            break;
        } else if (!word_is(w, "comment") && !word_is(w, "obj_info")) {
            scan_expected(s, "a line of a PLY header", w);
        }
    }
    if (!has_format) scan_fail(s, "the header has no format line; export the mesh again");
}

static int find_property(const header *h, const element *e, const char *name)
{
    for (int k = e->first; k < e->end; k++)
        if (word_is(h->property[k].name, name)) return k;
    return NO_PROPERTY;
}

/* ---- values ---- */

static double read_real(scan *s, scalar type, encoding format)
{
    return format == ASCII ? scan_number(s, "a coordinate") : scan_real(s, type, format == BIG);
}

static int64_t read_integer(scan *s, scalar type, encoding format, const char *what)
{
    return format == ASCII ? scan_integer(s, what) : scan_whole(s, type, format == BIG);
}

static size_t read_length(scan *s, const property *p, encoding format)
{
    return scan_check_count(s, read_integer(s, p->length, format, "a list length"), "a list length",
                            format == ASCII ? 2 : scalar_size(p->type));
}

static void skip_property(scan *s, const property *p, encoding format)
{
    const size_t n = p->list ? read_length(s, p, format) : 1;
    if (format != ASCII) {
        scan_bytes(s, n * scalar_size(p->type));
        return;
    }
    for (size_t k = 0; k < n && scan_ok(s); k++) {
        const word w = scan_word(s);
        if (!w.length) scan_expected(s, "a value", w);
    }
}

/* ---- elements ---- */

static void read_vertices(scan *s, const header *h, const element *e, soup *m)
{
    static const char *const axis[3] = { "x", "y", "z" };
    int which[3];
    for (int c = 0; c < 3; c++) {
        which[c] = find_property(h, e, axis[c]);
        if (which[c] == NO_PROPERTY || h->property[which[c]].list)
            scan_refuse(s, APSM_ERR_FORMAT,
                        "line %zu: vertices have no property %s; export the mesh again", e->line,
                        axis[c]);
    }
    soup_reserve_points(s, m, e->count);
    for (size_t v = 0; v < e->count && scan_ok(s); v++) {
        double x[3] = { 0, 0, 0 };
        for (int k = e->first; k < e->end; k++) {
            const int c = k == which[0] ? 0 : k == which[1] ? 1 : k == which[2] ? 2 : -1;
            if (c < 0) {
                skip_property(s, &h->property[k], h->format);
                continue;
            }
            x[c] = read_real(s, h->property[k].type, h->format);
            if (!isfinite(x[c]))
                scan_fail(s, "a coordinate of vertex %zu is not finite; export the mesh again", v);
        }
        soup_add_point(s, m, x);
    }
}

static void read_faces(scan *s, const header *h, const element *e, size_t points, soup *m)
{
    int corners = find_property(h, e, "vertex_indices");
    if (corners == NO_PROPERTY) corners = find_property(h, e, "vertex_index");
    if (corners == NO_PROPERTY || !h->property[corners].list ||
        scalar_is_real(h->property[corners].type)) {
        scan_refuse(
            s, APSM_ERR_FORMAT,
            "line %zu: faces have no list of integers vertex_indices; export the mesh again",
            e->line);
        return;
    }
    soup_reserve_faces(s, m, e->count, e->count);
    for (size_t f = 0; f < e->count && scan_ok(s); f++)
        for (int k = e->first; k < e->end; k++) {
            const property *const p = &h->property[k];
            if (k != corners) {
                skip_property(s, p, h->format);
                continue;
            }
            const size_t n = read_length(s, p, h->format);
            for (size_t c = 0; c < n && scan_ok(s); c++)
                soup_add_corner(s, m, read_integer(s, p->type, h->format, "a point's number"),
                                points);
            soup_end_polygon(s, m);
        }
}

/* At least so many bytes are needed by each of the element; 1 for one without properties. */
static size_t least_size(const header *h, const element *e)
{
    size_t size = 0;
    for (int k = e->first; k < e->end; k++) {
        const property *const p = &h->property[k];
        size += h->format == ASCII ? 2 : scalar_size(p->list ? p->length : p->type);
    }
    return size ? size : 1;
}

static void skip_element(scan *s, const header *h, const element *e)
{
    for (size_t i = 0; i < e->count && e->end > e->first && scan_ok(s); i++)
        for (int k = e->first; k < e->end; k++) skip_property(s, &h->property[k], h->format);
}

static void read_elements(scan *s, const header *h, soup *m)
{
    const element *vertices = NULL, *faces = NULL;
    for (int k = h->elements - 1; k >= 0; k--) {
        if (word_is(h->element[k].name, "vertex")) vertices = &h->element[k];
        if (word_is(h->element[k].name, "face")) faces = &h->element[k];
        m->lines += word_is(h->element[k].name, "edge") ? h->element[k].count : 0;
        if (word_is(h->element[k].name, "tristrips") && h->element[k].count)
            scan_refuse(s, APSM_ERR_FORMAT,
                        "has strips of triangles, which are not read; save it with faces (MeshLab "
                        "does)");
    }
    if (!vertices) scan_refuse(s, APSM_ERR_FORMAT, "has no element vertex; export it as a surface");
    const element *const last = faces > vertices ? faces : vertices;
    for (const element *e = h->element; scan_ok(s) && e <= last; e++) {
        if (scan_check_count(s, (int64_t)e->count, "number of elements", least_size(h, e)) == 0)
            continue;
        if (e == vertices)
            read_vertices(s, h, e, m);
        else if (e == faces)
            read_faces(s, h, e, vertices->count, m);
        else
            skip_element(s, h, e);
    }
}

void read_ply(scan *s, soup *m)
{
    header h = { .format = ASCII };
    read_header(s, &h);
    if (h.format != ASCII) s->binary = true;
    if (scan_ok(s)) read_elements(s, &h, m);
}

/* ---- a field of the vertices ---- */

static void take_field(scan *s, const header *h, const element *e, int which, double *value)
{
    for (size_t v = 0; v < e->count && scan_ok(s); v++)
        for (int k = e->first; k < e->end; k++)
            if (k != which)
                skip_property(s, &h->property[k], h->format);
            else
                value[v] = read_real(s, h->property[k].type, h->format);
}

double *read_ply_field(scan *s, const char *name, size_t *n)
{
    header h = { .format = ASCII };
    const element *e = h.element;
    double *value = NULL;
    *n = 0;
    read_header(s, &h);
    if (h.format != ASCII) s->binary = true;
    for (int k = 0; scan_ok(s) && k < h.elements && !word_is(e->name, "vertex"); k++, e++)
        skip_element(s, &h, e);
    const int which = e < h.element + h.elements ? find_property(&h, e, name) : NO_PROPERTY;
    if (!scan_ok(s) || which == NO_PROPERTY || h.property[which].list) return NULL;
    if (scan_check_count(s, (int64_t)e->count, "number of elements", least_size(&h, e)) > 0)
        value = malloc(e->count * sizeof *value);
    if (!value) return scan_no_memory(s), NULL;
    take_field(s, &h, e, which, value);
    *n = e->count;
    return value;
}
