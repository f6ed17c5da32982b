/* Neighbourhood and soundness of triangle meshes.
 *
 * Everything derives from the half-edges sorted by (smaller end, larger end, number): equal ends
 * lie side by side, and such a run is an edge with all its faces.  Two counting passes sort them
 * in O(nv + nf).  Faces with a repeated corner enclose nothing; they take no part, so their
 * neighbours meet across them. */
#include "geometry/topology.h"

#include <stdlib.h>
#include <string.h>

#include "geometry/stored.h"
#include "geometry/vec3.h"

static uint32_t half_edge_end(const uint32_t *F, uint32_t h)
{
    return F[h % 3 == 2 ? h - 2 : h + 1];
}
static uint32_t smaller_end(const uint32_t *F, uint32_t h)
{
    const uint32_t a = F[h], b = half_edge_end(F, h);
    return a < b ? a : b;
}
static uint32_t larger_end(const uint32_t *F, uint32_t h)
{
    const uint32_t a = F[h], b = half_edge_end(F, h);
    return a > b ? a : b;
}

static bool proper(const uint32_t *F, size_t f)
{
    const uint32_t a = F[3 * f], b = F[3 * f + 1], c = F[3 * f + 2];
    return a != b && b != c && c != a;
}

static bool same_edge(const uint32_t *F, uint32_t g, uint32_t h)
{
    return smaller_end(F, g) == smaller_end(F, h) && larger_end(F, g) == larger_end(F, h);
}

/* Stable counting sort of n half-edges by key(F, h); start is scratch (nv + 1). */
static void sort_by(uint32_t (*key)(const uint32_t *, uint32_t), const uint32_t *F, size_t nv,
                    size_t n, const uint32_t *in, uint32_t *out, uint32_t *start)
{
    memset(start, 0, (nv + 1) * sizeof *start);
    for (size_t i = 0; i < n; i++) start[key(F, in[i]) + 1]++;
    for (size_t v = 0; v < nv; v++) start[v + 1] += start[v];
    for (size_t i = 0; i < n; i++) out[start[key(F, in[i])]++] = in[i];
}

apsm_status topology_sort(const apsm_mesh *mesh, uint32_t **sorted, size_t *count)
{
    uint32_t *a = malloc((3 * mesh->nf + 1) * sizeof *a),
             *b = malloc((3 * mesh->nf + 1) * sizeof *b),
             *start = malloc((mesh->nv + 1) * sizeof *start);
    apsm_status status = APSM_ERR_MEMORY;
    if (a && b && start) {
        size_t n = 0;
        for (uint32_t h = 0; h < 3 * mesh->nf; h++)
            if (proper(mesh->F, h / 3)) a[n++] = h;
        sort_by(larger_end, mesh->F, mesh->nv, n, a, b, start);
        sort_by(smaller_end, mesh->F, mesh->nv, n, b, a, start);
        *sorted = a;
        *count = n;
        a = NULL;
        status = APSM_OK;
    }
    free(a);
    free(b);
    free(start);
    return status;
}

/* End of the run of half-edges on the same edge as sorted[i]. */
static size_t run_end(const uint32_t *F, const uint32_t *sorted, size_t n, size_t i)
{
    size_t j = i + 1;
    while (j < n && same_edge(F, sorted[i], sorted[j])) j++;
    return j;
}

static apsm_status check_indices(const apsm_mesh *mesh)
{
    if (mesh->nf > (UINT32_MAX - 1) / 3 || mesh->nv >= UINT32_MAX) return APSM_ERR_GEOMETRY;
    for (size_t i = 0; i < 3 * mesh->nf; i++)
        if (mesh->F[i] >= mesh->nv) return APSM_ERR_GEOMETRY;
    return APSM_OK;
}

static void fill_corners(const apsm_mesh *mesh, apsm_topology *t)
{
    memset(t->corner_start, 0, (mesh->nv + 1) * sizeof *t->corner_start);
    for (size_t i = 0; i < 3 * mesh->nf; i++) t->corner_start[mesh->F[i] + 1]++;
    for (size_t v = 0; v < mesh->nv; v++) t->corner_start[v + 1] += t->corner_start[v];
    for (size_t i = 3 * mesh->nf; i-- > 0;) /* from behind, so that starts end where they began */
        t->corner[--t->corner_start[mesh->F[i] + 1]] = (uint32_t)i;
    memmove(t->corner_start, t->corner_start + 1, mesh->nv * sizeof *t->corner_start);
    t->corner_start[mesh->nv] = (uint32_t)(3 * mesh->nf);
}

static apsm_status fill_twins(const apsm_mesh *mesh, uint32_t *twin)
{
    uint32_t *sorted;
    size_t n;
    APSM_TRY(topology_sort(mesh, &sorted, &n));
    for (size_t i = 0; i < 3 * mesh->nf; i++) twin[i] = APSM_NONE;
    for (size_t i = 0, j; i < n; i = j) {
        j = run_end(mesh->F, sorted, n, i);
        const uint32_t g = sorted[i], h = sorted[j - 1];
        if (j - i != 2 || mesh->F[g] == mesh->F[h]) continue;
        twin[g] = h;
        twin[h] = g;
    }
    free(sorted);
    return APSM_OK;
}

apsm_status apsm_topology_build(const apsm_mesh *mesh, apsm_topology *topology)
{
    *topology = (apsm_topology){ .nv = mesh->nv, .nf = mesh->nf };
    APSM_TRY(check_indices(mesh));
    topology->twin = malloc((3 * mesh->nf + 1) * sizeof(uint32_t));
    topology->corner = malloc((3 * mesh->nf + 1) * sizeof(uint32_t));
    topology->corner_start = malloc((mesh->nv + 2) * sizeof(uint32_t));
    apsm_status status = APSM_ERR_MEMORY;
    if (topology->twin && topology->corner && topology->corner_start) {
        fill_corners(mesh, topology);
        status = fill_twins(mesh, topology->twin);
    }
    if (status != APSM_OK) apsm_topology_free(topology);
    return status;
}

void topology_arrays(apsm_topology *t, array_list *list)
{
    arrays_add(list, &t->twin, 3 * t->nf * sizeof *t->twin);
    arrays_add(list, &t->corner, 3 * t->nf * sizeof *t->corner);
    arrays_add(list, &t->corner_start, (t->nv + 1) * sizeof *t->corner_start);
}

void apsm_topology_free(apsm_topology *topology)
{
    free(topology->twin);
    free(topology->corner);
    free(topology->corner_start);
    *topology = (apsm_topology){ 0 };
}

/* Disjoint sets of 0..n-1 (path halving; the smaller root stays). */
static uint32_t find_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}
static void join(uint32_t *parent, uint32_t i, uint32_t j)
{
    i = find_root(parent, i);
    j = find_root(parent, j);
    if (i < j) parent[j] = i;
    if (j < i) parent[i] = j;
}

static void edge_middle(const apsm_mesh *mesh, uint32_t h, double x[3])
{
    const double *a = mesh->V + 3 * (size_t)mesh->F[h],
                 *b = mesh->V + 3 * (size_t)half_edge_end(mesh->F, h);
    for (int c = 0; c < 3; c++) x[c] = 0.5 * (a[c] + b[c]);
}

/* The corner of h's face at vertex v, one of h's ends. */
static uint32_t corner_at(const uint32_t *F, uint32_t h, uint32_t v)
{
    return F[h] == v ? h : (h % 3 == 2 ? h - 2 : h + 1);
}

/* Counts the edge of m half-edges and joins its faces, and their corners at its ends. */
static void inspect_edge(const apsm_mesh *mesh, const uint32_t *edge, size_t m, uint32_t *face,
                         uint32_t *fan, apsm_mesh_defects *d)
{
    const uint32_t *F = mesh->F, lo = smaller_end(F, edge[0]), hi = larger_end(F, edge[0]);
    if (m == 1 && d->border_edges++ == 0) edge_middle(mesh, edge[0], d->border_at);
    if (m > 2 && d->nonmanifold_edges++ == 0) edge_middle(mesh, edge[0], d->nonmanifold_at);
    if (m == 2 && F[edge[0]] == F[edge[1]]) d->flipped_edges++;
    for (size_t i = 1; i < m; i++) {
        join(face, edge[0] / 3, edge[i] / 3);
        join(fan, corner_at(F, edge[0], lo), corner_at(F, edge[i], lo));
        join(fan, corner_at(F, edge[0], hi), corner_at(F, edge[i], hi));
    }
}

static void inspect_edges(const apsm_mesh *mesh, const uint32_t *sorted, size_t n, uint32_t *face,
                          uint32_t *fan, apsm_mesh_defects *d)
{
    for (uint32_t f = 0; f < mesh->nf; f++) face[f] = f;
    for (uint32_t h = 0; h < 3 * mesh->nf; h++) fan[h] = h;
    for (size_t i = 0, j; i < n; i = j) {
        j = run_end(mesh->F, sorted, n, i);
        inspect_edge(mesh, sorted + i, j - i, face, fan, d);
    }
    for (uint32_t f = 0; f < mesh->nf; f++)
        if (proper(mesh->F, f) && face[f] == f) d->components++;
}

/* fans: number of fans of each vertex, scratch (nv). */
static void inspect_vertices(const apsm_mesh *mesh, const uint32_t *fan, uint32_t *fans,
                             apsm_mesh_defects *d)
{
    memset(fans, 0, mesh->nv * sizeof *fans);
    for (uint32_t h = 0; h < 3 * mesh->nf; h++)
        if (proper(mesh->F, h / 3) && fan[h] == h) fans[mesh->F[h]]++;
    for (size_t v = 0; v < mesh->nv; v++) {
        d->unused_vertices += fans[v] == 0;
        if (fans[v] > 1 && d->nonmanifold_vertices++ == 0 && d->nonmanifold_edges == 0)
            memcpy(d->nonmanifold_at, mesh->V + 3 * v, 3 * sizeof(double));
    }
}

static size_t count_degenerate(const apsm_mesh *mesh)
{
    double lo[3], hi[3];
    apsm_mesh_bounds(mesh, lo, hi);
    const double least = 1e-14 * vec3_distance2(lo, hi);
    size_t count = 0;
    for (size_t f = 0; f < mesh->nf; f++) {
        const double *a = mesh->V + 3 * (size_t)mesh->F[3 * f];
        double ab[3], ac[3], n[3];
        vec3_sub(mesh->V + 3 * (size_t)mesh->F[3 * f + 1], a, ab);
        vec3_sub(mesh->V + 3 * (size_t)mesh->F[3 * f + 2], a, ac);
        vec3_cross(ab, ac, n);
        count += !proper(mesh->F, f) || !(0.5 * vec3_norm(n) >= least);
    }
    return count;
}

apsm_status apsm_mesh_inspect(const apsm_mesh *mesh, apsm_mesh_defects *defects)
{
    *defects = (apsm_mesh_defects){ 0 };
    APSM_TRY(check_indices(mesh));
    uint32_t *sorted;
    size_t n;
    APSM_TRY(topology_sort(mesh, &sorted, &n));
    uint32_t *face = malloc((mesh->nf + 1) * sizeof *face),
             *fan = malloc((3 * mesh->nf + 1) * sizeof *fan),
             *fans = malloc((mesh->nv + 1) * sizeof *fans);
    apsm_status status = APSM_ERR_MEMORY;
    if (face && fan && fans) {
        inspect_edges(mesh, sorted, n, face, fan, defects);
        inspect_vertices(mesh, fan, fans, defects);
        defects->degenerate_faces = count_degenerate(mesh);
        status = APSM_OK;
    }
    free(sorted);
    free(face);
    free(fan);
    free(fans);
    return status;
}

apsm_status apsm_mesh_find_open(const apsm_mesh *mesh, bool *open)
{
    apsm_mesh_defects defects;
    *open = false;
    APSM_TRY(apsm_mesh_inspect(mesh, &defects));
    *open = defects.border_edges > 0;
    return APSM_OK;
}

bool apsm_mesh_is_closed_manifold(const apsm_mesh_defects *d)
{
    return d->components > 0 && d->border_edges == 0 && d->nonmanifold_edges == 0 &&
           d->nonmanifold_vertices == 0 && d->flipped_edges == 0 && d->degenerate_faces == 0;
}

long apsm_mesh_euler(const apsm_mesh *mesh, const apsm_topology *topology)
{
    long vertices = 0, faces = 0, half = 0; /* half: twice the number of edges */
    for (size_t v = 0; v < mesh->nv; v++)
        vertices += topology->corner_start[v + 1] > topology->corner_start[v];
    for (size_t f = 0; f < mesh->nf; f++) {
        if (!proper(mesh->F, f)) continue;
        faces++;
        for (size_t k = 0; k < 3; k++) half += topology->twin[3 * f + k] == APSM_NONE ? 2 : 1;
    }
    return vertices - half / 2 + faces;
}
