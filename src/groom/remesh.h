/* remesh.h -- near-isotropic remeshing of triangle meshes. */
#ifndef APSM_REMESH_H
#define APSM_REMESH_H

#include <stdbool.h>

#include "core/option.h"
#include "geometry/bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The result has within 10 % of `faces` faces unless the shape itself needs more. */
#define APSM_REMESH_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                       \
    INT(S, faces, 10000, 100, 10000000, "faces of a groomed mesh, about; more where needed")       \
    FIXED(S, bool, refine, true,                                                                   \
          "split long edges of a mesh that has fewer faces than wanted: paths and warps need the " \
          "resolution; false: its own number is wanted")                                           \
    FIXED(S, int, iterations, 6, "of split, collapse, flip, relax, project")                       \
    FIXED(S, double, turn, 0.6,                                                                    \
          "angle (radians) that the normal may turn along an edge before edges get shorter "       \
          "there: rims of sheets, tips, thin tubes; 0: edges of one length everywhere")            \
    FIXED(S, double, shortest, 0.3, "edges are never shorter than this share of the common one")   \
    FIXED(S, double, fidelity, 0.1,                                                                \
          "a collapse, flip or move that puts the surface farther than this share of the local "   \
          "edge from where it was is refused")
typedef struct apsm_remesh_options {
    APSM_OPTION_FIELDS(APSM_REMESH_OPTIONS)
} apsm_remesh_options;
apsm_remesh_options apsm_remesh_defaults(void);

typedef struct apsm_remesh_report {
    size_t faces_before, faces_after;
    double edge; /* common edge length aimed at */
    double
        forward_mean; /* result to original: distance of the result's vertices and face centres */
    double forward_max;
    double backward_mean; /* original to result: distance of the original's vertices */
    double backward_max;
    double volume_change; /* relative */
    double min_angle;     /* smallest angle of a face, degrees */
    size_t below_30;      /* faces with an angle below 30 degrees */
} apsm_remesh_report;

/* out (owned by the caller, overwritten) is `mesh` with about opt->faces well-shaped
 * faces: closed, or open with the same border loops, oriented, of the same genus.  `original` is
 * the tree of the surface to stay on, usually of `mesh` itself.  Coordinates of out are float32
 * numbers, so that PLY and STL files hold it without loss.  opt NULL: defaults; report NULL: not
 * wanted (saves the measuring). Scaling mesh by a power of two scales the result exactly.
 *
 * Vertices of a border stay on the original's border, which keeps its corners.
 *
 * APSM_ERR_GEOMETRY if mesh is not a connected manifold, or if spikes or needles would need
 * many times the faces wanted.  O(nf log nf) time, O(nf) memory.
 * Source: Botsch & Kobbelt, "A remeshing approach to multiresolution modeling", SGP 2004;
 * sizes as in Dunyach et al., "Adaptive remeshing for real-time mesh deformation", 2013. */
apsm_status apsm_remesh(apsm_context *ctx, const apsm_mesh *mesh, const apsm_bvh *original,
                        const apsm_remesh_options *opt, apsm_mesh *out,
                        apsm_remesh_report *report) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
