/* Projection of the aligned reference's particles, and separation of those that coincide.
 * docs/method.md, "Initialisation": 2.2-2.4 mm from the true correspondence where farthest points
 * and assignment are at 3.8-4.4 mm. */
#include "initialize/projection.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"

apsm_projection_options apsm_projection_defaults(double h)
{
    return (apsm_projection_options){ .h = h, APSM_OPTION_DEFAULTS(APSM_PROJECTION_OPTIONS) };
}

/* A length. */
static double separation(const apsm_projection_options *o)
{
    return o->min_separation * o->h;
}

static apsm_closest project(const apsm_bvh *bvh, const double x[3], const double n[3],
                            const apsm_projection_options *o)
{
    apsm_closest any, facing;
    apsm_bvh_closest(bvh, x, INFINITY, &any);
    const double reach = sqrt(any.distance2) + o->detour * o->h;
    apsm_bvh_closest_facing(bvh, x, n, o->min_cos, reach * reach, &facing);
    return facing.distance2 < INFINITY ? facing : any;
}

/* Particles with where they come from, on one surface. */
typedef struct placing {
    const apsm_bvh *bvh;
    const apsm_projection_options *o;
    size_t J;
    const double *X, *N;   /* J x 3: the aligned reference's particles and normals */
    apsm_surface_point *S; /* J */
    double *P;             /* J x 3 */
} placing;

static void place(const placing *p, size_t j, const double x[3])
{
    const apsm_closest c = project(p->bvh, x, p->N + 3 * j, p->o);
    p->S[j] = c.on;
    for (size_t e = 0; e < 3; e++) p->P[3 * j + e] = c.x[e];
}

/* Of those that look the same way: the sides of a sheet may be as close as they like. */
static size_t nearest_other(const placing *p, size_t j, double *d2)
{
    const double *P = p->P, *N = p->N;
    size_t best = j;
    *d2 = INFINITY;
    for (size_t k = 0; k < p->J; k++) {
        const double e = vec3_distance2(P + 3 * j, P + 3 * k);
        if (k != j && e < *d2 && vec3_dot(N + 3 * j, N + 3 * k) > 0.0) {
            *d2 = e;
            best = k;
        }
    }
    return best;
}

/* Direction in which particle j leaves k: that between them, or between their references where
 * they coincide, within the plane across the normal. */
static void parting(const placing *p, size_t j, size_t k, double r[3])
{
    static const double axis[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    const double *from[2] = { p->P, p->X }, *n = p->N + 3 * j;
    for (int attempt = 0; attempt < 5; attempt++) {
        if (attempt < 2)
            vec3_sub(from[attempt] + 3 * j, from[attempt] + 3 * k, r);
        else
            for (int c = 0; c < 3; c++) r[c] = axis[attempt - 2][c];
        const double before = vec3_norm(r);
        vec3_add_scaled(r, -vec3_dot(r, n), n);
        if (vec3_normalise(r) > 1e-6 * before) return;
    }
}

/* Moves j away from k, at d from it, until they are min_separation apart, and back onto the
 * surface. */
static void part(const placing *p, size_t j, size_t k, double d)
{
    double r[3], x[3] = { p->P[3 * j], p->P[3 * j + 1], p->P[3 * j + 2] };
    parting(p, j, k, r);
    vec3_add_scaled(x, 1.1 * separation(p->o) - d, r);
    place(p, j, x);
}

/* One round, the later particle of a pair moves; returns how many were too close. */
static size_t separate(const placing *p, bool move)
{
    size_t close = 0;
    for (size_t j = 0; j < p->J; j++) {
        double d2;
        const size_t k = nearest_other(p, j, &d2);
        if (k == j || d2 >= separation(p->o) * separation(p->o)) continue;
        close++;
        if (move) part(p, j > k ? j : k, j > k ? k : j, sqrt(d2));
    }
    return close;
}

void apsm_project_particles(const apsm_bvh *bvh, size_t J, const double *X, const double *N,
                            const apsm_projection_options *options, apsm_surface_point *S,
                            double *P, size_t *close)
{
    const placing p = { bvh, options, J, X, N, S, P };
    for (size_t j = 0; j < J; j++) place(&p, j, X + 3 * j);
    size_t left = J;
    for (int round = 0; left > 0 && round <= options->rounds; round++)
        left = separate(&p, round < options->rounds);
    if (close) *close = left;
}

apsm_status apsm_register_particles(const apsm_registration *registration, const apsm_mesh *mesh,
                                    const apsm_bvh *bvh, size_t J, const double *X, const double *N,
                                    double h, double *P)
{
    const apsm_projection_options po = apsm_projection_defaults(h);
    apsm_cloud cloud;
    APSM_TRY(apsm_cloud_spread(mesh, APSM_REGISTRATION_POINTS, &cloud));
    const size_t n = 3 * J, size = apsm_registration_work_size(registration, cloud.n);
    double *moved = malloc((2 * n + size) * sizeof *moved);
    apsm_surface_point *S = malloc(J * sizeof *S);
    apsm_status status = moved && S ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        memcpy(moved, X, n * sizeof *X);
        memcpy(moved + n, N, n * sizeof *N);
        status = apsm_registration_move(registration, &cloud, J, moved, moved + n, moved + 2 * n);
    }
    if (status == APSM_OK) apsm_project_particles(bvh, J, moved, moved + n, &po, S, P, NULL);
    free(moved);
    free(S);
    apsm_cloud_free(&cloud);
    return status;
}
