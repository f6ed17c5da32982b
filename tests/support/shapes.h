/* shapes.h -- meshes with closed-form answers, for tests and benchmarks.  Every mesh is closed
 * and faces outward, but for shape_plane (open, faces +z).  The caller frees with
 * apsm_mesh_free; want of memory aborts the test. */
#ifndef APSM_TEST_SHAPES_H
#define APSM_TEST_SHAPES_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/mesh.h"

static inline apsm_mesh shape_alloc(size_t nv, size_t nf)
{
    apsm_mesh mesh = { 0 };
    if (apsm_mesh_alloc(&mesh, nv, nf) != APSM_OK) abort();
    return mesh;
}

static inline void shape_set3(double *v, double x, double y, double z)
{
    v[0] = x;
    v[1] = y;
    v[2] = z;
}

static inline void shape_face(apsm_mesh *mesh, size_t *f, size_t a, size_t b, size_t c)
{
    uint32_t *F = mesh->F + 3 * (*f)++;
    F[0] = (uint32_t)a;
    F[1] = (uint32_t)b;
    F[2] = (uint32_t)c;
}

/* Vertex halfway a..b pushed to the unit sphere, made once: the table is keyed by the smaller
 * end and holds up to 6 (other end, vertex) pairs. */
static inline uint32_t shape_midpoint(apsm_mesh *mesh, uint32_t (*seen)[6][2], uint32_t a,
                                      uint32_t b)
{
    const uint32_t lo = a < b ? a : b, hi = a < b ? b : a;
    uint32_t(*slot)[2] = seen[lo];
    while ((*slot)[0] != UINT32_MAX && (*slot)[0] != hi) slot++;
    if ((*slot)[0] == hi) return (*slot)[1];
    const uint32_t v = (uint32_t)mesh->nv++;
    const double *p = mesh->V + 3 * lo, *q = mesh->V + 3 * hi;
    const double x = p[0] + q[0], y = p[1] + q[1], z = p[2] + q[2];
    const double r = sqrt(x * x + y * y + z * z);
    shape_set3(mesh->V + 3 * v, x / r, y / r, z / r);
    (*slot)[0] = hi;
    (*slot)[1] = v;
    return v;
}

static inline apsm_mesh shape_icosahedron(void)
{
    static const uint8_t faces[20][3] = { { 0, 11, 5 },  { 0, 5, 1 },  { 0, 1, 7 },  { 0, 7, 10 },
                                          { 0, 10, 11 }, { 1, 5, 9 },  { 5, 11, 4 }, { 11, 10, 2 },
                                          { 10, 7, 6 },  { 7, 1, 8 },  { 3, 9, 4 },  { 3, 4, 2 },
                                          { 3, 2, 6 },   { 3, 6, 8 },  { 3, 8, 9 },  { 4, 9, 5 },
                                          { 2, 4, 11 },  { 6, 2, 10 }, { 8, 6, 7 },  { 9, 8, 1 } };
    apsm_mesh mesh = shape_alloc(12, 20);
    const double a = sqrt(0.5 - sqrt(0.05)), b = sqrt(0.5 + sqrt(0.05)); /* a^2 + b^2 = 1 */
    for (size_t i = 0; i < 4; i++) {
        const double s = i & 1 ? a : -a, t = i & 2 ? -b : b;
        shape_set3(mesh.V + 3 * i, s, t, 0);
        shape_set3(mesh.V + 3 * (4 + i), 0, s, t);
        shape_set3(mesh.V + 3 * (8 + i), t, 0, s);
    }
    for (size_t f = 0; f < 20;) shape_face(&mesh, &f, faces[f][0], faces[f][1], faces[f][2]);
    return mesh;
}

/* Unit sphere: an icosahedron split `level` times; 20 * 4^level faces. */
static inline apsm_mesh shape_icosphere(int level)
{
    apsm_mesh mesh = shape_icosahedron();
    for (int l = 0; l < level; l++) {
        apsm_mesh fine = shape_alloc(mesh.nv + 3 * mesh.nf / 2, 4 * mesh.nf);
        uint32_t(*seen)[6][2] = malloc(mesh.nv * sizeof *seen);
        if (!seen) abort();
        memset(seen, 0xff, mesh.nv * sizeof *seen);
        memcpy(fine.V, mesh.V, 3 * mesh.nv * sizeof *fine.V);
        fine.nv = mesh.nv;
        for (size_t f = 0, k = 0; f < mesh.nf; f++) {
            const uint32_t *F = mesh.F + 3 * f;
            const uint32_t ab = shape_midpoint(&fine, seen, F[0], F[1]),
                           bc = shape_midpoint(&fine, seen, F[1], F[2]),
                           ca = shape_midpoint(&fine, seen, F[2], F[0]);
            shape_face(&fine, &k, F[0], ab, ca);
            shape_face(&fine, &k, ab, F[1], bc);
            shape_face(&fine, &k, ca, bc, F[2]);
            shape_face(&fine, &k, ab, bc, ca);
        }
        free(seen);
        apsm_mesh_free(&mesh);
        mesh = fine;
    }
    return mesh;
}

/* Half-axes a, b, c. */
static inline apsm_mesh shape_ellipsoid(int level, double a, double b, double c)
{
    apsm_mesh mesh = shape_icosphere(level);
    for (size_t i = 0; i < mesh.nv; i++) {
        double *v = mesh.V + 3 * i;
        shape_set3(v, a * v[0], b * v[1], c * v[2]);
    }
    return mesh;
}

static inline apsm_mesh shape_sphere(int level, double radius)
{
    return shape_ellipsoid(level, radius, radius, radius);
}

/* Around the z axis: circle of radius R, tube of radius r; nu segments around, nt along the
 * tube's section. */
static inline apsm_mesh shape_torus(size_t nu, size_t nt, double R, double r)
{
    const double pi = 3.14159265358979323846;
    apsm_mesh mesh = shape_alloc(nu * nt, 2 * nu * nt);
    for (size_t i = 0, f = 0; i < nu; i++)
        for (size_t j = 0; j < nt; j++) {
            const double u = 2 * pi * (double)i / (double)nu, t = 2 * pi * (double)j / (double)nt;
            const double rho = R + r * cos(t);
            const size_t i1 = (i + 1) % nu, j1 = (j + 1) % nt;
            const size_t a = i * nt + j, b = i1 * nt + j, c = i1 * nt + j1, d = i * nt + j1;
            shape_set3(mesh.V + 3 * a, rho * cos(u), rho * sin(u), r * sin(t));
            shape_face(&mesh, &f, a, b, c);
            shape_face(&mesh, &f, a, c, d);
        }
    return mesh;
}

/* Box [-size/2, size/2] with n[c] cells along axis c; welded, sharp edges.  A cube, a thin plate
 * and a bar are boxes. */
static inline apsm_mesh shape_box(const size_t n[3], const double size[3])
{
    const size_t m[3] = { n[0] + 1, n[1] + 1, n[2] + 1 };
    const size_t quads = 2 * (n[0] * n[1] + n[1] * n[2] + n[2] * n[0]);
    apsm_mesh mesh = shape_alloc(quads + 2, 2 * quads);
    uint32_t *index = malloc(m[0] * m[1] * m[2] * sizeof *index);
    if (!index) abort();
    size_t nv = 0, f = 0;
    for (size_t k = 0; k < m[2]; k++)
        for (size_t j = 0; j < m[1]; j++)
            for (size_t i = 0; i < m[0]; i++) {
                if (i % n[0] && j % n[1] && k % n[2]) continue; /* inside */
                shape_set3(mesh.V + 3 * nv, size[0] * ((double)i / (double)n[0] - 0.5),
                           size[1] * ((double)j / (double)n[1] - 0.5),
                           size[2] * ((double)k / (double)n[2] - 0.5));
                index[i + m[0] * (j + m[1] * k)] = (uint32_t)nv++;
            }
    const size_t stride[3] = { 1, m[0], m[0] * m[1] };
    for (size_t c = 0; c < 3; c++) /* the two sides across axis c, spanned by axes u and v */
        for (size_t side = 0; side < 2; side++) {
            const size_t u = side ? (c + 1) % 3 : (c + 2) % 3, v = 3 - c - u;
            for (size_t i = 0; i < n[u]; i++)
                for (size_t j = 0; j < n[v]; j++) {
                    const size_t o = side * n[c] * stride[c] + i * stride[u] + j * stride[v];
                    const uint32_t p = index[o], q = index[o + stride[u]],
                                   r = index[o + stride[u] + stride[v]], s = index[o + stride[v]];
                    shape_face(&mesh, &f, p, q, r);
                    shape_face(&mesh, &f, p, r, s);
                }
        }
    free(index);
    return mesh;
}

/* Cube [-edge/2, edge/2]^3, n x n cells on each side. */
static inline apsm_mesh shape_cube(size_t n, double edge)
{
    return shape_box((size_t[3]){ n, n, n }, (double[3]){ edge, edge, edge });
}

/* Open rectangle [0, width] x [0, height] at z = 0, nx x ny cells. */
static inline apsm_mesh shape_plane(size_t nx, size_t ny, double width, double height)
{
    apsm_mesh mesh = shape_alloc((nx + 1) * (ny + 1), 2 * nx * ny);
    for (size_t j = 0; j <= ny; j++)
        for (size_t i = 0; i <= nx; i++)
            shape_set3(mesh.V + 3 * (j * (nx + 1) + i), width * (double)i / (double)nx,
                       height * (double)j / (double)ny, 0);
    for (size_t j = 0, f = 0; j < ny; j++)
        for (size_t i = 0; i < nx; i++) {
            const size_t a = j * (nx + 1) + i, d = a + nx + 1;
            shape_face(&mesh, &f, a, a + 1, d + 1);
            shape_face(&mesh, &f, a, d + 1, d);
        }
    return mesh;
}

#endif
