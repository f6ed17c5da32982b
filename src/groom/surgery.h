/* surgery.h -- a triangle mesh that can be edited: split, collapse, flip.
 *
 * Half-edge h = 3f + k runs from F[h] to F[next(h)], as in topology.h, and twin[h] always
 * exists.  Removed faces have F[3f] = APSM_NONE, removed vertices out[v] = APSM_NONE.
 *
 * An open mesh is closed by ghosts: one vertex a border loop, joined to all of it.  Ghosts have no
 * place, their faces no shape, and neither is in the result; so an edge of the border is one whose
 * other face has a ghost for apex. */
#ifndef APSM_GROOM_SURGERY_H
#define APSM_GROOM_SURGERY_H

#include <stdbool.h>

#include "geometry/topology.h"

typedef struct surgery {
    size_t nv, nf;       /* in use, removed ones included */
    size_t cap_v, cap_f; /* room */
    size_t live_f;       /* faces not removed */
    double *V;           /* cap_v x 3 */
    double *size;        /* cap_v: edge length wanted at the vertex */
    uint32_t *out;       /* cap_v: a half-edge leaving the vertex */
    uint32_t *mark;      /* cap_v: last stamp that met the vertex */
    uint32_t *F, *twin;  /* cap_f x 3 */
    uint32_t stamp;
    uint32_t first_ghost, ghosts; /* vertices first_ghost .. first_ghost + ghosts - 1 */
} surgery;

/* mesh must be an oriented manifold without unused vertices; size is left unset. */
apsm_status surgery_begin(surgery *s, const apsm_mesh *mesh) APSM_NODISCARD;
void surgery_free(surgery *s);
/* Faces of the result, and whether a vertex is in it. */
size_t surgery_faces(const surgery *s);
bool surgery_keeps(const surgery *s, uint32_t v);
/* The edited mesh without gaps; vertices and faces keep their order. */
apsm_status surgery_result(const surgery *s, apsm_mesh *mesh) APSM_NODISCARD;

static inline uint32_t he_next(uint32_t h)
{
    return h % 3 == 2 ? h - 2 : h + 1;
}
static inline uint32_t he_prev(uint32_t h)
{
    return h % 3 == 0 ? h + 2 : h - 1;
}
static inline uint32_t he_from(const surgery *s, uint32_t h)
{
    return s->F[h];
}
static inline uint32_t he_to(const surgery *s, uint32_t h)
{
    return s->F[he_next(h)];
}
static inline uint32_t he_apex(const surgery *s, uint32_t h)
{
    return s->F[he_prev(h)];
}
static inline bool he_live(const surgery *s, uint32_t h)
{
    return s->F[h - h % 3] != APSM_NONE;
}
/* The next half-edge leaving the same vertex, around it. */
static inline uint32_t he_turn(const surgery *s, uint32_t h)
{
    return s->twin[he_prev(h)];
}
static inline bool is_ghost(const surgery *s, uint32_t v)
{
    return v - s->first_ghost < s->ghosts;
}
/* Live, and an edge of the mesh itself. */
static inline bool he_real(const surgery *s, uint32_t h)
{
    return he_live(s, h) && !is_ghost(s, he_from(s, h)) && !is_ghost(s, he_to(s, h));
}
/* Whether h's face is a ghost's. */
static inline bool he_ghost_face(const surgery *s, uint32_t h)
{
    const uint32_t *c = s->F + (h - h % 3);
    return s->ghosts && (is_ghost(s, c[0]) || is_ghost(s, c[1]) || is_ghost(s, c[2]));
}
/* Whether h is an edge of the border. */
static inline bool he_on_border(const surgery *s, uint32_t h)
{
    return is_ghost(s, he_apex(s, h)) || is_ghost(s, he_apex(s, s->twin[h]));
}
/* The half-edge from v to its ghost; APSM_NONE if v is not on the border. */
uint32_t surgery_to_ghost(const surgery *s, uint32_t v);
/* Whether pulling to(h) into from(h) leaves the border where it is but for its own edge. */
bool surgery_pulls(const surgery *s, uint32_t h);

size_t surgery_valence(const surgery *s, uint32_t v);
/* Whether an edge joins a and b. */
bool surgery_joined(const surgery *s, uint32_t a, uint32_t b);

/* Puts a vertex at x on edge h = (a, b); returns it.  APSM_ERR_MEMORY leaves the mesh as it was.
 * Half-edge h becomes (a, new). */
apsm_status surgery_split(surgery *s, uint32_t h, const double x[3], uint32_t *made) APSM_NODISCARD;

/* Puts a vertex at x into face f; returns it.  As surgery_split. */
apsm_status surgery_insert(surgery *s, uint32_t f, const double x[3],
                           uint32_t *made) APSM_NODISCARD;

/* Turns edge h = (a, b) between triangles (a,b,c), (b,a,d) into (d, c).  Only if c and d are not
 * joined and a, b have more than three neighbours. */
void surgery_flip(surgery *s, uint32_t h);

/* Whether h = (a, b) can be collapsed without changing the topology: a and b have exactly two
 * common neighbours (link condition), which have more than three. */
bool surgery_collapsible(surgery *s, uint32_t h);
/* Pulls b = to(h) into a = from(h), which stays where it is; two faces go. */
void surgery_collapse(surgery *s, uint32_t h);

#endif
