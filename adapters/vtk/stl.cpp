/* STL, binary and ASCII.  A file is binary if its size fits the count it begins with, whatever
 * its first word: many binary files begin with "solid". */
#include "cursor.h"
#include "soup.h"

namespace apsm
{
namespace
{

constexpr size_t head = 84, record = 50;

void add_point(soup *s, const double x[3])
{
    s->corner.push_back(static_cast<uint32_t>(s->points()));
    s->point.insert(s->point.end(), x, x + 3);
}

soup read_binary(std::string_view bytes, size_t count)
{
    cursor c(bytes);
    c.begin_binary();
    c.skip(head);
    soup s;
    for (size_t f = 0; f < count; f++) {
        c.skip(12); /* the normal, which follows from the corners */
        for (int k = 0; k < 3; k++) {
            double x[3];
            for (double &xi : x) {
                xi = static_cast<double>(c.value<float>(false));
                if (!std::isfinite(xi))
                    c.fail("a coordinate of triangle " + std::to_string(f) +
                           " is not finite; export the mesh again");
            }
            add_point(&s, x);
        }
        c.skip(2);
        s.close_polygon();
    }
    return s;
}

void expect(cursor *c, const char *wanted)
{
    const std::string_view found = c->word();
    if (found != wanted) c->fail(c->expected(("'" + std::string(wanted) + "'").c_str(), found));
}

void read_facet(cursor *c, soup *s)
{
    expect(c, "normal");
    for (int k = 0; k < 3; k++)
        if (c->word().empty()) c->fail(c->expected("a normal", {}));
    expect(c, "outer");
    expect(c, "loop");
    for (int k = 0; k < 3; k++) {
        expect(c, "vertex");
        double x[3];
        for (double &xi : x) xi = c->finite("a coordinate");
        add_point(s, x);
    }
    expect(c, "endloop");
    expect(c, "endfacet");
    s->close_polygon();
}

soup read_ascii(std::string_view bytes)
{
    cursor c(bytes);
    soup s;
    while (c.skip_blanks()) { /* some files hold several solids */
        expect(&c, "solid");
        c.rest_of_line();
        for (;;) {
            const std::string_view word = c.word();
            if (word == "endsolid") break;
            if (word != "facet") c.fail(c.expected("'facet' or 'endsolid'", word));
            read_facet(&c, &s);
        }
        c.rest_of_line();
    }
    return s;
}

} // namespace

soup read_stl(std::string_view bytes)
{
    size_t count = 0;
    if (bytes.size() >= head) {
        cursor c(bytes);
        c.skip(80);
        count = c.value<uint32_t>(false);
        if (bytes.size() == head + record * count) return read_binary(bytes, count);
    }
    cursor c(bytes);
    if (c.word() == "solid") return read_ascii(bytes);
    if (bytes.size() < head) damaged("is too short for an STL file; copy or export it again");
    damaged("its header promises " + std::to_string(count) + " triangles, which take " +
            std::to_string(head + record * count) + " bytes, but it has " +
            std::to_string(bytes.size()) + "; copy or export it again");
}

} // namespace apsm
