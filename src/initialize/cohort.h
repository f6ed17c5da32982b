/* cohort.h -- the groomed, aligned shapes with everything the optimisation asks of them. */
#ifndef APSM_COHORT_H
#define APSM_COHORT_H

#include "apsm/mesh.h"
#include "core/option.h"
#include "files/store.h"
#include "geometry/bvh.h"
#include "geometry/distance_field.h"
#include "geometry/geodesic.h"
#include "geometry/rim.h"
#include "geometry/topology.h"
#include "initialize/obstacles.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One shape in the common (world) frame.  Owns all it points to but name. */
typedef struct apsm_shape {
    const char *name; /* borrowed, for messages */
    apsm_mesh mesh;
    apsm_topology topology;
    apsm_rim rim;          /* of an open mesh; without edges where it is closed */
    double *VN;            /* nv x 3: vertex normals */
    double half_thickness; /* 5th percentile over the surface; INFINITY if rays find no far side */
    apsm_bvh *bvh;
    apsm_field *field; /* NULL if the cohort was built without */
    apsm_geodesic *geodesic;
    bool stored; /* all arrays are in a store, not malloc'ed */
} apsm_shape;

/* Landmarks that guide the particles (initialize/anchors.h); L = 0: none.  Owns its arrays. */
typedef struct apsm_anchors {
    size_t L;
    bool hold;     /* the first L particles sit on them; else the correspondence is pulled there */
    double weight; /* of the pull */
    bool *has;     /* I x L: of shape i there is one */
    double *x;     /* I x L x 3: in the world */
} apsm_anchors;

/* Fields of the surfaces that must correspond (initialize/features.h); F = 0: none.  Owns its
 * arrays. */
typedef struct apsm_features {
    size_t I, F;
    double **value; /* I: F x nv of the shape's mesh, without unit and times their weights */
} apsm_features;

/* I subjects.  Of one part each this is all; of several, surfaces and what guides the particles on
 * them are the parts' (apsm_cohort_join), and a row of particles has all parts' one after the
 * other. */
typedef struct apsm_cohort {
    size_t I;
    apsm_shape *shape;     /* I; NULL of several parts */
    size_t template_index; /* t */
    bool *fixed;           /* I: particles that take part and stay where they are; NULL: none */
    apsm_anchors anchors;
    apsm_features features;
    apsm_obstacles obstacles; /* in the world */
    size_t parts;             /* 0: one */
    struct apsm_cohort *part; /* parts: each a cohort of one part; owned */
    size_t *first; /* parts + 1: particles first[d], ..., first[d + 1] - 1 are part d's */
} apsm_cohort;

/* Subjects of several parts: takes the parts over (n cohorts of one part each, also on failure) of
 * which part d has J[d] particles.  All have the same subjects, template and fixed subjects, else
 * APSM_ERR_ARG. */
apsm_status apsm_cohort_join(apsm_context *ctx, size_t n, apsm_cohort *parts, const size_t *J,
                             apsm_cohort *cohort) APSM_NODISCARD;

static inline size_t cohort_parts(const apsm_cohort *c)
{
    return c->part ? c->parts : 1;
}
/* Part d, a cohort of one part; of one part itself. */
static inline const apsm_cohort *cohort_part(const apsm_cohort *c, size_t d)
{
    return c->part ? &c->part[d] : c;
}
/* Where the particles of part d begin, of J in a row; d = cohort_parts: J. */
static inline size_t cohort_first(const apsm_cohort *c, size_t d, size_t J)
{
    return c->part ? c->first[d] : d == 0 ? 0 : J;
}
/* P (I x J x 3) of all parts from or to those of part d, Q (I x its particles x 3). */
void cohort_take_part(const apsm_cohort *c, size_t d, size_t J, const double *P, double *Q);
void cohort_put_part(const apsm_cohort *c, size_t d, size_t J, const double *Q, double *P);

/* Whether the particles of shape i may move. */
static inline bool cohort_moves(const apsm_cohort *c, size_t i)
{
    return !(c->fixed && c->fixed[i]);
}
/* How many shapes beside the template have particles that may move. */
size_t cohort_movers(const apsm_cohort *cohort);

#define APSM_FIELD_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                        \
    REAL(S, field_voxel, 0.125, 0.01, 1, "node spacing of the distance fields, in h")
typedef struct apsm_field_options {
    APSM_OPTION_FIELDS(APSM_FIELD_OPTIONS)
} apsm_field_options;

/* Spacing that J particles have on a surface of this area if every one has six neighbours at the
 * same distance: sqrt(2 area / (sqrt(3) J)).  Close to h, known before there are particles. */
double apsm_expected_spacing(double area, size_t J);

/* The dipoles' distance on a shape: what is wanted, but at most half the half-thickness. */
double apsm_dipole_length(const apsm_shape *shape, double wanted);

/* What a cohort is made of; borrowed, the names as long as the cohort is used. */
typedef struct apsm_cohort_input {
    size_t I;
    const char *const *names; /* I */
    const apsm_mesh *meshes;  /* I, in their own frames */
    const double *transforms; /* I x 16, to the world */
    size_t template_index;
} apsm_cohort_input;

/* Moves the meshes to the world frame and prepares each, in parallel.  voxel and band of the
 * distance fields are in the world's unit (the band at most apsm_dipole_length: nobody draws
 * farther away); voxel 0: no fields, for what only looks at finished particles.  O(surface) memory
 * a shape. */
apsm_status apsm_cohort_build(apsm_context *ctx, const apsm_cohort_input *in, double voxel,
                              double band, apsm_cohort *cohort) APSM_NODISCARD;
/* The distance fields of a cohort. */
typedef struct apsm_field_plan {
    double voxel, band;
    bool template_alone; /* no other shape gets one */
    bool bare; /* shapes that are neither the template nor of the share have their mesh alone */
    size_t share, shares; /* else those of shapes share, share + shares, ...; 0 shares: all */
} apsm_field_plan;

/* The same with every finished shape moved to the store, which must outlive the cohort (NULL: kept
 * in memory).  The shapes are the same to the byte. */
apsm_status apsm_cohort_build_in(apsm_context *ctx, apsm_store *store, const apsm_cohort_input *in,
                                 const apsm_field_plan *fields, apsm_cohort *cohort) APSM_NODISCARD;
void apsm_cohort_free(apsm_cohort *cohort);

/* The closest surface points S (n) of P (n x 3) on a shape, with their positions X (n x 3) and
 * unit normals N (n x 3) interpolated from the vertices'; X and N may be NULL. */
void apsm_shape_look_up(const apsm_shape *shape, size_t n, const double *P, apsm_surface_point *S,
                        double *X, double *N);

/* on (J, out): which of particles P (J x 3) lie on the shape's rim.  Those of the template are the
 * rim particles of a cohort. */
void apsm_shape_find_on_rim(const apsm_shape *shape, size_t J, const double *P, bool *on);
/* Moves those particles of P (J x 3) to the closest points of the shape's rim, if it has one; S (J;
 * may be NULL) says where they are then. */
void apsm_shape_keep_on_rim(const apsm_shape *shape, size_t J, const bool *on, double *P,
                            apsm_surface_point *S);

#ifdef __cplusplus
}
#endif
#endif
