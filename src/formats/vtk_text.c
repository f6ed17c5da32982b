#include "formats/vtk_text.h"

#include <string.h>

scalar vtk_type(scan *s, word name)
{
    static const struct {
        const char *name;
        scalar type;
    } known[] = { { "char", SCALAR_I8 },
                  { "signed_char", SCALAR_I8 },
                  { "unsigned_char", SCALAR_U8 },
                  { "short", SCALAR_I16 },
                  { "unsigned_short", SCALAR_U16 },
                  { "int", SCALAR_I32 },
                  { "vtkIdType", SCALAR_I32 }, /* written as int */
                  { "unsigned_int", SCALAR_U32 },
                  { "long", SCALAR_I64 },
                  { "vtktypeint64", SCALAR_I64 },
                  { "unsigned_long", SCALAR_U64 },
                  { "vtktypeuint64", SCALAR_U64 },
                  { "float", SCALAR_F32 },
                  { "double", SCALAR_F64 } };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (word_is_any_case(name, known[k].name)) return known[k].type;
    scan_expected(s, "a number type of VTK", name);
    return SCALAR_U8;
}

size_t vtk_least_size(const vtk_text *f, scalar type)
{
    return f->ascii ? 2 : scalar_size(type);
}

void vtk_begin_values(scan *s, const vtk_text *f)
{
    scan_rest_of_line(s);
    s->binary = !f->ascii;
}

vtk_array vtk_read_array(scan *s)
{
    vtk_array a = { .name = scan_word(s) };
    a.components = scan_count(s, "a number of components", 1);
    a.tuples = scan_count(s, "a number of tuples", 1);
    a.type = vtk_type(s, scan_word(s));
    return a;
}

vtk_array vtk_read_attribute(scan *s, size_t components, size_t tuples)
{
    const bool scalars = components == 1;
    int64_t given = (int64_t)components;
    vtk_array a = { .name = scan_word(s), .tuples = tuples };
    a.type = vtk_type(s, scan_word(s));
    const word more = scalars ? scan_word_in_line(s) : (word){ "", 0 };
    if (more.length && (!word_integer(more, &given) || given < 1 || given > 4))
        scan_expected(s, "a number of components", more);
    a.components = (size_t)given;
    if (scalars) {
        scan_rest_of_line(s);
        scan_expect(s, "LOOKUP_TABLE");
    }
    return a;
}

static void skip_values(scan *s, const vtk_text *f, vtk_array a)
{
    if (a.components && a.tuples > scan_left(s) / a.components)
        scan_fail(s, "an array that is larger than the file; export it again");
    vtk_begin_values(s, f);
    if (!f->ascii) scan_bytes(s, a.components * a.tuples * scalar_size(a.type));
    for (size_t v = 0; f->ascii && v < a.components * a.tuples && scan_ok(s); v++)
        if (!scan_word(s).length) scan_expected(s, "a value", (word){ "", 0 });
    s->binary = false;
}

void vtk_skip_field(scan *s, const vtk_text *f)
{
    scan_word(s);
    const size_t arrays = scan_count(s, "a number of arrays", 8);
    for (size_t k = 0; k < arrays && scan_ok(s); k++) skip_values(s, f, vtk_read_array(s));
}

void vtk_skip_cell_data(scan *s, const vtk_text *f)
{
    static const struct {
        const char *kind;
        size_t components;
    } known[] = { { "SCALARS", 1 }, { "VECTORS", 3 }, { "NORMALS", 3 }, { "TENSORS", 9 } };
    enum { KNOWN = sizeof known / sizeof *known };
    const size_t cells = scan_count(s, "a number of cells", 1);
    while (scan_skip_blanks(s, true)) {
        const scan before = *s;
        const word kind = scan_word(s);
        size_t k = 0;
        while (k < KNOWN && !word_is_any_case(kind, known[k].kind)) k++;
        if (k < KNOWN)
            skip_values(s, f, vtk_read_attribute(s, known[k].components, cells));
        else if (word_is_any_case(kind, "FIELD"))
            vtk_skip_field(s, f);
        else if (word_is_any_case(kind, "METADATA"))
            vtk_skip_metadata(s);
        else if (word_is_any_case(kind, "POINT_DATA")) {
            *s = before;
            return;
        } else
            scan_fail(s, "its cell data come first, and are not known here; save it with point "
                         "data alone");
    }
}

void vtk_skip_metadata(scan *s)
{
    scan_rest_of_line(s);
    while (scan_ok(s) && scan_left(s) && scan_rest_of_line(s).length) {
    }
}

void vtk_read_header(scan *s, vtk_text *f, word *set)
{
    static const char key[] = "# vtk DataFile Version ";
    const word first = scan_rest_of_line(s);
    double version = 0.0;
    word number = { first.text + sizeof key - 1, 0 };
    if (first.length > sizeof key - 1 && memcmp(first.text, key, sizeof key - 1) == 0)
        while (sizeof key - 1 + number.length < first.length && number.text[number.length] != ' ')
            number.length++;
    if (!number.length || !word_number(number, &version)) {
        scan_refuse(s, APSM_ERR_FORMAT,
                    "does not begin with '# vtk DataFile Version': not a legacy VTK file");
        return;
    }
    f->offsets = version >= 5.0;
    scan_rest_of_line(s);
    const word encoding = scan_word(s);
    f->ascii = word_is_any_case(encoding, "ASCII");
    if (!f->ascii && !word_is_any_case(encoding, "BINARY"))
        scan_expected(s, "ASCII or BINARY", encoding);
    scan_expect(s, "DATASET");
    *set = scan_word(s);
}
