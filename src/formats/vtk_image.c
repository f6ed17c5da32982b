/* Legacy VTK files, DATASET STRUCTURED_POINTS: an image of one value a point.
 *
 * VTK knows no patient: its axes are taken for LPS, as ITK does, and that is told. */
#include "formats/vtk_image.h"

#include <math.h>
#include <unistd.h>

#include "files/io.h"
#include "formats/image.h"
#include "formats/input_file.h"
#include "formats/vtk_text.h"

static void read_three(scan *s, const char *what, double x[3])
{
    for (int c = 0; c < 3; c++) x[c] = scan_number(s, what);
}

static void read_dimensions(scan *s, image *m)
{
    for (int c = 0; c < 3; c++) {
        const int64_t n = scan_integer(s, "a number of points along an axis");
        if (scan_ok(s) && (n < 1 || n > INT32_MAX))
            scan_fail(s, "%lld points along an axis; export it again", (long long)n);
        m->n[c] = scan_ok(s) ? (size_t)n : 0;
    }
}

/* Values begin here. */
static void begin_image(scan *s, const vtk_text *f, image *m, scalar type, int64_t components)
{
    if (components != 1)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "has %lld values a voxel (colours, vectors); save it with one label per voxel",
                    (long long)components);
    vtk_begin_values(s, f);
    m->type = type;
    m->big_endian = true;
    m->packing = f->ascii ? WRITTEN : PLAIN;
    m->data = (const unsigned char *)s->bytes + s->at;
    m->size = scan_left(s);
}

/* SCALARS name type [components], LOOKUP_TABLE name. */
static void read_scalars(scan *s, const vtk_text *f, image *m)
{
    int64_t components = 1;
    scan_word(s);
    const scalar type = vtk_type(s, scan_word(s));
    const word more = scan_word_in_line(s);
    if (more.length && !word_integer(more, &components))
        scan_expected(s, "a number of components", more);
    scan_rest_of_line(s);
    scan_expect(s, "LOOKUP_TABLE");
    begin_image(s, f, m, type, components);
}

/* FIELD name n, then arrays: name components tuples type, values.  The first is taken. */
static void read_field(scan *s, const vtk_text *f, size_t points, image *m)
{
    scan_word(s);
    if (scan_integer(s, "a number of arrays") < 1)
        scan_fail(s, "no array in it; export the image again");
    scan_word(s);
    const int64_t components = scan_integer(s, "a number of components");
    const int64_t tuples = scan_integer(s, "a number of tuples");
    if (scan_ok(s) && (uint64_t)tuples != points)
        scan_fail(s, "%lld values of %zu points; export the image again", (long long)tuples,
                  points);
    begin_image(s, f, m, vtk_type(s, scan_word(s)), components);
}

static void read_values(scan *s, const vtk_text *f, image *m)
{
    const double all = (double)m->n[0] * (double)m->n[1] * (double)m->n[2];
    char shown[WORD_SHOWN];
    const size_t points = scan_count(s, "a number of points", 1);
    if (scan_ok(s) && fabs(all - (double)points) > 0.0)
        scan_fail(s, "%zu values, but %zu x %zu x %zu points; export the image again", points,
                  m->n[0], m->n[1], m->n[2]);
    word kind = scan_word(s);
    if (word_is_any_case(kind, "METADATA")) {
        vtk_skip_metadata(s);
        kind = scan_word(s);
    }
    if (word_is_any_case(kind, "SCALARS"))
        read_scalars(s, f, m);
    else if (word_is_any_case(kind, "FIELD"))
        read_field(s, f, points, m);
    else
        scan_fail(s, "expected SCALARS, found '%s'; save the image with one label per voxel",
                  word_show(kind, shown));
}

/* VTK writes those of cells before those of points. */
static void pass_cell_data(scan *s, const vtk_text *f)
{
    vtk_skip_cell_data(s, f);
    if (scan_ok(s) && !scan_left(s))
        scan_fail(s, "its values belong to cells; turn them into point data, or save it as .nrrd");
}

static void place(scan *s, image *m, const double spacing[3])
{
    for (int c = 0; c < 3; c++) m->step[4 * c] = spacing[c];
    image_simple(m);
    image_note(s, m,
               "VTK's images do not say where left and right are; x was taken to run to the left, "
               "y to the back, z upward: check");
}

void read_vtk_image(scan *s, image *m)
{
    vtk_text f = { false, false };
    double spacing[3] = { 1, 1, 1 };
    word set;
    vtk_read_header(s, &f, &set);
    if (scan_ok(s) && !word_is_any_case(set, "STRUCTURED_POINTS"))
        scan_refuse(s, APSM_ERR_FORMAT, "is no image of VTK; save it as structured points");
    while (scan_ok(s) && !m->data) {
        const word section = scan_word(s);
        if (word_is_any_case(section, "DIMENSIONS"))
            read_dimensions(s, m);
        else if (word_is_any_case(section, "SPACING") || word_is_any_case(section, "ASPECT_RATIO"))
            read_three(s, "a spacing", spacing);
        else if (word_is_any_case(section, "ORIGIN"))
            read_three(s, "an origin", m->origin);
        else if (word_is_any_case(section, "FIELD"))
            vtk_skip_field(s, &f);
        else if (word_is_any_case(section, "METADATA"))
            vtk_skip_metadata(s);
        else if (word_is_any_case(section, "POINT_DATA"))
            read_values(s, &f, m);
        else if (word_is_any_case(section, "CELL_DATA"))
            pass_cell_data(s, &f);
        else
            scan_expected(s, "POINT_DATA", section);
    }
    if (scan_ok(s)) place(s, m, spacing);
}

bool vtk_is_image(const char *path)
{
    enum { HEAD = 1024 };
    char head[HEAD];
    int fd;
    if (!path_ends_in(path, ".vtk") || apsm_open_regular(NULL, path, &fd) != APSM_OK) return false;
    const ssize_t n = read(fd, head, sizeof head);
    close(fd);
    apsm_context *const quiet = n > 0 ? apsm_context_new() : NULL; /* no failure is told */
    if (!quiet) return false;
    scan s = scan_begin(quiet, path, head, (size_t)n);
    vtk_text f = { false, false };
    word set = { "", 0 };
    vtk_read_header(&s, &f, &set);
    const bool is = scan_ok(&s) && word_is_any_case(set, "STRUCTURED_POINTS");
    apsm_context_free(quiet);
    return is;
}
