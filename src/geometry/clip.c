/* Cuts on edges are found by the edge's two vertices, so that the faces on both sides get the same
 * one: a table of cuts sorted by them. */
#include "geometry/clip.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/topology.h"

static const double snap = 1e-3; /* of an edge */

typedef struct cut {
    uint32_t lo, hi; /* the edge, lo < hi */
} cut;

typedef struct clip {
    const apsm_mesh *mesh;
    signed char *side; /* nv: -1, 0 on the level, 1 */
    const double *field;
    cut *cuts; /* sorted, each once */
    size_t n_cuts;
} clip;

static int by_ends(const void *a, const void *b)
{
    const cut *p = a, *q = b;
    if (p->lo != q->lo) return p->lo < q->lo ? -1 : 1;
    return p->hi < q->hi ? -1 : p->hi > q->hi;
}

static uint32_t next_of(uint32_t h)
{
    return h % 3 == 2 ? h - 2 : h + 1;
}

/* Vertices on the level, or so near to it on an edge that they are taken to be. */
static void find_sides(clip *c)
{
    const apsm_mesh *m = c->mesh;
    const double *f = c->field;
    for (size_t v = 0; v < m->nv; v++) c->side[v] = (signed char)((f[v] > 0.0) - (f[v] < 0.0));
    for (uint32_t h = 0; h < 3 * m->nf; h++) {
        const uint32_t a = m->F[h], b = m->F[next_of(h)];
        if (!(f[a] * f[b] < 0.0)) continue;
        if (fabs(f[a]) < snap * fabs(f[a] - f[b])) c->side[a] = 0;
        if (fabs(f[b]) < snap * fabs(f[a] - f[b])) c->side[b] = 0;
    }
}

static bool crosses(const clip *c, uint32_t a, uint32_t b)
{
    return c->side[a] * c->side[b] < 0;
}

static apsm_status find_cuts(clip *c)
{
    const apsm_mesh *m = c->mesh;
    size_t n = 0;
    for (uint32_t h = 0; h < 3 * m->nf; h++) n += crosses(c, m->F[h], m->F[next_of(h)]);
    c->cuts = malloc(n * sizeof *c->cuts + 1);
    if (!c->cuts) return APSM_ERR_MEMORY;
    n = 0;
    for (uint32_t h = 0; h < 3 * m->nf; h++) {
        const uint32_t a = m->F[h], b = m->F[next_of(h)];
        if (crosses(c, a, b)) c->cuts[n++] = a < b ? (cut){ a, b } : (cut){ b, a };
    }
    qsort(c->cuts, n, sizeof *c->cuts, by_ends);
    for (size_t k = 0; k < n; k++)
        if (c->n_cuts == 0 || by_ends(&c->cuts[c->n_cuts - 1], &c->cuts[k]) != 0)
            c->cuts[c->n_cuts++] = c->cuts[k];
    return APSM_OK;
}

/* The vertex of out, before unused ones are dropped, that cuts edge (a, b). */
static uint32_t cut_of(const clip *c, uint32_t a, uint32_t b)
{
    const cut want = a < b ? (cut){ a, b } : (cut){ b, a };
    const cut *at = bsearch(&want, c->cuts, c->n_cuts, sizeof *c->cuts, by_ends);
    return (uint32_t)(c->mesh->nv + (size_t)(at - c->cuts));
}

/* What is left of face f: a polygon of up to four corners; returns their number. */
static size_t keep_face(const clip *c, size_t f, uint32_t corner[4])
{
    const uint32_t *F = c->mesh->F + 3 * f;
    size_t n = 0;
    bool any = false;
    for (uint32_t k = 0; k < 3; k++) {
        const uint32_t a = F[k], b = F[(k + 1) % 3];
        any = any || c->side[a] > 0;
        if (c->side[a] >= 0) corner[n++] = a;
        if (crosses(c, a, b)) corner[n++] = cut_of(c, a, b);
    }
    return any && n >= 3 ? n : 0;
}

static void place_cut(const clip *c, size_t k, double x[3])
{
    const uint32_t a = c->cuts[k].lo, b = c->cuts[k].hi;
    const double t = c->field[a] / (c->field[a] - c->field[b]);
    for (size_t i = 0; i < 3; i++)
        x[i] = (1.0 - t) * c->mesh->V[3 * (size_t)a + i] + t * c->mesh->V[3 * (size_t)b + i];
}

/* Faces into out->F, by the names that vertices have before unused ones are dropped. */
static void cut_faces(const clip *c, apsm_mesh *out)
{
    out->nf = 0;
    for (size_t f = 0; f < c->mesh->nf; f++) {
        uint32_t corner[4];
        const size_t n = keep_face(c, f, corner);
        for (size_t k = 2; k < n; k++) {
            const uint32_t face[3] = { corner[0], corner[k - 1], corner[k] };
            memcpy(out->F + 3 * out->nf++, face, sizeof face);
        }
    }
}

/* name (nv + cuts) scratch. */
static void cut_vertices(const clip *c, apsm_mesh *out, uint32_t *name)
{
    const size_t nv = c->mesh->nv;
    memset(name, 0xff, (nv + c->n_cuts) * sizeof *name);
    for (size_t h = 0; h < 3 * out->nf; h++) name[out->F[h]] = 0;
    out->nv = 0;
    for (size_t v = 0; v < nv + c->n_cuts; v++) {
        if (name[v] == APSM_NONE) continue;
        double *x = out->V + 3 * out->nv;
        if (v < nv)
            memcpy(x, c->mesh->V + 3 * v, 3 * sizeof *x);
        else
            place_cut(c, v - nv, x);
        name[v] = (uint32_t)out->nv++;
    }
    for (size_t h = 0; h < 3 * out->nf; h++) out->F[h] = name[out->F[h]];
}

static apsm_status cut_all(clip *c, apsm_mesh *out)
{
    find_sides(c);
    APSM_TRY(find_cuts(c));
    APSM_TRY(apsm_mesh_alloc(out, c->mesh->nv + c->n_cuts, 2 * c->mesh->nf));
    uint32_t *name = malloc((c->mesh->nv + c->n_cuts) * sizeof *name + 1);
    if (name) {
        cut_faces(c, out);
        cut_vertices(c, out, name);
    } else {
        apsm_mesh_free(out);
    }
    const bool ok = name != NULL;
    free(name);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}

apsm_status apsm_mesh_clip_field(const apsm_mesh *mesh, const double *field, apsm_mesh *out)
{
    clip c = { .mesh = mesh, .field = field, .side = malloc(mesh->nv + 1) };
    *out = (apsm_mesh){ 0 };
    const apsm_status status = c.side ? cut_all(&c, out) : APSM_ERR_MEMORY;
    free(c.cuts);
    free(c.side);
    return status;
}
