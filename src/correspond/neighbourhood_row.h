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

/* Appends row j (rows must come in order) with room for the worst case. */
apsm_status neighbourhoods_append(apsm_neighbourhoods *rows, uint32_t j,
                                  const neighbourhood_row *row);

#endif
