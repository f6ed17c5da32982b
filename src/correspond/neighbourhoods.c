/* Geodesic neighbourhoods of particles, and what is missing in them compared with the reference.
 *
 *   N_j = { k : D_jk <= f min_l D_jl }
 * (docs/method.md, "Geodesic correspondence (Algorithm 1)"): reference neighbour k of j is
 * mismatched on a shape if D_jk > F min_l D_jl there. Only distances up to f times the closest
 * matter, so a search from j starts with a radius from the closest particle in space, which is
 * never farther than the closest along the surface, and widens as needed. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "correspond/neighbourhood_row.h"
#include "geometry/vec3.h"

apsm_status apsm_neighbourhoods_resize(apsm_neighbourhoods *rows, size_t J)
{
    if (rows->J != J || !rows->start) {
        apsm_neighbourhoods_free(rows);
        rows->start = calloc(J + 1, sizeof *rows->start);
        rows->closest = malloc((J + 1) * sizeof *rows->closest);
        rows->nearest = malloc((J + 1) * sizeof *rows->nearest);
        if (!rows->start || !rows->closest || !rows->nearest) {
            apsm_neighbourhoods_free(rows);
            return APSM_ERR_MEMORY;
        }
        rows->J = J;
    }
    rows->start[0] = 0;
    return APSM_OK;
}

void apsm_neighbourhoods_free(apsm_neighbourhoods *rows)
{
    free(rows->start);
    free(rows->index);
    free(rows->distance);
    free(rows->closest);
    free(rows->nearest);
    *rows = (apsm_neighbourhoods){ 0 };
}

static apsm_status reserve(apsm_neighbourhoods *rows, size_t n)
{
    if (n <= rows->capacity) return APSM_OK;
    const size_t capacity = n + n / 2;
    uint32_t *index = realloc(rows->index, capacity * sizeof *index);
    if (index) rows->index = index;
    double *distance = realloc(rows->distance, capacity * sizeof *distance);
    if (distance) rows->distance = distance;
    if (!index || !distance) return APSM_ERR_MEMORY;
    rows->capacity = capacity;
    return APSM_OK;
}

apsm_status neighbourhoods_append(apsm_neighbourhoods *rows, uint32_t j,
                                  const neighbourhood_row *row)
{
    const size_t at = rows->start[j];
    APSM_TRY(reserve(rows, at + row->n + 16));
    memcpy(rows->index + at, row->index, row->n * sizeof *row->index);
    memcpy(rows->distance + at, row->distance, row->n * sizeof *row->distance);
    rows->start[j + 1] = (uint32_t)(at + row->n);
    rows->closest[j] = row->closest;
    rows->nearest[j] = row->nearest;
    return APSM_OK;
}

/* Keeps of the candidates those within factor times the closest. */
static void settle(neighbourhood_row *row, double factor)
{
    size_t n = 0;
    row->closest = INFINITY;
    row->nearest = APSM_NONE;
    for (size_t i = 0; i < row->n; i++)
        if (row->distance[i] < row->closest) {
            row->closest = row->distance[i];
            row->nearest = row->index[i];
        }
    for (size_t i = 0; i < row->n; i++) {
        if (!(row->distance[i] <= factor * row->closest)) continue;
        row->index[n] = row->index[i];
        row->distance[n++] = row->distance[i];
    }
    row->n = n;
}

/* Distances of the particles within radius of the search in w. */
static void collect(const apsm_geodesic *g, const apsm_geodesic_work *w, size_t J,
                    const apsm_surface_point *points, const double *P, uint32_t j, double radius,
                    neighbourhood_row *row)
{
    row->n = 0;
    for (uint32_t k = 0; k < J; k++) {
        if (k == j || vec3_distance2(P + 3 * j, P + 3 * k) > radius * radius) continue;
        const double d = apsm_geodesic_distance(g, w, points + k);
        if (!(d <= radius)) continue;
        row->index[row->n] = k;
        row->distance[row->n++] = d;
    }
}

/* The particle next to j in space; APSM_NONE if j is alone. */
static uint32_t nearest_in_space(size_t J, const double *P, uint32_t j)
{
    double d2 = INFINITY;
    uint32_t nearest = APSM_NONE;
    for (uint32_t k = 0; k < J; k++) {
        const double d = vec3_distance2(P + 3 * (size_t)j, P + 3 * (size_t)k);
        if (k == j || !(d < d2)) continue;
        d2 = d;
        nearest = k;
    }
    return nearest;
}

static double closest_in_space(size_t J, const double *P, uint32_t j)
{
    const uint32_t k = nearest_in_space(J, P, j);
    return k == APSM_NONE ? INFINITY : sqrt(vec3_distance2(P + 3 * (size_t)j, P + 3 * (size_t)k));
}

apsm_status neighbourhood_search(const apsm_geodesic *g, apsm_geodesic_work *w, size_t J,
                                 const apsm_surface_point *points, const double *P, uint32_t j,
                                 double factor, neighbourhood_row *row)
{
    double radius = 1.05 * factor * closest_in_space(J, P, j);
    APSM_TRY(apsm_geodesic_from(g, points + j, radius, w));
    for (bool more = true;;) {
        collect(g, w, J, points, P, j, radius, row);
        settle(row, factor);
        if (!more || factor * row->closest <= radius) return APSM_OK;
        radius = row->closest < INFINITY ? factor * row->closest
                                         : fmax(2.0 * radius, apsm_geodesic_margin(g));
        more = apsm_geodesic_extend(g, radius, w);
        if (!more) radius = INFINITY;
    }
}

bool neighbourhood_add_section(const apsm_geodesic *g, const apsm_surface_point *points, uint32_t j,
                               uint32_t k, double limit, neighbourhood_row *row)
{
    const double d = apsm_geodesic_section(g, points + j, points + k, limit);
    if (!(d < INFINITY)) return false;
    if (d < row->closest) {
        row->closest = d;
        row->nearest = k;
    }
    row->index[row->n] = k;
    row->distance[row->n++] = d;
    return true;
}

bool neighbourhood_by_sections(const apsm_geodesic *g, size_t J, const apsm_surface_point *points,
                               const double *P, const apsm_neighbourhoods *reference, uint32_t j,
                               double factor, neighbourhood_row *row)
{
    const uint32_t nearest = nearest_in_space(J, P, j);
    *row = (neighbourhood_row){ row->index, row->distance, 0, INFINITY, APSM_NONE };
    if (nearest == APSM_NONE) return false;
    const double d2 = vec3_distance2(P + 3 * (size_t)j, P + 3 * (size_t)nearest);
    const double limit = factor * sqrt(d2);
    if (!neighbourhood_add_section(g, points, j, nearest, limit, row)) return false;
    row->n = 0;
    for (size_t i = reference->start[j]; i < reference->start[j + 1]; i++)
        if (!neighbourhood_add_section(g, points, j, reference->index[i], limit, row)) return false;
    return true;
}

apsm_status apsm_geodesic_neighbourhoods(const apsm_geodesic *g, apsm_geodesic_work *w, size_t J,
                                         const apsm_surface_point *points, const double *P,
                                         double factor, apsm_neighbourhoods *rows)
{
    APSM_TRY(apsm_neighbourhoods_resize(rows, J));
    rows->factor = factor;
    neighbourhood_row row = { .index = malloc((J + 1) * sizeof *row.index),
                              .distance = malloc((J + 1) * sizeof *row.distance) };
    apsm_status status = row.index && row.distance ? APSM_OK : APSM_ERR_MEMORY;
    for (uint32_t j = 0; status == APSM_OK && j < J; j++) {
        status = neighbourhood_search(g, w, J, points, P, j, factor, &row);
        if (status == APSM_OK) status = neighbourhoods_append(rows, j, &row);
    }
    free(row.index);
    free(row.distance);
    return status;
}

apsm_status apsm_matrix_neighbourhoods(size_t J, const double *D, double factor,
                                       apsm_neighbourhoods *rows)
{
    APSM_TRY(apsm_neighbourhoods_resize(rows, J));
    rows->factor = factor;
    for (uint32_t j = 0; j < J; j++) {
        const size_t at = rows->start[j];
        APSM_TRY(reserve(rows, at + J));
        neighbourhood_row row = { .index = rows->index + at, .distance = rows->distance + at };
        for (uint32_t k = 0; k < J; k++) {
            if (k == j || !(D[j * J + k] < INFINITY)) continue;
            row.index[row.n] = k;
            row.distance[row.n++] = D[j * J + k];
        }
        settle(&row, factor);
        rows->start[j + 1] = (uint32_t)(at + row.n);
        rows->closest[j] = row.closest;
        rows->nearest[j] = row.nearest;
    }
    return APSM_OK;
}

double apsm_neighbour_distance(const apsm_neighbourhoods *rows, uint32_t j, uint32_t k)
{
    size_t lo = rows->start[j], hi = rows->start[j + 1];
    while (lo < hi) {
        const size_t mid = (lo + hi) / 2;
        if (rows->index[mid] < k)
            lo = mid + 1;
        else
            hi = mid;
    }
    return lo < rows->start[j + 1] && rows->index[lo] == k ? rows->distance[lo] : INFINITY;
}

size_t apsm_missing_neighbours(const apsm_neighbourhoods *reference,
                               const apsm_neighbourhoods *shape, double factor, uint32_t j,
                               uint32_t *missing)
{
    const double most = factor * shape->closest[j];
    size_t n = 0;
    for (size_t i = reference->start[j]; i < reference->start[j + 1]; i++) {
        const uint32_t k = reference->index[i];
        if (!(apsm_neighbour_distance(shape, j, k) <= most && most < INFINITY)) missing[n++] = k;
    }
    return n;
}

size_t apsm_mismatches(const apsm_neighbourhoods *reference, const apsm_neighbourhoods *shape,
                       double factor, uint32_t *count)
{
    size_t particles = 0;
    for (uint32_t j = 0; j < shape->J; j++) {
        const double most = factor * shape->closest[j];
        count[j] = 0;
        for (size_t i = reference->start[j]; i < reference->start[j + 1]; i++) {
            const double d = apsm_neighbour_distance(shape, j, reference->index[i]);
            count[j] += !(d <= most && most < INFINITY);
        }
        particles += count[j] > 0;
    }
    return particles;
}

size_t apsm_mismatch_order(size_t J, const uint32_t *count, uint32_t *order)
{
    size_t n = 0;
    uint32_t most = 0;
    for (size_t j = 0; j < J; j++) most = count[j] > most ? count[j] : most;
    for (uint32_t c = most; c > 0; c--)
        for (uint32_t j = 0; j < J; j++)
            if (count[j] == c) order[n++] = j;
    return n;
}
