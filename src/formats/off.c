/* OFF, the object file format of Geomview: points and polygons as text.  Colours, normals and
 * texture that may follow on a line are passed over; '#' begins a comment. */
#include <strings.h>

#include "formats/soup.h"

static void skip_comments(scan *s)
{
    while (scan_skip_blanks(s, true) && s->bytes[s->at] == '#') scan_rest_of_line(s);
}

/* "OFF", "COFF", "STNOFF" ...; it may be missing.  "4OFF" and "nOFF" hold points that are not 3-D.
 */
static void read_keyword(scan *s)
{
    skip_comments(s);
    scan ahead = *s;
    const word key = scan_word(&ahead);
    int64_t number;
    if (word_integer(key, &number)) return;
    if (key.length < 3 || strncasecmp(key.text + key.length - 3, "OFF", 3) != 0)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "is not an OFF file, whatever its name says; export it "
                    "again");
    if (memchr(key.text, '4', key.length) || memchr(key.text, 'n', key.length))
        scan_refuse(s, APSM_ERR_FORMAT, "its points are not 3-D; export it again");
    if (word_is_any_case(scan_word_in_line(&ahead), "BINARY"))
        scan_refuse(s, APSM_ERR_UNSUPPORTED, "is a binary OFF file; save it as text or as .ply");
    scan_word(s);
    skip_comments(s);
}

static void read_face(scan *s, soup *m)
{
    skip_comments(s);
    const size_t corners = scan_count(s, "a number of corners", 2);
    m->lines += corners < 3; /* a point or an edge by itself */
    for (size_t k = 0; k < corners && scan_ok(s); k++) {
        const int64_t i = scan_integer(s, "a point's number");
        if (corners >= 3) soup_add_corner(s, m, i, m->points);
    }
    if (corners >= 3) soup_end_polygon(s, m);
    scan_rest_of_line(s);
}

void read_off(scan *s, soup *m)
{
    read_keyword(s);
    const size_t points = scan_count(s, "a number of points", 6);
    const size_t faces = scan_count(s, "a number of faces", 2);
    scan_rest_of_line(s); /* the number of edges, which nobody fills in */
    soup_reserve_points(s, m, points);
    for (size_t v = 0; v < points && scan_ok(s); v++) {
        double x[3];
        skip_comments(s);
        for (int c = 0; c < 3; c++) x[c] = scan_number(s, "a coordinate");
        soup_add_point(s, m, x);
        scan_rest_of_line(s);
    }
    for (size_t f = 0; f < faces && scan_ok(s); f++) read_face(s, m);
}
