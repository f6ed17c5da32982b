/* vtk_grid.h -- a legacy VTK file (POLYDATA or UNSTRUCTURED_GRID) whose points move while all else
 * in it, cells, labels and other data, stays byte for byte. */
#ifndef APSM_FORMATS_VTK_GRID_H
#define APSM_FORMATS_VTK_GRID_H

#include <stdbool.h>
#include <stdint.h>

#include "apsm/context.h"

/* Owns its arrays.  Zero-initialise with {0}; vtk_grid_free leaves it so. */
typedef struct vtk_grid {
    char *bytes; /* of the file */
    size_t size;
    size_t points_at, points_end; /* the section POINTS in them */
    bool ascii, bare_cr;          /* lines end in CR */
    size_t n;
    double *x; /* n x 3 */
    size_t tets;
    uint32_t *tet;    /* tets x 4, points */
    uint32_t *number; /* of each among all cells */
} vtk_grid;

apsm_status vtk_grid_read(apsm_context *ctx, const char *path, vtk_grid *g) APSM_NODISCARD;
/* The file with its points at x (g->n x 3), atomically. */
apsm_status vtk_grid_write(apsm_context *ctx, const char *path, const vtk_grid *g,
                           const double *x) APSM_NODISCARD;
void vtk_grid_free(vtk_grid *g);

/* Tetrahedra that have turned inside out, or become flat, from x to y; list (g->tets, out) has
 * their numbers among the cells.  Returns how many. */
size_t vtk_grid_inverted(const vtk_grid *g, const double *x, const double *y, uint32_t *list);

#endif
