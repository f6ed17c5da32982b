/* mesh_mask.h -- the segmentation of a closed mesh: voxels whose centres are inside.  Along every
 * row of voxels the crossings of the surface are sorted; the inside is between the first and the
 * second, the third and the fourth. */
#ifndef APSM_TEST_MESH_MASK_H
#define APSM_TEST_MESH_MASK_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/mesh.h"
#include "apsm/volume.h"
#include "core/random.h"

enum { MASK_MARGIN = 3 };

typedef struct mask_crossing {
    size_t row;
    double x;
} mask_crossing;

typedef struct mask_crossings {
    mask_crossing *at;
    size_t n, room;
} mask_crossings;

static inline int mask_by_row(const void *a, const void *b)
{
    const mask_crossing *p = a, *q = b;
    if (p->row != q->row) return p->row < q->row ? -1 : 1;
    return (p->x > q->x) - (p->x < q->x);
}

static inline void mask_add(mask_crossings *c, size_t row, double x)
{
    if (c->n == c->room) {
        c->room = 2 * c->room + 1024;
        c->at = realloc(c->at, c->room * sizeof *c->at);
        if (!c->at) abort();
    }
    c->at[c->n++] = (mask_crossing){ row, x };
}

/* Rows (y, z) that the face crosses.  A centre on an edge would count twice or not at all; centres
 * are off by an irrational share of a voxel, so that none is. */
static inline void mask_face(const apsm_volume *v, const double *a, const double *b,
                             const double *c, mask_crossings *out)
{
    const double *p[3] = { a, b, c };
    size_t lo[3] = { 0 }, hi[3] = { 0 };
    for (int k = 1; k < 3; k++) {
        const double least = fmin(a[k], fmin(b[k], c[k])), most = fmax(a[k], fmax(b[k], c[k]));
        lo[k] = (size_t)fmax(ceil((least - v->origin[k]) / v->spacing[k]), 0);
        hi[k] = (size_t)fmax(floor((most - v->origin[k]) / v->spacing[k]) + 1, 0);
    }
    for (size_t z = lo[2]; z < hi[2] && z < v->n[2]; z++)
        for (size_t y = lo[1]; y < hi[1] && y < v->n[1]; y++) {
            const double q[2] = { v->origin[1] + v->spacing[1] * (double)y,
                                  v->origin[2] + v->spacing[2] * (double)z };
            double w[3], sum = 0, x = 0;
            for (int k = 0; k < 3; k++) {
                const double *r = p[(k + 1) % 3], *s = p[(k + 2) % 3];
                w[k] = (r[1] - q[0]) * (s[2] - q[1]) - (s[1] - q[0]) * (r[2] - q[1]);
                sum += w[k];
            }
            const bool in =
                (w[0] > 0 && w[1] > 0 && w[2] > 0) || (w[0] < 0 && w[1] < 0 && w[2] < 0);
            for (int k = 0; in && k < 3; k++) x += w[k] / sum * p[k][0];
            if (in) mask_add(out, y + v->n[1] * z, x);
        }
}

static inline void mask_fill(apsm_volume *v, const mask_crossings *c)
{
    for (size_t k = 0; k + 1 < c->n;) {
        if (c->at[k].row != c->at[k + 1].row) {
            k++;
            continue;
        }
        for (size_t i = 0; i < v->n[0]; i++) {
            const double x = v->origin[0] + v->spacing[0] * (double)i;
            if (x > c->at[k].x && x < c->at[k + 1].x) v->label[i + v->n[0] * c->at[k].row] = 1;
        }
        k += 2;
    }
}

static inline apsm_volume mesh_mask(const apsm_mesh *mesh, const double spacing[3])
{
    apsm_volume v = { .direction = { 1, 0, 0, 0, 1, 0, 0, 0, 1 } };
    double lo[3], hi[3];
    mask_crossings c = { 0 };
    apsm_mesh_bounds(mesh, lo, hi);
    for (int k = 0; k < 3; k++) {
        v.spacing[k] = spacing[k];
        v.origin[k] =
            (floor(lo[k] / spacing[k]) - MASK_MARGIN + 0.4142135 * (k + 1) / 3) * spacing[k];
        v.n[k] = (size_t)((hi[k] - v.origin[k]) / spacing[k]) + 1 + MASK_MARGIN;
    }
    v.label = calloc(v.n[0] * v.n[1] * v.n[2], sizeof *v.label);
    if (!v.label) abort();
    for (size_t f = 0; f < mesh->nf; f++) {
        const uint32_t *F = mesh->F + 3 * f;
        mask_face(&v, mesh->V + 3 * F[0], mesh->V + 3 * F[1], mesh->V + 3 * F[2], &c);
    }
    qsort(c.at, c.n, sizeof *c.at, mask_by_row);
    mask_fill(&v, &c);
    free(c.at);
    return v;
}

/* All voxels whose centres are within the radius get the label. */
static inline void mask_blob(apsm_volume *v, const double x[3], double radius, int32_t label)
{
    size_t at = 0;
    for (size_t k = 0; k < v->n[2]; k++)
        for (size_t j = 0; j < v->n[1]; j++)
            for (size_t i = 0; i < v->n[0]; i++, at++) {
                const double d[3] = { v->origin[0] + v->spacing[0] * (double)i - x[0],
                                      v->origin[1] + v->spacing[1] * (double)j - x[1],
                                      v->origin[2] + v->spacing[2] * (double)k - x[2] };
                if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= radius * radius)
                    v->label[at] = label;
            }
}

/* What is wrong with segmentations in practice: near the surface of the mesh that it shows, bubbles
 * inside, specks outside, dents and bumps across. */
static inline void mask_mess(apsm_volume *v, const apsm_mesh *mesh, apsm_random *rng, int level)
{
    const double size = sqrt(apsm_mesh_area(mesh));
    for (int k = 0; k < 12 * level; k++) {
        double x[3];
        const double *on = mesh->V + 3 * apsm_random_below(rng, mesh->nv);
        const double off = (k < 8 * level ? 0.05 : 0.0) * size;
        for (int c = 0; c < 3; c++) x[c] = on[c] + off * (2 * apsm_random_uniform(rng) - 1);
        mask_blob(v, x, (k < 8 * level ? 0.012 : 0.02) * size, k % 2);
    }
}

/* Tunnels (label 0) or strands (label 1) of half to one and a half voxels' radius between points of
 * the surface not far from each other: what a threshold leaves of a sinus. */
static inline void mask_tunnel(apsm_volume *v, const apsm_mesh *mesh, apsm_random *rng,
                               int32_t label)
{
    const double size = sqrt(apsm_mesh_area(mesh)), *a, *b;
    double d;
    do {
        a = mesh->V + 3 * apsm_random_below(rng, mesh->nv);
        b = mesh->V + 3 * apsm_random_below(rng, mesh->nv);
        d = sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                 (a[2] - b[2]) * (a[2] - b[2]));
    } while (d < 0.05 * size || d > 0.25 * size);
    const double h = v->spacing[0], radius = h * (0.5 + apsm_random_uniform(rng));
    for (double s = -2 * h; s <= d + 2 * h; s += 0.5 * h) {
        double x[3];
        for (int c = 0; c < 3; c++) x[c] = a[c] + (b[c] - a[c]) * s / d;
        if (label == 0 || (s >= 0 && s <= d)) mask_blob(v, x, radius, label);
    }
}

/* Cut to the label's own box, `less` voxels less on every side: the label touches all borders. */
static inline void mask_crop(apsm_volume *v, size_t less)
{
    const size_t margin = MASK_MARGIN + less, n[3] = { v->n[0], v->n[1], v->n[2] };
    size_t to = 0;
    for (int c = 0; c < 3; c++) {
        v->n[c] -= 2 * margin;
        v->origin[c] += v->spacing[c] * (double)margin;
    }
    for (size_t k = 0; k < v->n[2]; k++)
        for (size_t j = 0; j < v->n[1]; j++, to += v->n[0])
            memmove(v->label + to, v->label + margin + n[0] * (j + margin + n[1] * (k + margin)),
                    v->n[0] * sizeof *v->label);
}

#endif
