/* geodesic_state.h -- what propagation (geodesic.c) leaves behind and paths (geodesic_path.c)
 * follow back to the source. */
#ifndef APSM_GEOMETRY_GEODESIC_STATE_H
#define APSM_GEOMETRY_GEODESIC_STATE_H

#include <math.h>

#include "geometry/geodesic.h"

/* Triangle of half-edge k in the plane: start of k at (0, 0), its end at (length, 0), the third
 * corner at (x, |y|).  Sign bit of y set: there is no face beyond k, nothing comes from there. */
typedef struct geodesic_hinge {
    double length, x, y;
} geodesic_hinge;

struct apsm_geodesic {
    const apsm_mesh *mesh;         /* borrowed */
    const apsm_topology *topology; /* borrowed */
    geodesic_hinge *hinge;         /* 3 nf */
    bool *bends;                   /* nv: shortest paths can bend here (border, or angles > 2 pi) */
    double margin;                 /* about an edge: how far to look beyond the radius */
};

typedef struct geodesic_node {
    double d;        /* distance; INFINITY: not reached */
    double base;     /* distance at the last bend: the wave around v is a circle about that place */
    uint32_t via;    /* half-edge the path to the source crosses next, or APSM_NONE */
    uint32_t parent; /* else the vertex it passes next, or APSM_NONE: straight to the source */
    uint32_t tree;   /* who reached v first: leads to the source without fail, if not straight */
    uint32_t place;  /* in the heap, or one of the two below */
} geodesic_node;
#define GEODESIC_FRESH  UINT32_MAX
#define GEODESIC_CLOSED (UINT32_MAX - 1)

typedef struct geodesic_entry {
    double d;
    uint32_t v;
} geodesic_entry;

/* A straight piece of path inside one face. */
typedef struct geodesic_step {
    uint32_t face;
    double from[3], to[3]; /* barycentric */
    double length;
} geodesic_step;

struct apsm_geodesic_work {
    size_t nv;
    geodesic_node *node;    /* nv */
    geodesic_entry *heap;   /* nv */
    uint32_t *touched;      /* nv: vertices whose node is not fresh */
    size_t heaped, touches; /* their numbers */
    size_t reopened;        /* closed vertices that got shorter */
    double radius;          /* everything up to here is known */
    apsm_surface_point source;
    double x[3]; /* its position */
    geodesic_step *step;
    size_t steps, capacity;
};

/* How a shortest path leaves a face: through an edge at a fraction t of it, by a corner, or not
 * at all (the source is in the face). */
typedef struct geodesic_exit {
    enum { EXIT_NONE, EXIT_SOURCE, EXIT_EDGE, EXIT_CORNER } kind;
    uint32_t half_edge; /* EXIT_EDGE: crossed; EXIT_CORNER: starts at the corner */
    double t;
    double distance; /* from the point to the source */
} geodesic_exit;

static inline uint32_t geodesic_next(uint32_t k)
{
    return k % 3 == 2 ? k - 2 : k + 1;
}
static inline uint32_t geodesic_previous(uint32_t k)
{
    return k % 3 == 0 ? k + 2 : k - 1;
}

/* The source unfolded: a and b are the distances of a hinge's ends from it.  It lies at (s, -h)
 * in the hinge's plane; true if the straight line from there to (x, y), y >= 0, crosses the edge,
 * at the fraction t (NULL if not wanted).  *d2: its squared length. */
static inline bool geodesic_unfold(double length, double a, double b, double x, double y,
                                   double *d2, double *t)
{
    const double s = 0.5 * (length + (a - b) * (a + b) / length), h2 = a * a - s * s;
    const double h = h2 > 0.0 ? sqrt(h2) : 0.0, height = h + y;
    *d2 = (x - s) * (x - s) + height * height;
    if (!(height > 0.0)) { /* both on the edge's line */
        if (t) *t = s / length;
        return s >= 0.0 && s <= length;
    }
    const double crossing = s * y + x * h;
    if (t) *t = crossing / (length * height);
    return crossing >= 0.0 && crossing <= length * height;
}

/* The shortest way from a point of a face to the source that does not leave through half-edge
 * `barred` (APSM_NONE: any). */
geodesic_exit geodesic_best_exit(const apsm_geodesic *g, const apsm_geodesic_work *w,
                                 const apsm_surface_point *p, uint32_t barred);
/* The way through half-edge k of p's face; EXIT_NONE if the line does not cross it. */
geodesic_exit geodesic_edge_exit(const apsm_geodesic *g, const apsm_geodesic_work *w,
                                 const apsm_surface_point *p, uint32_t k);

#endif
