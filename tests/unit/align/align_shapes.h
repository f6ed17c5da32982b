/* align_shapes.h -- shapes without symmetry and random poses, for the tests of alignment. */
#ifndef APSM_TEST_ALIGN_SHAPES_H
#define APSM_TEST_ALIGN_SHAPES_H

#include "align/align.h"
#include "cmocka_all.h"
#include "core/random.h"
#include "geometry/affine.h"
#include "shapes.h"

/* An ellipsoid (half-axes a, b, c) whose radius varies with direction u by the factor
 * 1 + 0.2 u_x + 0.15 u_y + bump u_x u_z + chiral u_x u_y u_z: no symmetry; the sign of `chiral`
 * tells the hands apart. */
static inline apsm_mesh align_shape(int level, double a, double b, double c, double bump,
                                    double chiral)
{
    apsm_mesh mesh = shape_icosphere(level);
    for (size_t i = 0; i < mesh.nv; i++) {
        double *v = mesh.V + 3 * i;
        const double r =
            1.0 + 0.2 * v[0] + 0.15 * v[1] + bump * v[0] * v[2] + chiral * v[0] * v[1] * v[2];
        shape_set3(v, a * r * v[0], b * r * v[1], c * r * v[2]);
    }
    return mesh;
}

/* The size of a talus in mm. */
static inline apsm_mesh align_bone(double bump, double chiral)
{
    return align_shape(3, 27, 20, 14, bump, chiral);
}

/* A uniformly distributed rotation and a shift of size `far`. */
static inline void align_random_pose(uint64_t index, double far, double M[16])
{
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, index, 0);
    double A[9], R[9];
    for (size_t i = 0; i < 9; i++) A[i] = apsm_random_normal(&rng);
    apsm_nearest_rotation(A, R);
    apsm_affine_identity(M);
    for (size_t r = 0; r < 3; r++) {
        for (size_t c = 0; c < 3; c++) M[4 * r + c] = R[3 * r + c];
        M[4 * r + 3] = far * apsm_random_normal(&rng);
    }
}

static inline void align_scale_pose(double scale, double M[16])
{
    for (size_t i = 0; i < 12; i++)
        if (i % 4 < 3) M[i] *= scale;
}

/* Largest distance between A v and B v over the vertices. */
static inline double align_difference(const apsm_mesh *mesh, const double A[16], const double B[16])
{
    double most = 0.0;
    for (size_t i = 0; i < mesh->nv; i++) {
        double a[3], b[3], d2 = 0.0;
        apsm_affine_apply(A, 1, mesh->V + 3 * i, a);
        apsm_affine_apply(B, 1, mesh->V + 3 * i, b);
        for (size_t c = 0; c < 3; c++) d2 += (a[c] - b[c]) * (a[c] - b[c]);
        most = fmax(most, sqrt(d2));
    }
    return most;
}

/* A mesh with what registration needs; owns all. */
typedef struct align_surface {
    apsm_mesh mesh;
    apsm_bvh *bvh;
    apsm_cloud cloud;
    apsm_surface surface;
} align_surface;

/* Takes mesh.  The surface points into *s: it may not be moved. */
static inline void align_open(align_surface *s, apsm_mesh mesh, size_t points)
{
    s->mesh = mesh;
    assert_int_equal(apsm_bvh_build(&s->mesh, &s->bvh), APSM_OK);
    assert_int_equal(apsm_cloud_sample(&s->mesh, points, 1, 0, &s->cloud), APSM_OK);
    s->surface = (apsm_surface){ .bvh = s->bvh, .cloud = &s->cloud };
}

static inline void align_close(align_surface *s)
{
    apsm_bvh_free(s->bvh);
    apsm_cloud_free(&s->cloud);
    apsm_mesh_free(&s->mesh);
}

#endif
