/* Caps: a filled opening gets vertices of its own, as dense as the rim and sparser inward, so that
 * the end of a cut bone is not made of needles from rim to rim.
 *
 *   s(v)   wanted edge length: at the rim the mean length of the edges of the surface there,
 *          inward limited by  s(x) = min over a face's corners v of s(v) + growth |x - v|
 *   A face gets a vertex in its middle c if, for every corner v,  sqrt(2) |c - v| > s(c)  and
 *   > s(v)  (Liepa, "Filling holes in meshes", SGP 2003), and at once the edges around are flipped
 *   until each is Delaunay: the angles opposite to it make at most pi (Lawson's flips). */
#include <math.h>
#include <stdlib.h>

#include "geometry/vec3.h"
#include "groom/fan.h"
#include "groom/repair.h"

static const double growth = 0.3; /* as between the remesher's edges */
static const double liepa = M_SQRT2;
static const double flat = 0.1;   /* diagonals pass within this share of the edge */
static const double slack = 1e-9; /* of the sine: four points on a circle flip for ever */
enum { SWEEPS = 50, MOST_BY_INPUT = 4 };

/* Whether a face wants a vertex; its middle and the edge length wanted there (out). */
static bool wants_vertex(const double *V, const double *size, const uint32_t corner[3],
                         double middle[3], double *wanted)
{
    const double *x[3] = { V + 3 * corner[0], V + 3 * corner[1], V + 3 * corner[2] };
    for (int c = 0; c < 3; c++) middle[c] = (x[0][c] + x[1][c] + x[2][c]) / 3.0;
    double away[3];
    *wanted = INFINITY;
    for (int k = 0; k < 3; k++) {
        away[k] = sqrt(vec3_distance2(middle, x[k]));
        *wanted = fmin(*wanted, size[corner[k]] + growth * away[k]);
    }
    for (int k = 0; k < 3; k++)
        if (!(liepa * away[k] > *wanted && liepa * away[k] > size[corner[k]])) return false;
    return true;
}

/* size (nv, out): mean length of the edges at a vertex that faces before `first` have; 0 where
 * there are none.  n (nv): scratch. */
static void rim_sizes(const apsm_mesh *m, size_t first, double *size, uint32_t *n)
{
    for (size_t v = 0; v < m->nv; v++) size[v] = n[v] = 0;
    for (size_t h = 0; h < 3 * first; h++) {
        const uint32_t a = m->F[h], b = m->F[h % 3 == 2 ? h - 2 : h + 1];
        const double length = sqrt(vec3_distance2(m->V + 3 * a, m->V + 3 * b));
        size[a] += length, n[a]++;
        size[b] += length, n[b]++;
    }
    for (size_t v = 0; v < m->nv; v++)
        if (n[v]) size[v] /= n[v];
}

/* Caps that fans closed have a vertex in their middle, which no other face knows. */
static void middle_sizes(const apsm_mesh *m, size_t first, double *size)
{
    for (size_t h = 3 * first; h < 3 * m->nf; h++) {
        const uint32_t a = m->F[h], b = m->F[h % 3 == 2 ? h - 2 : h + 1];
        if (size[b] > 0.0) continue;
        size[b] = size[a] + growth * sqrt(vec3_distance2(m->V + 3 * a, m->V + 3 * b));
    }
}

static bool in_cap(const surgery *s, uint32_t h, size_t first)
{
    return h / 3 >= first && !he_ghost_face(s, h);
}

/* Unless the angles opposite to h make more than pi: sin(alpha + beta) < 0. */
static bool is_delaunay(const surgery *s, uint32_t h)
{
    const double *end[2] = { s->V + 3 * he_from(s, h), s->V + 3 * he_to(s, h) };
    const uint32_t apex[2] = { he_apex(s, h), he_apex(s, s->twin[h]) };
    double cosine[2], sine[2];
    for (int k = 0; k < 2; k++) {
        double u[3], v[3], n[3];
        vec3_sub(end[0], s->V + 3 * apex[k], u);
        vec3_sub(end[1], s->V + 3 * apex[k], v);
        vec3_cross(u, v, n);
        const double lengths = vec3_norm(u) * vec3_norm(v);
        cosine[k] = vec3_dot(u, v) / lengths;
        sine[k] = vec3_norm(n) / lengths;
    }
    return !(cosine[0] * sine[1] + sine[0] * cosine[1] < -slack);
}

/* Flips h if it is an edge within a cap that is not Delaunay, and may be flipped. */
static bool legalise(surgery *s, uint32_t h, size_t first)
{
    if (!in_cap(s, h, first) || !in_cap(s, s->twin[h], first) || is_delaunay(s, h)) return false;
    if (surgery_joined(s, he_apex(s, h), he_apex(s, s->twin[h])) ||
        surgery_valence(s, he_from(s, h)) < 4 || surgery_valence(s, he_to(s, h)) < 4)
        return false;
    const double length2 = vec3_distance2(s->V + 3 * he_from(s, h), s->V + 3 * he_to(s, h));
    if (!fan_flip_is_flat(s, h, flat * sqrt(length2))) return false;
    surgery_flip(s, h);
    return true;
}

/* Flips the edges opposite to v until all are Delaunay; every flip gives v a neighbour, so it
 * ends. */
static void legalise_fan(surgery *s, uint32_t v, size_t first)
{
    bool changed = true;
    while (changed) {
        changed = false;
        uint32_t h = s->out[v];
        do {
            changed = legalise(s, he_next(h), first);
            h = he_turn(s, h);
        } while (!changed && h != s->out[v]);
    }
}

static void sweep(surgery *s, size_t first)
{
    bool changed = true;
    for (int i = 0; changed && i < SWEEPS; i++) {
        changed = false;
        for (uint32_t h = (uint32_t)(3 * first); h < 3 * s->nf; h++)
            if (h < s->twin[h]) changed |= legalise(s, h, first);
    }
}

/* Vertices for all faces that want one, those made on the way included. */
static apsm_status refine(surgery *s, size_t first)
{
    const size_t most = MOST_BY_INPUT * s->nf;
    bool changed = true;
    sweep(s, first);
    while (changed) {
        changed = false;
        for (uint32_t f = (uint32_t)first; f < s->nf && s->nf < most; f++) {
            double x[3], wanted;
            uint32_t made;
            if (!in_cap(s, 3 * f, first) || !wants_vertex(s->V, s->size, s->F + 3 * f, x, &wanted))
                continue;
            APSM_TRY(surgery_insert(s, f, x, &made));
            s->size[made] = wanted;
            legalise_fan(s, made, first);
            changed = true;
        }
    }
    sweep(s, first);
    return APSM_OK;
}

static apsm_status run(apsm_mesh *mesh, size_t first, const double *size)
{
    surgery s;
    apsm_mesh refined;
    APSM_TRY(surgery_begin(&s, mesh));
    for (size_t v = 0; v < s.nv; v++) s.size[v] = v < mesh->nv ? size[v] : 0.0;
    apsm_status status = refine(&s, first);
    if (status == APSM_OK) status = surgery_result(&s, &refined);
    if (status == APSM_OK) {
        apsm_mesh_free(mesh);
        *mesh = refined;
    }
    surgery_free(&s);
    return status;
}

apsm_status repair_caps(repair *r, size_t first)
{
    apsm_mesh *m = &r->mesh;
    double *size = malloc(m->nv * sizeof *size + 1);
    uint32_t *n = malloc(m->nv * sizeof *n + 1);
    apsm_status status = size && n ? APSM_OK : APSM_ERR_MEMORY;
    bool coarse = false;
    if (status == APSM_OK) {
        rim_sizes(m, first, size, n);
        middle_sizes(m, first, size);
        for (size_t f = first; f < m->nf && !coarse; f++) {
            double x[3], wanted;
            coarse = wants_vertex(m->V, size, m->F + 3 * f, x, &wanted);
        }
    }
    apsm_mesh_defects d;
    if (status == APSM_OK && coarse) status = apsm_mesh_inspect(m, &d);
    /* What is no surface yet is said by the check of the result. */
    if (status == APSM_OK && coarse && !d.nonmanifold_edges && !d.nonmanifold_vertices &&
        !d.flipped_edges && !d.unused_vertices)
        status = run(m, first, size);
    free(size);
    free(n);
    return status;
}
