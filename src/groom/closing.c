/* With d(x, A) the distance of a voxel's centre to the nearest of A and r the radius:
 *
 *   dilated = { x : d(x, mask) <= r },   closed = { x : d(x, not dilated) > r }
 *
 * Squared distances by lower envelopes (envelope.c), one axis after the other.
 * Tunnels by Euler's number of the union of closed voxels, vertices - edges + faces - voxels, which
 * is the parts and the cavities less the tunnels. */
#include "groom/closing.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "groom/envelope.h"
#include "groom/parts.h"

/* d (n, in: 0 or INFINITY): squared distances. */
static void transform(const size_t n[3], const double spacing[3], const envelope *e, float *d)
{
    const size_t step[3] = { 1, n[0], n[0] * n[1] };
    for (int c = 0; c < 3; c++) {
        const int a = (c + 1) % 3, b = (c + 2) % 3;
        for (size_t i = 0; i < n[a]; i++)
            for (size_t k = 0; k < n[b]; k++) {
                float *line = d + i * step[a] + k * step[b];
                for (size_t p = 0; p < n[c]; p++) e->f[p] = line[p * step[c]];
                envelope_line(n[c], spacing[c], e);
                for (size_t p = 0; p < n[c]; p++) line[p * step[c]] = (float)e->f[p];
            }
    }
}

/* The crop with a rim of the radius. */
typedef struct padded {
    size_t n[3], rim[3];
    float *d;
    envelope e;
} padded;

static void padded_free(padded *p)
{
    free(p->d);
    envelope_free(&p->e);
}

static apsm_status padded_new(padded *p, const mask *m, const double spacing[3], double radius)
{
    size_t longest = 0;
    *p = (padded){ .d = NULL };
    for (int c = 0; c < 3; c++) {
        p->rim[c] = (size_t)ceil(radius / spacing[c]) + 1;
        p->n[c] = m->n[c] + 2 * p->rim[c];
        if (p->n[c] > longest) longest = p->n[c];
    }
    p->d = malloc(p->n[0] * p->n[1] * p->n[2] * sizeof *p->d);
    if (p->d && envelope_new(longest, &p->e) == APSM_OK) return APSM_OK;
    padded_free(p);
    return APSM_ERR_MEMORY;
}

static size_t padded_index(const padded *p, size_t x, size_t y, size_t z)
{
    return x + p->rim[0] + p->n[0] * (y + p->rim[1] + p->n[1] * (z + p->rim[2]));
}

/* d > r^2 (out) at what a closing of the mask (value 1) or of the background (value 0) leaves out.
 */
static void dilate_and_erode(padded *p, const mask *m, unsigned char value, const double spacing[3],
                             double radius)
{
    const size_t total = p->n[0] * p->n[1] * p->n[2];
    const float r2 = (float)(radius * radius);
    size_t i = 0;
    for (size_t k = 0; k < total; k++) p->d[k] = value ? INFINITY : 0.0f;
    for (size_t z = 0; z < m->n[2]; z++)
        for (size_t y = 0; y < m->n[1]; y++)
            for (size_t x = 0; x < m->n[0]; x++, i++)
                p->d[padded_index(p, x, y, z)] = m->in[i] == value ? 0.0f : INFINITY;
    transform(p->n, spacing, &p->e, p->d);
    for (size_t k = 0; k < total; k++) p->d[k] = p->d[k] <= r2 ? INFINITY : 0.0f;
    transform(p->n, spacing, &p->e, p->d);
}

/* Voxels that are not `value`, and are within the closing of those that are, become it. */
static apsm_status close_value(mask *m, unsigned char value, const double spacing[3], double radius,
                               size_t *changed)
{
    padded p;
    size_t i = 0;
    const float r2 = (float)(radius * radius);
    *changed = 0;
    APSM_TRY(padded_new(&p, m, spacing, radius));
    dilate_and_erode(&p, m, value, spacing, radius);
    for (size_t z = 0; z < m->n[2]; z++)
        for (size_t y = 0; y < m->n[1]; y++)
            for (size_t x = 0; x < m->n[0]; x++, i++) {
                if (m->in[i] == value || !(p.d[padded_index(&p, x, y, z)] > r2)) continue;
                m->in[i] = value;
                ++*changed;
            }
    padded_free(&p);
    return APSM_OK;
}

apsm_status mask_close(mask *m, const double spacing[3], double radius, size_t *added)
{
    return close_value(m, 1, spacing, radius, added);
}

apsm_status mask_open(mask *m, const double spacing[3], double radius, size_t *removed)
{
    return close_value(m, 0, spacing, radius, removed);
}

/* Whether any voxel of the 1 or 2 along each axis before node x, y, z is set: those that share its
 * vertex (2 2 2), an edge, a face, or the voxel itself (1 1 1). */
static bool any_before(const mask *m, const size_t at[3], const size_t width[3])
{
    for (size_t c = 0; c < width[2]; c++)
        for (size_t b = 0; b < width[1]; b++)
            for (size_t a = 0; a < width[0]; a++)
                if (m->in[at[0] - a + m->n[0] * (at[1] - b + m->n[1] * (at[2] - c))]) return true;
    return false;
}

/* Vertices - edges + faces - voxels whose highest corner is in the box [lo, hi]. */
static long euler_number(const mask *m, const size_t lo[3], const size_t hi[3])
{
    long euler = 0;
    for (size_t z = lo[2]; z <= hi[2]; z++)
        for (size_t y = lo[1]; y <= hi[1]; y++)
            for (size_t x = lo[0]; x <= hi[0]; x++) {
                const size_t at[3] = { x, y, z };
                if (!any_before(m, at, (const size_t[3]){ 2, 2, 2 })) continue;
                for (unsigned k = 0; k < 8; k++) { /* widths; each axis of width 1 is a dimension */
                    const size_t width[3] = { 1 + (k & 1), 1 + (k >> 1 & 1), 1 + (k >> 2 & 1) };
                    if (!any_before(m, at, width)) continue;
                    euler += (width[0] + width[1] + width[2]) % 2 ? -1 : 1;
                }
            }
    return euler;
}

long mask_euler(const mask *m, const size_t lo[3], const size_t hi[3])
{
    size_t from[3], to[3];
    for (int c = 0; c < 3; c++) {
        from[c] = lo[c] > 1 ? lo[c] : 1;
        to[c] = hi[c] + 1 < m->n[c] ? hi[c] + 1 : m->n[c] - 1;
    }
    return euler_number(m, from, to);
}

apsm_status mask_tunnels(const mask *m, long *tunnels)
{
    const size_t lo[3] = { 1, 1, 1 }, hi[3] = { m->n[0] - 1, m->n[1] - 1, m->n[2] - 1 };
    parts inside, outside;
    APSM_TRY(parts_find(m->n, m->in, 1, true, &inside));
    const apsm_status status = parts_find(m->n, m->in, 0, false, &outside);
    if (status == APSM_OK)
        *tunnels = (long)inside.n + (long)outside.n - 1 - euler_number(m, lo, hi);
    parts_free(&inside);
    parts_free(&outside);
    return status;
}
