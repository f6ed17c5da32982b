/* Wavefront OBJ: `v` and `f` lines; texture, normals, groups and materials are passed over. */
#include "formats/soup.h"

static bool is_passed_over(word key)
{
    static const char *const keys[] = { "vt",    "vn",       "vp",         "o",         "g",
                                        "s",     "mg",       "usemtl",     "mtllib",    "usemap",
                                        "p",     "lod",      "shadow_obj", "trace_obj", "maplib",
                                        "bevel", "c_interp", "d_interp" };
    if (key.text[0] == '#') return true;
    for (size_t k = 0; k < sizeof keys / sizeof *keys; k++)
        if (word_is(key, keys[k])) return true;
    return false;
}

/* A backslash at the end of a line: it goes on in the next. */
static void skip_continuation(scan *s)
{
    scan ahead = *s;
    while (word_is(scan_word_in_line(&ahead), "\\")) {
        scan_rest_of_line(&ahead);
        *s = ahead;
    }
}

static void read_point(scan *s, soup *m)
{
    double x[3] = { 0, 0, 0 };
    for (int k = 0; k < 3 && scan_ok(s); k++) {
        skip_continuation(s);
        if (!scan_skip_blanks(s, false))
            scan_fail(s, "a point with fewer than 3 coordinates; export the mesh again");
        x[k] = scan_number(s, "a coordinate");
    }
    soup_add_point(s, m, x);
    scan_rest_of_line(s); /* a weight or a colour may follow */
}

/* "7", "7/1", "7//2", "7/1/2"; negative numbers count from the last point.  Faces may name points
 * that come later, so `all` are known before. */
static void read_corner(scan *s, soup *m, word w, size_t all)
{
    const char *const slash = memchr(w.text, '/', w.length);
    const word number = { w.text, slash ? (size_t)(slash - w.text) : w.length };
    int64_t index;
    if (!word_integer(number, &index) || index == 0) {
        scan_expected(s, "a point's number", w);
        return;
    }
    if (index > 0)
        soup_add_corner(s, m, index - 1, all);
    else
        soup_add_corner(s, m, index + (int64_t)m->points, m->points);
}

static void read_face(scan *s, soup *m, size_t all)
{
    const size_t first = m->corners;
    while (scan_ok(s)) {
        const word w = scan_word_in_line(s);
        if (!w.length) break;
        if (word_is(w, "\\")) /* the face goes on in the next line */
            scan_rest_of_line(s);
        else
            read_corner(s, m, w, all);
    }
    if (m->corners < first + 3)
        scan_fail(s, "a face with %zu corners; export the mesh again", m->corners - first);
    soup_end_polygon(s, m);
    scan_rest_of_line(s);
}

static size_t count_points(scan s)
{
    size_t n = 0;
    while (scan_skip_blanks(&s, true)) {
        n += word_is(scan_word(&s), "v");
        scan_rest_of_line(&s);
    }
    return n;
}

void read_obj(scan *s, soup *m)
{
    const size_t all = count_points(*s);
    soup_reserve_points(s, m, all);
    while (scan_skip_blanks(s, true)) {
        const word key = scan_word(s);
        if (word_is(key, "v")) {
            read_point(s, m);
        } else if (word_is(key, "f")) {
            read_face(s, m, all);
        } else if (word_is(key, "l")) {
            m->lines++;
            scan_rest_of_line(s);
        } else if (is_passed_over(key)) {
            scan_rest_of_line(s);
        } else {
            scan_expected(s, "a line of an OBJ file", key);
        }
    }
}
