/* align.h -- brings shapes into one frame: registration of two surfaces (ICP), a search that
 * works from any initial pose and tells a shape from its mirror image, and the alignment of a
 * cohort to its medoid (docs/method.md, "Pose").
 *
 * Maps are row-major 4 x 4.  Lengths have the unit of the meshes; scaling all of them scales the
 * result.  The "residual" of a map M of a moving to a fixed surface is
 *     1/2 (mean over the moving surface of the distance of M x to the fixed surface
 *          + mean over the fixed surface of the distance of y to the moved surface),
 * in the fixed surface's unit: because of its second half it cannot be made small by shrinking. */
#ifndef APSM_ALIGN_H
#define APSM_ALIGN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "align/cloud.h"
#include "apsm/context.h"
#include "apsm/mesh.h"
#include "core/option.h"
#include "geometry/bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What registration needs of a surface; both borrowed. */
typedef struct apsm_surface {
    const apsm_bvh *bvh;
    const apsm_cloud *cloud;
} apsm_surface;

typedef struct apsm_icp_options {
    bool scale;         /* similarity instead of rigid */
    size_t points;      /* of each cloud, 0: all */
    int max_iterations; /* >= 0; 0 only measures the residual */
    double tolerance;   /* stop when a step moves the points by less, relative to the radius */
    double enough;      /* or when one near Newton's lowers the sum of squares by a smaller share */
    bool near;          /* begin with steps near Newton's, since the pose is near its end */
    double rival;       /* of a search: residual of a pose that is known, 0: none */
    double trim;        /* share of each direction's farthest pairs to ignore, in [0, 1): for cut
                           bones about the share of surface that only one of the two has */
    const double *usual; /* rotation (9) that is to be expected: of turns about which the surfaces
                            say little, the small one is taken; NULL: none is.  Proper M only */
} apsm_icp_options;
apsm_icp_options apsm_icp_defaults(void); /* rigid, all points, 60, 1e-4, 0, NULL */

/* Scratch in doubles, for clouds of at most n points. */
size_t apsm_icp_work_size(size_t n);

/* Registers moving to fixed starting from *M (in and out): a rigid map or similarity; det < 0 is
 * allowed and stays, so that a reflection registers the mirrored surface.  Without `usual`
 * it never ends with a larger mean squared distance than it started with.  O(iterations points log
 * nf). */
void apsm_icp(const apsm_surface *moving, const apsm_surface *fixed, const apsm_icp_options *opt,
              double M[16], double *residual, double *work);

#define APSM_POSE_OPTIONS 3

/* The best pose found and how clear it is. */
typedef struct apsm_pose {
    double M[16];
    double residual;
    double runner_up; /* residual of the best clearly different pose among the finalists;
                         INFINITY if all ended in one.  Close to residual: ambiguous */
    double option_M[APSM_POSE_OPTIONS][16];    /* the clearly different finalists, best first */
    double option_residual[APSM_POSE_OPTIONS]; /* INFINITY: no more */
} apsm_pose;

/* Registers moving to fixed whatever their poses: ICP from a fixed grid of rotations between
 * their principal frames, on few points first, most starts being dropped on the way.  mirrored:
 * registers the mirror image of moving; det M < 0.  opt applies to the last round; its
 * tolerance, scale and trim to all.  Poses that fit twice as badly as the best, or as opt->rival,
 * are left as the rounds before the last find them.  work of apsm_icp_work_size.  About 40,000
 * closest points. */
void apsm_pose_search(const apsm_surface *moving, const apsm_surface *fixed, bool mirrored,
                      const apsm_icp_options *opt, apsm_pose *pose, double *work);

/* A shape whose mirror image fits better by this factor is taken for mirrored. */
#define APSM_MIRROR_RATIO 0.8
/* A pose whose runner-up is within this factor of it is called ambiguous. */
#define APSM_AMBIGUOUS_RATIO 1.1
/* Where the shapes come in one orientation, a pose near that is taken if it fits within this factor
 * of the best. */
#define APSM_GIVEN_RATIO 1.5
/* Let the template be the medoid. */
#define APSM_TEMPLATE_AUTO SIZE_MAX

/* Borders of a shape's image that its mask reaches: only there can the image have cut it off. */
typedef struct apsm_borders {
    bool known; /* false: a mesh, of which nobody knows */
    size_t n;
    double normal[6][3]; /* outward, in the shape's frame */
} apsm_borders;

enum { APSM_ALIGN_RIGID, APSM_ALIGN_SIMILARITY, APSM_ALIGN_NONE };
enum { APSM_MIRROR_WARN, APSM_MIRROR_FIX, APSM_MIRROR_OFF };
#define APSM_ALIGN_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                        \
    ENUM(S, align, "rigid|similarity|none", "pose (and size) removed before the model is made")    \
    ENUM(S, mirror_check, "warn|fix|off", "what to do with inputs that look mirrored")             \
    FIXED(S, size_t, points, 400, "that stand for a shape, at least 64")
typedef struct apsm_align_options {
    APSM_OPTION_FIELDS(APSM_ALIGN_OPTIONS)
    size_t template_index;       /* or APSM_TEMPLATE_AUTO */
    double trim;                 /* see apsm_icp_options */
    const apsm_borders *borders; /* one a shape, borrowed; NULL: nothing is known of any */
    bool oriented; /* it is known that they come in one orientation: poses near that are taken
                      where they fit, also if no pose that was found is near it */
} apsm_align_options;
apsm_align_options apsm_align_defaults(void); /* rigid, warn, auto, 400, 0, NULL, false */

/* Where a shape was cut off. */
typedef struct apsm_cut {
    size_t shape;
    double plane[4]; /* n, d in the world, with the pose `sized`: the shape lies where n.x <= d */
    double radius;   /* of the shape, there */
} apsm_cut;

/* Owns its arrays; zero-initialise with {0}. */
typedef struct apsm_alignment {
    size_t n, template_index;
    bool oriented;           /* nearly all came in one orientation */
    double *M;               /* n x 16: world = M local; det < 0 only for shapes mirrored by _FIX */
    double *residual;        /* n: to the template, in the world's unit; 0 for the template */
    double *runner_up_ratio; /* n: residual of the best clearly different pose over that of the
                                pose taken; >= 1, close to 1: ambiguous; INFINITY: none found */
    double *mirror_ratio;    /* n: residual of the mirror image over that of the shape as it is;
                                INFINITY if not tried.  This and runner_up_ratio compare with the
                                provisional template, which has INFINITY itself */
    bool *sought;    /* n: lies as its surface says alone, not as it came or as most others came */
    bool *ambiguous; /* n: another pose fits as well, and nothing else speaks for this one */
    bool *stranger;  /* n: of a size or form that the others do not have */
    bool *unfit;     /* n: stranger, ambiguous (where few are) or of the wrong hand: no template */
    bool *unclear_hand; /* n: its mirror image is as likely; asked with _FIX only */
    bool *mirrored;     /* n: looks mirrored, compared with the given template or with most
                           shapes */
    size_t cuts;        /* places where shapes were cut off, in the order of the shapes */
    apsm_cut *cut;
    double *sized; /* n x 16: as M, and shapes made the template's size by what they share, if any
                      was cut; else as M */
} apsm_alignment;

/* Aligns n >= 1 meshes (borrowed, each in its own frame; names, for messages, may be NULL) to a
 * template: the given one or the medoid (see below).  The template's M only moves its centroid to
 * the origin (with _NONE every M is the identity).  Mirrored and ambiguous shapes are reported as
 * warnings; _FIX mirrors the former.  Parallel over shapes; the same for any number of threads.
 *
 * Poses and handedness are judged with size removed, also in rigid mode (unless trim > 0: a cut
 * bone's size means little), because a difference in size is none in handedness.
 *
 * Medoid: the shape of least mean residual.  All shapes are aligned to a provisional template
 * (the one of median area); up to 32 shapes, all pairs are registered from there; beyond, 32
 * candidates against 64 shapes, drawn by the seed: O(n).  All are then registered to the medoid.
 * In similarity mode residuals are compared relative to size.  At most 97 search trees are held
 * at a time. */
apsm_status apsm_align_cohort(apsm_context *ctx, size_t n, const apsm_mesh *const *meshes,
                              const char *const *names, const apsm_align_options *opt,
                              apsm_alignment *alignment) APSM_NODISCARD;
/* M and residual anew from the M that alignment has, for meshes that have been cropped since: what
 * was cut off counts no more.  opt as for the first time; its template and mirror do not matter. */
apsm_status apsm_align_cropped(apsm_context *ctx, size_t n, const apsm_mesh *const *meshes,
                               const char *const *names, const apsm_align_options *opt,
                               apsm_alignment *alignment) APSM_NODISCARD;
void apsm_alignment_free(apsm_alignment *alignment);

#ifdef __cplusplus
}
#endif
#endif
