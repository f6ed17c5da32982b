/* Registration of two surfaces: clouds, ICP, pose search. */
#include "align_shapes.h"

#include "align/icp.h"
#include "align/pose_choice.h"
#include "geometry/vec3.h"

enum { POINTS = 300 };

static double *new_work(void)
{
    double *work = malloc(apsm_icp_work_size(POINTS) * sizeof *work);
    if (!work) abort();
    return work;
}

static void cloud_stands_for_the_surface(void **state)
{
    (void)state;
    align_surface s;
    align_open(&s, align_bone(0.2, 0.3), POINTS);
    double sum = 0.0, c[3], mean[3] = { 0 };
    for (size_t k = 0; k < POINTS; k++) {
        apsm_closest at;
        apsm_bvh_closest(s.bvh, s.cloud.x + 3 * k, INFINITY, &at);
        assert_true(sqrt(at.distance2) <= 1e-12 * s.cloud.radius);
        assert_true(s.cloud.w[k] > 0.0);
        sum += s.cloud.w[k];
        for (size_t i = 0; i < 3; i++) mean[i] += s.cloud.w[k] * s.cloud.x[3 * k + i];
    }
    assert_float_equal(sum, 1.0, 1e-12);
    apsm_mesh_centroid(&s.mesh, c);
    for (size_t i = 0; i < 3; i++) /* 2400 stratified points err by about radius / 100 */
        if (!(fabs(mean[i] - c[i]) < 0.02 * s.cloud.radius &&
              fabs(s.cloud.centre[i] - c[i]) < 0.02 * s.cloud.radius))
            fail_msg("centre[%zu] = %g, weighted mean %g, centroid %g", i, s.cloud.centre[i],
                     mean[i], c[i]);
    align_close(&s);
}

/* On a flat rectangle of two triangles, the centre of uniform points is the middle: 2400 points
 * stray by less than the standard error of unstratified ones, 0.006. */
static void points_are_uniform_on_a_face(void **state)
{
    (void)state;
    apsm_mesh plane = shape_plane(1, 1, 1, 1);
    apsm_cloud cloud;
    assert_ok(apsm_cloud_sample(&plane, POINTS, 0, 0, &cloud));
    assert_near(cloud.centre[0], 0.5, 0.02);
    assert_near(cloud.centre[1], 0.5, 0.02);
    apsm_cloud_free(&cloud);
    apsm_mesh_free(&plane);
}

static void moved_mesh_gets_the_moved_cloud(void **state)
{
    (void)state;
    align_surface s, t;
    double M[16], x[3];
    align_random_pose(4, 100.0, M);
    align_open(&s, align_bone(0.2, 0.3), POINTS);
    apsm_mesh moved = align_bone(0.2, 0.3);
    apsm_mesh_transform(&moved, M);
    align_open(&t, moved, POINTS);
    for (size_t k = 0; k < POINTS; k++) {
        apsm_affine_apply(M, 1, s.cloud.x + 3 * k, x);
        for (size_t i = 0; i < 3; i++) assert_true(fabs(x[i] - t.cloud.x[3 * k + i]) < 1e-10);
    }
    for (size_t a = 0; a < 3; a++) {
        double turned[3];
        apsm_affine_apply_normals(M, 1, s.cloud.axes + 3 * a, turned);
        for (size_t i = 0; i < 3; i++) assert_near(t.cloud.axes[3 * a + i], turned[i], 1e-9);
    }
    align_close(&s);
    align_close(&t);
}

/* Vertices in another order, coordinates in single precision in another unit: nearly all of the
 * points are the same. */
static apsm_mesh in_other_unit(const apsm_mesh *mesh, double unit)
{
    apsm_mesh other;
    assert_int_equal(apsm_mesh_copy(mesh, &other), APSM_OK);
    for (size_t v = 0; v < mesh->nv; v++)
        for (size_t c = 0; c < 3; c++)
            other.V[3 * (mesh->nv - 1 - v) + c] = (double)(float)(unit * mesh->V[3 * v + c]);
    for (size_t h = 0; h < 3 * mesh->nf; h++)
        other.F[h] = (uint32_t)mesh->nv - 1 - mesh->F[3 * mesh->nf - 3 - 3 * (h / 3) + h % 3];
    return other;
}

static size_t count_same(const apsm_cloud *a, const apsm_cloud *b, double unit)
{
    size_t same = 0;
    for (size_t i = 0; i < a->n; i++)
        for (size_t k = 0; k < b->n; k++) {
            double d2 = 0.0;
            for (size_t c = 0; c < 3; c++) d2 += pow(a->x[3 * i + c] - b->x[3 * k + c] / unit, 2);
            same += d2 < pow(1e-5 * a->radius, 2);
        }
    return same;
}

static void spread_points_do_not_depend_on_unit_or_order(void **state)
{
    (void)state;
    apsm_mesh mesh = align_shape(4, 27, 20, 14, 0.2, 0.5);
    for (size_t k = 0; k < 3 * mesh.nv; k++) /* no two distances are equal */
        mesh.V[k] = (double)(float)(mesh.V[k] * (1 + 0.01 * sin(37.0 * (double)k)));
    apsm_mesh other = in_other_unit(&mesh, 1000.0);
    apsm_cloud a, b;
    double sum = 0.0;
    assert_int_equal(apsm_cloud_spread(&mesh, POINTS, &a), APSM_OK);
    assert_int_equal(apsm_cloud_spread(&other, POINTS, &b), APSM_OK);
    assert_int_equal(a.n, POINTS);
    for (size_t k = 0; k < a.n; k++) sum += a.w[k];
    assert_true(fabs(sum - 1.0) < 1e-12);
    assert_true(fabs(b.radius / 1000.0 - a.radius) < 1e-6 * a.radius);
    if (count_same(&a, &b, 1000.0) < POINTS * 95 / 100)
        fail_msg("%zu of %d points the same", count_same(&a, &b, 1000.0), POINTS);
    apsm_cloud_free(&a);
    apsm_cloud_free(&b);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&other);
}

static void few_vertices_are_all_taken(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_icosphere(0);
    apsm_cloud cloud;
    assert_int_equal(apsm_cloud_spread(&mesh, POINTS, &cloud), APSM_OK);
    assert_int_equal(cloud.n, mesh.nv);
    for (size_t k = 0; k < cloud.n; k++) {
        assert_true(fabs(cloud.w[k] - 1.0 / 12) < 1e-12);
        for (size_t c = 0; c < 3; c++) /* normals look outward */
            assert_true(fabs(cloud.normal[3 * k + c] - cloud.x[3 * k + c]) < 1e-12);
    }
    apsm_cloud_free(&cloud);
    for (size_t k = 0; k < 3 * mesh.nv; k++) mesh.V[k] = 0.0;
    assert_int_equal(apsm_cloud_spread(&mesh, POINTS, &cloud), APSM_ERR_GEOMETRY);
    apsm_mesh_free(&mesh);
}

/* Which vertices a cloud of some, in their order, holds. */
static void mark_taken(const apsm_mesh *mesh, const apsm_cloud *cloud, bool *taken)
{
    size_t k = 0;
    for (size_t v = 0; v < mesh->nv; v++) {
        taken[v] =
            k < cloud->n && memcmp(cloud->x + 3 * k, mesh->V + 3 * v, 3 * sizeof *cloud->x) == 0;
        k += taken[v];
    }
    assert_int_equal(k, cloud->n);
}

/* Of a face one vertex at most is taken, every vertex is or has one beside it, and the weighted
 * points are where the surface is, nearly as all vertices say. */
static void some_vertices_stand_for_all(void **state)
{
    (void)state;
    align_surface s;
    apsm_cloud some, all;
    double sum[2] = { 0 }, mean[2][3] = { { 0 } };
    align_open(&s, align_bone(0.2, 0.3), POINTS);
    bool *taken = calloc(2 * s.mesh.nv, sizeof *taken), *near = taken + s.mesh.nv;
    assert_non_null(taken);
    assert_int_equal(apsm_cloud_of_some_vertices(&s.mesh, &s.cloud, &some), APSM_OK);
    assert_int_equal(apsm_cloud_of_vertices(&s.mesh, &s.cloud, &all), APSM_OK);
    mark_taken(&s.mesh, &some, taken);
    for (size_t f = 0; f < s.mesh.nf; f++) {
        const uint32_t *F = s.mesh.F + 3 * f;
        const int n = taken[F[0]] + taken[F[1]] + taken[F[2]];
        assert_true(n <= 1);
        for (size_t c = 0; c < 3; c++) near[F[c]] |= n > 0;
    }
    for (size_t v = 0; v < s.mesh.nv; v++) assert_true(near[v]);
    for (size_t of = 0; of < 2; of++) {
        const apsm_cloud *cloud = of == 0 ? &some : &all;
        for (size_t k = 0; k < cloud->n; k++) {
            sum[of] += cloud->w[k];
            vec3_add_scaled(mean[of], cloud->w[k], cloud->x + 3 * k);
        }
    }
    assert_true(fabs(sum[0] - sum[1]) < 1e-9 * sum[1]);
    for (size_t c = 0; c < 3; c++)
        if (!(fabs(mean[0][c] - mean[1][c]) < 2e-3 * s.cloud.radius * sum[1]))
            fail_msg("mean %g of some, %g of all", mean[0][c] / sum[0], mean[1][c] / sum[1]);
    apsm_cloud_free(&some);
    apsm_cloud_free(&all);
    free(taken);
    align_close(&s);
}

/* With some vertices first a shape comes to rest where it does with all alone and no hurry. */
static void some_vertices_first_rest_where_all_do(void **state)
{
    (void)state;
    static const double nudge[3] = { 0.04, -0.03, 0.05 };
    align_surface a, b;
    apsm_cloud cloud[2][2];
    align_open(&a, align_bone(0.2, 0.3), POINTS);
    align_open(&b, align_bone(0.1, 0.45), POINTS);
    for (size_t k = 0; k < 2; k++) {
        const align_surface *s = k == 0 ? &a : &b;
        assert_ok(apsm_cloud_of_some_vertices(&s->mesh, &s->cloud, &cloud[k][0]));
        assert_ok(apsm_cloud_of_vertices(&s->mesh, &s->cloud, &cloud[k][1]));
    }
    const apsm_surface moving[2] = { { a.bvh, &cloud[0][0] }, { a.bvh, &cloud[0][1] } };
    const apsm_surface fixed[2] = { { b.bvh, &cloud[1][0] }, { b.bvh, &cloud[1][1] } };
    double *work = malloc(apsm_icp_work_size(cloud[0][1].n + cloud[1][1].n) * sizeof *work);
    assert_non_null(work);
    for (size_t trial = 0; trial < 3; trial++) {
        double M[16], N[16], residual, moved = 0, x[3], y[3];
        apsm_icp_options opt = { .max_iterations = 12, .tolerance = 3e-5 };
        apsm_affine_identity(M);
        for (size_t c = 0; c < 3; c++)
            M[4 * c + 3] =
                b.cloud.centre[c] - a.cloud.centre[c] + nudge[(c + trial) % 3] * b.cloud.radius;
        memcpy(N, M, sizeof N);
        apsm_icp_to_rest(2, moving, fixed, &opt, M, &residual, work);
        opt.max_iterations = 300;
        opt.tolerance = 1e-8;
        apsm_icp_to_rest(1, moving + 1, fixed + 1, &opt, N, &residual, work);
        for (size_t v = 0; v < a.mesh.nv; v++) {
            apsm_affine_apply(M, 1, a.mesh.V + 3 * v, x);
            apsm_affine_apply(N, 1, a.mesh.V + 3 * v, y);
            moved = fmax(moved, sqrt(vec3_distance2(x, y)));
        }
        if (!(moved < 3e-4 * b.cloud.radius))
            fail_msg("trial %zu: rests %g of the radius away", trial, moved / b.cloud.radius);
    }
    free(work);
    for (size_t k = 0; k < 4; k++) apsm_cloud_free(&cloud[k / 2][k % 2]);
    align_close(&a);
    align_close(&b);
}

static void mesh_without_area_is_refused(void **state)
{
    (void)state;
    apsm_mesh flat = align_bone(0, 0);
    apsm_cloud cloud;
    for (size_t i = 0; i < 3 * flat.nv; i++) flat.V[i] = 1.0;
    assert_int_equal(apsm_cloud_sample(&flat, POINTS, 0, 0, &cloud), APSM_ERR_GEOMETRY);
    flat.V[0] = NAN;
    assert_int_equal(apsm_cloud_sample(&flat, POINTS, 0, 0, &cloud), APSM_ERR_GEOMETRY);
    assert_int_equal(apsm_cloud_sample(&flat, 3, 0, 0, &cloud), APSM_ERR_ARG);
    apsm_mesh_free(&flat);
}

/* Concentric spheres: every distance is the difference of the radii, whatever the rotation. */
static void residual_of_spheres_is_known(void **state)
{
    (void)state;
    align_surface a, b;
    double M[16], residual, *work = new_work();
    apsm_icp_options opt = apsm_icp_defaults();
    opt.max_iterations = 0;
    align_open(&a, shape_sphere(4, 10.0), POINTS);
    align_open(&b, shape_sphere(4, 12.0), POINTS);
    align_random_pose(1, 0.0, M);
    apsm_icp(&a.surface, &b.surface, &opt, M, &residual, work);
    /* The facets of a level 4 icosphere lie up to 0.1 % inside the sphere. */
    assert_near(residual, 2.0, 0.02);
    align_scale_pose(2.0, M); /* 20 in 12: 8 in the fixed sphere's unit, both ways */
    apsm_icp(&a.surface, &b.surface, &opt, M, &residual, work);
    assert_near(residual, 8.0, 0.04);
    opt.scale = true;
    opt.max_iterations = 20;
    apsm_icp(&a.surface, &b.surface, &opt, M, &residual, work);
    if (!(residual < 0.02)) fail_msg("similarity: %g", residual);
    if (!(fabs(cbrt(apsm_affine_det(M)) - 1.2) < 0.002))
        fail_msg("scale^3: %g", apsm_affine_det(M));
    align_close(&a);
    align_close(&b);
    free(work);
}

/* Mean squared distance both ways, computed apart from ICP. */
static double squared_error(const align_surface *moving, const align_surface *fixed,
                            const double M[16])
{
    double back[16], x[3], sum = 0.0;
    apsm_closest at;
    assert_ok(apsm_affine_invert(M, back));
    for (size_t k = 0; k < POINTS; k++) {
        apsm_affine_apply(M, 1, moving->cloud.x + 3 * k, x);
        apsm_bvh_closest(fixed->bvh, x, INFINITY, &at);
        sum += 0.5 * moving->cloud.w[k] * at.distance2;
        apsm_affine_apply(back, 1, fixed->cloud.x + 3 * k, x);
        apsm_bvh_closest(moving->bvh, x, INFINITY, &at);
        sum += 0.5 * fixed->cloud.w[k] * at.distance2;
    }
    return sum;
}

/* With one iteration more, the error is never larger, even from starts that lead nowhere. */
static void error_never_grows(void **state)
{
    (void)state;
    align_surface fixed, moved;
    double start[16], M[16], residual, *work = new_work();
    apsm_icp_options opt = apsm_icp_defaults();
    opt.tolerance = 0.0;
    align_open(&fixed, align_bone(0.2, 0.3), POINTS);
    align_open(&moved, align_shape(3, 30, 19, 15, 0.1, 0.4), POINTS);
    for (uint64_t k = 0; k < 4; k++) {
        double last = INFINITY;
        align_random_pose(k, 2.0, start);
        for (opt.max_iterations = 0; opt.max_iterations < 20; opt.max_iterations++) {
            memcpy(M, start, sizeof M);
            apsm_icp(&moved.surface, &fixed.surface, &opt, M, &residual, work);
            const double error = squared_error(&moved, &fixed, M);
            if (!(error <= last * (1.0 + 1e-9)))
                fail_msg("start %d, iteration %d: %g after %g", (int)k, opt.max_iterations, error,
                         last);
            last = error;
        }
    }
    align_close(&fixed);
    align_close(&moved);
    free(work);
}

/* Ten iterations are enough from 20 degrees and 10 % off: point-to-point alone is not. */
static void convergence_is_fast(void **state)
{
    (void)state;
    align_surface s;
    const double identity[16] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };
    double residual, *work = new_work();
    apsm_icp_options opt = apsm_icp_defaults();
    opt.max_iterations = 10;
    align_open(&s, align_bone(0.2, 0.3), POINTS);
    for (int scale = 0; scale < 2; scale++) {
        double M[16] = { 0.94, -0.34, 0, 2, 0.34, 0.94, 0, -3, 0, 0, 1, 1, 0, 0, 0, 1 };
        opt.scale = scale;
        for (size_t i = 0; i < 2; i++)
            for (size_t c = 0; c < 2; c++) M[4 * i + c] /= hypot(0.94, 0.34);
        if (scale) align_scale_pose(0.9, M);
        apsm_icp(&s.surface, &s.surface, &opt, M, &residual, work);
        const double error = align_difference(&s.mesh, M, identity);
        if (!(error < 1e-3 * s.cloud.radius)) fail_msg("scale %d: off by %g", scale, error);
    }
    align_close(&s);
    free(work);
}

/* Registers `moved`, a copy of a bone moved by pose, back; returns the largest error. */
static double recover(const apsm_mesh *bone, const align_surface *moved, const align_surface *fixed,
                      const double pose[16], const apsm_icp_options *opt, double *work)
{
    apsm_pose found;
    double there[16];
    apsm_pose_search(&moved->surface, &fixed->surface, false, opt, &found, work);
    apsm_affine_multiply(found.M, pose, there);
    const double identity[16] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };
    return align_difference(bone, there, identity);
}

static void pose_and_scale_are_recovered(void **state)
{
    (void)state;
    align_surface fixed, moved;
    double pose[16], *work = new_work();
    apsm_icp_options opt = apsm_icp_defaults();
    opt.tolerance = 1e-6;
    align_open(&fixed, align_bone(0.2, 0.3), POINTS);
    for (uint64_t k = 0; k < 10; k++) {
        opt.scale = k % 2 == 1;
        align_random_pose(k, 200.0, pose);
        if (opt.scale) align_scale_pose(k == 1 ? 0x1p-10 : 0x1p10, pose);
        apsm_mesh mesh = align_bone(0.2, 0.3);
        apsm_mesh_transform(&mesh, pose);
        align_open(&moved, mesh, POINTS);
        const double error = recover(&fixed.mesh, &moved, &fixed, pose, &opt, work);
        if (!(error < 1e-3 * fixed.cloud.radius)) fail_msg("pose %d: error %g mm", (int)k, error);
        align_close(&moved);
    }
    align_close(&fixed);
    free(work);
}

/* A different individual in 100 poses: always the same registration. */
static void every_initial_pose_gives_the_same_result(void **state)
{
    (void)state;
    align_surface fixed, moved;
    double pose[16], first[16], there[16], least = INFINITY, most = 0.0, *work = new_work();
    const apsm_icp_options opt = apsm_icp_defaults();
    align_open(&fixed, align_bone(0.2, 0.3), POINTS);
    apsm_mesh bone = align_shape(3, 30, 19, 15, 0.1, 0.4);
    for (uint64_t k = 0; k < 100; k++) {
        apsm_mesh mesh;
        apsm_pose found;
        assert_int_equal(apsm_mesh_copy(&bone, &mesh), APSM_OK);
        align_random_pose(k, 300.0, pose);
        apsm_mesh_transform(&mesh, pose);
        align_open(&moved, mesh, POINTS);
        apsm_pose_search(&moved.surface, &fixed.surface, false, &opt, &found, work);
        apsm_affine_multiply(found.M, pose, there);
        if (k == 0) memcpy(first, there, sizeof first);
        least = fmin(least, found.residual);
        most = fmax(most, found.residual);
        const double error = align_difference(&bone, there, first);
        if (!(error < 0.05 * fixed.cloud.radius)) fail_msg("pose %d: off by %g", (int)k, error);
        align_close(&moved);
    }
    if (!(most <= 1.01 * least)) fail_msg("residuals from %g to %g", least, most);
    apsm_mesh_free(&bone);
    align_close(&fixed);
    free(work);
}

/* The starts are a grid relative to principal frames; with those frames turned at random the
 * search must still find the best pose. */
static void grid_of_starts_is_dense_enough(void **state)
{
    (void)state;
    align_surface fixed, moved;
    double turn[16], axes[9], *work = new_work();
    const apsm_icp_options opt = apsm_icp_defaults();
    apsm_pose best, found;
    align_open(&fixed, align_bone(0.2, 0.3), POINTS);
    align_open(&moved, align_shape(3, 30, 19, 15, 0.1, 0.4), POINTS);
    apsm_pose_search(&moved.surface, &fixed.surface, false, &opt, &best, work);
    memcpy(axes, moved.cloud.axes, sizeof axes);
    for (uint64_t k = 0; k < 20; k++) {
        align_random_pose(k, 0.0, turn);
        for (size_t i = 0; i < 9; i++) {
            moved.cloud.axes[i] = 0.0;
            for (size_t c = 0; c < 3; c++)
                moved.cloud.axes[i] += turn[4 * (i / 3) + c] * axes[3 * c + i % 3];
        }
        apsm_pose_search(&moved.surface, &fixed.surface, false, &opt, &found, work);
        if (!(fabs(found.residual - best.residual) <= 0.01 * best.residual))
            fail_msg("turn %d: residual %g instead of %g", (int)k, found.residual, best.residual);
    }
    align_close(&fixed);
    align_close(&moved);
    free(work);
}

static void mirror_image_is_told(void **state)
{
    (void)state;
    align_surface fixed, moved;
    double pose[16], *work = new_work();
    const apsm_icp_options opt = apsm_icp_defaults();
    apsm_pose as_is, mirrored;
    align_open(&fixed, align_bone(0.2, 0.5), POINTS);
    align_random_pose(8, 100.0, pose);
    for (size_t i = 0; i < 12; i += 4) pose[i] = -pose[i]; /* reflects x */
    apsm_mesh mesh = align_bone(0.1, 0.55);
    apsm_mesh_transform(&mesh, pose);
    align_open(&moved, mesh, POINTS);
    apsm_pose_search(&moved.surface, &fixed.surface, false, &opt, &as_is, work);
    apsm_pose_search(&moved.surface, &fixed.surface, true, &opt, &mirrored, work);
    assert_true(apsm_affine_det(as_is.M) > 0.0);
    assert_true(apsm_affine_det(mirrored.M) < 0.0);
    if (!(mirrored.residual < APSM_MIRROR_RATIO * as_is.residual))
        fail_msg("mirrored %g, as it is %g", mirrored.residual, as_is.residual);
    align_close(&fixed);
    align_close(&moved);
    free(work);
}

/* The best pose is the same with and without a rival; the others are only left less finished. */
static void a_rival_changes_no_best_pose(void **state)
{
    (void)state;
    align_surface fixed, moved;
    double *work = new_work();
    apsm_icp_options opt = apsm_icp_defaults();
    apsm_pose alone, rivalled;
    align_open(&fixed, align_bone(0.2, 0.3), POINTS);
    align_open(&moved, align_bone(0.25, 0.3), POINTS);
    apsm_pose_search(&moved.surface, &fixed.surface, true, &opt, &alone, work);
    opt.rival = 1e-3 * alone.residual;
    apsm_pose_search(&moved.surface, &fixed.surface, true, &opt, &rivalled, work);
    assert_memory_equal(alone.M, rivalled.M, sizeof alone.M);
    assert_true(alone.residual == rivalled.residual);
    assert_true(rivalled.runner_up > 0.8 * alone.runner_up); /* by fewer points */
    assert_true(isfinite(rivalled.runner_up) == isfinite(alone.runner_up));
    free(work);
    align_close(&fixed);
    align_close(&moved);
}

/* An ellipsoid fits itself in four ways; a bone without symmetry in one. */
static void ambiguity_is_reported(void **state)
{
    (void)state;
    align_surface fixed, moved, bone;
    double *work = new_work();
    const apsm_icp_options opt = apsm_icp_defaults();
    apsm_pose pose;
    align_open(&fixed, shape_ellipsoid(3, 30, 20, 10), POINTS);
    align_open(&moved, shape_ellipsoid(3, 32, 19, 11), POINTS);
    align_open(&bone, align_bone(0.2, 0.3), POINTS);
    apsm_pose_search(&moved.surface, &fixed.surface, false, &opt, &pose, work);
    if (!(pose.runner_up < APSM_AMBIGUOUS_RATIO * pose.residual))
        fail_msg("ellipsoid: %g, runner-up %g", pose.residual, pose.runner_up);
    apsm_pose_search(&bone.surface, &bone.surface, false, &opt, &pose, work);
    if (!(pose.runner_up > 2.0 * pose.residual))
        fail_msg("bone: %g, runner-up %g", pose.residual, pose.runner_up);
    align_close(&fixed);
    align_close(&moved);
    align_close(&bone);
    free(work);
}

/* Drops the faces beyond x > cut. */
static void cut(apsm_mesh *mesh, double at)
{
    size_t kept = 0;
    for (size_t f = 0; f < mesh->nf; f++) {
        if (mesh->V[3 * mesh->F[3 * f]] > at) continue;
        memmove(mesh->F + 3 * kept, mesh->F + 3 * f, 3 * sizeof *mesh->F);
        kept++;
    }
    mesh->nf = kept;
}

static void cut_bone_is_aligned_with_trimming(void **state)
{
    (void)state;
    align_surface fixed, moved;
    double pose[16], error[2], *work = new_work();
    align_open(&fixed, align_bone(0.2, 0.3), POINTS);
    for (int trimmed = 0; trimmed < 2; trimmed++) {
        apsm_icp_options opt = apsm_icp_defaults();
        opt.trim = trimmed ? 0.25 : 0.0;
        align_random_pose(2, 100.0, pose);
        apsm_mesh mesh = align_bone(0.2, 0.3);
        cut(&mesh, 15.0); /* of -22 .. 33 */
        apsm_mesh_transform(&mesh, pose);
        align_open(&moved, mesh, POINTS);
        error[trimmed] = recover(&fixed.mesh, &moved, &fixed, pose, &opt, work);
        align_close(&moved);
    }
    if (!(error[1] < 0.02 * fixed.cloud.radius && error[1] < 0.2 * error[0]))
        fail_msg("error %g mm trimmed, %g untrimmed", error[1], error[0]);
    align_close(&fixed);
    free(work);
}

static void powers_of_two_scale_exactly(void **state)
{
    (void)state;
    align_surface fixed[2], moved[2];
    apsm_pose pose[2];
    double *work = new_work();
    const apsm_icp_options opt = apsm_icp_defaults();
    for (int k = 0; k < 2; k++) {
        apsm_mesh a = align_bone(0.2, 0.3), b = align_shape(3, 30, 19, 15, 0.1, 0.4);
        for (size_t i = 0; k && i < 3 * a.nv; i++) {
            a.V[i] *= 0x1p-20;
            b.V[i] *= 0x1p-20;
        }
        align_open(&fixed[k], a, POINTS);
        align_open(&moved[k], b, POINTS);
        apsm_pose_search(&moved[k].surface, &fixed[k].surface, false, &opt, &pose[k], work);
    }
    for (size_t i = 0; i < 16; i++)
        assert_true(pose[1].M[i] == pose[0].M[i] * (i % 4 == 3 && i < 12 ? 0x1p-20 : 1.0));
    assert_true(pose[1].residual == 0x1p-20 * pose[0].residual);
    assert_true(pose[1].runner_up == 0x1p-20 * pose[0].runner_up);
    for (int k = 0; k < 2; k++) {
        align_close(&fixed[k]);
        align_close(&moved[k]);
    }
    free(work);
}

/* Shape 2 of eight fits a quarter better as its mirror image, and looks a little more like one:
 * that tells something only where the others' hands are clear. */
static void single_hands_of_symmetric_shapes_are_not_told(void **state)
{
    (void)state;
    static const double of_others[] = { 0.1, 1.0, INFINITY };
    double scratch[8];
    for (size_t k = 0; k < 3; k++) {
        pose_choice c[8];
        pose_ballot b = { .residual = { { 1.0 }, { 0.75 } } };
        for (size_t i = 0; i < 8; i++)
            c[i] = (pose_choice){ .evidence = { 2.0, i == 2 ? 2.3 : 2.0 - of_others[k] } };
        const bool differ = pose_hands_differ(8, 0, c, scratch);
        assert_int_equal(differ, of_others[k] > 0.5);
        assert_int_equal(pose_hand(&c[2], &b, differ), differ);
        assert_true(pose_hands_differ(7, 0, c, scratch));
        c[2].evidence[1] = 2.6; /* clear by itself */
        assert_int_equal(pose_hand(&c[2], &b, false), 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cloud_stands_for_the_surface),
        cmocka_unit_test(points_are_uniform_on_a_face),
        cmocka_unit_test(moved_mesh_gets_the_moved_cloud),
        cmocka_unit_test(spread_points_do_not_depend_on_unit_or_order),
        cmocka_unit_test(few_vertices_are_all_taken),
        cmocka_unit_test(some_vertices_stand_for_all),
        cmocka_unit_test(some_vertices_first_rest_where_all_do),
        cmocka_unit_test(mesh_without_area_is_refused),
        cmocka_unit_test(residual_of_spheres_is_known),
        cmocka_unit_test(error_never_grows),
        cmocka_unit_test(convergence_is_fast),
        cmocka_unit_test(pose_and_scale_are_recovered),
        cmocka_unit_test(every_initial_pose_gives_the_same_result),
        cmocka_unit_test(grid_of_starts_is_dense_enough),
        cmocka_unit_test(mirror_image_is_told),
        cmocka_unit_test(a_rival_changes_no_best_pose),
        cmocka_unit_test(ambiguity_is_reported),
        cmocka_unit_test(cut_bone_is_aligned_with_trimming),
        cmocka_unit_test(powers_of_two_scale_exactly),
        cmocka_unit_test(single_hands_of_symmetric_shapes_are_not_told),
    };
    return cmocka_run_group_tests_name("align_pose", tests, NULL, NULL);
}
