/* Polygons into triangles by cutting ears (Meisters 1975): a corner that points outward and whose
 * triangle holds no other corner may be cut off; the best shaped of them goes first.  Corners are
 * judged in the plane of the polygon's area vector (Newell). */
#include <math.h>
#include <stdlib.h>

#include "formats/soup.h"

enum { MOST_CORNERS = 4096 }; /* cutting takes O(n^2) */

typedef struct ring {
    size_t n;         /* corners left */
    uint32_t *corner; /* the points' numbers */
    double *x, *y;    /* in the plane, counter-clockwise */
    double *badness;  /* of the ear at each corner: squared perimeter over area; < 0: none */
} ring;

static double turn(const ring *r, size_t a, size_t b, size_t c)
{
    return (r->x[b] - r->x[a]) * (r->y[c] - r->y[a]) - (r->x[c] - r->x[a]) * (r->y[b] - r->y[a]);
}

static bool is_empty(const ring *r, size_t a, size_t b, size_t c)
{
    for (size_t k = 0; k < r->n; k++) {
        if (k == a || k == b || k == c || r->corner[k] == r->corner[a] ||
            r->corner[k] == r->corner[b] || r->corner[k] == r->corner[c])
            continue;
        if (turn(r, a, b, k) >= 0.0 && turn(r, b, c, k) >= 0.0 && turn(r, c, a, k) >= 0.0)
            return false;
    }
    return true;
}

static double side(const ring *r, size_t a, size_t b)
{
    return hypot(r->x[b] - r->x[a], r->y[b] - r->y[a]);
}

static void judge(ring *r, size_t b)
{
    const size_t a = (b + r->n - 1) % r->n, c = (b + 1) % r->n;
    const double area = turn(r, a, b, c);
    r->badness[b] = -1.0;
    if (!(area > 0.0) || !is_empty(r, a, b, c)) return;
    const double perimeter = side(r, a, b) + side(r, b, c) + side(r, c, a);
    r->badness[b] = perimeter * perimeter / area;
}

static void drop(ring *r, size_t b)
{
    const size_t after = r->n - b - 1;
    memmove(r->corner + b, r->corner + b + 1, after * sizeof *r->corner);
    memmove(r->x + b, r->x + b + 1, after * sizeof *r->x);
    memmove(r->y + b, r->y + b + 1, after * sizeof *r->y);
    memmove(r->badness + b, r->badness + b + 1, after * sizeof *r->badness);
    r->n--;
}

/* out <- r->n - 2 triangles; a fan of what is left where there is no ear (no area). */
static void cut_ears(ring *r, uint32_t *out)
{
    for (size_t k = 0; k < r->n; k++) judge(r, k);
    while (r->n > 3) {
        size_t best = r->n;
        for (size_t k = 0; k < r->n; k++)
            if (r->badness[k] >= 0.0 && (best == r->n || r->badness[k] < r->badness[best]))
                best = k;
        if (best == r->n) break;
        const uint32_t ear[3] = { r->corner[best], r->corner[(best + 1) % r->n],
                                  r->corner[(best + r->n - 1) % r->n] };
        memcpy(out, ear, sizeof ear);
        out += 3;
        drop(r, best);
        judge(r, (best + r->n - 1) % r->n);
        judge(r, best % r->n);
    }
    for (size_t k = 1; k + 1 < r->n; k++, out += 3) {
        out[0] = r->corner[k];
        out[1] = r->corner[k + 1];
        out[2] = r->corner[0];
    }
}

/* Into the plane of the two axes in which the polygon has the largest area. */
static void flatten(const soup *m, const uint32_t *corner, ring *r)
{
    double area[3] = { 0, 0, 0 };
    const double *const o = m->point + 3 * corner[0];
    for (size_t k = 1; k + 1 < r->n; k++) {
        const double *const p = m->point + 3 * corner[k], *const q = m->point + 3 * corner[k + 1];
        for (int c = 0; c < 3; c++) {
            const int u = (c + 1) % 3, v = (c + 2) % 3;
            area[c] += (p[u] - o[u]) * (q[v] - o[v]) - (p[v] - o[v]) * (q[u] - o[u]);
        }
    }
    int axis = 0;
    for (int c = 1; c < 3; c++)
        if (fabs(area[c]) > fabs(area[axis])) axis = c;
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (size_t k = 0; k < r->n; k++) {
        const double *const p = m->point + 3 * corner[k];
        r->corner[k] = corner[k];
        r->x[k] = (p[u] - o[u]) * (area[axis] < 0.0 ? -1.0 : 1.0);
        r->y[k] = p[v] - o[v];
    }
}

static size_t largest_polygon(const soup *m)
{
    size_t most = 0;
    for (size_t p = 0; p < m->polygons; p++) {
        const size_t n = m->end[p] - (p ? m->end[p - 1] : 0);
        if (n > most) most = n;
    }
    return most;
}

static void cut_all(const soup *m, ring *r, uint32_t *out)
{
    for (size_t p = 0; p < m->polygons; p++) {
        const size_t first = p ? m->end[p - 1] : 0;
        r->n = m->end[p] - first;
        const size_t cut = 3 * (r->n - 2);
        if (r->n == 3) {
            memcpy(out, m->corner + first, 3 * sizeof *out);
        } else {
            flatten(m, m->corner + first, r);
            cut_ears(r, out);
        }
        out += cut;
    }
}

void soup_triangulate(scan *s, soup *m)
{
    const size_t most = largest_polygon(m), triangles = m->corners - 2 * m->polygons;
    if (!scan_ok(s) || most <= 3) return;
    if (most > MOST_CORNERS) {
        scan_refuse(s, APSM_ERR_FORMAT, "a face has %zu corners; cut it into triangles first",
                    most);
        return;
    }
    uint32_t *const out = malloc(3 * triangles * sizeof *out);
    ring r = { 0, malloc(most * sizeof *r.corner), malloc(most * sizeof *r.x),
               malloc(most * sizeof *r.y), malloc(most * sizeof *r.badness) };
    size_t *const end = malloc(triangles * sizeof *end);
    if (out && end && r.corner && r.x && r.y && r.badness) {
        cut_all(m, &r, out);
        for (size_t t = 0; t < triangles; t++) end[t] = 3 * (t + 1);
        free(m->corner);
        free(m->end);
        m->corner = out;
        m->end = end;
        m->corners = m->corner_room = 3 * triangles;
        m->polygons = m->polygon_room = triangles;
    } else {
        scan_no_memory(s);
        free(out);
        free(end);
    }
    free(r.corner);
    free(r.x);
    free(r.y);
    free(r.badness);
}
