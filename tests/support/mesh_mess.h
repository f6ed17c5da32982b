/* mesh_mess.h -- what is wrong with meshes in practice, done to a good one: holes, faces that are
 * doubled, turned over or slivers, fins, islands, patches pushed through the other side. */
#ifndef APSM_TEST_MESH_MESS_H
#define APSM_TEST_MESH_MESS_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/mesh.h"
#include "core/random.h"

static inline void mess_reserve(apsm_mesh *m, size_t vertices, size_t faces)
{
    double *V = realloc(m->V, 3 * (m->nv + vertices) * sizeof *V);
    uint32_t *F = realloc(m->F, 3 * (m->nf + faces) * sizeof *F);
    if (!V || !F) abort();
    m->V = V;
    m->F = F;
}

static inline void mess_add_face(apsm_mesh *m, size_t a, size_t b, size_t c)
{
    mess_reserve(m, 0, 1);
    uint32_t *F = m->F + 3 * m->nf++;
    F[0] = (uint32_t)a;
    F[1] = (uint32_t)b;
    F[2] = (uint32_t)c;
}

static inline size_t mess_add_vertex(apsm_mesh *m, const double x[3])
{
    mess_reserve(m, 1, 0);
    memcpy(m->V + 3 * m->nv, x, 3 * sizeof *x);
    return m->nv++;
}

static inline double mess_distance(const apsm_mesh *m, size_t v, const double x[3])
{
    const double *y = m->V + 3 * v;
    return sqrt((x[0] - y[0]) * (x[0] - y[0]) + (x[1] - y[1]) * (x[1] - y[1]) +
                (x[2] - y[2]) * (x[2] - y[2]));
}

static inline double mess_size(const apsm_mesh *m)
{
    return sqrt(apsm_mesh_area(m));
}

/* Faces near a random vertex vanish. */
static inline void mess_hole(apsm_mesh *m, apsm_random *rng, double radius)
{
    double x[3];
    memcpy(x, m->V + 3 * apsm_random_below(rng, m->nv), sizeof x);
    size_t kept = 0;
    for (size_t f = 0; f < m->nf; f++) {
        if (mess_distance(m, m->F[3 * f], x) < radius) continue;
        memmove(m->F + 3 * kept++, m->F + 3 * f, 3 * sizeof *m->F);
    }
    m->nf = kept;
}

/* A patch is pushed inwards (towards the middle) by up to `depth`: through the other side where the
 * shape is thin. */
static inline void mess_push(apsm_mesh *m, apsm_random *rng, double radius, double depth)
{
    double x[3], c[3];
    memcpy(x, m->V + 3 * apsm_random_below(rng, m->nv), sizeof x);
    apsm_mesh_centroid(m, c);
    const double from = sqrt((x[0] - c[0]) * (x[0] - c[0]) + (x[1] - c[1]) * (x[1] - c[1]) +
                             (x[2] - c[2]) * (x[2] - c[2]));
    for (size_t v = 0; v < m->nv; v++) {
        const double d = mess_distance(m, v, x);
        if (d >= radius || from <= 0) continue;
        for (int k = 0; k < 3; k++)
            m->V[3 * v + (size_t)k] += depth * (1 - d / radius) * (c[k] - x[k]) / from;
    }
}

/* A small tetrahedron near a random vertex: outside or across the surface. */
static inline void mess_island(apsm_mesh *m, apsm_random *rng, double size)
{
    static const double corner[4][3] = { { 1, 1, 1 }, { 1, -1, -1 }, { -1, 1, -1 }, { -1, -1, 1 } };
    double at[3];
    size_t v[4];
    memcpy(at, m->V + 3 * apsm_random_below(rng, m->nv), sizeof at);
    for (int k = 0; k < 3; k++) at[k] += 3 * size * (2 * apsm_random_uniform(rng) - 1);
    for (int a = 0; a < 4; a++) {
        double x[3];
        for (int k = 0; k < 3; k++) x[k] = at[k] + size * corner[a][k];
        v[a] = mess_add_vertex(m, x);
    }
    mess_add_face(m, v[0], v[1], v[2]);
    mess_add_face(m, v[0], v[3], v[1]);
    mess_add_face(m, v[0], v[2], v[3]);
    mess_add_face(m, v[1], v[3], v[2]);
}

/* A face gets a vertex next to one of its edges: two good faces and a sliver. */
static inline void mess_sliver(apsm_mesh *m, apsm_random *rng)
{
    const size_t f = (size_t)apsm_random_below(rng, m->nf);
    const size_t a = m->F[3 * f], b = m->F[3 * f + 1], c = m->F[3 * f + 2];
    double x[3];
    for (size_t k = 0; k < 3; k++)
        x[k] = 0.4999 * m->V[3 * a + k] + 0.4999 * m->V[3 * b + k] + 0.0002 * m->V[3 * c + k];
    const size_t v = mess_add_vertex(m, x);
    m->F[3 * f + 2] = (uint32_t)v; /* a b v, the sliver */
    mess_add_face(m, b, c, v);
    mess_add_face(m, c, a, v);
}

/* A third face at an edge. */
static inline void mess_fin(apsm_mesh *m, apsm_random *rng)
{
    const size_t f = (size_t)apsm_random_below(rng, m->nf), a = m->F[3 * f], b = m->F[3 * f + 1];
    double x[3];
    const double length = mess_distance(m, a, m->V + 3 * b);
    for (size_t k = 0; k < 3; k++)
        x[k] =
            0.5 * (m->V[3 * a + k] + m->V[3 * b + k]) + length * (2 * apsm_random_uniform(rng) - 1);
    mess_add_face(m, a, b, mess_add_vertex(m, x));
}

static inline void mess_faces(apsm_mesh *m, apsm_random *rng, double share)
{
    const size_t n = (size_t)(share * (double)m->nf);
    for (size_t k = 0; k < n; k++) {
        const uint32_t *F = m->F + 3 * apsm_random_below(rng, m->nf);
        const size_t a = F[0], b = F[1], c = F[2];
        if (k % 2)
            mess_add_face(m, a, b, c);
        else
            mess_add_face(m, a, c, b); /* doubled, and turned over */
    }
    for (size_t k = 0; k < n; k++) {
        uint32_t *F = m->F + 3 * apsm_random_below(rng, m->nf), b = F[1];
        F[1] = F[2];
        F[2] = b;
    }
}

/* level 1: as it often is; 2: as bad as it gets while a person would still call it a surface. */
static inline void mess_up(apsm_mesh *m, apsm_random *rng, int level)
{
    const double size = mess_size(m);
    for (int k = 0; k < 3 * level; k++) {
        mess_push(m, rng, 0.04 * size, 0.02 * size * level);
        mess_hole(m, rng, 0.012 * size * level);
        mess_island(m, rng, 0.01 * size);
    }
    for (int k = 0; k < 10 * level; k++) {
        mess_sliver(m, rng);
        mess_fin(m, rng);
    }
    mess_faces(m, rng, 0.005 * level);
}

#endif
