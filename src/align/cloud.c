/* Points that stand for a surface: drawn uniformly by area, stratified in the order of the faces,
 * then thinned by farthest-point selection (Gonzalez, Theor. Comput. Sci. 38, 1985).  Both depend
 * on areas and distances alone: the points of a moved mesh are the moved points.  Each point's
 * weight is the share of the drawn points that are closest to it. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/cloud.h"
#include "core/kernel.h"
#include "core/random.h"
#include "geometry/affine.h"
#include "geometry/face.h"
#include "geometry/topology.h"

enum {
    DRAWN = 8, /* points drawn per point kept */
    MOST_VERTICES = 16384
};

static void draw_on_face(const apsm_mesh *mesh, size_t f, apsm_random *rng, double x[3])
{
    const double r = sqrt(apsm_random_uniform(rng)), t = apsm_random_uniform(rng);
    const apsm_surface_point p = { .face = (uint32_t)f,
                                   .weight = { 1.0 - r, r * (1.0 - t), r * t } };
    apsm_surface_position(mesh, &p, x);
}

/* One point in each of n equal shares of the area; X is n x 3, face is n. */
static void draw_points(const apsm_mesh *mesh, double area, size_t n, apsm_random *rng, double *X,
                        size_t *face)
{
    size_t f = 0;
    double below = 0.0, here = face_area(mesh, 0);
    for (size_t k = 0; k < n; k++) {
        const double at = ((double)k + apsm_random_uniform(rng)) / (double)n * area;
        while (f + 1 < mesh->nf && below + here <= at) {
            below += here;
            here = face_area(mesh, ++f);
        }
        draw_on_face(mesh, f, rng, X + 3 * k);
        face[k] = f;
    }
}

/* Points X that are nearer to p, number k, than d2 says are its; returns the one that is then
 * farthest from all, of equal ones the first. */
APSM_KERNEL static size_t come_nearer(size_t N, const double *restrict X, const double p[3],
                                      size_t k, double *restrict d2, size_t *restrict owner)
{
    enum { CHUNK = 64 };
    double farthest = -1.0;
    size_t at = 0;
    for (size_t first = 0; first < N; first += CHUNK) {
        const size_t end = N - first < CHUNK ? N : first + CHUNK;
        double most = 0.0;
#pragma omp simd reduction(max : most)
        for (size_t i = first; i < end; i++) {
            const double x = X[3 * i] - p[0], y = X[3 * i + 1] - p[1], z = X[3 * i + 2] - p[2];
            const double d = x * x + y * y + z * z;
            owner[i] = d < d2[i] ? k : owner[i];
            d2[i] = d < d2[i] ? d : d2[i];
            most = d2[i] > most ? d2[i] : most;
        }
        if (!(most > farthest)) continue;
        farthest = most;
        at = first;
    }
    while (d2[at] != farthest) at++;
    return at;
}

/* pick: the n of the points X (N x 3) that are farthest from those before, `first` first; owner
 * (N): which of them each point is closest to.  d2 (N) is scratch. */
static void pick_farthest(size_t N, const double *X, size_t first, size_t n, size_t *pick,
                          double *d2, size_t *owner)
{
    for (size_t i = 0; i < N; i++) d2[i] = INFINITY;
    pick[0] = first;
    for (size_t k = 0; k < n; k++) {
        const double p[3] = { X[3 * pick[k]], X[3 * pick[k] + 1], X[3 * pick[k] + 2] };
        const size_t farthest = come_nearer(N, X, p, k, d2, owner);
        if (k + 1 < n) pick[k + 1] = farthest;
    }
}

/* The same from the first point, with w: the share of X closest to each. */
static void thin(size_t N, const double *X, size_t n, size_t *pick, double *w, double *d2,
                 size_t *owner)
{
    pick_farthest(N, X, 0, n, pick, d2, owner);
    for (size_t k = 0; k < n; k++) w[k] = 0.0;
    for (size_t i = 0; i < N; i++) w[owner[i]] += 1.0 / (double)N;
}

/* Turns the principal axes (columns of V, as rows of A) to where the third moment is positive and
 * makes them right-handed. */
static void orient_axes(size_t N, const double *X, const double c[3], const double V[9],
                        double A[9])
{
    for (size_t a = 0; a < 2; a++) {
        double m3 = 0.0;
        for (size_t b = 0; b < 3; b++) A[3 * a + b] = V[3 * b + a];
        for (size_t i = 0; i < N; i++) {
            double x[3];
            vec3_sub(X + 3 * i, c, x);
            const double t = vec3_dot(A + 3 * a, x);
            m3 += t * t * t;
        }
        if (m3 < 0.0)
            for (size_t b = 0; b < 3; b++) A[3 * a + b] = -A[3 * a + b];
    }
    vec3_cross(A, A + 3, A + 6);
}

/* Centre, radius and principal axes of N equally weighted points. */
static void moments(size_t N, const double *X, apsm_cloud *cloud)
{
    double *c = cloud->centre, S[9] = { 0 }, U[9], s[3], V[9];
    c[0] = c[1] = c[2] = 0.0;
    for (size_t i = 0; i < 3 * N; i++) c[i % 3] += X[i] / (double)N;
    for (size_t i = 0; i < N; i++)
        for (size_t a = 0; a < 3; a++)
            for (size_t b = 0; b < 3; b++)
                S[3 * a + b] += (X[3 * i + a] - c[a]) * (X[3 * i + b] - c[b]) / (double)N;
    cloud->radius = sqrt(S[0] + S[4] + S[8]);
    apsm_svd3(S, U, s, V);
    orient_axes(N, X, c, V, cloud->axes);
}

/* X: 4 N doubles, index: 2 N + n, both scratch. */
static void sample(const apsm_mesh *mesh, double area, size_t N, apsm_random *rng, double *X,
                   size_t *index, apsm_cloud *cloud)
{
    size_t *face = index, *owner = index + N, *pick = index + 2 * N;
    draw_points(mesh, area, N, rng, X, face);
    moments(N, X, cloud);
    thin(N, X, cloud->n, pick, cloud->w, X + 3 * N, owner);
    for (size_t k = 0; k < cloud->n; k++) {
        memcpy(cloud->x + 3 * k, X + 3 * pick[k], 3 * sizeof *cloud->x);
        face_vector(mesh, face[pick[k]], cloud->normal + 3 * k);
        vec3_normalise(cloud->normal + 3 * k);
    }
}

apsm_status apsm_cloud_sample(const apsm_mesh *mesh, size_t n, uint64_t seed, uint64_t index,
                              apsm_cloud *cloud)
{
    *cloud = (apsm_cloud){ .n = n };
    if (n < 4) return APSM_ERR_ARG;
    const double area = apsm_mesh_area(mesh);
    if (!(area > 0.0) || !isfinite(area)) return APSM_ERR_GEOMETRY;
    const size_t N = DRAWN * n;
    double *X = malloc(4 * N * sizeof *X);
    size_t *scratch = malloc((2 * N + n) * sizeof *scratch);
    cloud->x = malloc(3 * n * sizeof *cloud->x);
    cloud->normal = malloc(3 * n * sizeof *cloud->normal);
    cloud->w = malloc(n * sizeof *cloud->w);
    const bool enough = X && scratch && cloud->x && cloud->normal && cloud->w;
    if (enough) {
        apsm_random rng = apsm_random_stream(seed, APSM_STREAM_ALIGN, index, 0);
        sample(mesh, area, N, &rng, X, scratch, cloud);
    } else {
        apsm_cloud_free(cloud);
    }
    free(X);
    free(scratch);
    return enough ? APSM_OK : APSM_ERR_MEMORY;
}

static size_t stride(const apsm_mesh *mesh)
{
    return (mesh->nv + MOST_VERTICES - 1) / MOST_VERTICES;
}

size_t apsm_cloud_vertices(const apsm_mesh *mesh)
{
    const size_t every = stride(mesh);
    return every > 0 ? (mesh->nv + every - 1) / every : 0;
}

apsm_status apsm_cloud_of_vertices(const apsm_mesh *mesh, const apsm_cloud *sample,
                                   apsm_cloud *cloud)
{
    const size_t every = stride(mesh);
    *cloud = *sample;
    cloud->n = apsm_cloud_vertices(mesh);
    cloud->normal = NULL;
    cloud->x = malloc(3 * cloud->n * sizeof *cloud->x);
    cloud->w = calloc(cloud->n, sizeof *cloud->w);
    if (!cloud->x || !cloud->w) {
        apsm_cloud_free(cloud);
        return APSM_ERR_MEMORY;
    }
    for (size_t k = 0; k < cloud->n; k++)
        memcpy(cloud->x + 3 * k, mesh->V + 3 * k * every, 3 * sizeof *cloud->x);
    for (size_t h = 0; h < 3 * mesh->nf; h++)
        if (mesh->F[h] % every == 0) cloud->w[mesh->F[h] / every] += face_area(mesh, h / 3);
    return APSM_OK;
}

/* ---- vertices of which no two are neighbours ---- */

/* next (3 nf): the corners of each vertex as lists; first (nv): their beginnings. */
static void list_corners(const apsm_mesh *mesh, uint32_t *first, uint32_t *next)
{
    for (size_t v = 0; v < mesh->nv; v++) first[v] = APSM_NONE;
    for (size_t h = 3 * mesh->nf; h-- > 0;) {
        next[h] = first[mesh->F[h]];
        first[mesh->F[h]] = (uint32_t)h;
    }
}

/* taken[v] <- whether v is taken, by which no vertex beside it is.  Returns how many are. */
static size_t take_apart(const apsm_mesh *mesh, const uint32_t *first, const uint32_t *next,
                         unsigned char *taken)
{
    size_t n = 0;
    for (size_t v = 0; v < mesh->nv; v++) {
        bool beside = first[v] == APSM_NONE;
        for (uint32_t h = first[v]; h != APSM_NONE && !beside; h = next[h]) {
            const uint32_t *F = mesh->F + 3 * (h / 3);
            beside = taken[F[0]] || taken[F[1]] || taken[F[2]];
        }
        taken[v] = !beside;
        n += !beside;
    }
    return n;
}

/* The areas of the faces around the vertices go to those taken, those of the others in equal parts
 * for every corner beside them. */
static void share_areas(const apsm_mesh *mesh, const uint32_t *first, const uint32_t *next,
                        const unsigned char *taken, double *w)
{
    for (size_t v = 0; v < mesh->nv; v++) {
        double area = 0.0, beside = 0.0;
        for (uint32_t h = first[v]; h != APSM_NONE; h = next[h]) {
            const uint32_t *F = mesh->F + 3 * (h / 3);
            area += face_area(mesh, h / 3);
            for (size_t c = 0; c < 3; c++) beside += taken[F[c]];
        }
        for (uint32_t h = first[v]; h != APSM_NONE && beside > 0.0; h = next[h])
            for (size_t c = 0; c < 3; c++) {
                const uint32_t u = mesh->F[3 * (h / 3) + c];
                if (taken[u]) w[u] += area / beside;
            }
    }
}

/* taken, w, first, next: scratch as above. */
static apsm_status choose_some(const apsm_mesh *mesh, uint32_t *first, uint32_t *next,
                               unsigned char *taken, double *w, apsm_cloud *cloud)
{
    list_corners(mesh, first, next);
    const size_t n = take_apart(mesh, first, next, taken);
    share_areas(mesh, first, next, taken, w);
    cloud->x = malloc(3 * n * sizeof *cloud->x);
    cloud->w = malloc(n * sizeof *cloud->w);
    if (!cloud->x || !cloud->w) return APSM_ERR_MEMORY;
    for (size_t v = 0; v < mesh->nv; v++) {
        if (!taken[v]) continue;
        memcpy(cloud->x + 3 * cloud->n, mesh->V + 3 * v, 3 * sizeof *cloud->x);
        cloud->w[cloud->n++] = w[v];
    }
    return APSM_OK;
}

apsm_status apsm_cloud_of_some_vertices(const apsm_mesh *mesh, const apsm_cloud *sample,
                                        apsm_cloud *cloud)
{
    uint32_t *corners = malloc((mesh->nv + 3 * mesh->nf) * sizeof *corners);
    unsigned char *taken = calloc(mesh->nv, sizeof *taken);
    double *w = calloc(mesh->nv, sizeof *w);
    *cloud = *sample;
    cloud->n = 0;
    cloud->x = cloud->w = cloud->normal = NULL;
    apsm_status status = corners && taken && w ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = choose_some(mesh, corners, corners + mesh->nv, taken, w, cloud);
    if (status != APSM_OK) apsm_cloud_free(cloud);
    free(corners);
    free(taken);
    free(w);
    return status;
}

/* ---- spread over the vertices ---- */

/* N vertices X (N x 3) with the area w (N) and the sum of face vectors m (N x 3) around each. */
static void gather_vertices(const apsm_mesh *mesh, size_t N, double *X, double *w, double *m)
{
    const size_t every = stride(mesh);
    memset(w, 0, N * sizeof *w);
    memset(m, 0, 3 * N * sizeof *m);
    for (size_t k = 0; k < N; k++) memcpy(X + 3 * k, mesh->V + 3 * k * every, 3 * sizeof *X);
    for (size_t h = 0; h < 3 * mesh->nf; h++) {
        double n[3];
        if (mesh->F[h] % every != 0) continue;
        face_vector(mesh, h / 3, n);
        w[mesh->F[h] / every] += vec3_norm(n);
        vec3_add_scaled(m + 3 * (mesh->F[h] / every), 1.0, n);
    }
}

/* Centre and radius of weighted points; the first point to pick is the farthest from the centre. */
static size_t weighted_moments(size_t N, const double *X, const double *w, apsm_cloud *cloud)
{
    double sum = 0.0, d2_sum = 0.0, most = -1.0;
    size_t farthest = 0;
    for (size_t k = 0; k < N; k++) {
        sum += w[k];
        vec3_add_scaled(cloud->centre, w[k], X + 3 * k);
    }
    for (size_t c = 0; c < 3; c++) cloud->centre[c] /= sum;
    for (size_t k = 0; k < N; k++) {
        const double d2 = vec3_distance2(X + 3 * k, cloud->centre);
        d2_sum += w[k] * d2;
        if (d2 > most) most = d2, farthest = k;
    }
    cloud->radius = sqrt(d2_sum / sum);
    return farthest;
}

/* X .. d2: as above and scratch (N). */
static void spread(size_t N, const double *X, const double *w, const double *m, double *d2,
                   size_t *owner, size_t *pick, apsm_cloud *cloud)
{
    double sum = 0.0;
    const size_t first = weighted_moments(N, X, w, cloud);
    pick_farthest(N, X, first, cloud->n, pick, d2, owner);
    memset(cloud->w, 0, cloud->n * sizeof *cloud->w);
    for (size_t i = 0; i < N; i++) {
        cloud->w[owner[i]] += w[i];
        sum += w[i];
    }
    for (size_t k = 0; k < cloud->n; k++) {
        cloud->w[k] /= sum;
        memcpy(cloud->x + 3 * k, X + 3 * pick[k], 3 * sizeof *cloud->x);
        memcpy(cloud->normal + 3 * k, m + 3 * pick[k], 3 * sizeof *cloud->normal);
        vec3_normalise(cloud->normal + 3 * k);
    }
}

apsm_status apsm_cloud_spread(const apsm_mesh *mesh, size_t n, apsm_cloud *cloud)
{
    const size_t N = apsm_cloud_vertices(mesh);
    *cloud = (apsm_cloud){ .n = n < N ? n : N };
    const double area = apsm_mesh_area(mesh);
    if (!(area > 0.0) || !isfinite(area)) return APSM_ERR_GEOMETRY;
    double *X = malloc(8 * N * sizeof *X);
    size_t *index = malloc((N + cloud->n) * sizeof *index);
    cloud->x = malloc(3 * cloud->n * sizeof *cloud->x);
    cloud->normal = malloc(3 * cloud->n * sizeof *cloud->normal);
    cloud->w = malloc(cloud->n * sizeof *cloud->w);
    const bool enough = X && index && cloud->x && cloud->normal && cloud->w;
    if (enough) {
        double *w = X + 3 * N, *m = X + 4 * N, *d2 = X + 7 * N;
        gather_vertices(mesh, N, X, w, m);
        spread(N, X, w, m, d2, index, index + N, cloud);
    } else {
        apsm_cloud_free(cloud);
    }
    free(X);
    free(index);
    return enough ? APSM_OK : APSM_ERR_MEMORY;
}

void apsm_cloud_free(apsm_cloud *cloud)
{
    free(cloud->x);
    free(cloud->normal);
    free(cloud->w);
    *cloud = (apsm_cloud){ 0 };
}
