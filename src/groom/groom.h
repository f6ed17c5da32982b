/* groom.h -- from a segmentation or a raw mesh to a clean one: one outward surface of well-shaped
 * triangles, closed unless it may stay open.  Alignment is in align.h. */
#ifndef APSM_GROOM_H
#define APSM_GROOM_H

#include <stdbool.h>

#include "apsm/mesh.h"
#include "apsm/volume.h"
#include "groom/remesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Of masks: fill_holes, closing, opening, smooth, fairing; of meshes: remesh, fill_holes, merge. */
#define APSM_GROOM_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                        \
    BOOL(S, remesh, true, "make groomed meshes near-isotropic with about `faces` faces")           \
    BOOL(S, fill_holes, true, "fill cavities of segmentations and holes of meshes")                \
    BOOL(S, open, false,                                                                           \
         "meshes may be open surfaces: openings stay that take a lid of more than 1 % of the "     \
         "area (with no-fill-holes: all)")                                                         \
    BOOL(S, fill, false,                                                                           \
         "close openings of any size; else one that takes a lid of more than 10 % of the area is " \
         "a question")                                                                             \
    REAL(S, closing, -1, -1, 1,                                                                    \
         "radius by which masks are closed, as a share of the cube root of their volume: tunnels " \
         "and gaps narrower than twice that are filled, a number may end in mm; 0: none; -1: "     \
         "handles narrower than twice 0.12 are filled or cut one by one, whichever takes fewer "   \
         "voxels, those that most shapes have are kept, and where they are many and differ (a "    \
         "branched sinus) all shapes are closed by 0.1")                                           \
    REAL(S, closing_length, 0, 0, 1e9,                                                             \
         "the radius of closing in the input's unit, what `closing` in mm sets; 0: as closing "    \
         "says")                                                                                   \
    REAL(S, opening, 0, 0, 1,                                                                      \
         "radius by which masks are opened before they are closed, as a share like closing or in " \
         "mm: spikes, bridges and sheets thinner than twice that are cut off; 0: none")            \
    REAL(S, opening_length, 0, 0, 1e9,                                                             \
         "the radius of opening in the input's unit, what `opening` in mm sets; 0: as opening "    \
         "says")                                                                                   \
    REAL(S, smooth, 1, 0, 4, "smoothing of masks; less keeps nearer to the voxels, 0: none")       \
    BOOL(S, largest_component, true, "keep only the largest component of every shape")             \
    REAL(S, max_drop_share, 0.2, 0, 1,                                                             \
         "smaller components may have together this share of the area (mesh) or of the voxels "    \
         "(mask) at most; 1: drop any")                                                            \
    FIXED(S, double, fairing, 5.0,                                                                 \
          "ripples of a mask shorter than so many voxels (cube root of the volume of one), times " \
          "smooth, are taken off its surface, by at most one voxel")                               \
    FIXED(S, double, merge, 1e-7, "vertices closer than this share of the diagonal are one")       \
    FIXED(S, double, max_cap_share, 0.1,                                                           \
          "unless asked to fill, an opening is closed only if its lid is at most this share of "   \
          "the area")                                                                              \
    FIXED(S, double, open_share, 0.01,                                                             \
          "with open, openings stay that take a lid of more than this share of the area, unless "  \
          "holes are not to be filled: then all")
typedef struct apsm_groom_options {
    APSM_OPTION_FIELDS(APSM_GROOM_OPTIONS)
    bool keep_sides; /* what is outside is known: the file's order of corners says it */
    apsm_remesh_options remesh_options;
    bool measure; /* what remeshing did, for the report; takes a third longer */
} apsm_groom_options;
apsm_groom_options apsm_groom_defaults(void); /* measure: true */

/* What was done to one shape.  Zero where a step had nothing to do. */
typedef struct apsm_groom_report {
    /* segmentation */
    size_t voxels;              /* of the label, after the steps below */
    size_t dropped_parts;       /* parts of the label not kept ... */
    size_t dropped_voxels;      /* ... and their voxels */
    size_t filled_voxels;       /* enclosed background filled */
    double closing;             /* radius of the closing or of the widest handle mended, 0: none */
    double opening;             /* radius of the opening, 0: none */
    size_t opened_voxels;       /* what that took away, with parts that it cut off */
    size_t closed_voxels;       /* what the closing filled ... */
    size_t cut_voxels;          /* ... and what it cut */
    long handles_before;        /* genus without it */
    unsigned border;            /* the label touches the image's border: bits 0..5 for
                                   -i +i -j +j -k +k; the surface is closed there */
    int supersampling[3];       /* nodes a voxel along each axis */
    double border_normal[6][3]; /* of those borders, outward, in LPS; zero for the others */
    double mask_volume;         /* in the unit's cube */
    double dice;      /* of the result with the largest part of the label as it was given ... */
    double departure; /* ... and the farthest that a voxel's centre lies on the wrong side */
    double smoothing_volume; /* relative change of volume by smoothing */
    /* repair */
    size_t merged_vertices, unused_vertices;
    size_t degenerate_faces, duplicate_faces; /* removed */
    size_t fin_faces;                         /* removed with sheets hanging on the surface */
    size_t split_vertices;                    /* copies made where fans or sheets only touched */
    size_t flipped_faces;
    size_t dropped_components, dropped_faces;
    double dropped_area; /* share of the area */
    size_t holes, hole_faces;
    size_t openings;    /* left open */
    double open_length; /* of their borders, over the square root of the area */
    bool sided; /* open, and so flat that the file's order of corners says what is outside */
    double largest_cap; /* area of the largest cap as a share of the mesh's */
    double largest_cap_at[3];
    bool inverted;             /* all triangles faced inward */
    long genus;                /* of the result */
    apsm_remesh_report remesh; /* zero if not asked for */
} apsm_groom_report;

/* mesh_out (owned by the caller, overwritten): the surface of all voxels with label != 0.  name
 * is for messages (a file, usually).  opt and report may be NULL.
 *
 * The largest 26-connected part is kept and background that no 6-connected path joins to the
 * outside is filled; the part is cropped, padded, smoothed (antialias.c), contoured and then
 * treated like a mesh.  APSM_ERR_GEOMETRY if the label is empty, too small, or in several large
 * parts.  O(voxels of the label's bounding box) time and memory. */
apsm_status apsm_groom_segmentation(apsm_context *ctx, const char *name, const apsm_volume *volume,
                                    const apsm_groom_options *opt, apsm_mesh *mesh_out,
                                    apsm_groom_report *report) APSM_NODISCARD;
/* The same, and the volume's labels are freed as soon as they are not needed; options are given. */
apsm_status groom_taken_segmentation(apsm_context *ctx, const char *name, apsm_volume *volume,
                                     const apsm_groom_options *options, apsm_mesh *mesh_out,
                                     apsm_groom_report *report) APSM_NODISCARD;

/* mesh_out (owned by the caller, overwritten): mesh repaired, closed, outward, remeshed.
 * APSM_ERR_GEOMETRY, with the place, where no safe repair is known: a surface that cannot be
 * oriented, an opening too large to close, parts of similar size, no volume.
 * O(nf log nf) time, O(nf) memory. */
apsm_status apsm_groom_mesh(apsm_context *ctx, const char *name, const apsm_mesh *mesh,
                            const apsm_groom_options *opt, apsm_mesh *mesh_out,
                            apsm_groom_report *report) APSM_NODISCARD;

/* Repair alone, as above without remeshing; report is added to, not cleared. */
apsm_status apsm_repair(apsm_context *ctx, const char *name, const apsm_mesh *mesh,
                        const apsm_groom_options *opt, apsm_mesh *mesh_out,
                        apsm_groom_report *report) APSM_NODISCARD;

/* Mirrors mesh in place at the plane x = its centroid's x (docs/method.md, "Pose") and turns its
 * triangles; M (16, out, row-major) is the map used, its own inverse.  The plane is rounded to
 * float32 so that M x is the same number wherever it is computed. */
void apsm_reflect(apsm_mesh *mesh, double M[16]);

#ifdef __cplusplus
}
#endif
#endif
