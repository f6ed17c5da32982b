/* Largest part and cavities of a label.  The label is 26-connected, the background 6-connected:
 * the usual dual pair, in which a sheet that runs askew through the voxels neither falls apart
 * nor leaks.  What such contacts across a corner really are is settled later, on the surface.
 * Everything happens in the label's bounding box. */
#include "groom/mask.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "groom/closing.h"

/* Bounding box lo..hi (inclusive) of the label; false if there is none. */
static bool bounding_box(const apsm_volume *v, size_t lo[3], size_t hi[3])
{
    bool any = false;
    for (int c = 0; c < 3; c++) {
        lo[c] = SIZE_MAX;
        hi[c] = 0;
    }
    for (size_t z = 0; z < v->n[2]; z++)
        for (size_t y = 0; y < v->n[1]; y++) {
            const int32_t *row = v->label + v->n[0] * (y + v->n[1] * z);
            size_t from = 0, to = v->n[0];
            while (from < to && !row[from]) from++;
            if (from == to) continue;
            while (!row[to - 1]) to--;
            const size_t first[3] = { from, y, z }, last[3] = { to - 1, y, z };
            for (int c = 0; c < 3; c++) {
                if (first[c] < lo[c]) lo[c] = first[c];
                if (last[c] > hi[c]) hi[c] = last[c];
            }
            any = true;
        }
    return any;
}

static apsm_status crop(const apsm_volume *v, const size_t lo[3], const size_t hi[3],
                        const size_t rim[3], mask *m)
{
    for (int c = 0; c < 3; c++) {
        m->n[c] = hi[c] - lo[c] + 1 + 2 * rim[c];
        m->origin[c] = (ptrdiff_t)lo[c] - (ptrdiff_t)rim[c];
    }
    m->in = calloc(m->n[0] * m->n[1] * m->n[2], 1);
    m->given = malloc(m->n[0] * m->n[1] * m->n[2]);
    if (!m->in || !m->given) return APSM_ERR_MEMORY;
    for (size_t z = lo[2]; z <= hi[2]; z++)
        for (size_t y = lo[1]; y <= hi[1]; y++) {
            const int32_t *row = v->label + v->n[0] * (y + v->n[1] * z);
            unsigned char *to =
                m->in + m->n[0] * (y - lo[1] + rim[1] + m->n[1] * (z - lo[2] + rim[2])) + rim[0];
            for (size_t x = lo[0]; x <= hi[0]; x++) to[x - lo[0]] = row[x] != 0;
        }
    return APSM_OK;
}

/* Collects the voxels of value `from` joined to seed into queue, setting them to `to`; all or
 * only the 6 face neighbours.  The rim of the crop bounds the walk for from = 1; for from = 0
 * the border is checked. */
static size_t flood(mask *m, size_t seed, unsigned char from, unsigned char to, bool all,
                    size_t *queue)
{
    const ptrdiff_t nx = (ptrdiff_t)m->n[0], ny = (ptrdiff_t)m->n[1], nz = (ptrdiff_t)m->n[2];
    size_t n = 0;
    m->in[seed] = to;
    queue[n++] = seed;
    for (size_t i = 0; i < n; i++) {
        const ptrdiff_t p = (ptrdiff_t)queue[i];
        const ptrdiff_t x = p % nx, y = p / nx % ny, z = p / (nx * ny);
        for (int k = 0; k < 27; k++) {
            const int dx = k % 3 - 1, dy = k / 3 % 3 - 1, dz = k / 9 - 1;
            if (!all && abs(dx) + abs(dy) + abs(dz) != 1) continue;
            if (x + dx < 0 || y + dy < 0 || z + dz < 0 || x + dx >= nx || y + dy >= ny ||
                z + dz >= nz)
                continue;
            const size_t q = (size_t)(p + dx + nx * (dy + ny * dz));
            if (m->in[q] != from) continue;
            m->in[q] = to;
            queue[n++] = q;
        }
    }
    return n;
}

enum { OTHER = 2, KEPT = 3, OUTSIDE = 4 };

/* Keeps the largest part (the first of equals); voxels of the rest become background. */
static void keep_largest(mask *m, size_t *queue, apsm_groom_report *r)
{
    const size_t total = m->n[0] * m->n[1] * m->n[2];
    size_t parts = 0, best = 0, best_seed = 0, all = 0;
    for (size_t i = 0; i < total; i++) {
        if (m->in[i] != 1) continue;
        const size_t n = flood(m, i, 1, OTHER, true, queue);
        parts++;
        all += n;
        if (n > best) {
            best = n;
            best_seed = i;
        }
    }
    (void)flood(m, best_seed, OTHER, KEPT, true, queue);
    for (size_t i = 0; i < total; i++) m->in[i] = m->in[i] == KEPT;
    r->dropped_parts = parts - 1;
    r->dropped_voxels = all - best;
    r->voxels = best;
}

double mask_size(const apsm_volume *v, size_t voxels)
{
    double M[16];
    apsm_volume_index_to_lps(v, M);
    return cbrt((double)voxels * fabs(apsm_affine_det(M)));
}

static size_t fill_with(mask *m, size_t *queue)
{
    const size_t total = m->n[0] * m->n[1] * m->n[2];
    size_t filled = 0;
    (void)flood(m, 0, 0, OUTSIDE, false, queue); /* voxel 0 is in the rim */
    for (size_t i = 0; i < total; i++) {
        filled += m->in[i] == 0;
        m->in[i] = m->in[i] != OUTSIDE;
    }
    return filled;
}

apsm_status mask_fill_cavities(mask *m, size_t *filled)
{
    size_t *queue = malloc(m->n[0] * m->n[1] * m->n[2] * sizeof *queue);
    if (!queue) return APSM_ERR_MEMORY;
    *filled = fill_with(m, queue);
    free(queue);
    return APSM_OK;
}

static void fill_cavities(mask *m, size_t *queue, apsm_groom_report *r)
{
    const size_t filled = fill_with(m, queue);
    r->filled_voxels += filled;
    r->voxels += filled;
}

/* The closing that was asked for, and the cavities that it made. */
static apsm_status close_gaps(mask *m, const apsm_volume *v, const apsm_groom_options *opt,
                              size_t *queue, apsm_groom_report *r)
{
    if (!(opt->closing > 0.0)) return APSM_OK;
    size_t added;
    r->closing = opt->closing * mask_size(v, r->voxels);
    APSM_TRY(mask_close(m, v->spacing, r->closing, &added));
    added += fill_with(m, queue);
    r->closed_voxels = added;
    r->voxels += added;
    return APSM_OK;
}

/* At which borders of the image the part kept ends. */
static void note_border(const apsm_volume *v, const mask *m, apsm_groom_report *r)
{
    size_t i = 0;
    for (size_t z = 0; z < m->n[2]; z++)
        for (size_t y = 0; y < m->n[1]; y++)
            for (size_t x = 0; x < m->n[0]; x++, i++) {
                if (!m->in[i]) continue;
                const size_t at[3] = { x, y, z };
                for (int c = 0; c < 3; c++) {
                    const ptrdiff_t p = (ptrdiff_t)at[c] + m->origin[c];
                    if (p == 0) r->border |= 1u << (2 * c);
                    if (p == (ptrdiff_t)v->n[c] - 1) r->border |= 2u << (2 * c);
                }
            }
}

/* Outward normals of those borders, for axes that need not be at right angles. */
static void note_normals(const apsm_volume *v, apsm_groom_report *r)
{
    for (int c = 0; c < 3; c++) {
        double n[3], a[3], b[3], axis[3];
        for (int k = 0; k < 3; k++) {
            a[k] = v->direction[3 * k + (c + 1) % 3];
            b[k] = v->direction[3 * k + (c + 2) % 3];
            axis[k] = v->direction[3 * k + c];
        }
        vec3_cross(a, b, n);
        vec3_normalise(n);
        const double sign = vec3_dot(n, axis) < 0.0 ? -1.0 : 1.0;
        for (int k = 0; k < 3; k++) {
            if (r->border & (1u << (2 * c))) r->border_normal[2 * c][k] = -sign * n[k];
            if (r->border & (2u << (2 * c))) r->border_normal[2 * c + 1][k] = sign * n[k];
        }
    }
}

static apsm_status judge(apsm_context *ctx, const char *name, const apsm_groom_options *opt,
                         const apsm_groom_report *r)
{
    const double share = (double)r->dropped_voxels / (double)(r->dropped_voxels + r->voxels);
    if (r->dropped_parts && (!opt->keep_largest || share > opt->max_drop_share))
        return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                         "%s: the label has %zu separate parts; those beside the largest have %.1f "
                         "%% of its voxels; remove them, or give each part a label of its own",
                         name, r->dropped_parts + 1, 100.0 * share);
    return APSM_OK;
}

apsm_status mask_make(apsm_context *ctx, const char *name, const apsm_volume *volume,
                      const apsm_groom_options *opt, const size_t rim[3], mask *m,
                      apsm_groom_report *report)
{
    size_t lo[3], hi[3];
    *m = (mask){ .in = NULL };
    if (!bounding_box(volume, lo, hi))
        return apsm_fail(ctx, APSM_ERR_GEOMETRY, "%s: no voxel has the label", name);
    apsm_status status = crop(volume, lo, hi, rim, m);
    size_t *queue = malloc(m->n[0] * m->n[1] * m->n[2] * sizeof *queue);
    if (!queue) status = APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        keep_largest(m, queue, report);
        memcpy(m->given, m->in, m->n[0] * m->n[1] * m->n[2]);
        status = judge(ctx, name, opt, report);
        if (opt->fill_cavities) fill_cavities(m, queue, report);
        if (status == APSM_OK) status = close_gaps(m, volume, opt, queue, report);
        note_border(volume, m, report);
        note_normals(volume, report);
    }
    free(queue);
    if (status != APSM_OK) mask_free(m);
    return status;
}

void mask_free(mask *m)
{
    free(m->in);
    free(m->given);
    m->in = m->given = NULL;
}
