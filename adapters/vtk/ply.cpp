/* PLY (Turk 1994), ASCII and binary.  Elements may come in any order and hold anything beside x, y,
 * z and the list of corners; what is not needed is passed over, and what follows the last needed
 * element is not looked at (Amira puts materials there). */
#include <array>
#include <cstdint>

#include "cursor.h"
#include "soup.h"

namespace apsm
{
namespace
{

enum class scalar { i8, u8, i16, u16, i32, u32, f32, f64 };

struct property {
    std::string name;
    bool list;
    scalar length, type;
};

struct element {
    std::string name;
    size_t count;
    size_t line; /* of its declaration */
    std::vector<property> properties;

    const property *find(const char *wanted) const
    {
        for (const property &p : properties)
            if (p.name == wanted) return &p;
        return nullptr;
    }
};

enum class encoding { ascii, little, big };

struct header {
    encoding format;
    std::vector<element> elements;
};

size_t size_of(scalar type)
{
    return std::array<size_t, 8>{ 1, 1, 2, 2, 4, 4, 4, 8 }[static_cast<size_t>(type)];
}

scalar type_named(const cursor &c, std::string_view name)
{
    const struct {
        const char *names[2];
        scalar type;
    } known[] = {
        { { "char", "int8" }, scalar::i8 },      { { "uchar", "uint8" }, scalar::u8 },
        { { "short", "int16" }, scalar::i16 },   { { "ushort", "uint16" }, scalar::u16 },
        { { "int", "int32" }, scalar::i32 },     { { "uint", "uint32" }, scalar::u32 },
        { { "float", "float32" }, scalar::f32 }, { { "double", "float64" }, scalar::f64 }
    };
    for (const auto &k : known)
        if (name == k.names[0] || name == k.names[1]) return k.type;
    c.fail("'" + one_line(std::string(name.substr(0, 40))) +
           "' is not a type of PLY; export the mesh again");
}

encoding read_format(cursor *c)
{
    const std::string_view name = c->word(false);
    if (name == "ascii") return encoding::ascii;
    if (name == "binary_little_endian") return encoding::little;
    if (name == "binary_big_endian") return encoding::big;
    c->fail(c->expected("ascii, binary_little_endian or binary_big_endian", name));
}

property read_property(cursor *c)
{
    property p{};
    std::string_view word = c->word(false);
    p.list = word == "list";
    if (p.list) {
        p.length = type_named(*c, c->word(false));
        if (p.length == scalar::f32 || p.length == scalar::f64)
            c->fail("the length of a list is not an integer; export the mesh again");
        word = c->word(false);
    }
    p.type = type_named(*c, word);
    p.name = c->word(false);
    if (p.name.empty()) c->fail("a property without name; export the mesh again");
    return p;
}

header read_header(cursor *c)
{
    header h{ encoding::ascii, {} };
    bool has_format = false;
    if (c->rest_of_line() != "ply")
        damaged("does not begin with 'ply': not a PLY file, whatever its name says");
    for (;;) {
        const std::string_view word = c->word();
        if (word == "format") {
            h.format = read_format(c);
            has_format = true;
        } else if (word == "element") {
            const std::string name(c->word(false));
            h.elements.push_back({ name, c->count("a number of elements", 1), c->line(), {} });
        } else if (word == "property") {
            if (h.elements.empty()) c->fail("a property without element; export the mesh again");
            h.elements.back().properties.push_back(read_property(c));
        } else if (word == "end_header") {
            c->rest_of_line();
            if (!has_format) c->fail("the header has no format line; export the mesh again");
            return h;
        } else if (word != "comment" && word != "obj_info") {
            c->fail(c->expected("a line of a PLY header", word));
        }
        c->rest_of_line();
    }
}

double read_scalar(cursor *c, scalar type, encoding format)
{
    if (format == encoding::ascii) return c->number("a number");
    const bool big = format == encoding::big;
    switch (type) {
    case scalar::i8:
        return c->value<int8_t>(big);
    case scalar::u8:
        return c->value<uint8_t>(big);
    case scalar::i16:
        return c->value<int16_t>(big);
    case scalar::u16:
        return c->value<uint16_t>(big);
    case scalar::i32:
        return c->value<int32_t>(big);
    case scalar::u32:
        return c->value<uint32_t>(big);
    case scalar::f32:
        return static_cast<double>(c->value<float>(big));
    default:
        return c->value<double>(big);
    }
}

long long read_integer(cursor *c, scalar type, encoding format, const char *what)
{
    if (format == encoding::ascii) return c->integer(what);
    return static_cast<long long>(read_scalar(c, type, format));
}

size_t read_length(cursor *c, const property &p, encoding format)
{
    return c->checked_count(read_integer(c, p.length, format, "a list length"), "a list length",
                            format == encoding::ascii ? 2 : size_of(p.type));
}

void skip_property(cursor *c, const property &p, encoding format)
{
    const size_t n = p.list ? read_length(c, p, format) : 1;
    if (format != encoding::ascii) return c->skip(n * size_of(p.type));
    for (size_t k = 0; k < n; k++)
        if (c->word().empty()) c->fail(c->expected("a value", {}));
}

void read_vertices(cursor *c, const element &e, encoding format, soup *s)
{
    const char *const axis[3] = { "x", "y", "z" };
    std::vector<int> slot; /* which coordinate each property is; -1: none */
    for (const property &p : e.properties) {
        slot.push_back(-1);
        for (int k = 0; k < 3; k++)
            if (p.name == axis[k] && !p.list) slot.back() = k;
    }
    for (const char *name : axis)
        if (!e.find(name) || e.find(name)->list)
            damaged("line " + std::to_string(e.line) + ": vertices have no property " + name +
                    "; export the mesh again");
    s->point.resize(3 * e.count);
    for (size_t v = 0; v < e.count; v++)
        for (size_t k = 0; k < slot.size(); k++) {
            if (slot[k] < 0) {
                skip_property(c, e.properties[k], format);
                continue;
            }
            const double x = read_scalar(c, e.properties[k].type, format);
            if (!std::isfinite(x))
                c->fail("a coordinate of vertex " + std::to_string(v) +
                        " is not finite; export the mesh again");
            s->point[3 * v + static_cast<size_t>(slot[k])] = x;
        }
}

void read_faces(cursor *c, const element &e, encoding format, size_t points, soup *s)
{
    const property *corners = e.find("vertex_indices");
    if (!corners) corners = e.find("vertex_index");
    if (!corners || !corners->list || corners->type == scalar::f32 || corners->type == scalar::f64)
        damaged("line " + std::to_string(e.line) +
                ": faces have no list of integers vertex_indices; export the mesh again");
    for (size_t f = 0; f < e.count; f++) {
        for (const property &p : e.properties) {
            if (&p != corners) {
                skip_property(c, p, format);
                continue;
            }
            const size_t n = read_length(c, p, format);
            if (n < 3)
                c->fail("face " + std::to_string(f) + " has " + std::to_string(n) +
                        " corners; export the mesh again");
            for (size_t k = 0; k < n; k++)
                s->corner.push_back(checked_corner(
                    *c, read_integer(c, p.type, format, "a point's number"), points));
        }
        s->close_polygon();
    }
}

/* At least so many bytes are needed by each of the element. */
size_t least_size(const element &e, encoding format)
{
    size_t size = 0;
    for (const property &p : e.properties)
        size += format == encoding::ascii ? 2 : size_of(p.list ? p.length : p.type);
    return size;
}

} // namespace

soup read_ply(std::string_view bytes)
{
    cursor c(bytes);
    const header h = read_header(&c);
    if (h.format != encoding::ascii) c.begin_binary();
    soup s;
    size_t points = 0;
    bool vertices = false, faces = false;
    for (const element &e : h.elements)
        if (e.name == "vertex") points = e.count;
    for (const element &e : h.elements) {
        if (vertices && faces) break;
        if (e.properties.empty()) continue;
        c.checked_count(static_cast<long long>(e.count),
                        ("number of " + e.name + " elements").c_str(), least_size(e, h.format));
        if (e.name == "vertex" && !vertices) {
            read_vertices(&c, e, h.format, &s);
            vertices = true;
        } else if (e.name == "face" && !faces) {
            read_faces(&c, e, h.format, points, &s);
            faces = true;
        } else {
            for (size_t k = 0; k < e.count; k++)
                for (const property &p : e.properties) skip_property(&c, p, h.format);
        }
    }
    if (!vertices) damaged("has no element vertex; export it as a surface");
    if (!faces) damaged("has no element face: a point cloud? export it as a surface");
    return s;
}

} // namespace apsm
