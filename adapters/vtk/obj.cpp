/* Wavefront OBJ: `v` and `f` lines; texture, normals, groups and materials are passed over. */
#include "cursor.h"
#include "soup.h"

namespace apsm
{
namespace
{

bool is_passed_over(std::string_view key)
{
    const char *const keys[] = { "vt",     "vn",    "vp",       "o",          "g",
                                 "s",      "mg",    "usemtl",   "mtllib",     "usemap",
                                 "l",      "p",     "lod",      "shadow_obj", "trace_obj",
                                 "maplib", "bevel", "c_interp", "d_interp" };
    for (const char *k : keys)
        if (key == k) return true;
    return false;
}

void read_point(cursor *c, soup *s)
{
    for (int k = 0; k < 3; k++) {
        if (!c->skip_blanks(false))
            c->fail("a point with fewer than 3 coordinates; export it again");
        s->point.push_back(c->finite("a coordinate"));
    }
    c->rest_of_line(); /* a weight or a colour may follow */
}

/* "7", "7/1", "7//2", "7/1/2"; negative numbers count from the last point. */
uint32_t read_corner(const cursor &c, std::string_view word, size_t points)
{
    long long index;
    if (!cursor::parse(word.substr(0, word.find('/')), &index) || index == 0)
        c.fail(c.expected("a point's number", word));
    return checked_corner(c, index > 0 ? index - 1 : index + static_cast<long long>(points),
                          points);
}

/* Faces may name points that come later, so their number is checked at the end. */
void read_face(cursor *c, size_t all_points, soup *s)
{
    const size_t first = s->corner.size(), line = c->line();
    for (;;) {
        const std::string_view word = c->word(false);
        if (word == "\\") { /* the face goes on in the next line */
            c->rest_of_line();
            continue;
        }
        if (word.empty()) break;
        const bool relative = word[0] == '-';
        s->corner.push_back(read_corner(*c, word, relative ? s->points() : all_points));
    }
    if (s->corner.size() < first + 3)
        damaged("line " + std::to_string(line) + ": a face with " +
                std::to_string(s->corner.size() - first) + " corners; export the mesh again");
    c->rest_of_line();
    s->close_polygon();
}

size_t count_points(std::string_view bytes)
{
    cursor c(bytes);
    size_t n = 0;
    while (c.skip_blanks()) {
        if (c.word() == "v") n++;
        c.rest_of_line();
    }
    return n;
}

} // namespace

soup read_obj(std::string_view bytes)
{
    const size_t all_points = count_points(bytes);
    cursor c(bytes);
    soup s;
    while (c.skip_blanks()) {
        const std::string_view key = c.word();
        if (key == "v")
            read_point(&c, &s);
        else if (key == "f")
            read_face(&c, all_points, &s);
        else if (key[0] == '#' || is_passed_over(key))
            c.rest_of_line();
        else
            c.fail(c.expected("a line of an OBJ file", key));
    }
    return s;
}

} // namespace apsm
