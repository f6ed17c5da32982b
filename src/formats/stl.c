/* STL, binary and ASCII.  A file is binary if its size fits the count it begins with, whatever
 * its first word: many binary files begin with "solid". */
#include <math.h>
#include <stdio.h>
#include <strings.h>

#include "formats/soup.h"

enum { HEAD = 84, RECORD = 50 };

static void add_corner_at(scan *s, soup *m, const double x[3])
{
    soup_add_corner(s, m, (int64_t)m->points, m->points + 1);
    soup_add_point(s, m, x);
}

static void read_binary(scan *s, soup *m, size_t count)
{
    s->binary = true;
    s->at = HEAD;
    soup_reserve_points(s, m, 3 * count);
    soup_reserve_faces(s, m, count, 3 * count);
    for (size_t f = 0; f < count && scan_ok(s); f++) {
        scan_bytes(s, 12); /* the normal, which follows from the corners */
        for (int k = 0; k < 3; k++) {
            double x[3];
            for (int c = 0; c < 3; c++) {
                x[c] = scan_real(s, SCALAR_F32, false);
                if (!isfinite(x[c]))
                    scan_fail(
                        s, "a coordinate of triangle %zu is not finite; export the mesh again", f);
            }
            add_corner_at(s, m, x);
        }
        scan_bytes(s, 2);
        soup_end_polygon(s, m);
    }
}

static void read_facet(scan *s, soup *m)
{
    scan_expect(s, "normal");
    for (int k = 0; k < 3; k++) {
        const word w = scan_word(s);
        if (!w.length) scan_expected(s, "a normal", w);
    }
    scan_expect(s, "outer");
    scan_expect(s, "loop");
    for (int k = 0; k < 3; k++) {
        double x[3];
        scan_expect(s, "vertex");
        for (int c = 0; c < 3; c++) x[c] = scan_number(s, "a coordinate");
        add_corner_at(s, m, x);
    }
    scan_expect(s, "endloop");
    scan_expect(s, "endfacet");
    soup_end_polygon(s, m);
}

/* Whether `text`, in any case of letters, occurs in the next `most` bytes. */
static bool holds(const scan *s, const char *text, size_t most)
{
    const size_t length = strlen(text);
    const size_t left = scan_left(s) < most ? scan_left(s) : most;
    for (size_t k = 0; k + length <= left; k++)
        if (strncasecmp(s->bytes + s->at + k, text, length) == 0) return true;
    return false;
}

static void read_solid(scan *s, soup *m)
{
    scan_expect(s, "solid");
    scan_rest_of_line(s);
    while (scan_ok(s)) {
        const word w = scan_word(s);
        if (word_is_any_case(w, "endsolid")) break;
        if (!word_is_any_case(w, "facet")) scan_expected(s, "'facet' or 'endsolid'", w);
        read_facet(s, m);
    }
    scan_rest_of_line(s);
}

/* Some files hold several solids, some a few bytes after the last. */
static void read_ascii(scan *s, soup *m)
{
    read_solid(s, m);
    while (scan_skip_blanks(s, true)) {
        if (!holds(s, "facet", SIZE_MAX)) {
            apsm_log(s->ctx, APSM_LOG_WARNING, "%s: %zu bytes after the last solid are passed over",
                     s->path, scan_left(s));
            break;
        }
        read_solid(s, m);
    }
}

static bool is_ascii(const scan *s)
{
    scan look = *s;
    return word_is_any_case(scan_word(&look), "solid") &&
           (holds(&look, "facet", 4096) || holds(&look, "endsolid", 4096));
}

void read_stl(scan *s, soup *m)
{
    size_t count = 0;
    if (s->size >= HEAD)
        count = (size_t)scalar_bits((const unsigned char *)s->bytes + 80, 4, false);
    const size_t wanted = HEAD + RECORD * count;
    if (s->size == wanted) {
        read_binary(s, m, count);
    } else if (is_ascii(s)) {
        read_ascii(s, m);
    } else if (s->size < HEAD) {
        scan_refuse(s, APSM_ERR_FORMAT, "is too short for an STL file; copy or export it again");
    } else if (s->size < wanted || (s->size - wanted) % RECORD == 0) {
        scan_refuse(s, APSM_ERR_FORMAT,
                    "its header promises %zu triangles, which take %zu bytes, but it has %zu; copy "
                    "or export it again",
                    count, wanted, s->size);
    } else {
        apsm_log(s->ctx, APSM_LOG_WARNING,
                 "%s: %zu bytes after the last of its %zu triangles are passed over", s->path,
                 s->size - wanted, count);
        read_binary(s, m, count);
    }
}
