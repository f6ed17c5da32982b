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
#include "geometry/volume.h"
#include "groom/closing.h"
#include "groom/parts.h"

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
            const size_t row = v->n[0] * (y + v->n[1] * z);
            size_t from = 0, to = v->n[0];
            while (from < to && !volume_label(v, row + from)) from++;
            if (from == to) continue;
            while (!volume_label(v, row + to - 1)) to--;
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
        m->origin[c] = (ptrdiff_t)(v->first[c] + lo[c]) - (ptrdiff_t)rim[c];
    }
    m->in = calloc(m->n[0] * m->n[1] * m->n[2], 1);
    if (!m->in) return APSM_ERR_MEMORY;
    for (size_t z = lo[2]; z <= hi[2]; z++)
        for (size_t y = lo[1]; y <= hi[1]; y++) {
            const size_t row = v->n[0] * (y + v->n[1] * z);
            unsigned char *to =
                m->in + m->n[0] * (y - lo[1] + rim[1] + m->n[1] * (z - lo[2] + rim[2])) + rim[0];
            for (size_t x = lo[0]; x <= hi[0]; x++) to[x - lo[0]] = volume_label(v, row + x) != 0;
        }
    return APSM_OK;
}

/* Keeps the largest part (the first of equals); voxels of the rest become background. */
static apsm_status keep_largest(mask *m, apsm_groom_report *r)
{
    parts p;
    size_t best = 0, all = 0;
    APSM_TRY(parts_find(m->n, m->in, 1, true, &p));
    for (size_t i = 0; i < p.n; i++) {
        all += p.size[i];
        if (p.size[i] > p.size[best]) best = i;
    }
    memset(m->in, 0, m->n[0] * m->n[1] * m->n[2]);
    parts_paint(m->n, &p, best, 1, m->in);
    r->dropped_parts = p.n - 1;
    r->dropped_voxels = all - p.size[best];
    r->voxels = p.size[best];
    parts_free(&p);
    return APSM_OK;
}

double mask_size(const apsm_volume *v, size_t voxels)
{
    double M[16];
    apsm_volume_index_to_lps(v, M);
    return cbrt((double)voxels * fabs(apsm_affine_det(M)));
}

apsm_status mask_fill_cavities(mask *m, size_t *filled)
{
    parts p;
    *filled = 0;
    APSM_TRY(parts_find(m->n, m->in, 0, false, &p));
    for (size_t i = 1; i < p.n; i++) { /* part 0 has voxel 0, which is in the rim */
        *filled += p.size[i];
        parts_paint(m->n, &p, i, 1, m->in);
    }
    parts_free(&p);
    return APSM_OK;
}

static apsm_status fill_cavities(mask *m, apsm_groom_report *r)
{
    size_t filled;
    APSM_TRY(mask_fill_cavities(m, &filled));
    r->filled_voxels += filled;
    r->voxels += filled;
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
                    if (p == (ptrdiff_t)(v->whole[c] ? v->whole[c] : v->n[c]) - 1)
                        r->border |= 2u << (2 * c);
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
    if (r->dropped_parts && (!opt->largest_component || share > opt->max_drop_share))
        return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                         "%s: the label has %zu separate parts; those beside the largest have %.1f "
                         "%% of its voxels; remove them, or give each part a label of its own",
                         name, r->dropped_parts + 1, 100.0 * share);
    return APSM_OK;
}

/* A radius that was asked for, as a length or as a share of the size. */
static double radius_of(double length, double share, double size)
{
    return length > 0.0 ? length : share > 0.0 ? share * size : 0.0;
}

/* The opening that was asked for; of what it leaves the largest part is kept. */
static apsm_status open_strands(apsm_context *ctx, const char *name, mask *m, const apsm_volume *v,
                                const apsm_groom_options *opt, apsm_groom_report *r)
{
    const size_t before = r->voxels;
    apsm_groom_report after = { 0 };
    const double radius = radius_of(opt->opening_length, opt->opening, mask_size(v, before));
    if (!(radius > 0.0)) return APSM_OK;
    size_t removed;
    APSM_TRY(mask_open(m, v->spacing, radius, &removed));
    if (removed == before)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                         "%s: the opening leaves nothing of the label; make its radius smaller",
                         name);
    APSM_TRY(keep_largest(m, &after));
    r->opening = radius;
    r->voxels = after.voxels;
    r->opened_voxels = before - after.voxels;
    return APSM_OK;
}

/* The closing that was asked for, and the cavities that it made. */
static apsm_status close_gaps(mask *m, const apsm_volume *v, const apsm_groom_options *opt,
                              apsm_groom_report *r)
{
    size_t added, filled;
    r->closing = radius_of(opt->closing_length, opt->closing, mask_size(v, r->voxels));
    if (!(r->closing > 0.0)) return APSM_OK;
    APSM_TRY(mask_close(m, v->spacing, r->closing, &added));
    APSM_TRY(mask_fill_cavities(m, &filled));
    r->closed_voxels = added + filled;
    r->voxels += added + filled;
    return APSM_OK;
}

apsm_status mask_keep_given(mask *m)
{
    const size_t total = m->n[0] * m->n[1] * m->n[2];
    if (m->given) return APSM_OK;
    m->given = malloc(total);
    if (!m->given) return APSM_ERR_MEMORY;
    memcpy(m->given, m->in, total);
    return APSM_OK;
}

static apsm_status clean(apsm_context *ctx, const char *name, const apsm_volume *volume,
                         const apsm_groom_options *opt, mask *m, apsm_groom_report *report)
{
    APSM_TRY(keep_largest(m, report));
    APSM_TRY(mask_keep_given(m));
    APSM_TRY(judge(ctx, name, opt, report));
    if (opt->fill_holes) APSM_TRY(fill_cavities(m, report));
    APSM_TRY(open_strands(ctx, name, m, volume, opt, report));
    APSM_TRY(close_gaps(m, volume, opt, report));
    if (memcmp(m->given, m->in, m->n[0] * m->n[1] * m->n[2]) == 0) {
        free(m->given);
        m->given = NULL;
    }
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
    if (status == APSM_OK) status = clean(ctx, name, volume, opt, m, report);
    if (status == APSM_OK) {
        note_border(volume, m, report);
        note_normals(volume, report);
    } else {
        mask_free(m);
    }
    return status;
}

void mask_free(mask *m)
{
    free(m->in);
    free(m->given);
    m->in = m->given = NULL;
}
