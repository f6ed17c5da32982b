/* surface_distance.h -- how far a reconstruction (the warped template) is from a shape's own
 * surface, by the paper's definition and by ShapeWorks' (docs/method.md, "Metrics").  All distances
 * are from a vertex to the nearest point of the other surface's triangles, unsigned, in input
 * units. */
#ifndef APSM_EVALUATE_SURFACE_DISTANCE_H
#define APSM_EVALUATE_SURFACE_DISTANCE_H

#include "apsm/evaluate.h"
#include "apsm/mesh.h"
#include "geometry/bvh.h"
#include "model/warp.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Summary of n >= 1 distances; weight NULL: all 1.  order (2 n) is
 * scratch, its first n end as the places by distance; distances are from +0 on.  O(n). */
void apsm_distance_summarize(size_t n, const double *distance, const double *weight, size_t *order,
                             apsm_distance_summary *summary);

/* distance (n, out) of points X (n x 3) to the mesh of the tree; face (n, out; may be NULL) is
 * the closest triangle. */
void apsm_point_distances(const apsm_bvh *bvh, size_t n, const double *X, double *distance,
                          uint32_t *face);

/* Per-vertex distances for heat maps; each array may be NULL.  Sizes: reconstruction nv, shape nv,
 * shape nv. */
typedef struct apsm_distance_fields {
    double *pull, *push, *disagreement;
} apsm_distance_fields;

/* Compares a shape with its reconstruction.  shape_bvh is the shape's tree, or NULL to make one
 * here; fields NULL: not wanted.  Neither mesh may be empty (APSM_ERR_GEOMETRY). */
apsm_status apsm_surface_distance_between(apsm_context *ctx, const apsm_mesh *shape,
                                          const apsm_bvh *shape_bvh,
                                          const apsm_mesh *reconstruction,
                                          const apsm_distance_fields *fields,
                                          apsm_surface_distance *result) APSM_NODISCARD;

/* Where the meshes of a cohort come from: get lends the mesh of shape i and, if there is one, its
 * tree (else NULL); release (may be NULL) gives both back.  Both are called from several threads at
 * a time, for different i. */
typedef struct apsm_mesh_source {
    apsm_status (*get)(apsm_context *ctx, size_t i, const apsm_mesh **mesh, const apsm_bvh **bvh,
                       void *user);
    void (*release)(size_t i, const apsm_mesh *mesh, const apsm_bvh *bvh, void *user);
    void *user;
} apsm_mesh_source;
/* A source of meshes[i], borrowed. */
apsm_mesh_source apsm_mesh_source_array(const apsm_mesh *meshes);

/* Distances of every shape to the template's mesh warped to its particles P (I x J x 3, in the
 * frame of the meshes).  warp is that of template_mesh's vertices.  result (I, out).  Parallel over
 * shapes. */
apsm_status apsm_surface_distances(apsm_context *ctx, const apsm_warp *warp,
                                   const apsm_mesh *template_mesh, size_t I, const double *P,
                                   const apsm_mesh_source *shape,
                                   apsm_surface_distance *result) APSM_NODISCARD;
/* The template, which is warped to itself, is left out.  template_index >= I: no shape is it. */
void apsm_surface_summarize(size_t I, const apsm_surface_distance *distance, size_t template_index,
                            apsm_surface_summary *summary);

/* Two-way distances with other shapes in the template's place, which nothing was fitted to:
 * `others` of them (at most I - 1; 0: nothing is measured), evenly taken after the template, each
 * warped to at most 12 shapes, evenly taken, others for each, without itself.  mean: of the
 * aggregates; its `max` the largest. others warps, and distances of as many times the shapes. */
apsm_status apsm_other_templates(apsm_context *ctx, size_t I, size_t J, const double *P,
                                 const apsm_mesh_source *shape, size_t template_index,
                                 size_t others, apsm_surface_aggregate *mean) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
