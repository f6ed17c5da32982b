/* Where the ends are that shapes of a cohort were cut at, and what all of them hold. */
#include "align/common_ends.h"

#include <math.h>
#include <string.h>

#include "geometry/affine.h"
#include "geometry/vec3.h"

static const double cosine_same = 0.8660; /* two cuts of one end: 30 degrees */
static const double in_plane = 0.02;      /* radii: so near to a cut plane is in it */
static const double differ = 0.1;         /* radii: ends no farther apart are let be */

/* What is known of one end so far. */
typedef struct group {
    double sum[3]; /* of the normals */
    size_t n;
    size_t last; /* shape of the last cut taken: one of a shape */
} group;

static size_t group_of(const group *g, size_t groups, const apsm_cut *cut)
{
    size_t best = groups;
    double most = cosine_same;
    for (size_t k = 0; k < groups; k++) {
        const double cosine = vec3_dot(g[k].sum, cut->plane) / vec3_norm(g[k].sum);
        if (cosine > most && g[k].last != cut->shape) most = cosine, best = k;
    }
    return best;
}

/* Sorts the cuts into groups by their directions; false if there are too many. */
static bool find_groups(const apsm_alignment *a, group g[APSM_MOST_ENDS], size_t *groups)
{
    *groups = 0;
    for (size_t c = 0; c < a->cuts; c++) {
        const size_t k = group_of(g, *groups, &a->cut[c]);
        if (k == APSM_MOST_ENDS) return false;
        if (k == *groups) g[(*groups)++] = (group){ { 0 }, 0, 0 };
        vec3_add_scaled(g[k].sum, 1.0, a->cut[c].plane);
        g[k].last = a->cut[c].shape;
        g[k].n++;
    }
    return true;
}

/* The cut of a shape that looks in direction n, or NULL. */
static const apsm_cut *cut_at(const apsm_alignment *a, size_t shape, const double n[3])
{
    for (size_t c = 0; c < a->cuts; c++)
        if (a->cut[c].shape == shape && vec3_dot(a->cut[c].plane, n) > cosine_same)
            return &a->cut[c];
    return NULL;
}

/* How far in direction n a shape reaches: to the lowest edge of its cut face, or to its end. */
static double reach_of(const apsm_mesh *mesh, const double M[16], const apsm_cut *cut,
                       const double n[3])
{
    double lowest = INFINITY, end = -INFINITY;
    for (size_t v = 0; v < mesh->nv; v++) {
        double x[3];
        apsm_affine_apply(M, 1, mesh->V + 3 * v, x);
        const double z = vec3_dot(n, x);
        end = fmax(end, z);
        if (cut && fabs(vec3_dot(cut->plane, x) - cut->plane[3]) < in_plane * cut->radius)
            lowest = fmin(lowest, z);
    }
    return cut && lowest < INFINITY ? lowest : end;
}

static void find_end(size_t n, const apsm_mesh *const *meshes, const apsm_alignment *a,
                     const group *g, apsm_common_end *end)
{
    double longest = -INFINITY, radius = 0.0;
    memcpy(end->plane, g->sum, sizeof g->sum);
    vec3_normalise(end->plane);
    end->plane[3] = end->next = INFINITY;
    end->cut = g->n;
    for (size_t i = 0; i < n; i++) {
        const apsm_cut *cut = cut_at(a, i, end->plane);
        const double reach = reach_of(meshes[i], a->sized + 16 * i, cut, end->plane);
        longest = fmax(longest, reach);
        const double d = cut ? reach - in_plane * cut->radius : INFINITY;
        if (d < end->next && d >= end->plane[3]) end->next = d;
        if (d >= end->plane[3]) continue;
        end->next = end->plane[3];
        end->plane[3] = d;
        end->shortest = i;
        radius = cut->radius;
    }
    end->apart = (longest - end->plane[3]) / radius - in_plane;
}

double apsm_common_ends_loss(const apsm_mesh *mesh, const double M[16],
                             const apsm_common_ends *ends)
{
    double lost = 0.0, all = 0.0;
    for (size_t f = 0; f < mesh->nf; f++) {
        double x[3][3], u[3], v[3], m[3], middle[3] = { 0 };
        for (size_t k = 0; k < 3; k++) {
            apsm_affine_apply(M, 1, mesh->V + 3 * mesh->F[3 * f + k], x[k]);
            vec3_add_scaled(middle, 1.0 / 3.0, x[k]);
        }
        vec3_sub(x[1], x[0], u);
        vec3_sub(x[2], x[0], v);
        vec3_cross(u, v, m);
        bool beyond = false;
        for (size_t k = 0; k < ends->n; k++)
            beyond |= vec3_dot(ends->end[k].plane, middle) > ends->end[k].plane[3];
        all += vec3_norm(m);
        if (beyond) lost += vec3_norm(m);
    }
    return lost / all;
}

void apsm_common_ends_planes(const apsm_common_ends *ends, const double M[16],
                             double plane[APSM_MOST_ENDS][4])
{
    for (size_t k = 0; k < ends->n; k++) {
        const double *n = ends->end[k].plane;
        double m[3] = { 0 }, d = n[3];
        for (size_t r = 0; r < 3; r++) {
            d -= n[r] * M[4 * r + 3];
            for (size_t c = 0; c < 3; c++) m[c] += n[r] * M[4 * r + c];
        }
        const double scale = vec3_normalise(m);
        memcpy(plane[k], m, sizeof m);
        plane[k][3] = d / scale;
    }
}

static bool is_shortest(const apsm_common_ends *ends, size_t shape)
{
    bool is = false;
    for (size_t k = 0; k < ends->n; k++) is |= ends->end[k].shortest == shape;
    return is;
}

/* What the others would lose if the shortest were left out. */
static double next_loss(size_t n, const apsm_mesh *const *meshes, const apsm_alignment *a,
                        const apsm_common_ends *ends)
{
    apsm_common_ends next = *ends;
    double sum = 0.0;
    size_t others = 0;
    for (size_t k = 0; k < next.n; k++) next.end[k].plane[3] = next.end[k].next;
    for (size_t i = 0; i < n; i++) {
        if (is_shortest(ends, i)) continue;
        sum += apsm_common_ends_loss(meshes[i], a->sized + 16 * i, &next);
        others++;
    }
    return others ? sum / (double)others : 0.0;
}

static void find_losses(size_t n, const apsm_mesh *const *meshes, const apsm_alignment *a,
                        apsm_common_ends *ends)
{
    for (size_t i = 0; i < n; i++) {
        const double loss = apsm_common_ends_loss(meshes[i], a->sized + 16 * i, ends);
        ends->mean_loss += loss / (double)n;
        if (loss <= ends->most_loss) continue;
        ends->most_loss = loss;
        ends->loser = i;
    }
    ends->next_loss = next_loss(n, meshes, a, ends);
}

void apsm_find_common_ends(size_t n, const apsm_mesh *const *meshes, const apsm_alignment *a,
                           size_t least, apsm_common_ends *ends)
{
    group g[APSM_MOST_ENDS];
    size_t groups;
    *ends = (apsm_common_ends){ 0 };
    if (!find_groups(a, g, &groups)) return;
    for (size_t k = 0; k < groups; k++) {
        if (g[k].n < least) continue;
        apsm_common_end *end = &ends->end[ends->n];
        *end = (apsm_common_end){ 0 };
        find_end(n, meshes, a, &g[k], end);
        ends->n += end->apart > differ;
    }
    if (ends->n > 0) find_losses(n, meshes, a, ends);
}
