/* Points and polygons as they come out of a file. */
#include "formats/soup.h"

#include <stdlib.h>

void soup_free(soup *m)
{
    free(m->point);
    free(m->corner);
    free(m->end);
    free(m->edge);
    free(m->field);
    *m = (soup){ 0 };
}

/* *array <- room for `wanted` things of `size` bytes; doubles, so that adding is O(1). */
static void *grown(scan *s, void *array, size_t *room, size_t wanted, size_t size, bool exact)
{
    if (wanted <= *room || !scan_ok(s)) return array;
    const size_t next = exact || wanted > 2 * *room ? wanted : 2 * *room;
    void *const larger = next <= SIZE_MAX / size ? realloc(array, next * size) : NULL;
    if (!larger) {
        scan_no_memory(s);
        return array;
    }
    *room = next;
    return larger;
}

void soup_reserve_points(scan *s, soup *m, size_t more)
{
    m->point =
        grown(s, m->point, &m->point_room, m->points + more, 3 * sizeof *m->point, m->points == 0);
}

void soup_reserve_faces(scan *s, soup *m, size_t polygons, size_t corners)
{
    m->end = grown(s, m->end, &m->polygon_room, m->polygons + polygons, sizeof *m->end,
                   m->polygons == 0);
    m->corner = grown(s, m->corner, &m->corner_room, m->corners + corners, sizeof *m->corner,
                      m->corners == 0);
}

void soup_add_point(scan *s, soup *m, const double x[3])
{
    soup_reserve_points(s, m, 1);
    if (!scan_ok(s)) return;
    memcpy(m->point + 3 * m->points++, x, 3 * sizeof *x);
}

void soup_add_corner(scan *s, soup *m, int64_t index, size_t points)
{
    if (scan_ok(s) && (index < 0 || (uint64_t)index >= points || index > UINT32_MAX))
        scan_fail(s,
                  "a face refers to point %lld, but there are %zu (counted from 0); export the "
                  "mesh again",
                  (long long)index, points);
    soup_reserve_faces(s, m, 0, 1);
    if (scan_ok(s)) m->corner[m->corners++] = (uint32_t)index;
}

void soup_add_line(scan *s, soup *m, const int64_t *i, size_t n)
{
    if (!m->want_lines || n < 2) return;
    m->edge = grown(s, m->edge, &m->edge_room, m->edges + n - 1, 2 * sizeof *m->edge, false);
    for (size_t k = 0; k + 1 < n && scan_ok(s); k++, m->edges++) {
        m->edge[2 * m->edges] = i[k];
        m->edge[2 * m->edges + 1] = i[k + 1];
    }
}

void soup_end_polygon(scan *s, soup *m)
{
    const size_t first = m->polygons ? m->end[m->polygons - 1] : 0;
    if (m->corners < first + 3)
        scan_fail(s, "face %zu has %zu corners; export the mesh again", m->polygons,
                  m->corners - first);
    soup_reserve_faces(s, m, 1, 0);
    if (scan_ok(s)) m->end[m->polygons++] = m->corners;
}

void soup_add_cell(scan *s, soup *m, const int64_t *i, size_t n, bool strip)
{
    if (!strip || n < 3) {
        for (size_t k = 0; k < n && scan_ok(s); k++) soup_add_corner(s, m, i[k], m->points);
        soup_end_polygon(s, m);
        return;
    }
    for (size_t k = 0; k + 2 < n && scan_ok(s); k++) {
        const size_t odd = k % 2;
        soup_add_corner(s, m, i[k + odd], m->points);
        soup_add_corner(s, m, i[k + 1 - odd], m->points);
        soup_add_corner(s, m, i[k + 2], m->points);
        soup_end_polygon(s, m);
    }
}

void soup_ras_to_lps(soup *m, const double centre[3])
{
    for (size_t v = 0; v < m->points; v++)
        for (int c = 0; c < 3; c++) {
            double *const x = m->point + 3 * v + c;
            *x = (c < 2 ? -1.0 : 1.0) * (*x + centre[c]);
        }
}

/* ---- coinciding points ---- */

static size_t place_hash(const double x[3])
{
    uint64_t h = 0;
    for (int k = 0; k < 3; k++) {
        const double value = x[k] + 0.0; /* -0 is 0 */
        uint64_t bits;
        memcpy(&bits, &value, sizeof bits);
        h = (h ^ bits) * UINT64_C(0x9e3779b97f4a7c15);
        h ^= h >> 32;
    }
    return (size_t)h;
}

static bool same_place(const double a[3], const double b[3])
{
    return !(a[0] < b[0] || a[0] > b[0] || a[1] < b[1] || a[1] > b[1] || a[2] < b[2] ||
             a[2] > b[2]);
}

void soup_merge_points(scan *s, soup *m)
{
    size_t room = 16, kept = 0;
    if (!scan_ok(s)) return;
    while (room < 2 * m->points) room *= 2;
    uint32_t *const table = calloc(room, sizeof *table); /* 1 + the point; 0: free */
    uint32_t *const now = malloc((m->points + 1) * sizeof *now);
    if (!table || !now) scan_no_memory(s);
    for (size_t v = 0; v < m->points && scan_ok(s); v++) {
        const double *const x = m->point + 3 * v;
        size_t at = place_hash(x) & (room - 1);
        while (table[at] && !same_place(m->point + 3 * (table[at] - 1), x))
            at = (at + 1) & (room - 1);
        if (!table[at]) {
            memmove(m->point + 3 * kept, x, 3 * sizeof *x);
            table[at] = (uint32_t)++kept;
        }
        now[v] = table[at] - 1;
    }
    if (scan_ok(s)) {
        m->points = kept;
        for (size_t c = 0; c < m->corners; c++) m->corner[c] = now[m->corner[c]];
    }
    free(table);
    free(now);
}
