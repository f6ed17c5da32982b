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

void vtk_skip_field(scan *s, const vtk_text *f)
{
    scan_word(s);
    const size_t arrays = scan_count(s, "a number of arrays", 8);
    for (size_t k = 0; k < arrays && scan_ok(s); k++) {
        scan_word(s);
        const size_t components = scan_count(s, "a number of components", 1);
        const size_t tuples = scan_count(s, "a number of tuples", 1);
        const scalar type = vtk_type(s, scan_word(s));
        if (components && tuples > scan_left(s) / components)
            scan_fail(s, "a field array that is larger than the file; export the mesh again");
        vtk_begin_values(s, f);
        if (!f->ascii) scan_bytes(s, components * tuples * scalar_size(type));
        for (size_t v = 0; f->ascii && v < components * tuples && scan_ok(s); v++)
            if (!scan_word(s).length) scan_expected(s, "a value", (word){ "", 0 });
        s->binary = false;
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
