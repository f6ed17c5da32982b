/* Marching cubes (Lorensen & Cline 1987) with cases that fit each other: see isosurface_cases.h.
 *
 * A node whose value is the level, or nearly, makes triangles without area, as the surface cuts all
 * edges at that node in one place.  So each value is kept away from the level by a thousandth of
 * its largest step to a neighbour: the surface moves by at most a thousandth of a voxel, and values
 * do not change sides (the level itself counts as inside). */
#include "geometry/isosurface.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/isosurface_cases.h"

enum { MOST_NODES = 1 << 20, MOST = 1 << 30 };

/* Of the grid, two slices at a time: slice[0] is k, slice[1] is k + 1. */
typedef struct sweep {
    const size_t *n;
    const float *values;
    float level;
    float *slice[2];     /* n[0] x n[1]: values less the level, none of them nearly 0 */
    uint32_t *cut[2][2]; /* n[0] x n[1]: the vertex on the edge along x or y that begins here */
    uint32_t *rise;      /* n[0] x n[1]: on the edge from slice 0 to slice 1 */
    apsm_mesh *mesh;
    size_t vertex_room, face_room;
} sweep;

/* The largest step from node i = (x[0], x[1], x[2]) to one of its six neighbours. */
static float largest_step(const sweep *s, size_t i, const size_t x[3])
{
    const float *const v = s->values;
    float step = 0.0f;
    size_t stride = 1;
    for (int c = 0; c < 3; stride *= s->n[c++]) {
        if (x[c] > 0) step = fmaxf(step, fabsf(v[i] - v[i - stride]));
        if (x[c] + 1 < s->n[c]) step = fmaxf(step, fabsf(v[i] - v[i + stride]));
    }
    return step;
}

/* False if a value is not finite. */
static bool fill_slice(const sweep *s, size_t k, float *out)
{
    size_t x[3] = { 0, 0, k }, i = s->n[0] * s->n[1] * k;
    for (x[1] = 0; x[1] < s->n[1]; x[1]++)
        for (x[0] = 0; x[0] < s->n[0]; x[0]++, i++) {
            if (!isfinite(s->values[i])) return false;
            const float least = 1e-3f * largest_step(s, i, x);
            const float d = s->values[i] - s->level, kept = fmaxf(fabsf(d), least);
            *out++ = d > 0.0f ? kept : -kept;
        }
    return true;
}

/* ---- vertices ---- */

static bool room_for(void **array, size_t *room, size_t wanted, size_t size)
{
    if (wanted <= *room) return true;
    const size_t next = 2 * *room > wanted ? 2 * *room : wanted + 1024;
    void *const larger = realloc(*array, next * size);
    if (!larger) return false;
    *array = larger;
    *room = next;
    return true;
}

/* Where the values a at (i, j, k) and b one step further along `axis` have different signs. */
static bool add_vertex(sweep *s, size_t i, size_t j, size_t k, int axis, double a, double b,
                       uint32_t *vertex)
{
    apsm_mesh *const m = s->mesh;
    void *V = m->V;
    if ((a < 0.0) == (b < 0.0)) return true;
    const bool room = room_for(&V, &s->vertex_room, m->nv + 1, 3 * sizeof(double));
    m->V = V;
    if (!room) return false;
    double *const x = m->V + 3 * m->nv;
    x[0] = (double)i;
    x[1] = (double)j;
    x[2] = (double)k;
    x[axis] += a / (a - b);
    *vertex = (uint32_t)m->nv++;
    return true;
}

/* Along x and y in slice `which`, at height k. */
static bool cut_slice(sweep *s, int which, size_t k)
{
    const size_t nx = s->n[0], ny = s->n[1];
    const float *const v = s->slice[which];
    bool good = true;
    for (size_t j = 0, i = 0; j < ny && good; j++)
        for (size_t x = 0; x < nx && good; x++, i++) {
            const double a = (double)v[i];
            if (x + 1 < nx)
                good = add_vertex(s, x, j, k, 0, a, (double)v[i + 1], &s->cut[which][0][i]);
            if (j + 1 < ny && good)
                good = add_vertex(s, x, j, k, 1, a, (double)v[i + nx], &s->cut[which][1][i]);
        }
    return good;
}

static bool cut_between(sweep *s, size_t k)
{
    bool good = true;
    for (size_t j = 0, i = 0; j < s->n[1] && good; j++)
        for (size_t x = 0; x < s->n[0] && good; x++, i++)
            good = add_vertex(s, x, j, k, 2, (double)s->slice[0][i], (double)s->slice[1][i],
                              &s->rise[i]);
    return good;
}

/* ---- triangles ---- */

/* The vertex on edge e of the cell whose first node is i. */
static uint32_t vertex_of(const sweep *s, size_t i, int e)
{
    const size_t u = (size_t)(e & 1), v = (size_t)(e >> 1 & 1), nx = s->n[0];
    if (e < 4) return s->cut[v][0][i + u * nx];
    return e < 8 ? s->cut[v][1][i + u] : s->rise[i + u + v * nx];
}

static bool add_cell(sweep *s, size_t i)
{
    apsm_mesh *const m = s->mesh;
    void *F = m->F;
    unsigned code = 0;
    for (unsigned c = 0; c < 8; c++) {
        const float value = s->slice[c >> 2][i + (c & 1) + (c >> 1 & 1) * s->n[0]];
        code |= (unsigned)(value < 0.0f) << c;
    }
    const char *const cell = isosurface_case[code];
    const size_t corners = strlen(cell);
    const bool room = room_for(&F, &s->face_room, m->nf + corners / 3, 3 * sizeof(uint32_t));
    m->F = F;
    if (!room) return false;
    for (size_t c = 0; c < corners; c++) m->F[3 * m->nf + c] = vertex_of(s, i, cell[c] - 'a');
    m->nf += corners / 3;
    return true;
}

static bool add_layer(sweep *s)
{
    for (size_t j = 0; j + 1 < s->n[1]; j++)
        for (size_t x = 0; x + 1 < s->n[0]; x++)
            if (!add_cell(s, x + s->n[0] * j)) return false;
    return true;
}

static void swap_slices(sweep *s)
{
    float *const slice = s->slice[0];
    s->slice[0] = s->slice[1];
    s->slice[1] = slice;
    for (int a = 0; a < 2; a++) {
        uint32_t *const cut = s->cut[0][a];
        s->cut[0][a] = s->cut[1][a];
        s->cut[1][a] = cut;
    }
}

static apsm_status march(sweep *s)
{
    if (!fill_slice(s, 0, s->slice[1])) return APSM_ERR_NONFINITE;
    if (!cut_slice(s, 1, 0)) return APSM_ERR_MEMORY;
    for (size_t k = 0; k + 1 < s->n[2]; k++) {
        swap_slices(s);
        if (!fill_slice(s, k + 1, s->slice[1])) return APSM_ERR_NONFINITE;
        if (!cut_between(s, k) || !cut_slice(s, 1, k + 1) || !add_layer(s)) return APSM_ERR_MEMORY;
        if (s->mesh->nv > MOST || s->mesh->nf > MOST) return APSM_ERR_GEOMETRY;
    }
    return APSM_OK;
}

static apsm_status with_scratch(sweep *s)
{
    const size_t nodes = s->n[0] * s->n[1];
    float *const slices = malloc(2 * nodes * sizeof *slices);
    uint32_t *const cuts = malloc(5 * nodes * sizeof *cuts);
    apsm_status status = APSM_ERR_MEMORY;
    if (slices && cuts) {
        for (int k = 0; k < 2; k++) {
            s->slice[k] = slices + (size_t)k * nodes;
            for (int a = 0; a < 2; a++) s->cut[k][a] = cuts + (size_t)(2 * k + a) * nodes;
        }
        s->rise = cuts + 4 * nodes;
        status = march(s);
    }
    free(slices);
    free(cuts);
    return status;
}

apsm_status apsm_isosurface(apsm_context *ctx, const size_t n[3], const float *values, double level,
                            apsm_mesh *mesh)
{
    sweep s = { .n = n, .values = values, .level = (float)level, .mesh = mesh };
    *mesh = (apsm_mesh){ 0 };
    for (int c = 0; c < 3; c++)
        if (n[c] < 2 || n[c] > MOST_NODES)
            return apsm_fail(ctx, APSM_ERR_ARG,
                             "iso-surface: a grid needs 2 to 2^20 nodes along each axis");
    const apsm_status status = with_scratch(&s);
    if (status == APSM_OK && mesh->nf > 0) return APSM_OK;
    apsm_mesh_free(mesh);
    if (status == APSM_ERR_MEMORY)
        return apsm_fail(ctx, status, "iso-surface: out of memory; close other programs");
    if (status == APSM_ERR_NONFINITE)
        return apsm_fail(ctx, status, "iso-surface: a value of the grid is not finite");
    return apsm_fail(ctx, APSM_ERR_GEOMETRY, "iso-surface: %s",
                     status == APSM_OK ? "no value lies on the other side of the level"
                                       : "more than 2^30 triangles; resample the image first");
}
