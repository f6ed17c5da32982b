/* template_surface.h -- the surface that stands for all shapes: the template's mesh, or where a
 * subject has several parts, the mesh of each part's template, and the warp of each by its own
 * particles. */
#ifndef APSM_REPORT_TEMPLATE_SURFACE_H
#define APSM_REPORT_TEMPLATE_SURFACE_H

#include "folder/model_folder.h"
#include "geometry/bvh.h"
#include "model/warp.h"

/* Owns everything but m.  Zero-initialise with {0}; template_surface_free leaves it so. */
typedef struct template_surface {
    const model_folder *m;
    apsm_mesh *mesh;      /* m->parts, world frame */
    size_t *first_vertex; /* m->parts + 1: where a part's vertices are among those of all */
    apsm_warp *warp;      /* m->parts */
} template_surface;

/* With about `faces` faces in all, or 0: as groomed. */
apsm_status template_surface_make(apsm_context *ctx, const model_folder *m, size_t faces,
                                  template_surface *t);
void template_surface_free(template_surface *t);

/* The meshes of all parts as one. */
apsm_status template_surface_mesh(const template_surface *t, apsm_mesh *mesh);

/* y (first_vertex[parts] x 3, out) <- all vertices as particles p (J x 3) have them.  Linear in p.
 */
void template_surface_warp(const template_surface *t, const double *p, double *y);

/* shown <- mesh with about `faces` faces, or all of them if it has few or cannot be remeshed. */
apsm_status reduce_mesh(apsm_context *ctx, const apsm_mesh *mesh, const apsm_bvh *bvh, size_t faces,
                        apsm_mesh *shown);

#endif
