/* VTK's own old format, versions 1 to 5.1, DATASET POLYDATA: points, polygons and triangle
 * strips.  Attributes come last and are not looked at.  Binary values are big-endian. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "formats/soup.h"
#include "formats/vtk_grid.h"
#include "formats/vtk_text.h"

static void read_points(scan *s, const vtk_text *f, soup *m)
{
    const int64_t n = scan_integer(s, "a number of points");
    const scalar type = vtk_type(s, scan_word(s));
    vtk_begin_values(s, f);
    const size_t count = scan_check_count(s, n, "number of points", 3 * vtk_least_size(f, type));
    soup_reserve_points(s, m, count);
    for (size_t v = 0; v < count && scan_ok(s); v++) {
        double x[3];
        for (int c = 0; c < 3; c++) {
            x[c] = f->ascii ? scan_number(s, "a coordinate") : scan_real(s, type, true);
            if (!isfinite(x[c])) scan_fail(s, "a coordinate is not finite; export the mesh again");
        }
        soup_add_point(s, m, x);
    }
    s->binary = false;
}

/* NULL on failure, which is recorded. */
static int64_t *read_integers(scan *s, const vtk_text *f, int64_t n, scalar type)
{
    const size_t count = scan_check_count(s, n, "number of values", vtk_least_size(f, type));
    if (scan_ok(s) && scalar_is_real(type))
        scan_fail(s, "cells of numbers that are not integers; export the mesh again");
    int64_t *const values = scan_ok(s) ? malloc((count + 1) * sizeof *values) : NULL;
    if (!values) scan_no_memory(s);
    for (size_t k = 0; k < count && scan_ok(s); k++)
        values[k] = f->ascii ? scan_integer(s, "an integer") : scan_whole(s, type, true);
    s->binary = false;
    if (scan_ok(s)) return values;
    free(values);
    return NULL;
}

typedef enum cells { POLYGONS, STRIPS, LINES, VERTICES } cells;

static void add_cell(scan *s, soup *m, const int64_t *corner, int64_t n, cells kind)
{
    if (kind == LINES) m->lines++, soup_add_line(s, m, corner, (size_t)n);
    if (kind == POLYGONS || kind == STRIPS) soup_add_cell(s, m, corner, (size_t)n, kind == STRIPS);
}

/* Versions before 5: n cells in `size` values, each the number of its corners and they. */
static void read_old_cells(scan *s, const vtk_text *f, int64_t n, int64_t size, cells kind, soup *m)
{
    vtk_begin_values(s, f);
    int64_t *const value = read_integers(s, f, size, SCALAR_I32), found = 0;
    for (int64_t at = 0; scan_ok(s) && at < size; found++) {
        const int64_t corners = value[at++];
        if (corners < 0 || corners > size - at)
            scan_fail(s,
                      "a cell has %lld corners, more than its section holds; export the mesh again",
                      (long long)corners);
        else
            add_cell(s, m, value + at, corners, kind);
        at += corners;
    }
    if (found != n)
        scan_fail(s, "a section of %lld cells holds %lld; export the mesh again", (long long)n,
                  (long long)found);
    free(value);
}

static int64_t *read_section(scan *s, const vtk_text *f, const char *keyword, int64_t n)
{
    scan_expect(s, keyword);
    const scalar type = vtk_type(s, scan_word(s));
    vtk_begin_values(s, f);
    return read_integers(s, f, n, type);
}

/* Version 5: n offsets, that is n - 1 cells, and the corners of all. */
static void read_new_cells(scan *s, const vtk_text *f, int64_t n, int64_t size, cells kind, soup *m)
{
    int64_t *const start = read_section(s, f, "OFFSETS", n);
    int64_t *const corner = start ? read_section(s, f, "CONNECTIVITY", size) : NULL;
    for (int64_t k = 0; scan_ok(s) && k + 1 < n; k++) {
        if (start[k] < 0 || start[k + 1] < start[k] || start[k + 1] > size)
            scan_fail(s, "the offsets of the cells do not ascend; export the mesh again");
        else
            add_cell(s, m, corner + start[k], start[k + 1] - start[k], kind);
    }
    free(start);
    free(corner);
}

static void read_cells(scan *s, const vtk_text *f, cells kind, soup *m)
{
    const int64_t n = scan_integer(s, "a number of cells");
    const int64_t size = scan_integer(s, "a number of values");
    if (!scan_ok(s)) return;
    if (f->offsets)
        read_new_cells(s, f, n, size, kind, m);
    else
        read_old_cells(s, f, n, size, kind, m);
}

static void refuse_other_set(scan *s, word set)
{
    char shown[WORD_SHOWN];
    if (!scan_ok(s) || word_is_any_case(set, "POLYDATA")) return;
    const char *remedy = "extract the surface and save it as poly data";
    if (word_is_any_case(set, "STRUCTURED_POINTS")) remedy = "an image, where a surface is needed";
    if (word_is_any_case(set, "RECTILINEAR_GRID"))
        remedy = "an image: save it as .nrrd or .nii.gz, or as structured points";
    scan_fail(s, "the file holds %s, not POLYDATA; %s", word_show(set, shown), remedy);
}

/* ---- a field of the points ---- */

/* Of one array; kept if it is the one that is wanted and has one component. */
static void read_values(scan *s, const vtk_text *f, vtk_array a, soup *m)
{
    const bool wanted = a.components == 1 && word_is(a.name, m->want_field) && !m->field;
    vtk_begin_values(s, f);
    const size_t count = scan_check_count(s, (int64_t)(a.components * a.tuples), "number of values",
                                          vtk_least_size(f, a.type));
    double *const x = wanted && scan_ok(s) ? malloc((count + 1) * sizeof *x) : NULL;
    if (wanted && !x) scan_no_memory(s);
    for (size_t k = 0; k < count && scan_ok(s); k++) {
        const double v = f->ascii ? scan_number(s, "a value") : scan_real(s, a.type, true);
        if (x) x[k] = v;
    }
    s->binary = false;
    if (!x) return;
    m->field = x;
    m->fields = count;
}

/* FIELD name k, then k arrays. */
static void read_arrays(scan *s, const vtk_text *f, soup *m)
{
    scan_word(s);
    const size_t arrays = scan_count(s, "a number of arrays", 8);
    for (size_t k = 0; k < arrays && scan_ok(s); k++) read_values(s, f, vtk_read_array(s), m);
}

static void read_attribute(scan *s, const vtk_text *f, word kind, size_t n, soup *m)
{
    const size_t components = word_is_any_case(kind, "SCALARS") ? 1 : 3;
    read_values(s, f, vtk_read_attribute(s, components, n), m);
}

/* What follows POINT_DATA, up to what is wanted or not known here. */
static void read_point_data(scan *s, const vtk_text *f, soup *m)
{
    const size_t n = scan_count(s, "a number of points", 1);
    while (scan_ok(s) && !m->field && scan_skip_blanks(s, true)) {
        const word kind = scan_word(s);
        if (word_is_any_case(kind, "FIELD"))
            read_arrays(s, f, m);
        else if (word_is_any_case(kind, "METADATA"))
            vtk_skip_metadata(s);
        else if (word_is_any_case(kind, "SCALARS") || word_is_any_case(kind, "VECTORS") ||
                 word_is_any_case(kind, "NORMALS"))
            read_attribute(s, f, kind, n, m);
        else
            return;
    }
}

static bool is_attribute(word section)
{
    return word_is_any_case(section, "CELL_DATA") || word_is_any_case(section, "POINT_DATA");
}

void read_legacy_vtk(scan *s, soup *m)
{
    static const char *const names[] = { "POLYGONS", "TRIANGLE_STRIPS", "LINES", "VERTICES" };
    vtk_text f = { false, false };
    word set;
    vtk_read_header(s, &f, &set);
    refuse_other_set(s, set);
    while (scan_skip_blanks(s, true)) {
        const word section = scan_word(s);
        int kind = 0;
        while (kind < 4 && !word_is_any_case(section, names[kind])) kind++;
        if (m->want_field && word_is_any_case(section, "POINT_DATA")) read_point_data(s, &f, m);
        if (m->want_field && word_is_any_case(section, "CELL_DATA")) {
            vtk_skip_cell_data(s, &f);
            continue;
        }
        if (is_attribute(section)) break;
        if (kind < 4)
            read_cells(s, &f, (cells)kind, m);
        else if (word_is_any_case(section, "POINTS"))
            read_points(s, &f, m);
        else if (word_is_any_case(section, "FIELD"))
            vtk_skip_field(s, &f);
        else if (word_is_any_case(section, "METADATA"))
            vtk_skip_metadata(s);
        else
            scan_expected(s, "a section of a VTK file", section);
    }
}

/* ---- points that move, all else as it is ---- */

enum { TETRAHEDRON = 10, CORNERS = 4, FILE_LIMIT_SHIFT = 36 };

/* Where the corners of each cell are among all. */
typedef struct grid_cells {
    int64_t n, size;
    int64_t *start;  /* n: of the first corner in value */
    int64_t *length; /* n */
    int64_t *value;
} grid_cells;

static void grid_cells_free(grid_cells *c)
{
    free(c->start);
    free(c->length);
    free(c->value);
}

static void find_old_cells(scan *s, grid_cells *c)
{
    int64_t found = 0;
    for (int64_t at = 0; scan_ok(s) && at < c->size && found < c->n; found++) {
        c->length[found] = c->value[at];
        c->start[found] = at + 1;
        if (c->length[found] < 0 || c->length[found] >= c->size - at)
            scan_fail(s, "a cell has more corners than its section holds; export the mesh again");
        else
            at += 1 + c->length[found];
    }
    if (scan_ok(s) && found != c->n)
        scan_fail(s, "a section of %lld cells holds %lld; export the mesh again", (long long)c->n,
                  (long long)found);
}

static void find_new_cells(scan *s, const int64_t *offset, grid_cells *c)
{
    for (int64_t k = 0; scan_ok(s) && k < c->n; k++) {
        c->start[k] = offset[k];
        c->length[k] = offset[k + 1] - offset[k];
        if (offset[k] < 0 || c->length[k] < 0 || offset[k + 1] > c->size)
            scan_fail(s, "the offsets of the cells do not ascend; export the mesh again");
    }
}

static void read_grid_cells(scan *s, const vtk_text *f, grid_cells *c)
{
    const int64_t n = scan_integer(s, "a number of cells");
    c->size = scan_integer(s, "a number of values");
    c->n = (int64_t)scan_check_count(s, n, "number of cells", 2);
    if (f->offsets && c->n > 0) c->n--;
    if (!scan_ok(s)) return;
    c->start = calloc((size_t)c->n + 1, sizeof *c->start);
    c->length = calloc((size_t)c->n + 1, sizeof *c->length);
    if (!c->start || !c->length) {
        scan_no_memory(s);
        return;
    }
    if (!f->offsets) {
        vtk_begin_values(s, f);
        c->value = read_integers(s, f, c->size, SCALAR_I32);
        if (c->value) find_old_cells(s, c);
        return;
    }
    int64_t *const offset = read_section(s, f, "OFFSETS", n);
    c->value = offset ? read_section(s, f, "CONNECTIVITY", c->size) : NULL;
    if (c->value) find_new_cells(s, offset, c);
    free(offset);
}

static bool is_tetrahedron(const grid_cells *c, const int64_t *type, int64_t k)
{
    return type[k] == TETRAHEDRON && c->length[k] == CORNERS;
}

static void take_tetrahedra(scan *s, const grid_cells *c, const int64_t *type, vtk_grid *g)
{
    for (int64_t k = 0; k < c->n; k++) g->tets += is_tetrahedron(c, type, k);
    g->tet = malloc((CORNERS * g->tets + 1) * sizeof *g->tet);
    g->number = malloc((g->tets + 1) * sizeof *g->number);
    size_t t = 0;
    if (!g->tet || !g->number) scan_no_memory(s);
    for (int64_t k = 0; scan_ok(s) && k < c->n; k++) {
        if (!is_tetrahedron(c, type, k)) continue;
        for (int64_t q = 0; q < CORNERS; q++) {
            const int64_t v = c->value[c->start[k] + q];
            if (v < 0 || (uint64_t)v >= g->n)
                scan_fail(s, "cell %lld has corner %lld, but there are %zu points", (long long)k,
                          (long long)v, g->n);
            g->tet[CORNERS * t + (size_t)q] = (uint32_t)v;
        }
        g->number[t++] = (uint32_t)k;
    }
}

static void read_cell_types(scan *s, const vtk_text *f, const grid_cells *c, vtk_grid *g)
{
    const int64_t n = scan_integer(s, "a number of cells");
    vtk_begin_values(s, f);
    if (scan_ok(s) && n != c->n)
        scan_fail(s, "%lld types of %lld cells; export the mesh again", (long long)n,
                  (long long)c->n);
    int64_t *const type = scan_ok(s) ? read_integers(s, f, n, SCALAR_I32) : NULL;
    if (type) take_tetrahedra(s, c, type, g);
    free(type);
}

static void read_grid_points(scan *s, const vtk_text *f, size_t at, vtk_grid *g)
{
    soup m = { 0 };
    g->points_at = at;
    read_points(s, f, &m);
    g->points_end = s->at;
    g->n = m.points;
    g->x = m.point;
    m.point = NULL;
    soup_free(&m);
}

static void read_grid(scan *s, vtk_grid *g)
{
    vtk_text f = { false, false };
    grid_cells all = { 0 };
    word set;
    vtk_read_header(s, &f, &set);
    g->ascii = f.ascii;
    g->bare_cr = s->bare_cr;
    const bool grid = scan_ok(s) && word_is_any_case(set, "UNSTRUCTURED_GRID");
    if (!grid) refuse_other_set(s, set);
    while (scan_skip_blanks(s, true)) {
        const size_t at = s->at;
        const word section = scan_word(s);
        if (word_is_any_case(section, "POINTS") && !g->x)
            read_grid_points(s, &f, at, g);
        else if (word_is_any_case(section, "FIELD"))
            vtk_skip_field(s, &f);
        else if (word_is_any_case(section, "METADATA"))
            vtk_skip_metadata(s);
        else if (grid && word_is_any_case(section, "CELLS") && !all.start)
            read_grid_cells(s, &f, &all);
        else if (grid && word_is_any_case(section, "CELL_TYPES") && all.value && !g->tet)
            read_cell_types(s, &f, &all, g);
        else
            break; /* attributes, and of poly data the cells: they stay as they are */
    }
    if (scan_ok(s) && !g->x) scan_fail(s, "no points; export the mesh again");
    grid_cells_free(&all);
}

apsm_status vtk_grid_read(apsm_context *ctx, const char *path, vtk_grid *g)
{
    *g = (vtk_grid){ 0 };
    APSM_TRY(apsm_read_file(ctx, path, (size_t)1 << FILE_LIMIT_SHIFT, &g->bytes, &g->size));
    scan s = scan_begin(ctx, path, g->bytes, g->size);
    read_grid(&s, g);
    if (!scan_ok(&s)) vtk_grid_free(g);
    return s.status;
}

void vtk_grid_free(vtk_grid *g)
{
    free(g->bytes);
    free(g->x);
    free(g->tet);
    free(g->number);
    *g = (vtk_grid){ 0 };
}

static void put_big_endian(apsm_writer *w, double x)
{
    uint64_t bits;
    unsigned char raw[8];
    memcpy(&bits, &x, sizeof bits);
    for (int b = 0; b < 8; b++) raw[b] = (unsigned char)(bits >> (56 - 8 * b));
    apsm_writer_write(w, raw, sizeof raw);
}

apsm_status vtk_grid_write(apsm_context *ctx, const char *path, const vtk_grid *g, const double *x)
{
    apsm_writer *w;
    const char *const end = g->bare_cr ? "\r" : "\n";
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    apsm_writer_write(w, g->bytes, g->points_at);
    apsm_writer_printf(w, "POINTS %zu double%s", g->n, end);
    for (size_t k = 0; k < 3 * g->n; k++) {
        if (g->ascii)
            apsm_writer_number(w, x[k]);
        else
            put_big_endian(w, x[k]);
        if (g->ascii) apsm_writer_write(w, k % 3 == 2 ? end : " ", 1);
    }
    const char *rest = g->bytes + g->points_end;
    if (!g->ascii && g->points_end < g->size && *rest != *end) apsm_writer_write(w, end, 1);
    apsm_writer_write(w, rest, g->size - g->points_end);
    return apsm_writer_commit(w);
}

/* Six times the volume. */
static double volume_of(const uint32_t *t, const double *x)
{
    double u[3], v[3], w[3];
    for (size_t c = 0; c < 3; c++) {
        u[c] = x[3 * t[1] + c] - x[3 * t[0] + c];
        v[c] = x[3 * t[2] + c] - x[3 * t[0] + c];
        w[c] = x[3 * t[3] + c] - x[3 * t[0] + c];
    }
    return u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) +
           u[2] * (v[0] * w[1] - v[1] * w[0]);
}

size_t vtk_grid_inverted(const vtk_grid *g, const double *x, const double *y, uint32_t *list)
{
    size_t n = 0;
    for (size_t t = 0; t < g->tets; t++) {
        const double before = volume_of(g->tet + CORNERS * t, x),
                     after = volume_of(g->tet + CORNERS * t, y);
        if (!(before * after > 0)) list[n++] = g->number[t];
    }
    return n;
}
