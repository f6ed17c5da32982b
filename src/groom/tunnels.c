/* For rising radii, the closing of the mask and its opening (closing.c) differ from it by pieces. A
 * piece is worth its voxels if changing it leaves fewer tunnels
 *
 *   tunnels = parts + cavities - Euler's number,
 *
 * and neither more parts nor more cavities; those of a radius are tried from the least number of
 * voxels a tunnel on.  Euler's number changes only near the piece, and what does not raise it
 * cannot help: parts and cavities are counted for the few others. */
#include "groom/tunnels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "groom/closing.h"
#include "groom/parts.h"

static const double ladder[] = { 0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.10, 0.12 };
enum { STEPS = sizeof ladder / sizeof *ladder, MOST_TRIED = 200 };
/* Of the mask's voxels, that one cut may take. */
static const double most_cut = 0.02;
/* Times the radius that closed a tunnel: what the closing by that fills beside the plug. */
static const double beside = 1.5;

typedef struct piece {
    size_t part, voxels, lo[3], hi[3];
    double cost; /* voxels a tunnel */
    bool fill;
} piece;

typedef struct work {
    mask *m;
    const double *spacing;
    mask changed[2];     /* opened, closed */
    parts found[2];      /* where they differ: cuts, fills */
    unsigned char *plug; /* 1 where tunnels were filled */
    piece *list;         /* of both */
    size_t count;
    size_t parts, cavities, voxels; /* of m */
    long tunnels;
} work;

static size_t total_of(const mask *m)
{
    return m->n[0] * m->n[1] * m->n[2];
}

/* Parts and cavities of m. */
static apsm_status count_parts(const mask *m, size_t *n_parts, size_t *n_cavities)
{
    parts p;
    APSM_TRY(parts_find(m->n, m->in, 1, true, &p));
    *n_parts = p.n;
    parts_free(&p);
    APSM_TRY(parts_find(m->n, m->in, 0, false, &p));
    *n_cavities = p.n - 1;
    parts_free(&p);
    return APSM_OK;
}

/* changed[fill].in <- 1 where closing or opening changes m. */
static apsm_status find_changes(work *w, bool fill, double radius)
{
    mask *c = &w->changed[fill];
    size_t n;
    memcpy(c->in, w->m->in, total_of(w->m));
    APSM_TRY(fill ? mask_close(c, w->spacing, radius, &n) : mask_open(c, w->spacing, radius, &n));
    for (size_t i = 0; i < total_of(c); i++) c->in[i] ^= w->m->in[i];
    parts_free(&w->found[fill]);
    return parts_find(c->n, c->in, 1, !fill, &w->found[fill]);
}

static void grow_box(piece *p, const size_t from[3], const size_t to[3])
{
    for (int c = 0; c < 3; c++) {
        if (from[c] < p->lo[c]) p->lo[c] = from[c];
        if (to[c] > p->hi[c]) p->hi[c] = to[c];
    }
}

/* Pieces of one kind, with their boxes, to list. */
static void list_pieces(const work *w, bool fill, piece *list)
{
    const parts *f = &w->found[fill];
    const size_t ny = w->m->n[1];
    for (size_t k = 0; k < f->n; k++)
        list[k] = (piece){
            .part = k, .voxels = f->size[k], .lo = { SIZE_MAX, SIZE_MAX, SIZE_MAX }, .fill = fill
        };
    for (size_t row = 0; row < ny * w->m->n[2]; row++)
        for (size_t i = f->first[row]; i < f->first[row + 1]; i++) {
            const part_run *r = &f->run[i];
            const size_t y = row % ny, z = row / ny;
            grow_box(&list[r->part], (const size_t[3]){ r->from, y, z },
                     (const size_t[3]){ r->to - 1, y, z });
        }
}

/* m at the voxels of a piece <- to. */
static void set_piece(const work *w, const piece *p, unsigned char to)
{
    const parts *f = &w->found[p->fill];
    for (size_t z = p->lo[2]; z <= p->hi[2]; z++)
        for (size_t y = p->lo[1]; y <= p->hi[1]; y++) {
            const size_t row = y + w->m->n[1] * z;
            for (size_t i = f->first[row]; i < f->first[row + 1]; i++)
                if (f->run[i].part == p->part)
                    memset(w->m->in + w->m->n[0] * row + f->run[i].from, to,
                           f->run[i].to - f->run[i].from);
        }
}

/* By how much changing the piece raises Euler's number. */
static long euler_gain(const work *w, const piece *p)
{
    const long before = mask_euler(w->m, p->lo, p->hi);
    set_piece(w, p, p->fill);
    const long after = mask_euler(w->m, p->lo, p->hi);
    set_piece(w, p, !p->fill);
    return after - before;
}

static int by_cost(const void *a, const void *b)
{
    const piece *p = a, *q = b;
    if (p->cost != q->cost) return p->cost < q->cost ? -1 : 1;
    if (p->fill != q->fill) return p->fill ? -1 : 1;
    return (p->part > q->part) - (p->part < q->part);
}

/* The pieces of a radius that can help, cheapest first. */
static apsm_status find_pieces(work *w, double radius)
{
    size_t kept = 0;
    for (int fill = 0; fill < 2; fill++) APSM_TRY(find_changes(w, fill, radius));
    const size_t cuts = w->found[0].n, all = cuts + w->found[1].n;
    free(w->list);
    w->list = malloc((all + 1) * sizeof *w->list);
    if (!w->list) return APSM_ERR_MEMORY;
    list_pieces(w, false, w->list);
    list_pieces(w, true, w->list + cuts);
    for (size_t k = 0; k < all; k++) {
        piece *p = &w->list[k];
        if (!p->fill && (double)p->voxels > most_cut * (double)w->voxels) continue;
        const long gain = euler_gain(w, p);
        if (gain <= 0) continue;
        p->cost = (double)p->voxels / (double)gain;
        w->list[kept++] = *p;
    }
    w->count = kept < MOST_TRIED ? kept : MOST_TRIED;
    qsort(w->list, kept, sizeof *w->list, by_cost);
    return APSM_OK;
}

/* Changes the piece if that leaves fewer tunnels. */
static apsm_status try_piece(work *w, const piece *p, double radius, tunnels_report *r)
{
    const long gain = euler_gain(w, p);
    size_t n_parts, n_cavities;
    if (gain <= 0) return APSM_OK;
    set_piece(w, p, p->fill);
    APSM_TRY(count_parts(w->m, &n_parts, &n_cavities));
    if (n_parts > w->parts || n_cavities > w->cavities) {
        set_piece(w, p, !p->fill);
        return APSM_OK;
    }
    const long merged = (long)(w->parts - n_parts) + (long)(w->cavities - n_cavities);
    w->tunnels -= gain + merged;
    w->parts = n_parts;
    w->cavities = n_cavities;
    *(p->fill ? &r->filled : &r->cut) += p->voxels;
    r->radius = radius;
    if (p->fill) parts_paint(w->m->n, &w->found[1], p->part, 1, w->plug);
    return APSM_OK;
}

/* Whether a run of row touches a plug. */
static bool touches_plug(const work *w, size_t row, const part_run *r)
{
    const size_t nx = w->m->n[0], plane = nx * w->m->n[1], at = nx * row;
    for (size_t i = at + r->from; i < at + r->to; i++) /* the rim is never part of a closing */
        if (w->plug[i - 1] || w->plug[i + 1] || w->plug[i - nx] || w->plug[i + nx] ||
            w->plug[i - plane] || w->plug[i + plane])
            return true;
    return false;
}

/* A plug makes two pits of a tunnel: what is narrow beside plugs is filled as well. */
static apsm_status fill_beside(work *w, tunnels_report *r)
{
    const size_t rows = w->m->n[1] * w->m->n[2];
    size_t cavities;
    APSM_TRY(find_changes(w, true, beside * r->radius));
    const parts *f = &w->found[1];
    bool *wanted = calloc(f->n + 1, sizeof *wanted);
    if (!wanted) return APSM_ERR_MEMORY;
    for (size_t row = 0; row < rows; row++)
        for (size_t i = f->first[row]; i < f->first[row + 1]; i++)
            if (!wanted[f->run[i].part]) wanted[f->run[i].part] = touches_plug(w, row, &f->run[i]);
    for (size_t k = 0; k < f->n; k++) {
        if (!wanted[k]) continue;
        parts_paint(w->m->n, f, k, 1, w->m->in);
        r->filled += f->size[k];
    }
    free(wanted);
    APSM_TRY(mask_fill_cavities(w->m, &cavities));
    r->filled += cavities;
    return mask_tunnels(w->m, &r->after);
}

static apsm_status mend(work *w, double size, tunnels_report *r)
{
    size_t i = 0;
    for (; i < total_of(w->m); i++) w->voxels += w->m->in[i];
    APSM_TRY(count_parts(w->m, &w->parts, &w->cavities));
    APSM_TRY(mask_tunnels(w->m, &w->tunnels));
    r->before = w->tunnels;
    for (int k = 0; k < STEPS && w->tunnels > 0; k++) {
        APSM_TRY(find_pieces(w, ladder[k] * size));
        for (i = 0; i < w->count && w->tunnels > 0; i++)
            APSM_TRY(try_piece(w, &w->list[i], ladder[k] * size, r));
    }
    r->after = w->tunnels;
    return r->filled > 0 ? fill_beside(w, r) : APSM_OK;
}

apsm_status mask_mend_tunnels(mask *m, const double spacing[3], double size, tunnels_report *report)
{
    work w = { .m = m, .spacing = spacing, .changed = { *m, *m } };
    *report = (tunnels_report){ 0 };
    for (int fill = 0; fill < 2; fill++) w.changed[fill].in = malloc(total_of(m));
    w.plug = calloc(total_of(m), 1);
    apsm_status status =
        w.changed[0].in && w.changed[1].in && w.plug ? mend(&w, size, report) : APSM_ERR_MEMORY;
    for (int fill = 0; fill < 2; fill++) {
        free(w.changed[fill].in);
        parts_free(&w.found[fill]);
    }
    free(w.list);
    free(w.plug);
    return status;
}
