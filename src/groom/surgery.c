/* Local changes of a triangle mesh on indexed half-edges.  Every operation keeps the mesh
 * closed (by ghosts, if it was open), oriented and of the same genus, given the conditions stated
 * in surgery.h (link condition: Dey, Edelsbrunner, Guha & Nekhayev, "Topology preserving edge
 * contraction", 1999). */
#include "groom/surgery.h"

#include <stdlib.h>
#include <string.h>

static bool resize(void *array, size_t count, size_t bytes)
{
    void **at = array;
    void *grown = realloc(*at, count * bytes);
    if (!grown) return false;
    *at = grown;
    return true;
}

static apsm_status reserve(surgery *s, size_t nv, size_t nf)
{
    if (nv > s->cap_v) {
        const size_t cap = nv + nv / 2;
        if (!resize(&s->V, 3 * cap, sizeof *s->V) || !resize(&s->size, cap, sizeof *s->size) ||
            !resize(&s->out, cap, sizeof *s->out) || !resize(&s->mark, cap, sizeof *s->mark))
            return APSM_ERR_MEMORY;
        memset(s->mark + s->cap_v, 0, (cap - s->cap_v) * sizeof *s->mark);
        s->cap_v = cap;
    }
    if (nf > s->cap_f) {
        const size_t cap = nf + nf / 2;
        if (cap > UINT32_MAX / 3 - 1) return APSM_ERR_MEMORY;
        if (!resize(&s->F, 3 * cap, sizeof *s->F) || !resize(&s->twin, 3 * cap, sizeof *s->twin))
            return APSM_ERR_MEMORY;
        s->cap_f = cap;
    }
    return APSM_OK;
}

void surgery_free(surgery *s)
{
    free(s->V);
    free(s->size);
    free(s->out);
    free(s->mark);
    free(s->F);
    free(s->twin);
    *s = (surgery){ 0 };
}

static apsm_status begin_closed(surgery *s, const apsm_mesh *mesh, const apsm_topology *topology)
{
    APSM_TRY(reserve(s, mesh->nv, mesh->nf));
    s->nv = mesh->nv;
    s->nf = s->live_f = mesh->nf;
    memcpy(s->V, mesh->V, 3 * s->nv * sizeof *s->V);
    memcpy(s->F, mesh->F, 3 * s->nf * sizeof *s->F);
    memcpy(s->twin, topology->twin, 3 * s->nf * sizeof *s->twin);
    for (size_t h = 3 * s->nf; h-- > 0;) s->out[s->F[h]] = (uint32_t)h;
    return APSM_OK;
}

/* Adds the ghosts' vertices and faces to closed, a copy of the mesh with room for them.  from
 * (nv): the border's half-edge that starts at a vertex, or APSM_NONE; it is used up. */
static void add_ghosts(surgery *s, uint32_t *from, apsm_mesh *closed)
{
    s->first_ghost = (uint32_t)closed->nv;
    for (uint32_t v = 0; v < s->first_ghost; v++) {
        if (from[v] == APSM_NONE) continue;
        const uint32_t ghost = (uint32_t)closed->nv++;
        memcpy(closed->V + 3 * (size_t)ghost, closed->V + 3 * (size_t)v, 3 * sizeof *closed->V);
        for (uint32_t a = v; from[a] != APSM_NONE;) {
            const uint32_t b = closed->F[he_next(from[a])];
            uint32_t *face = closed->F + 3 * closed->nf++;
            face[0] = b, face[1] = a, face[2] = ghost;
            from[a] = APSM_NONE;
            a = b;
        }
        s->ghosts++;
    }
}

static apsm_status begin_open(surgery *s, const apsm_mesh *mesh, const apsm_topology *topology,
                              size_t border)
{
    apsm_mesh closed;
    apsm_topology with_ghosts;
    uint32_t *from = malloc(mesh->nv * sizeof *from);
    if (!from) return APSM_ERR_MEMORY;
    apsm_status status = apsm_mesh_alloc(&closed, mesh->nv + border, mesh->nf + border);
    if (status == APSM_OK) {
        memset(from, 0xff, mesh->nv * sizeof *from);
        for (uint32_t h = 0; h < 3 * mesh->nf; h++)
            if (topology->twin[h] == APSM_NONE) from[mesh->F[h]] = h;
        memcpy(closed.V, mesh->V, 3 * mesh->nv * sizeof *mesh->V);
        memcpy(closed.F, mesh->F, 3 * mesh->nf * sizeof *mesh->F);
        closed.nv = mesh->nv;
        closed.nf = mesh->nf;
        add_ghosts(s, from, &closed);
        status = apsm_topology_build(&closed, &with_ghosts);
        if (status == APSM_OK) {
            status = begin_closed(s, &closed, &with_ghosts);
            apsm_topology_free(&with_ghosts);
        }
        apsm_mesh_free(&closed);
    }
    free(from);
    return status;
}

apsm_status surgery_begin(surgery *s, const apsm_mesh *mesh)
{
    *s = (surgery){ 0 };
    apsm_topology topology;
    APSM_TRY(apsm_topology_build(mesh, &topology));
    size_t border = 0;
    for (size_t h = 0; h < 3 * mesh->nf; h++) border += topology.twin[h] == APSM_NONE;
    const apsm_status status =
        border ? begin_open(s, mesh, &topology, border) : begin_closed(s, mesh, &topology);
    if (status != APSM_OK) surgery_free(s);
    apsm_topology_free(&topology);
    return status;
}

uint32_t surgery_to_ghost(const surgery *s, uint32_t v)
{
    uint32_t h = s->out[v];
    if (s->ghosts == 0) return APSM_NONE;
    do {
        if (is_ghost(s, he_to(s, h))) return h;
        h = he_turn(s, h);
    } while (h != s->out[v]);
    return APSM_NONE;
}

size_t surgery_valence(const surgery *s, uint32_t v)
{
    size_t n = 0;
    const uint32_t first = s->out[v];
    uint32_t h = first;
    do {
        n++;
        h = he_turn(s, h);
    } while (h != first);
    return n;
}

bool surgery_joined(const surgery *s, uint32_t a, uint32_t b)
{
    const uint32_t first = s->out[a];
    uint32_t h = first;
    do {
        if (he_to(s, h) == b) return true;
        h = he_turn(s, h);
    } while (h != first);
    return false;
}

static void set_face(surgery *s, uint32_t f, uint32_t a, uint32_t b, uint32_t c)
{
    s->F[3 * f] = a;
    s->F[3 * f + 1] = b;
    s->F[3 * f + 2] = c;
}

static void join(surgery *s, uint32_t h, uint32_t g)
{
    s->twin[h] = g;
    s->twin[g] = h;
}

apsm_status surgery_split(surgery *s, uint32_t h, const double x[3], uint32_t *made)
{
    APSM_TRY(reserve(s, s->nv + 1, s->nf + 2));
    /* (a,b,c), (b,a,d)  ->  (a,m,c), (m,b,c), (b,m,d), (m,a,d) */
    const uint32_t g = s->twin[h], hn = he_next(h), gn = he_next(g);
    const uint32_t a = he_from(s, h), b = he_to(s, h), c = he_apex(s, h), d = he_apex(s, g);
    const uint32_t m = (uint32_t)s->nv++, f1 = (uint32_t)s->nf, f2 = f1 + 1;
    s->nf += 2;
    s->live_f += 2;
    memcpy(s->V + 3 * m, x, 3 * sizeof *x);
    s->size[m] = 0.5 * (s->size[a] + s->size[b]);
    s->mark[m] = 0;
    const uint32_t bc = s->twin[hn], ad = s->twin[gn];
    s->F[hn] = m; /* h's face is now (a,m,c), g's (b,m,d) */
    s->F[gn] = m;
    set_face(s, f1, m, b, c);
    set_face(s, f2, m, a, d);
    join(s, h, 3 * f2);
    join(s, g, 3 * f1);
    join(s, 3 * f1 + 1, bc);
    join(s, 3 * f2 + 1, ad);
    join(s, 3 * f1 + 2, hn);
    join(s, 3 * f2 + 2, gn);
    s->out[m] = 3 * f1;
    s->out[a] = h;
    s->out[b] = g;
    s->out[c] = he_prev(h);
    s->out[d] = he_prev(g);
    *made = m;
    return APSM_OK;
}

apsm_status surgery_insert(surgery *s, uint32_t f, const double x[3], uint32_t *made)
{
    APSM_TRY(reserve(s, s->nv + 1, s->nf + 2));
    /* (a,b,c)  ->  (a,b,m), (b,c,m), (c,a,m) */
    const uint32_t a = s->F[3 * f], b = s->F[3 * f + 1], c = s->F[3 * f + 2];
    const uint32_t bc = s->twin[3 * f + 1], ca = s->twin[3 * f + 2];
    const uint32_t m = (uint32_t)s->nv++, f1 = (uint32_t)s->nf, f2 = f1 + 1;
    s->nf += 2;
    s->live_f += 2;
    memcpy(s->V + 3 * m, x, 3 * sizeof *x);
    s->size[m] = (s->size[a] + s->size[b] + s->size[c]) / 3.0;
    s->mark[m] = 0;
    s->F[3 * f + 2] = m;
    set_face(s, f1, b, c, m);
    set_face(s, f2, c, a, m);
    join(s, 3 * f1, bc);
    join(s, 3 * f2, ca);
    join(s, 3 * f + 1, 3 * f1 + 2);
    join(s, 3 * f1 + 1, 3 * f2 + 2);
    join(s, 3 * f2 + 1, 3 * f + 2);
    s->out[m] = 3 * f + 2;
    s->out[a] = 3 * f;
    s->out[b] = 3 * f1;
    s->out[c] = 3 * f2;
    *made = m;
    return APSM_OK;
}

void surgery_flip(surgery *s, uint32_t h)
{
    /* (a,b,c), (b,a,d)  ->  (d,c,a), (c,d,b) */
    const uint32_t g = s->twin[h], f = h / 3, e = g / 3;
    const uint32_t a = he_from(s, h), b = he_to(s, h), c = he_apex(s, h), d = he_apex(s, g);
    const uint32_t bc = s->twin[he_next(h)], ca = s->twin[he_prev(h)];
    const uint32_t ad = s->twin[he_next(g)], db = s->twin[he_prev(g)];
    set_face(s, f, d, c, a);
    set_face(s, e, c, d, b);
    join(s, 3 * f, 3 * e);
    join(s, 3 * f + 1, ca);
    join(s, 3 * f + 2, ad);
    join(s, 3 * e + 1, db);
    join(s, 3 * e + 2, bc);
    s->out[a] = 3 * f + 2;
    s->out[b] = 3 * e + 2;
    s->out[c] = 3 * e;
    s->out[d] = 3 * f;
}

bool surgery_collapsible(surgery *s, uint32_t h)
{
    const uint32_t a = he_from(s, h), b = he_to(s, h);
    const uint32_t c = he_apex(s, h), d = he_apex(s, s->twin[h]);
    const uint32_t stamp = ++s->stamp;
    uint32_t g = s->out[a];
    do {
        s->mark[he_to(s, g)] = stamp;
        g = he_turn(s, g);
    } while (g != s->out[a]);
    size_t common = 0;
    g = s->out[b];
    do {
        if (s->mark[he_to(s, g)] == stamp) common++;
        g = he_turn(s, g);
    } while (g != s->out[b]);
    return common == 2 && surgery_valence(s, c) > 3 && surgery_valence(s, d) > 3;
}

/* Removes the face of h, whose two other edges become one. */
static void close_face(surgery *s, uint32_t h)
{
    const uint32_t p = s->twin[he_next(h)], q = s->twin[he_prev(h)];
    const uint32_t apex = he_apex(s, h);
    join(s, p, q);
    s->out[apex] = p;
    s->F[h - h % 3] = APSM_NONE;
    s->live_f--;
}

void surgery_collapse(surgery *s, uint32_t h)
{
    const uint32_t a = he_from(s, h), b = he_to(s, h), g = s->twin[h];
    const uint32_t first = s->out[b];
    uint32_t k = first;
    do { /* he_turn looks at twins only, so the corners can change on the way */
        s->F[k] = a;
        k = he_turn(s, k);
    } while (k != first);
    /* Outside the two faces, the twin of (c, a) leaves a: it survives. */
    const uint32_t keep = s->twin[he_prev(h)];
    close_face(s, h);
    close_face(s, g);
    s->out[a] = keep;
    s->out[b] = APSM_NONE;
}

bool surgery_pulls(const surgery *s, uint32_t h)
{
    if (s->ghosts == 0) return true;
    if (is_ghost(s, he_from(s, h)) || is_ghost(s, he_to(s, h))) return false;
    return surgery_to_ghost(s, he_to(s, h)) == APSM_NONE || he_on_border(s, h);
}

size_t surgery_faces(const surgery *s)
{
    size_t n = s->live_f;
    for (uint32_t k = 0; k < s->ghosts; k++) n -= surgery_valence(s, s->first_ghost + k);
    return n;
}

bool surgery_keeps(const surgery *s, uint32_t v)
{
    return s->out[v] != APSM_NONE && !is_ghost(s, v);
}

apsm_status surgery_result(const surgery *s, apsm_mesh *mesh)
{
    uint32_t *name = malloc(s->nv * sizeof *name + 1);
    if (!name) return APSM_ERR_MEMORY;
    uint32_t nv = 0;
    for (uint32_t v = 0; v < s->nv; v++)
        if (surgery_keeps(s, v)) name[v] = nv++;
    const apsm_status status = apsm_mesh_alloc(mesh, nv, surgery_faces(s));
    if (status == APSM_OK) {
        size_t n = 0;
        for (uint32_t v = 0; v < s->nv; v++)
            if (surgery_keeps(s, v))
                memcpy(mesh->V + 3 * name[v], s->V + 3 * (size_t)v, 3 * sizeof *s->V);
        for (uint32_t h = 0; h < 3 * s->nf; h++)
            if (he_live(s, h) && !he_ghost_face(s, h)) mesh->F[n++] = name[s->F[h]];
    }
    free(name);
    return status;
}
