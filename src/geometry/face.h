/* face.h -- area and normal of one face of a mesh. */
#ifndef APSM_GEOMETRY_FACE_H
#define APSM_GEOMETRY_FACE_H

#include "apsm/mesh.h"
#include "geometry/vec3.h"

/* Twice the area long, outward. */
static inline void face_vector(const apsm_mesh *mesh, size_t f, double n[3])
{
    const uint32_t *c = mesh->F + 3 * f;
    vec3_triangle(mesh->V + 3 * (size_t)c[0], mesh->V + 3 * (size_t)c[1],
                  mesh->V + 3 * (size_t)c[2], n);
}

/* Unit; returns how long it was, twice the area. */
static inline double face_normal(const apsm_mesh *mesh, size_t f, double n[3])
{
    face_vector(mesh, f, n);
    return vec3_normalise(n);
}

static inline double face_area(const apsm_mesh *mesh, size_t f)
{
    double n[3];
    face_vector(mesh, f, n);
    return 0.5 * vec3_norm(n);
}

#endif
