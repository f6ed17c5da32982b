/* Where a part lies on the model: one-way registrations of its points to the template from many
 * places and rotations, on few points first.  Where the cohort came in one orientation, that is
 * tried at every place as well. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/part.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"

enum {
    GRID = 60,
    PLACES = 25,
    FEW = 40,
    STEPS = 4,
    FIXED = 150,
    KEPT = 24,
    LATER = 12,
    MORE = 120
};
static const double same_pose = 0.2; /* root mean square distance over the radius */

typedef struct candidate {
    double M[16], residual;
    bool usual; /* from the common orientation */
} candidate;

/* Centres that a part may have: that of the template, and places half and nearly all the way to
 * its surface. */
static void place_at(const apsm_cloud *fixed, size_t k, double c[3])
{
    const size_t point = k > 0 ? (k - 1) / 2 : 0;
    const double t = k == 0 ? 0 : k % 2 ? 0.45 : 0.9;
    for (size_t a = 0; a < 3; a++)
        c[a] = fixed->centre[a] + t * (fixed->x[3 * point + a] - fixed->centre[a]);
}

/* M = R about the moving centre, which goes to c; the other hand: x mirrored first. */
static void start_at(const double R[9], const double centre[3], const double c[3], bool mirrored,
                     double M[16])
{
    apsm_affine_identity(M);
    for (size_t r = 0; r < 3; r++) {
        for (size_t k = 0; k < 3; k++) M[4 * r + k] = mirrored && k == 0 ? -R[3 * r] : R[3 * r + k];
        M[4 * r + 3] = c[r] - vec3_dot(M + 4 * r, centre);
    }
}

static size_t closest_point(const apsm_cloud *fixed, size_t n, const double x[3],
                            const double normal[3], double *d2)
{
    size_t best = 0;
    *d2 = INFINITY;
    for (size_t k = 0; k < n; k++) {
        double d = vec3_distance2(x, fixed->x + 3 * k);
        if (normal && vec3_dot(normal, fixed->normal + 3 * k) < 0) d *= 4;
        if (d < *d2) *d2 = d, best = k;
    }
    return best;
}

/* Steps on clouds alone; mean distance in the end. */
static void register_roughly(const apsm_fit_model *m, const part_points *p, candidate *c)
{
    double x[FEW][3], y[FEW][3], n[FEW][3], step[16];
    const size_t few = p->n < FEW ? p->n : FEW, fixed = m->cloud.n < FIXED ? m->cloud.n : FIXED;
    for (int s = 0; s < STEPS; s++) {
        c->residual = 0;
        apsm_affine_apply(c->M, few, p->x, x[0]);
        if (p->normal) apsm_affine_apply_normals(c->M, few, p->normal, n[0]);
        for (size_t k = 0; k < few; k++) {
            double d2;
            const size_t at = closest_point(&m->cloud, fixed, x[k], p->normal ? n[k] : NULL, &d2);
            memcpy(y[k], m->cloud.x + 3 * at, sizeof y[k]);
            c->residual += sqrt(d2) / (double)few;
        }
        if (s + 1 == STEPS) break;
        apsm_affine_fit(few, x[0], y[0], NULL, 0, step);
        apsm_affine_multiply(step, c->M, c->M);
    }
}

/* Steps on the template's surface, the worse half of the points weighing little. */
static void register_well(const apsm_fit_model *m, const part_points *p, candidate *c)
{
    enum { WELL = 12 };
    double x[MORE][3], y[MORE][3], w[MORE], d[MORE], step[16];
    const size_t n = p->n < MORE ? p->n : MORE;
    for (int s = 0; s <= WELL; s++) {
        apsm_affine_apply(c->M, n, p->x, x[0]);
        c->residual = 0;
        for (size_t k = 0; k < n; k++) {
            apsm_closest at;
            apsm_bvh_closest(m->cohort.shape[0].bvh, x[k], INFINITY, &at);
            memcpy(y[k], at.x, sizeof y[k]);
            d[k] = sqrt(at.distance2);
            c->residual += fmin(d[k], m->h) / (double)n;
        }
        if (s == WELL) break;
        for (size_t k = 0; k < n; k++) w[k] = 1 / (d[k] + 0.2 * c->residual + 1e-6 * m->h);
        apsm_affine_fit(n, x[0], y[0], w, 0, step);
        apsm_affine_multiply(step, c->M, c->M);
    }
}

static int by_residual(const void *a, const void *b)
{
    const candidate *x = a, *y = b;
    return (x->residual > y->residual) - (x->residual < y->residual);
}

/* Sorted, and of poses that are nearly one the best; at most `keep`. */
static size_t keep_distinct(const apsm_fit_model *m, const part_points *p, size_t keep, size_t n,
                            candidate *c)
{
    size_t kept = 0;
    const size_t few = p->n < 16 ? p->n : 16;
    const double near = same_pose * same_pose * m->radius * m->radius * (double)few;
    qsort(c, n, sizeof *c, by_residual);
    for (size_t i = 0; i < n && kept < keep; i++) {
        bool fresh = true;
        for (size_t j = 0; j < kept && fresh; j++) {
            double a[16][3], b[16][3], sum = 0;
            apsm_affine_apply(c[i].M, few, p->x, a[0]);
            apsm_affine_apply(c[j].M, few, p->x, b[0]);
            for (size_t k = 0; k < few; k++) sum += vec3_distance2(a[k], b[k]);
            fresh = sum > near;
        }
        if (fresh) c[kept++] = c[i];
    }
    return kept;
}

static void centre_of(const part_points *p, double c[3])
{
    memset(c, 0, 3 * sizeof *c);
    for (size_t k = 0; k < p->n; k++) vec3_add_scaled(c, 1 / (double)p->n, p->x + 3 * k);
}

/* All starts of one hand. */
static size_t make_starts(const apsm_fit_model *m, const part_points *p, bool mirrored,
                          candidate *c)
{
    double centre[3], at[3], R[9];
    size_t n = 0;
    const size_t places = 2 * m->cloud.n + 1 < PLACES ? 2 * m->cloud.n + 1 : PLACES;
    centre_of(p, centre);
    for (size_t k = 0; k < places; k++) {
        place_at(&m->cloud, k, at);
        for (size_t r = 0; r <= GRID; r++) {
            const bool usual = r == GRID;
            if (usual && (mirrored || !(m->oriented > 0))) continue;
            if (usual)
                memcpy(R, m->common, sizeof R);
            else
                apsm_rotation_of_spiral(r, GRID, R);
            start_at(R, centre, at, mirrored, c[n].M);
            c[n++].usual = usual;
        }
    }
    return n;
}

/* Those of the common orientation stay in the race if they fit within this factor. */
static void favour_usual(size_t n, candidate *c)
{
    for (size_t k = 0; k < n; k++)
        if (c[k].usual) c[k].residual /= APSM_GIVEN_RATIO;
}

apsm_status part_poses(const apsm_fit_model *m, const part_points *p,
                       const apsm_fit_options *options, size_t most, double (*M)[16], size_t *n)
{
    enum { STARTS = PLACES * (GRID + 1) };
    candidate *c = malloc(2 * STARTS * sizeof *c);
    *n = 0;
    if (!c) return APSM_ERR_MEMORY;
    size_t k = 0;
    if (options->hand != APSM_HAND_OTHER) k += make_starts(m, p, false, c);
    if (options->hand != APSM_HAND_SAME) k += make_starts(m, p, true, c + k);
    for (size_t i = 0; i < k; i++) register_roughly(m, p, &c[i]);
    favour_usual(k, c);
    k = keep_distinct(m, p, KEPT, k, c);
    for (size_t i = 0; i < k; i++) register_well(m, p, &c[i]);
    favour_usual(k, c);
    k = keep_distinct(m, p, most < LATER ? most : LATER, k, c);
    for (size_t i = 0; i < k; i++) memcpy(M[i], c[i].M, sizeof c[i].M);
    *n = k;
    free(c);
    return APSM_OK;
}
