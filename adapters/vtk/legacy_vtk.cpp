/* VTK's own old format, versions 1 to 5.1, DATASET POLYDATA: points, polygons and triangle
 * strips.  Attributes come last and are not looked at.  Binary values are big-endian. */
#include <limits>

#include "cursor.h"
#include "soup.h"

namespace apsm
{
namespace
{

enum class kind { i8, u8, i16, u16, i32, u32, i64, u64, f32, f64, bit, text };

struct file {
    cursor c;
    bool ascii = true;
    bool offsets = false; /* version 5: cells as OFFSETS and CONNECTIVITY */
    soup s;
};

kind kind_named(const cursor &c, std::string_view name)
{
    const struct {
        const char *name;
        kind type;
    } known[] = { { "char", kind::i8 },
                  { "signed_char", kind::i8 },
                  { "unsigned_char", kind::u8 },
                  { "short", kind::i16 },
                  { "unsigned_short", kind::u16 },
                  { "int", kind::i32 },
                  { "vtkIdType", kind::i32 }, /* written as int */
                  { "unsigned_int", kind::u32 },
                  { "long", kind::i64 },
                  { "vtktypeint64", kind::i64 },
                  { "unsigned_long", kind::u64 },
                  { "vtktypeuint64", kind::u64 },
                  { "float", kind::f32 },
                  { "double", kind::f64 },
                  { "bit", kind::bit },
                  { "string", kind::text } };
    for (const auto &k : known)
        if (name == k.name) return k.type;
    c.fail(c.expected("a VTK type", name));
}

size_t size_of(kind type)
{
    switch (type) {
    case kind::i16:
    case kind::u16:
        return 2;
    case kind::i32:
    case kind::u32:
    case kind::f32:
        return 4;
    case kind::i64:
    case kind::u64:
    case kind::f64:
        return 8;
    default:
        return 1;
    }
}

template <class T> T read_value(file *f, kind type)
{
    if (f->ascii) {
        if constexpr (std::is_floating_point_v<T>)
            return f->c.number("a number");
        else
            return f->c.integer("an integer");
    }
    switch (type) {
    case kind::i8:
        return static_cast<T>(f->c.value<int8_t>(true));
    case kind::u8:
        return static_cast<T>(f->c.value<uint8_t>(true));
    case kind::i16:
        return static_cast<T>(f->c.value<int16_t>(true));
    case kind::u16:
        return static_cast<T>(f->c.value<uint16_t>(true));
    case kind::i32:
        return static_cast<T>(f->c.value<int32_t>(true));
    case kind::u32:
        return static_cast<T>(f->c.value<uint32_t>(true));
    case kind::i64:
        return static_cast<T>(f->c.value<int64_t>(true));
    case kind::u64:
        return static_cast<T>(f->c.value<uint64_t>(true));
    case kind::f64:
        if constexpr (std::is_floating_point_v<T>) return f->c.value<double>(true);
        break;
    case kind::f32:
        if constexpr (std::is_floating_point_v<T>) return static_cast<T>(f->c.value<float>(true));
        break;
    default:
        break;
    }
    f->c.fail("values of this type are not expected here; export the mesh again");
}

/* The line with the section's keyword ends; in a binary file values follow at once. */
void begin_values(file *f)
{
    f->c.rest_of_line();
    if (!f->ascii) f->c.begin_binary();
}

void read_points(file *f)
{
    const long long n = f->c.integer("a number of points");
    const kind type = kind_named(f->c, f->c.word());
    begin_values(f);
    const size_t count =
        f->c.checked_count(n, "number of points", 3 * (f->ascii ? 2 : size_of(type)));
    f->s.point.resize(3 * count);
    for (double &x : f->s.point) {
        x = read_value<double>(f, type);
        if (!std::isfinite(x)) f->c.fail("a coordinate is not finite; export the mesh again");
    }
    f->c.end_binary();
}

std::vector<long long> read_integers(file *f, long long n, kind type)
{
    const size_t count = f->c.checked_count(n, "number of values", f->ascii ? 2 : size_of(type));
    std::vector<long long> values(count);
    for (long long &v : values) v = read_value<long long>(f, type);
    f->c.end_binary();
    return values;
}

/* Cells as lists of corners: corner[start[k]] .. corner[start[k+1]-1]. */
struct cells {
    std::vector<long long> start, corner;
};

void expect(file *f, const char *wanted)
{
    const std::string_view found = f->c.word();
    if (found != wanted) f->c.fail(f->c.expected(("'" + std::string(wanted) + "'").c_str(), found));
}

cells read_cells(file *f)
{
    const long long n = f->c.integer("a number of cells");
    const long long size = f->c.integer("a number of values");
    cells all;
    if (f->offsets) {
        for (std::vector<long long> *values : { &all.start, &all.corner }) {
            expect(f, values == &all.start ? "OFFSETS" : "CONNECTIVITY");
            const kind type = kind_named(f->c, f->c.word());
            begin_values(f);
            *values = read_integers(f, values == &all.start ? n : size, type);
        }
        return all;
    }
    begin_values(f);
    const std::vector<long long> values = read_integers(f, size, kind::i32);
    all.start.push_back(0);
    for (size_t at = 0; at < values.size();) {
        const long long corners = values[at++];
        if (corners < 0 || static_cast<unsigned long long>(corners) > values.size() - at)
            f->c.fail("a cell has " + std::to_string(corners) +
                      " corners, more than its section holds; export the mesh again");
        for (long long k = 0; k < corners; k++) all.corner.push_back(values[at++]);
        all.start.push_back(static_cast<long long>(all.corner.size()));
    }
    if (static_cast<long long>(all.start.size()) != n + 1)
        f->c.fail("a section of " + std::to_string(n) + " cells holds " +
                  std::to_string(all.start.size() - 1) + "; export the mesh again");
    return all;
}

/* A strip p0 p1 p2 p3 .. is the triangles (p0 p1 p2), (p2 p1 p3), (p2 p3 p4), .. */
void add_strip(const cursor &c, const long long *p, size_t n, soup *s)
{
    for (size_t k = 0; k + 2 < n; k++) {
        const size_t odd = k % 2;
        for (const long long index : { p[k + odd], p[k + 1 - odd], p[k + 2] })
            s->corner.push_back(checked_corner(c, index, s->points()));
        s->close_polygon();
    }
}

void add_cells(file *f, const cells &all, bool strips)
{
    for (size_t k = 0; k + 1 < all.start.size(); k++) {
        const long long a = all.start[k], b = all.start[k + 1];
        if (a < 0 || b < a || static_cast<size_t>(b) > all.corner.size())
            f->c.fail("the offsets of the cells do not ascend; export the mesh again");
        if (b - a < 3)
            f->c.fail("cell " + std::to_string(k) + " has " + std::to_string(b - a) +
                      " corners; export the mesh again");
        const long long *const p = all.corner.data() + a;
        if (strips) {
            add_strip(f->c, p, static_cast<size_t>(b - a), &f->s);
            continue;
        }
        for (long long j = 0; j < b - a; j++)
            f->s.corner.push_back(checked_corner(f->c, p[j], f->s.points()));
        f->s.close_polygon();
    }
}

/* FIELD name n, then n arrays: name components tuples type, values. */
void skip_field(file *f)
{
    f->c.word();
    const size_t arrays = f->c.count("a number of arrays", 8);
    for (size_t k = 0; k < arrays; k++) {
        f->c.word();
        const size_t components = f->c.count("a number of components", 1);
        const size_t tuples = f->c.count("a number of tuples", 1);
        const kind type = kind_named(f->c, f->c.word());
        if (type == kind::bit || type == kind::text ||
            (components && tuples > f->c.left() / components))
            f->c.fail("a field array that cannot be read here; save the mesh as PLY");
        begin_values(f);
        if (f->ascii)
            for (size_t v = 0; v < components * tuples; v++) f->c.number("a number");
        else
            f->c.skip(components * tuples * size_of(type));
        f->c.end_binary();
    }
}

/* Ends with an empty line. */
void skip_metadata(file *f)
{
    f->c.rest_of_line();
    while (f->c.left() && !f->c.rest_of_line().empty()) {
    }
}

void read_header(file *f)
{
    const std::string_view first = f->c.rest_of_line(), key = "# vtk DataFile Version ";
    double version = 0.0;
    if (first.substr(0, key.size()) != key ||
        !cursor::parse(first.substr(key.size(), first.find_last_not_of(' ') + 1 - key.size()),
                       &version))
        damaged("does not begin with '# vtk DataFile Version': not a legacy VTK file");
    f->offsets = version >= 5.0;
    f->c.rest_of_line();
    const std::string_view encoding = f->c.word();
    if (encoding != "ASCII" && encoding != "BINARY")
        f->c.fail(f->c.expected("ASCII or BINARY", encoding));
    f->ascii = encoding == "ASCII";
    expect(f, "DATASET");
    const std::string_view set = f->c.word();
    if (set != "POLYDATA")
        f->c.fail("the file holds " + one_line(std::string(set.substr(0, 40))) +
                  ", not POLYDATA; extract the surface and save it as poly data");
}

} // namespace

soup read_legacy_vtk(std::string_view bytes)
{
    file f{ cursor(bytes), true, false, {} };
    read_header(&f);
    while (f.c.skip_blanks()) {
        const std::string_view section = f.c.word();
        if (section == "POINTS")
            read_points(&f);
        else if (section == "POLYGONS")
            add_cells(&f, read_cells(&f), false);
        else if (section == "TRIANGLE_STRIPS")
            add_cells(&f, read_cells(&f), true);
        else if (section == "VERTICES" || section == "LINES")
            read_cells(&f);
        else if (section == "FIELD")
            skip_field(&f);
        else if (section == "METADATA")
            skip_metadata(&f);
        else if (section == "CELL_DATA" || section == "POINT_DATA")
            break;
        else
            f.c.fail(f.c.expected("a section of a VTK file", section));
    }
    return std::move(f.s);
}

} // namespace apsm
