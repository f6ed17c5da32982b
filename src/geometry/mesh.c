/* Triangle meshes: memory, measures, normals.
 *
 *   area    = sum_f |(b-a) x (c-a)| / 2
 *   volume  = sum_f (a-o) . ((b-o) x (c-o)) / 6      o: the first vertex, against cancellation
 *   normal of vertex v = sum over its faces of angle_f(v) n_f, to unit length
 *           (Thuermer & Wuethrich, "Computing vertex normals from polygonal facets", 1998):
 *           does not depend on how the faces around v are cut into triangles. */
#include "apsm/mesh.h"

#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"
#include "geometry/face.h"
#include "geometry/stored.h"

apsm_status apsm_mesh_alloc(apsm_mesh *mesh, size_t nv, size_t nf)
{
    *mesh = (apsm_mesh){ .nv = nv, .nf = nf };
    if (nv > SIZE_MAX / 24 || nf > SIZE_MAX / 12) {
        *mesh = (apsm_mesh){ 0 };
        return APSM_ERR_MEMORY;
    }
    mesh->V = malloc((nv ? nv : 1) * 3 * sizeof *mesh->V);
    mesh->F = malloc((nf ? nf : 1) * 3 * sizeof *mesh->F);
    if (mesh->V && mesh->F) return APSM_OK;
    apsm_mesh_free(mesh);
    return APSM_ERR_MEMORY;
}

apsm_status apsm_mesh_copy(const apsm_mesh *from, apsm_mesh *to)
{
    APSM_TRY(apsm_mesh_alloc(to, from->nv, from->nf));
    if (from->nv) memcpy(to->V, from->V, 3 * from->nv * sizeof *to->V);
    if (from->nf) memcpy(to->F, from->F, 3 * from->nf * sizeof *to->F);
    return APSM_OK;
}

void mesh_arrays(apsm_mesh *mesh, array_list *list)
{
    arrays_add(list, &mesh->V, mesh->nv * 3 * sizeof *mesh->V);
    arrays_add(list, &mesh->F, mesh->nf * 3 * sizeof *mesh->F);
}

apsm_status apsm_mesh_append(apsm_mesh *mesh, const apsm_mesh *more)
{
    apsm_mesh all;
    const size_t nv = mesh->nv, nf = mesh->nf;
    if (nv + more->nv > UINT32_MAX) return APSM_ERR_GEOMETRY;
    APSM_TRY(apsm_mesh_alloc(&all, nv + more->nv, nf + more->nf));
    if (nv > 0) memcpy(all.V, mesh->V, 3 * nv * sizeof *all.V);
    if (nf > 0) memcpy(all.F, mesh->F, 3 * nf * sizeof *all.F);
    if (more->nv > 0) memcpy(all.V + 3 * nv, more->V, 3 * more->nv * sizeof *all.V);
    for (size_t k = 0; k < 3 * more->nf; k++) all.F[3 * nf + k] = more->F[k] + (uint32_t)nv;
    apsm_mesh_free(mesh);
    *mesh = all;
    return APSM_OK;
}

void apsm_mesh_free(apsm_mesh *mesh)
{
    free(mesh->V);
    free(mesh->F);
    *mesh = (apsm_mesh){ 0 };
}

static const double *corner(const apsm_mesh *mesh, size_t f, size_t k)
{
    return mesh->V + 3 * (size_t)mesh->F[3 * f + k];
}

void apsm_surface_position(const apsm_mesh *mesh, const apsm_surface_point *p, double x[3])
{
    const double *a = corner(mesh, p->face, 0), *b = corner(mesh, p->face, 1),
                 *c = corner(mesh, p->face, 2);
    for (int k = 0; k < 3; k++)
        x[k] = p->weight[0] * a[k] + p->weight[1] * b[k] + p->weight[2] * c[k];
}

void apsm_surface_normal(const apsm_mesh *mesh, const double *VN, const apsm_surface_point *p,
                         double n[3])
{
    memset(n, 0, 3 * sizeof *n);
    for (size_t k = 0; k < 3; k++)
        vec3_add_scaled(n, p->weight[k], VN + 3 * (size_t)mesh->F[3 * (size_t)p->face + k]);
    if (vec3_normalise(n) > 0.0) return;
    face_vector(mesh, p->face, n); /* vertex normals that cancel: the face's own */
    if (!(vec3_normalise(n) > 0.0)) n[2] = 1.0;
}

double apsm_mesh_area(const apsm_mesh *mesh)
{
    double twice = 0.0, n[3];
    for (size_t f = 0; f < mesh->nf; f++) {
        face_vector(mesh, f, n);
        twice += vec3_norm(n);
    }
    return 0.5 * twice;
}

double apsm_mesh_volume(const apsm_mesh *mesh)
{
    double six = 0.0;
    for (size_t f = 0; f < mesh->nf; f++) {
        double n[3], a[3];
        face_vector(mesh, f, n);
        vec3_sub(corner(mesh, f, 0), mesh->V, a);
        six += vec3_dot(a, n);
    }
    return six / 6.0;
}

void apsm_mesh_bounds(const apsm_mesh *mesh, double lo[3], double hi[3])
{
    for (size_t c = 0; c < 3; c++) {
        lo[c] = mesh->nv ? mesh->V[c] : 0.0;
        hi[c] = lo[c];
    }
    for (size_t i = 0; i < 3 * mesh->nv; i++) {
        const double x = mesh->V[i];
        if (x < lo[i % 3]) lo[i % 3] = x;
        if (x > hi[i % 3]) hi[i % 3] = x;
    }
}

void apsm_mesh_centroid(const apsm_mesh *mesh, double c[3])
{
    double sum[3] = { 0.0, 0.0, 0.0 }, total = 0.0;
    memset(c, 0, 3 * sizeof *c);
    if (!mesh->nv) return;
    for (size_t f = 0; f < mesh->nf; f++) {
        double n[3];
        face_vector(mesh, f, n);
        const double w = vec3_norm(n);
        total += w;
        for (size_t k = 0; k < 3; k++) {
            vec3_sub(corner(mesh, f, k), mesh->V, n);
            vec3_add_scaled(sum, w / 3.0, n);
        }
    }
    for (int k = 0; k < 3; k++) c[k] = mesh->V[k] + (total > 0.0 ? sum[k] / total : 0.0);
}

double apsm_mesh_mean_edge(const apsm_mesh *mesh)
{
    double sum = 0.0;
    for (size_t f = 0; f < mesh->nf; f++)
        for (size_t k = 0; k < 3; k++)
            sum += sqrt(vec3_distance2(corner(mesh, f, k), corner(mesh, f, (k + 1) % 3)));
    return mesh->nf ? sum / (3.0 * (double)mesh->nf) : 0.0;
}

static double corner_angle(const double a[3], const double b[3], const double c[3])
{
    double u[3], v[3], n[3];
    vec3_sub(b, a, u);
    vec3_sub(c, a, v);
    vec3_cross(u, v, n);
    return atan2(vec3_norm(n), vec3_dot(u, v));
}

void apsm_mesh_vertex_normals(const apsm_mesh *mesh, double *VN)
{
    memset(VN, 0, 3 * mesh->nv * sizeof *VN);
    for (size_t f = 0; f < mesh->nf; f++) {
        double n[3];
        face_vector(mesh, f, n);
        if (!(vec3_normalise(n) > 0.0)) continue;
        for (size_t k = 0; k < 3; k++) {
            const double angle = corner_angle(corner(mesh, f, k), corner(mesh, f, (k + 1) % 3),
                                              corner(mesh, f, (k + 2) % 3));
            vec3_add_scaled(VN + 3 * (size_t)mesh->F[3 * f + k], angle, n);
        }
    }
    for (size_t v = 0; v < mesh->nv; v++)
        if (!(vec3_normalise(VN + 3 * v) > 0.0)) VN[3 * v + 2] = 1.0;
}

void apsm_mesh_transform(apsm_mesh *mesh, const double M[16])
{
    apsm_affine_apply(M, mesh->nv, mesh->V, mesh->V);
    if (apsm_affine_det(M) >= 0.0) return;
    for (size_t f = 0; f < mesh->nf; f++) {
        uint32_t *F = mesh->F + 3 * f, swap = F[1];
        F[1] = F[2];
        F[2] = swap;
    }
}
