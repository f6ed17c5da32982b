/* FreeSurfer's surfaces of triangles (lh.white, rh.pial): three bytes that mark them, two lines of
 * comment, counts, points and corners with the highest byte first, then what is known of the
 * volume.  Points are in the frame of that volume's centre, right, anterior, superior; where the
 * centre is given (c_ras), they come out in the scanner's frame, where the images are, as LPS; so
 * do those of which the file says that they are in that frame already. */
#include <math.h>

#include "formats/header_line.h"
#include "formats/soup.h"

enum { SCANNER_TAG = 2, VOLUME_TAG = 20, MOST_LINES = 32 };

static void read_mark(scan *s)
{
    const unsigned char *const mark = scan_bytes(s, 3);
    if (s->size > 13 && memcmp(s->bytes, "# HyperSurface", 14) == 0)
        scan_refuse(s, APSM_ERR_UNSUPPORTED,
                    "is Amira's own format; save it there as .stl or .ply");
    if (mark && mark[0] == 0xff && mark[1] == 0xff && (mark[2] == 0xff || mark[2] == 0xfd))
        scan_refuse(s, APSM_ERR_UNSUPPORTED,
                    "is a map of values, or an old surface of quadrangles; give a surface such as "
                    "lh.white, or run `mris_convert IN OUT.gii`");
    if (!mark || mark[0] != 0xff || mark[1] != 0xff || mark[2] != 0xfe)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "is no surface of FreeSurfer, whatever its name says; export it again");
}

static void read_comment(scan *s)
{
    scan_rest_of_line(s);
    if (scan_left(s) && s->bytes[s->at] == '\n') s->at++;
}

static void read_points(scan *s, soup *m, size_t n)
{
    soup_reserve_points(s, m, n);
    for (size_t v = 0; v < n && scan_ok(s); v++) {
        double x[3];
        for (int c = 0; c < 3; c++) x[c] = scan_real(s, SCALAR_F32, true);
        if (!isfinite(x[0]) || !isfinite(x[1]) || !isfinite(x[2]))
            scan_fail(s, "a coordinate of point %zu is not finite; export the mesh again", v);
        soup_add_point(s, m, x);
    }
}

static void read_faces(scan *s, soup *m, size_t n)
{
    soup_reserve_faces(s, m, n, 3 * n);
    for (size_t f = 0; f < n && scan_ok(s); f++) {
        for (int k = 0; k < 3; k++)
            soup_add_corner(s, m, scan_whole(s, SCALAR_I32, true), m->points);
        soup_end_polygon(s, m);
    }
}

/* The tag of the volume, behind which s ends.  Before it may be said whether the points are in the
 * scanner's frame already: then the volume does not matter. */
static bool find_volume(scan *s)
{
    int64_t tag = scan_left(s) >= 4 ? scan_whole(s, SCALAR_I32, true) : 0;
    if (tag == SCANNER_TAG && scan_left(s) >= 8) {
        if (scan_whole(s, SCALAR_I32, true) != 0) return false;
        tag = scan_whole(s, SCALAR_I32, true);
    }
    return tag == VOLUME_TAG;
}

/* centre <- c_ras, if the file says it, that it is valid, and that it has to be added. */
static void read_centre(scan s, double centre[3])
{
    double x[3];
    bool valid = false;
    if (!scan_ok(&s) || !find_volume(&s)) return;
    for (int k = 0; k < MOST_LINES && scan_left(&s); k++) {
        header_line l;
        if (!header_split(scan_rest_of_line(&s), "=", &l)) return;
        if (word_is(l.key, "valid")) valid = l.value.length && l.value.text[0] == '1';
        if (!word_is(l.key, "cras")) continue;
        if (valid && word_numbers(l.value, 3, x) && isfinite(x[0] + x[1] + x[2]))
            memcpy(centre, x, sizeof x);
        return;
    }
}

void read_freesurfer(scan *s, soup *m)
{
    double centre[3] = { 0, 0, 0 };
    s->binary = true;
    s->at = 0;
    read_mark(s);
    read_comment(s);
    const int64_t points = scan_whole(s, SCALAR_I32, true), faces = scan_whole(s, SCALAR_I32, true);
    const size_t n = scan_check_count(s, points, "a number of points", 12);
    const size_t nf = scan_check_count(s, faces, "a number of triangles", 12);
    read_points(s, m, n);
    read_faces(s, m, nf);
    read_centre(*s, centre);
    if (scan_ok(s)) soup_ras_to_lps(m, centre);
}
