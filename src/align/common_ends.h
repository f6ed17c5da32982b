/* common_ends.h -- shapes that were cut off at different places, by the edge of an image, have in
 * common only what all of them hold: where that ends, and cropping to it. */
#ifndef APSM_COMMON_ENDS_H
#define APSM_COMMON_ENDS_H

#include "align/align.h"
#include "groom/groom.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { APSM_CUTS_AUTO, APSM_CUTS_CROP, APSM_CUTS_KEEP };
#define APSM_CUTS_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                         \
    ENUM(S, cuts, "auto|crop|keep",                                                                \
         "where shapes were cut off at different places, by the edge of an image: crop all to "    \
         "what all of them hold, keep them as they are, or (auto) crop if at least a fifth of "    \
         "them, and two, were cut")
typedef struct apsm_cuts_options {
    APSM_OPTION_FIELDS(APSM_CUTS_OPTIONS)
} apsm_cuts_options;

/* Ends at more places than this have nothing to do with the edges of images. */
#define APSM_MOST_ENDS 4

/* One end at which shapes of a cohort were cut. */
typedef struct apsm_common_end {
    double plane[4]; /* n, d in the world: all shapes reach it, n.x <= d is kept */
    size_t cut;      /* shapes that were cut there */
    size_t shortest; /* the one that decides d */
    double next;     /* d without that one; INFINITY: no other shape was cut there */
    double apart;    /* how much farther than that one the longest reaches, in its radii */
} apsm_common_end;

/* Zero-initialise with {0}; nothing to free. */
typedef struct apsm_common_ends {
    size_t n;
    apsm_common_end end[APSM_MOST_ENDS];
    double mean_loss; /* share of its surface that a shape loses beyond the planes */
    double next_loss; /* the same if the shortest at every end were left out */
    double most_loss; /* of the shape that loses most ... */
    size_t loser;     /* ... this one */
} apsm_common_ends;

/* Ends at which at least `least` aligned shapes (of n meshes in their own frames) were cut and in
 * which shapes differ by more than 0.1 radii; no such end: ends->n is 0.  Cuts belong to one end if
 * they look the same way within 30 degrees.  Its plane is the one across their mean direction, 0.02
 * radii below the lowest edge of any of their cut faces, all shapes being of one size.
 * O(vertices). */
void apsm_find_common_ends(size_t n, const apsm_mesh *const *meshes,
                           const apsm_alignment *alignment, size_t least, apsm_common_ends *ends);

/* Share of its surface that a mesh, with the pose M, has beyond the planes.  O(nf). */
double apsm_common_ends_loss(const apsm_mesh *mesh, const double M[16],
                             const apsm_common_ends *ends);

/* plane (ends->n, out): the world's planes in the frame of a shape with the pose M, n.(M x) <= d.
 */
void apsm_common_ends_planes(const apsm_common_ends *ends, const double M[16],
                             double plane[APSM_MOST_ENDS][4]);

/* clipped (owned by the caller, overwritten): what of mesh lies where n.x <= d, open at the plane.
 * O(nf). */
apsm_status apsm_mesh_clip(const apsm_mesh *mesh, const double plane[4],
                           apsm_mesh *clipped) APSM_NODISCARD;

/* cropped (owned by the caller, overwritten): mesh without what lies beyond any of the n planes,
 * closed there and remeshed by the options (NULL: defaults); of several parts the largest.  Errors
 * as of apsm_groom_mesh. */
apsm_status apsm_crop_mesh(apsm_context *ctx, const char *name, const apsm_mesh *mesh, size_t n,
                           const double (*plane)[4], const apsm_groom_options *opt,
                           apsm_mesh *cropped) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
