/* fidelity_shape.h -- the objective (12) of one shape: its value, and one Gauss-Newton step. */
#ifndef APSM_OPTIMIZE_FIDELITY_SHAPE_H
#define APSM_OPTIMIZE_FIDELITY_SHAPE_H

#include "correspond/certificate.h"
#include "model/warp.h"
#include "optimize/fidelity.h"

typedef struct fidelity_coarse fidelity_coarse;

/* Particles that a vertex of the template hangs on, but for the faint rest. */
typedef struct fidelity_near {
    size_t *start;      /* nv + 1 */
    uint32_t *particle; /* of vertex v from start[v] on, ascending */
} fidelity_near;

struct apsm_fidelity {
    const apsm_cohort *cohort;
    apsm_fidelity_options o;
    size_t J;
    double h;
    apsm_warp warp;     /* of the template's vertices */
    float *W32;         /* its W; NULL where particles are few: see `dense` */
    fidelity_near near; /* of W32 */
    uint32_t *place;    /* J: particles along the template, with W32 */
    float *Q32;         /* J x J: Q in that order */
    size_t band;        /* unknowns in that order that a factor takes; 0: all */
    apsm_warp anchors;  /* of its landmarks; nv 0: none */
    double *features;   /* J x F: of its particles; NULL: none */
    double *T, *TN;     /* J x 3: its particles and their normals */
    bool *on_rim;       /* J: those on its rim, which stay on the shapes' rims */
    uint32_t *N6;       /* J x 6 */
    size_t triangles;
    uint32_t (*triangle)[3]; /* of mutual neighbours, with an orientation on the template */
    int *side;               /* triangles: that orientation */
    apsm_neighbourhoods reference;
    fidelity_coarse *coarse; /* the first rounds'; NULL before and without them */
    double *Q;               /* J x J: what displacements cost that are not smooth */
    double doubt; /* how far surfaces leave open where particles are: 0 before the prior weighs */
};

/* A point of either surface and the closest on the other. */
typedef struct fidelity_match {
    uint32_t vertex;       /* of the template (pull) or of the shape (push) */
    double direction[3];   /* unit, from the shape towards the warped template */
    double distance;       /* over h */
    apsm_surface_point on; /* where on the shape (pull) or on the warped template (push) */
} fidelity_match;

/* Where a shape is: particles with normals, matches, value of the objective. */
typedef struct fidelity_state {
    double *P, *N;         /* J x 3 */
    apsm_surface_point *S; /* J */
    size_t pulls, n;       /* matches: pulls of template vertices, then pushes of the shape's */
    fidelity_match *match;
    size_t contacts; /* matches behind the n: vertices of the template that lie in an obstacle */
    double distance; /* mean over the n, in h */
    double value;    /* of (12) */
} fidelity_state;

/* Weights of the quadratic terms of (12), lengths in h. */
typedef struct fidelity_weights {
    double stay, smooth, prior, order, contact;
    size_t shape;       /* whose */
    const double *from; /* J x 3: particles when the stage began */
    const double *mean; /* J x 3 */
    size_t modes;
    const double *mode;   /* modes x 3J */
    const double *weight; /* modes */
    double noise;         /* standard deviation of a coordinate beside the modes */
} fidelity_weights;

/* Q (J x J, out) from the template's particles T. */
apsm_status fidelity_smoothness(size_t J, const double *T, double *Q) APSM_NODISCARD;
/* Qe (J x 3) = Q e; work: 3J. */
void fidelity_roughness(size_t J, const double *Q, const double *e, double *work, double *Qe);
/* H (2J x 2J lower) += weight T'QT, T the tangents (J x 2 x 3); work: 8J. */
void fidelity_add_roughness(size_t J, double weight, const double *Q, const double *tangent,
                            double *work, double *H);

/* H of many particles: what it is made of, unknowns in the order of places.  fidelity_system.c */
typedef struct fidelity_system {
    size_t n;        /* rows r of H = sum r r' + smooth T'QT + diagonal, the prior's modes apart */
    size_t *start;   /* of their entries */
    uint32_t *place; /* particles, ascending in a row */
    float *x;        /* 2 of each */
    double smooth;
    float *diagonal; /* 2J */
    float *tangent;  /* 3 x 2J, by coordinate */
    float *work;     /* 8J */
} fidelity_system;

/* With room for so many rows and entries.  Begun with the tangents (J x 2 x 3, by particle) it is
 * 0; a row comes by particle, with 2 numbers of each. */
apsm_status fidelity_system_alloc(size_t J, size_t rows, size_t entries, fidelity_system *s);
void fidelity_system_free(fidelity_system *s);
void fidelity_system_begin(const apsm_fidelity *f, const double *tangent, fidelity_system *s);
void fidelity_system_put(const apsm_fidelity *f, size_t count, const uint32_t *particle,
                         const double *x, fidelity_system *s);
void fidelity_system_put_diagonal(const apsm_fidelity *f, size_t unknown, double weight,
                                  fidelity_system *s);
/* y = H x; the band of H (2J x (band + 1), row x: H_xx, H_x+1,x, ...), which is made up on its
 * diagonal for a part of what is beyond; H as a whole (2J x 2J lower). */
void fidelity_system_multiply(const apsm_fidelity *f, const fidelity_system *s, const float *x,
                              float *y);
void fidelity_system_band(const apsm_fidelity *f, const fidelity_system *s, float *band);
void fidelity_system_form(const apsm_fidelity *f, const fidelity_system *s, double *H);

/* Scratch of one thread; arrays for J particles and 2J unknowns. */
typedef struct fidelity_work {
    fidelity_state a, b;
    double *feature;  /* F, F x 3 */
    double *entry;    /* J x 3: particles at the round's start */
    bool *named;      /* J: by the certificate */
    double *Y, *at;   /* nv x 3: warped template; J x 3: particles that it is warped to */
    double *YN;       /* nv x 3: its normals, for thin shapes */
    apsm_mesh warped; /* its triangles on Y */
    apsm_bvh *bvh;    /* of warped */
    bool moved;       /* Y, since the tree was fitted to it */
    double *tangent;  /* J x 2 x 3 */
    double *part;     /* J: of the particles in a point of the warped template */
    float *rows;      /* FIDELITY_ROWS x 2J */
    bool sparse;      /* H is `system`, not H */
    fidelity_system system;
    uint32_t *near;       /* J: particles that are */
    double *force;        /* nv x 3: of the matches on the warped vertices */
    double *row;          /* 8J */
    float *H32;           /* 2J x 2J lower: the surface terms' part of H, if that is not sparse */
    float *band;          /* 2J x (band + 1) */
    double *H, *g;        /* 2J x 2J lower (sparse: NULL until no band will do), 2J */
    apsm_status status;   /* of the steps: that of memory, if it has not been enough */
    double *e, *Se;       /* J x 3 */
    double *v, *z, *K;    /* precision of the prior: J, modes x 3J; modes x modes: scratch */
    double *tangent_mode; /* modes x 2J */
} fidelity_work;
enum { FIDELITY_ROWS = 256 };

apsm_status fidelity_work_alloc(const apsm_fidelity *f, size_t modes, fidelity_work *w);
void fidelity_work_free(fidelity_work *w);

/* A round of shape i alone, with a prior that is there already (its fold i % folds): how a shape
 * that is new to a finished model is fitted.  P0, P as for apsm_fidelity_round. */
apsm_status fidelity_round_of(const apsm_fidelity *f, const apsm_fidelity_prior *prior, size_t i,
                              long round, const double *P0, double *P,
                              fidelity_work *w) APSM_NODISCARD;

/* How many of the first rounds a part of the particles takes, 0 if they are few; such a round. */
long fidelity_coarse_rounds(const apsm_fidelity *f);
apsm_status fidelity_coarse_round(apsm_context *ctx, apsm_fidelity *f, long round, const double *P0,
                                  double *P, apsm_fidelity_record *record) APSM_NODISCARD;
void fidelity_coarse_free(fidelity_coarse *c);

/* Fills s->match and s->distance for particles s->P of shape i. */
void fidelity_measure(const apsm_fidelity *f, size_t i, long round, fidelity_state *s,
                      fidelity_work *w);
/* The same for particles that have moved a little: the vertices of `from`, whose closest points lie
 * near those that it has. */
void fidelity_follow(const apsm_fidelity *f, size_t i, const fidelity_state *from,
                     fidelity_state *s, fidelity_work *w);
/* The precision of the prior for a shape with particles P (J x 3): w->v and w->z. */
void fidelity_set_prior(const apsm_fidelity *f, const fidelity_weights *q, const double *P,
                        fidelity_work *w);
/* s->value from the matches and the quadratic terms. */
void fidelity_value(const apsm_fidelity *f, const fidelity_weights *q, fidelity_state *s,
                    fidelity_work *w);
/* w->tangent, w->H and w->g of the surface terms of shape i at s; returns the mean of H's diagonal.
 */
double fidelity_linearise(const apsm_fidelity *f, size_t i, const fidelity_state *s,
                          fidelity_work *w);
/* Its part for many particles, each point's near ones: adds to w->system and w->g. */
void fidelity_add_near(const apsm_fidelity *f, const fidelity_state *s, fidelity_work *w);
/* The row of a vertex that is moved along a direction, times root, to w->system. */
void fidelity_put_vertex(const apsm_fidelity *f, uint32_t vertex, const double direction[3],
                         double root, fidelity_work *w);
/* Lists of the nv rows of W (J). */
apsm_status fidelity_find_near(size_t nv, size_t J, const float *W,
                               fidelity_near *near) APSM_NODISCARD;
void fidelity_near_free(fidelity_near *near);
size_t fidelity_most_near(size_t nv, const fidelity_near *near); /* particles of a vertex */
/* Adds the quadratic terms to H and w->g, but for the prior's modes where H is w->system. */
void fidelity_add_quadratic(const apsm_fidelity *f, const fidelity_weights *q,
                            const fidelity_state *s, fidelity_work *w);
/* Particles' places (J, out) along the template's longest axis, and the band of H in that order. */
apsm_status fidelity_find_band(size_t J, const double *T, uint32_t *place,
                               size_t *band) APSM_NODISCARD;
/* w->g: in g, out the step -H^-1 g.  Destroys w->H.  APSM_ERR_SINGULAR if H is not definite. */
apsm_status fidelity_solve(const apsm_fidelity *f, const fidelity_weights *q,
                           fidelity_work *w) APSM_NODISCARD;
/* Mean distance in h of particles P (J x 3) from what the other shapes' model makes of them. */
double fidelity_left_out(const apsm_fidelity *f, const fidelity_weights *q, const double *P,
                         fidelity_work *w);
/* x <- the closest point of the surface, on the side that looks the way of the normal; of the rim,
 * if the particle is one of it. */
void fidelity_land(const apsm_shape *shape, bool on_rim, const double normal[3], double x[3],
                   apsm_surface_point *on);
/* to->P (with N, S) = from->P moved along the surface by t times the tangential step w->g, in h. */
void fidelity_move(const apsm_fidelity *f, size_t i, double t, const fidelity_state *from,
                   fidelity_state *to, fidelity_work *w);
/* Adds the landmarks' part to s->value, or to w->H and w->g. */
void fidelity_value_landmarks(const apsm_fidelity *f, size_t i, fidelity_state *s);
void fidelity_add_landmarks(const apsm_fidelity *f, size_t i, const fidelity_state *s,
                            fidelity_work *w);
/* The same of features. */
void fidelity_value_features(const apsm_fidelity *f, size_t i, fidelity_state *s, fidelity_work *w);
void fidelity_add_features(const apsm_fidelity *f, size_t i, const fidelity_state *s,
                           fidelity_work *w);
/* Matches behind the others, w->Y being warped to s->P; and their part. */
void fidelity_find_contacts(const apsm_fidelity *f, size_t i, fidelity_state *s,
                            const fidelity_work *w);
void fidelity_value_contacts(const fidelity_weights *q, fidelity_state *s);
void fidelity_add_contacts(const apsm_fidelity *f, const fidelity_weights *q,
                           const fidelity_state *s, fidelity_work *w);
/* Triangles of neighbours that are turned over against the template. */
size_t fidelity_folds(const apsm_fidelity *f, const fidelity_state *s);

#endif
