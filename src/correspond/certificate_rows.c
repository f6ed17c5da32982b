/* The neighbourhoods that a certificate asks for, with as little search as will do.
 *
 * A certificate counts reference neighbours that are beyond 1.5 and beyond 2 times the closest's
 * distance; how far the others are it asks only where a particle has mismatches at 1.5 (swaps), or
 * if any has one at 2 (lost neighbours).  So a particle all of whose reference neighbours are seen
 * within 1.5 by sections needs no search, and one whose others are seen within 2 a search to 1.5;
 * of all others the row is what a search to 2 finds: what is beyond counts as lost, however far.
 *
 * Searches find distances a little too large (geodesic.c), sections the length of a way that is
 * there.  What is seen by sections has to be nearer by `margin`, so that a search would agree. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "correspond/certificate.h"
#include "correspond/neighbourhood_row.h"

static const double strict = 1.5, usual = 2.0, margin = 1.05;

typedef struct looking {
    const apsm_geodesic *g;
    apsm_geodesic_work *w;
    size_t J;
    const apsm_surface_point *points;
    const double *P;
    const apsm_neighbourhoods *reference;
    neighbourhood_row row, found; /* of one particle; what a search has found of it */
} looking;

/* The search's row with the reference neighbours beyond it, if a section no longer than factor
 * times the closest's distance leads to them; false if none does to one.  They stay beyond
 * `strict`, where the search has put them. */
static bool complete(looking *l, uint32_t j, double factor)
{
    const apsm_neighbourhoods *r = l->reference;
    const neighbourhood_row *found = &l->found;
    neighbourhood_row *row = &l->row;
    const double limit = factor * found->closest, beyond = strict * found->closest * (1.0 + 1e-9);
    size_t at = 0;
    if (!(found->closest < INFINITY)) return false;
    row->n = 0;
    for (size_t i = r->start[j]; i <= r->start[j + 1]; i++) {
        const uint32_t k = i < r->start[j + 1] ? r->index[i] : APSM_NONE;
        for (; at < found->n && found->index[at] < k; at++) {
            row->index[row->n] = found->index[at];
            row->distance[row->n++] = found->distance[at];
        }
        if (k == APSM_NONE || (at < found->n && found->index[at] == k)) continue;
        if (!neighbourhood_add_section(l->g, l->points, j, k, limit, row)) return false;
        double *d = &row->distance[row->n - 1];
        *d = fmax(*d, beyond);
    }
    row->closest = found->closest;
    row->nearest = found->nearest;
    return true;
}

/* l->row of particle j. */
static apsm_status look(looking *l, uint32_t j)
{
    if (neighbourhood_by_sections(l->g, l->J, l->points, l->P, l->reference, j, strict / margin,
                                  &l->row))
        return APSM_OK;
    APSM_TRY(neighbourhood_search(l->g, l->w, l->J, l->points, l->P, j, strict, &l->found));
    if (complete(l, j, usual / margin)) return APSM_OK;
    return neighbourhood_search(l->g, l->w, l->J, l->points, l->P, j, usual, &l->row);
}

static apsm_status look_at_all(looking *l, apsm_neighbourhoods *rows)
{
    APSM_TRY(apsm_neighbourhoods_resize(rows, l->J));
    rows->factor = usual;
    for (uint32_t j = 0; j < l->J; j++) {
        APSM_TRY(look(l, j));
        APSM_TRY(neighbourhoods_append(rows, j, &l->row));
    }
    return APSM_OK;
}

apsm_status apsm_certificate_rows(const apsm_geodesic *g, apsm_geodesic_work *w, size_t J,
                                  const apsm_surface_point *points, const double *P,
                                  const apsm_neighbourhoods *reference, apsm_neighbourhoods *rows)
{
    uint32_t *index = malloc(2 * (J + 1) * sizeof *index);
    double *distance = malloc(2 * (J + 1) * sizeof *distance);
    looking l = { .g = g, .w = w, .J = J, .points = points, .P = P, .reference = reference };
    apsm_status status = APSM_ERR_MEMORY;
    if (index && distance) {
        l.row = (neighbourhood_row){ .index = index, .distance = distance };
        l.found = (neighbourhood_row){ .index = index + J + 1, .distance = distance + J + 1 };
        status = look_at_all(&l, rows);
    }
    free(index);
    free(distance);
    return status;
}

apsm_status apsm_certificate_measure(const apsm_geodesic *g, size_t J,
                                     const apsm_surface_point *points, const double *P,
                                     const apsm_neighbourhoods *reference, double factor,
                                     apsm_neighbourhoods *rows)
{
    apsm_geodesic_work *w = NULL;
    APSM_TRY(apsm_neighbourhoods_resize(rows, J));
    APSM_TRY(apsm_geodesic_work_new(g, &w));
    const apsm_status status = factor > 0
                                   ? apsm_geodesic_neighbourhoods(g, w, J, points, P, factor, rows)
                                   : apsm_certificate_rows(g, w, J, points, P, reference, rows);
    apsm_geodesic_work_free(w);
    return status;
}
