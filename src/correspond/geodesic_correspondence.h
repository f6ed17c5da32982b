/* geodesic_correspondence.h -- Algorithm 1 of the paper: particles that miss neighbours which they
 * have on the reference walk towards them along the surface.  docs/method.md, "Geodesic
 * correspondence (Algorithm 1)".
 *
 * Neighbours of particle j on the reference are those within ref_factor (1.5) times the distance
 * of the closest.  On a shape such a neighbour is *mismatched* if farther than F times j's closest
 * distance there. */
#ifndef APSM_GEODESIC_CORRESPONDENCE_H
#define APSM_GEODESIC_CORRESPONDENCE_H

#include "core/option.h"
#include "geometry/bvh.h"
#include "geometry/geodesic.h"

#ifdef __cplusplus
extern "C" {
#endif

#define APSM_REFERENCE_FACTOR 1.5 /* the paper's, on the reference */

/* For every particle those within `factor` times the distance of its closest, by rising index:
 * row j is index/distance[start[j] .. start[j+1]).  Owns its arrays; zero-initialise with {0}. */
typedef struct apsm_neighbourhoods {
    size_t J;
    double factor;
    uint32_t *start;   /* J + 1 */
    uint32_t *index;   /* start[J] */
    double *distance;  /* start[J] */
    double *closest;   /* J: distance of the closest particle; INFINITY if alone on a component */
    uint32_t *nearest; /* J: that particle (ties: lowest index), APSM_NONE if alone */
    size_t capacity;   /* of index and distance */
} apsm_neighbourhoods;

/* Makes room for J particles, reusing what is there. */
apsm_status apsm_neighbourhoods_resize(apsm_neighbourhoods *rows, size_t J) APSM_NODISCARD;
void apsm_neighbourhoods_free(apsm_neighbourhoods *rows);

/* Rows of J particles on a surface, by geodesic distance.  P (J x 3): positions of the points.
 * Searches end where the neighbourhood does: O(nv) per shape in all for well-spread particles,
 * and O(J^2) to look for candidates. */
apsm_status apsm_geodesic_neighbourhoods(const apsm_geodesic *g, apsm_geodesic_work *w, size_t J,
                                         const apsm_surface_point *points, const double *P,
                                         double factor, apsm_neighbourhoods *rows) APSM_NODISCARD;
/* The same from a full distance matrix D (J x J). */
apsm_status apsm_matrix_neighbourhoods(size_t J, const double *D, double factor,
                                       apsm_neighbourhoods *rows) APSM_NODISCARD;

/* Distance from j to k on the shape, INFINITY if k is not in j's row.  O(log row). */
double apsm_neighbour_distance(const apsm_neighbourhoods *rows, uint32_t j, uint32_t k);

/* count[j] (J, out): mismatched neighbours of particle j for F = factor <= shape->factor.  Returns
 * the number of particles that have any. */
size_t apsm_mismatches(const apsm_neighbourhoods *reference, const apsm_neighbourhoods *shape,
                       double factor, uint32_t *count);
/* order (J, out): particles with mismatches, most first, ties by index.  Returns how many. */
size_t apsm_mismatch_order(size_t J, const uint32_t *count, uint32_t *order);
/* Mismatched neighbours of j by rising index; missing holds J.  Returns how many. */
size_t apsm_missing_neighbours(const apsm_neighbourhoods *reference,
                               const apsm_neighbourhoods *shape, double factor, uint32_t j,
                               uint32_t *missing);

enum { APSM_TARGET_MEAN, APSM_TARGET_FARTHEST };
enum { APSM_STOP_RULE_EITHER, APSM_STOP_RULE_MATCHED, APSM_STOP_RULE_NEVER };
#define APSM_WALK_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                         \
    BOOL(S, geodesic_correspondence, true, "run Algorithm 1 in stage 1")                           \
    INT(S, geodesic_interval, 25, 1, 1000000,                                                      \
        "epochs between its passes (at most half of the stage)")                                   \
    REAL(S, geodesic_factor, 2, 1, 10,                                                             \
         "F: a neighbour farther than F times the closest is mismatched (paper: 1.5)")             \
    ENUM(S, geodesic_target, "mean|farthest",                                                      \
         "where a particle walks: mean of the targets, or the farthest missing neighbour (paper)") \
    REAL(S, geodesic_walk, 1, 0.01, 1, "share of the walk that is made")                           \
    BOOL(S, geodesic_guard, true, "keep a move only if it does not make matters worse")            \
    REAL(S, stop_mismatched, 0.02, 0, 1,                                                           \
         "stage 1 ends early when no shape has a larger share of particles mismatched by F")       \
    ENUM(S, stop_rule, "matched-or-stalled|matched|never",                                         \
         "or when two passes brought nothing; only then (paper); or never")                        \
    FIXED(S, double, min_separation, 0.5,                                                          \
          "particles nearer than this come too near for the guard, in h")
typedef struct apsm_walk_options {
    APSM_OPTION_FIELDS(APSM_WALK_OPTIONS)
    double h;    /* mean neighbour distance */
    bool strict; /* the report counts at 1.5 too, which takes a search from every particle */
} apsm_walk_options;
apsm_walk_options apsm_walk_defaults(double h); /* strict */

/* Mismatched particles at 1.5/1.5 (0 unless strict) and 1.5/2.0, and what the pass did. */
typedef struct apsm_walk_report {
    size_t before[2], after[2];
    size_t in_force; /* after, at 1.5/F */
    size_t moved, refused;
} apsm_walk_report;

/* Scratch for J particles. */
typedef struct apsm_walk_work apsm_walk_work;
apsm_status apsm_walk_work_new(size_t J, apsm_walk_work **work) APSM_NODISCARD;
void apsm_walk_work_free(apsm_walk_work *work);

/* The surface that particles walk on. */
typedef struct apsm_walk_ground {
    const apsm_geodesic *g;
    apsm_geodesic_work *w;
    const apsm_bvh *bvh; /* of g's mesh */
} apsm_walk_ground;

/* One pass over a shape.  points (J) and P (J x 3) are moved together; they must agree on entry.
 * Particles move one after the other in the order of apsm_mismatch_order, each seeing those
 * before it: along the geodesic towards missing neighbour k, to the distance from k at which k's
 * closest particle is.  The ground's bvh brings the mean of several such targets back to the
 * surface; NULL is allowed with farthest.  Missing neighbours on another component are left alone.
 * Unless strict, a particle whose reference neighbours are all within F times the distance in space
 * of its closest by a way across the surface (apsm_geodesic_section) is not mismatched and is not
 * searched from.  O(searches of the other neighbourhoods + a longer one per particle that walks).
 */
apsm_status apsm_geodesic_correspondence(const apsm_walk_ground *ground, size_t J,
                                         const apsm_neighbourhoods *reference,
                                         const apsm_walk_options *options,
                                         apsm_surface_point *points, double *P,
                                         apsm_walk_work *work,
                                         apsm_walk_report *report) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
