/* Edge lengths that follow curvature.
 *
 *   L      common edge length
 *   kappa  largest change of the unit normal per length along the edges at a vertex
 *   s      wanted edge length = clamp(turn / kappa, shortest L, L), then limited so that it
 *          grows by at most `growth` per length
 *   faces  = sum over faces of area / (sqrt(3)/4 s^2), solved for L by bisection
 *
 * Curvature decides by angle, not by an absolute error, so that a small shape and the same shape
 * large are treated alike.  Normals are first averaged over about one L: noise and stairs finer
 * than the new edges do not count as curvature. */
#include "groom/edge_size.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"

static const double growth = 0.3;
static const double face_per_edge2 = 0.43301270189221932; /* sqrt(3)/4 */
enum { MOST_AVERAGINGS = 30, BISECTIONS = 40, GROWTH_SWEEPS = 30 };

/* Unit normals averaged over the 1-ring `passes` times; N (nv x 3) in and out, T scratch. */
static void average_normals(const apsm_mesh *mesh, int passes, double *N, double *T)
{
    for (int p = 0; p < passes; p++) {
        memcpy(T, N, 3 * mesh->nv * sizeof *T);
        for (size_t h = 0; h < 3 * mesh->nf; h++) {
            const uint32_t a = mesh->F[h], b = mesh->F[h % 3 == 2 ? h - 2 : h + 1];
            vec3_add_scaled(T + 3 * a, 1.0, N + 3 * b);
        }
        for (size_t v = 0; v < mesh->nv; v++) vec3_normalise(T + 3 * v);
        memcpy(N, T, 3 * mesh->nv * sizeof *T);
    }
}

/* kappa (nv, out). */
static void curvature(const apsm_mesh *mesh, const double *N, double *kappa)
{
    memset(kappa, 0, mesh->nv * sizeof *kappa);
    for (size_t h = 0; h < 3 * mesh->nf; h++) {
        const uint32_t a = mesh->F[h], b = mesh->F[h % 3 == 2 ? h - 2 : h + 1];
        const double d2 = vec3_distance2(mesh->V + 3 * a, mesh->V + 3 * b);
        if (!(d2 > 0.0)) continue;
        const double k = sqrt(vec3_distance2(N + 3 * a, N + 3 * b) / d2);
        kappa[a] = fmax(kappa[a], k);
        kappa[b] = fmax(kappa[b], k);
    }
}

static double size_at(const apsm_remesh_options *opt, double kappa, double L)
{
    const double s = kappa * L > opt->turn ? opt->turn / kappa : L;
    return opt->turn > 0.0 ? fmax(s, opt->shortest * L) : L;
}

/* Faces needed, for areas A (nf). */
static double faces_needed(const apsm_mesh *mesh, const double *A, const double *size)
{
    double n = 0.0;
    for (size_t f = 0; f < mesh->nf; f++) {
        const uint32_t *c = mesh->F + 3 * f;
        const double s = (size[c[0]] + size[c[1]] + size[c[2]]) / 3.0;
        n += A[f] / (face_per_edge2 * s * s);
    }
    return n;
}

/* Lowers sizes until none grows faster than `growth` along an edge (a few sweeps do). */
static void limit_growth(const apsm_mesh *mesh, double *size)
{
    bool changed = true;
    for (int sweep = 0; changed && sweep < GROWTH_SWEEPS; sweep++) {
        changed = false;
        for (size_t h = 0; h < 3 * mesh->nf; h++) {
            const uint32_t a = mesh->F[h], b = mesh->F[h % 3 == 2 ? h - 2 : h + 1];
            if (size[a] <= size[b]) continue;
            const double most =
                size[b] + growth * sqrt(vec3_distance2(mesh->V + 3 * a, mesh->V + 3 * b));
            if (size[a] > most) {
                size[a] = most;
                changed = true;
            }
        }
    }
}

static void areas(const apsm_mesh *mesh, double *A)
{
    for (size_t f = 0; f < mesh->nf; f++) {
        const uint32_t *c = mesh->F + 3 * f;
        double u[3], v[3], n[3];
        vec3_sub(mesh->V + 3 * c[1], mesh->V + 3 * c[0], u);
        vec3_sub(mesh->V + 3 * c[2], mesh->V + 3 * c[0], v);
        vec3_cross(u, v, n);
        A[f] = 0.5 * vec3_norm(n);
    }
}

/* L such that the sizes need `faces` faces; the sizes are left in size. */
static double solve_common(const apsm_mesh *mesh, const apsm_remesh_options *opt, size_t faces,
                           const double *A, const double *kappa, double *size)
{
    /* Between edges all of length L and all of the shortest. */
    const double even = sqrt(apsm_mesh_area(mesh) / (face_per_edge2 * (double)faces));
    double lo = even, hi = even / opt->shortest, L = even;
    for (int i = 0; i < BISECTIONS; i++) {
        L = 0.5 * (lo + hi);
        for (size_t v = 0; v < mesh->nv; v++) size[v] = size_at(opt, kappa[v], L);
        if (faces_needed(mesh, A, size) > (double)faces)
            lo = L;
        else
            hi = L;
    }
    return L;
}

apsm_status edge_size(const apsm_mesh *mesh, const apsm_remesh_options *opt, size_t faces,
                      double *size, double *common)
{
    double *N = malloc(3 * mesh->nv * sizeof *N), *T = malloc(3 * mesh->nv * sizeof *T);
    double *A = malloc(mesh->nf * sizeof *A);
    const bool ok = N && T && A;
    if (ok) {
        areas(mesh, A);
        apsm_mesh_vertex_normals(mesh, N);
        const double even = sqrt(apsm_mesh_area(mesh) / (face_per_edge2 * (double)faces));
        const double ratio = even / apsm_mesh_mean_edge(mesh);
        /* p averagings reach about sqrt(p) edges. */
        const double passes = floor(0.25 * ratio * ratio + 0.5);
        average_normals(mesh, passes > MOST_AVERAGINGS ? MOST_AVERAGINGS : (int)passes, N, T);
        curvature(mesh, N, T);
        *common = solve_common(mesh, opt, faces, A, T, size);
        limit_growth(mesh, size);
        /* The limit shortened some edges: make up for it. */
        const double up = sqrt(faces_needed(mesh, A, size) / (double)faces);
        for (size_t v = 0; v < mesh->nv; v++) size[v] *= up;
        *common *= up;
    }
    free(N);
    free(T);
    free(A);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}
