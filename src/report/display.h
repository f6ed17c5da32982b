/* display.h -- the meshes and heat maps that the page shows, all in the world frame. */
#ifndef APSM_REPORT_DISPLAY_H
#define APSM_REPORT_DISPLAY_H

#include "folder/model_folder.h"
#include "report/joint_view.h"

/* One shape and its reconstruction: the template's mesh warped to the shape's particles. */
typedef struct display_shape {
    apsm_mesh mesh;
    size_t *first_vertex;    /* parts + 1: where a part's vertices are among those of mesh */
    double *distance;        /* mesh.nv: to the reconstruction */
    size_t rest;             /* of mesh's vertices, so many at the end do not count: rest.h */
    double *warped;          /* template nv x 3: vertices of the reconstruction */
    double *warped_distance; /* template nv: to the shape */
} display_shape;

/* Owns everything.  Zero-initialise with {0}; display_free leaves it so. */
typedef struct display {
    size_t I;
    display_shape *shape;    /* I */
    apsm_mesh template_mesh; /* its faces are those of all reconstructions */
    size_t modes;            /* that are shown */
    double *mean;            /* template nv x 3: the template's mesh warped to the mean */
    double *mode;            /* modes x template nv x 3: displacement at one standard deviation */
    size_t *first_vertex;    /* parts + 1: of template_mesh */
    joint_view joint;        /* pose and shape apart; n = 0 for one part */
} display;

apsm_status display_make(apsm_context *ctx, const model_folder *m, display *d);
void display_free(display *d);

#endif
