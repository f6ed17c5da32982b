/* What remeshing did to a surface: distances both ways, volume, angles. */
#include "groom/remesh_measure.h"

#include <math.h>

#include "geometry/vec3.h"
#include "groom/fan.h"

/* Distances of n points, (sum, max) added to. */
static void measure_points(const apsm_bvh *bvh, size_t n, const double *X, double *sum,
                           double *most)
{
    for (size_t i = 0; i < n; i++) {
        apsm_closest hit;
        apsm_bvh_closest(bvh, X + 3 * i, INFINITY, &hit);
        const double d = sqrt(hit.distance2);
        *sum += d;
        *most = fmax(*most, d);
    }
}

static void forward(const apsm_bvh *original, const apsm_mesh *after, apsm_remesh_report *r)
{
    double sum = 0.0, most = 0.0;
    measure_points(original, after->nv, after->V, &sum, &most);
    for (size_t f = 0; f < after->nf; f++) {
        double x[3];
        const apsm_surface_point middle = { (uint32_t)f, { 1.0 / 3, 1.0 / 3, 1.0 / 3 } };
        apsm_surface_position(after, &middle, x);
        measure_points(original, 1, x, &sum, &most);
    }
    r->forward_mean = sum / (double)(after->nv + after->nf);
    r->forward_max = most;
}

static apsm_status backward(const apsm_bvh *original, const apsm_mesh *after, apsm_remesh_report *r)
{
    apsm_bvh *tree;
    APSM_TRY(apsm_bvh_build_unsigned(after, &tree));
    const apsm_mesh *from = apsm_bvh_mesh(original);
    double sum = 0.0, most = 0.0;
    measure_points(tree, from->nv, from->V, &sum, &most);
    r->backward_mean = sum / (double)from->nv;
    r->backward_max = most;
    apsm_bvh_free(tree);
    return APSM_OK;
}

static void angles(const apsm_mesh *mesh, apsm_remesh_report *r)
{
    const double degrees = 57.295779513082323;
    r->min_angle = 180.0;
    r->below_30 = 0;
    for (size_t f = 0; f < mesh->nf; f++) {
        double least = 180.0;
        for (size_t k = 0; k < 3; k++) {
            const double *a = mesh->V + 3 * mesh->F[3 * f + k];
            double u[3], v[3], n[3];
            vec3_sub(mesh->V + 3 * mesh->F[3 * f + (k + 1) % 3], a, u);
            vec3_sub(mesh->V + 3 * mesh->F[3 * f + (k + 2) % 3], a, v);
            vec3_cross(u, v, n);
            least = fmin(least, degrees * atan2(vec3_norm(n), vec3_dot(u, v)));
        }
        r->min_angle = fmin(r->min_angle, least);
        if (least < 30.0) r->below_30++;
    }
}

apsm_status remesh_measure(const apsm_mesh *before, const apsm_bvh *original,
                           const apsm_mesh *after, apsm_remesh_report *report)
{
    report->faces_before = before->nf;
    report->faces_after = after->nf;
    forward(original, after, report);
    APSM_TRY(backward(original, after, report));
    const double volume = apsm_mesh_volume(before);
    report->volume_change = volume != 0.0 ? apsm_mesh_volume(after) / volume - 1.0 : 0.0;
    angles(after, report);
    return APSM_OK;
}
