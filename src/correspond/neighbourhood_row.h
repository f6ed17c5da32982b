/* neighbourhood_row.h -- one particle's neighbourhood, for the two files that make rows. */
#ifndef APSM_CORRESPOND_NEIGHBOURHOOD_ROW_H
#define APSM_CORRESPOND_NEIGHBOURHOOD_ROW_H

#include "correspond/geodesic_correspondence.h"

typedef struct neighbourhood_row {
    uint32_t *index;  /* borrowed, J */
    double *distance; /* borrowed, J */
    size_t n;
    double closest;
    uint32_t nearest;
} neighbourhood_row;

/* The row of particle j; the search stays in w and reaches at least factor * closest. */
apsm_status neighbourhood_search(const apsm_geodesic *g, apsm_geodesic_work *w, size_t J,
                                 const apsm_surface_point *points, const double *P, uint32_t j,
                                 double factor, neighbourhood_row *row);

/* Adds k to the row by the way of a section from j no longer than limit; false if there is none. */
bool neighbourhood_add_section(const apsm_geodesic *g, const apsm_surface_point *points, uint32_t j,
                               uint32_t k, double limit, neighbourhood_row *row);

/* Whether j is seen to miss nothing without a search: a way across the surface to each of its
 * reference neighbours is no longer than factor times the distance in space of the closest
 * particle.  Then the row holds them by the lengths of those ways. */
bool neighbourhood_by_sections(const apsm_geodesic *g, size_t J, const apsm_surface_point *points,
                               const double *P, const apsm_neighbourhoods *reference, uint32_t j,
                               double factor, neighbourhood_row *row);

/* Appends row j (rows must come in order) with room for the worst case. */
apsm_status neighbourhoods_append(apsm_neighbourhoods *rows, uint32_t j,
                                  const neighbourhood_row *row);

#endif
