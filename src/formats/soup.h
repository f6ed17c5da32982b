/* soup.h -- polygons as mesh files hold them, before they become a mesh, and their readers and
 * writers.
 *
 * The readers check every byte they use: memory asked for is bounded by the size of the file, and
 * whatever is wrong is told with its line or byte.  They read numbers without the locale, and to
 * double. */
#ifndef APSM_FORMATS_SOUP_H
#define APSM_FORMATS_SOUP_H

#include "apsm/mesh.h"
#include "formats/scan.h"

/* Owns its arrays; zero-initialise with {0}. */
typedef struct soup {
    size_t points, corners, polygons;
    double *point;    /* points x 3, finite */
    uint32_t *corner; /* of all polygons, each a point */
    size_t *end;      /* polygon p has the corners end[p-1] (0 for the first) .. end[p] - 1 */
    size_t point_room, corner_room, polygon_room;
    size_t lines;           /* cells that are no polygons: contours */
    const char *want_field; /* set by who wants this field of the points; NULL: none */
    size_t fields;
    double *field;   /* fields: as many as points, if the file has it */
    bool want_lines; /* set by who wants the edges of those */
    size_t edges, edge_room;
    int64_t *edge; /* edges x 2: points, not checked */
} soup;

void soup_free(soup *m);
/* Room for so many more points or corners and polygons. */
void soup_reserve_points(scan *s, soup *m, size_t more);
void soup_reserve_faces(scan *s, soup *m, size_t polygons, size_t corners);
void soup_add_point(scan *s, soup *m, const double x[3]);
/* A corner of the polygon that is being made; index is checked against `points`. */
void soup_add_corner(scan *s, soup *m, int64_t index, size_t points);
/* Refuses a polygon of fewer than three corners. */
void soup_end_polygon(scan *s, soup *m);
/* The corners i[0..n) as a polygon, or as a strip of n - 2 triangles: (0 1 2), (2 1 3), (2 3 4) */
void soup_add_cell(scan *s, soup *m, const int64_t *i, size_t n, bool strip);

/* The edges between n points in their order, if they are wanted. */
void soup_add_line(scan *s, soup *m, const int64_t *i, size_t n);

/* Makes points at exactly the same place one, in order of first appearance; -0 is 0. */
void soup_merge_points(scan *s, soup *m);
/* Points in right, anterior, superior from `centre` become LPS. */
void soup_ras_to_lps(soup *m, const double centre[3]);
/* Polygons of more than three corners into triangles. */
void soup_triangulate(scan *s, soup *m);

void read_ply(scan *s, soup *m);
/* The property `name` of the *n vertices, malloc'ed; NULL if there is none, or on failure. */
double *read_ply_field(scan *s, const char *name, size_t *n);
void read_stl(scan *s, soup *m); /* three points for each triangle: see soup_merge_points */
void read_obj(scan *s, soup *m);
void read_legacy_vtk(scan *s, soup *m); /* DATASET POLYDATA: polygons and strips */
void read_vtp(scan *s, soup *m);
void read_off(scan *s, soup *m);
void read_gifti(scan *s, soup *m);
void read_freesurfer(scan *s, soup *m);

#endif
