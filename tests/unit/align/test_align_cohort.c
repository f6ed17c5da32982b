/* Alignment of a cohort: template, poses, mirrored shapes, threads. */
#include "align_shapes.h"
#include "anatomy.h"

enum { MOST = 40 };

typedef struct cohort {
    size_t n;
    apsm_mesh local[MOST];       /* as given: in a random pose */
    const apsm_mesh *mesh[MOST]; /* of local */
    double pose[MOST][16];       /* from the common frame */
} cohort;

/* Bumps from 0.15 to 0.45 in equal steps: the middle shape is closest to all. */
static void open_cohort(cohort *c, size_t n)
{
    c->n = n;
    for (size_t i = 0; i < n; i++) {
        const double b = 0.15 + 0.3 * (double)i / (double)(n - 1);
        c->local[i] = align_bone(b, 0.5);
        align_random_pose(i, 200.0, c->pose[i]);
        apsm_mesh_transform(&c->local[i], c->pose[i]);
        c->mesh[i] = &c->local[i];
    }
}

static void close_cohort(cohort *c)
{
    for (size_t i = 0; i < c->n; i++) apsm_mesh_free(&c->local[i]);
}

static void reflect_shape(cohort *c, size_t i)
{
    const double F[16] = { 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };
    apsm_mesh_transform(&c->local[i], F);
    apsm_affine_multiply(F, c->pose[i], c->pose[i]);
}

typedef struct counts {
    size_t warnings, infos;
} counts;
static void count_lines(void *user, apsm_log_level level, const char *text)
{
    counts *n = user;
    (void)text;
    *(level == APSM_LOG_WARNING ? &n->warnings : &n->infos) += 1;
}

static apsm_alignment run(const cohort *c, const apsm_align_options *opt, int threads, counts *n)
{
    apsm_alignment a;
    apsm_context *ctx = apsm_context_new();
    if (!ctx) abort();
    apsm_context_set_threads(ctx, threads);
    if (n) apsm_context_set_log(ctx, count_lines, n);
    if (apsm_align_cohort(ctx, c->n, c->mesh, NULL, opt, &a) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    apsm_context_free(ctx);
    return a;
}

/* world <- common frame, the same for all shapes if they are aligned. */
static void check_aligned(const cohort *c, const apsm_alignment *a, double tolerance)
{
    double first[16], other[16];
    const size_t t = a->template_index;
    apsm_affine_multiply(a->M + 16 * t, c->pose[t], first);
    for (size_t i = 0; i < c->n; i++) {
        apsm_affine_multiply(a->M + 16 * i, c->pose[i], other);
        apsm_mesh bone = align_bone(0, 0.5);
        const double error = align_difference(&bone, other, first);
        apsm_mesh_free(&bone);
        if (!(error < tolerance)) fail_msg("shape %zu of %zu: off by %g mm", i, c->n, error);
    }
}

static void central_shape_becomes_the_template(void **state)
{
    (void)state;
    cohort c;
    counts n = { 0 };
    const apsm_align_options opt = apsm_align_defaults();
    open_cohort(&c, 7);
    apsm_alignment a = run(&c, &opt, 2, &n);
    assert_int_equal(a.template_index, 3);
    check_aligned(&c, &a, 4.0); /* mm; half the bones' difference in shape */
    assert_int_equal(n.warnings, 0);
    for (size_t i = 0; i < 7; i++) {
        assert_false(a.mirrored[i]);
        assert_true(a.residual[i] < 2.0);
        assert_float_equal(apsm_affine_det(a.M + 16 * i), 1.0, 1e-12);
        if (i > 3) assert_true(a.residual[i] > a.residual[i - 1]);
        if (i < 3) assert_true(a.residual[i] > a.residual[i + 1]);
    }
    /* The template is only moved, its centroid to the origin. */
    double centroid[3], at[3];
    const double *M = a.M + 16 * 3;
    apsm_mesh_centroid(c.mesh[3], centroid);
    apsm_affine_apply(M, 1, centroid, at);
    for (size_t r = 0; r < 3; r++) {
        assert_true(fabs(at[r]) < 1e-9);
        for (size_t k = 0; k < 3; k++) assert_true(M[4 * r + k] == (r == k ? 1.0 : 0.0));
    }
    apsm_alignment_free(&a);
    close_cohort(&c);
}

static void check_equal(const apsm_alignment *a, const apsm_alignment *b)
{
    assert_int_equal(a->template_index, b->template_index);
    assert_memory_equal(a->M, b->M, 16 * a->n * sizeof *a->M);
    assert_memory_equal(a->residual, b->residual, a->n * sizeof *a->residual);
    assert_memory_equal(a->mirror_ratio, b->mirror_ratio, a->n * sizeof *a->mirror_ratio);
    assert_memory_equal(a->runner_up_ratio, b->runner_up_ratio, a->n * sizeof *a->runner_up_ratio);
    assert_memory_equal(a->mirrored, b->mirrored, a->n * sizeof *a->mirrored);
}

/* Turns the list of faces by one and rounds coordinates to float32 in a unit of 1/scale mm. */
static void redraw(cohort *c, double scale)
{
    for (size_t i = 0; i < c->n; i++) {
        apsm_mesh *mesh = &c->local[i];
        uint32_t *F = mesh->F, first[3] = { F[0], F[1], F[2] };
        memmove(F, F + 3, 3 * (mesh->nf - 1) * sizeof *F);
        memcpy(F + 3 * (mesh->nf - 1), first, sizeof first);
        for (size_t x = 0; x < 3 * mesh->nv; x++)
            mesh->V[x] = (double)(float)(scale * mesh->V[x]) / scale;
    }
}

/* The order of faces decides which points are drawn, and rounding which of many ways a registration
 * goes: the poses where they end are those of the surfaces. */
static void poses_belong_to_the_surfaces(void **state)
{
    (void)state;
    cohort c, d;
    const apsm_align_options opt = apsm_align_defaults();
    open_cohort(&c, 5);
    open_cohort(&d, 5);
    redraw(&d, 1000.0);
    apsm_alignment a = run(&c, &opt, 2, NULL), b = run(&d, &opt, 2, NULL);
    assert_int_equal(a.template_index, b.template_index);
    for (size_t i = 0; i < c.n; i++) {
        const double apart = align_difference(c.mesh[i], a.M + 16 * i, b.M + 16 * i);
        if (!(apart < 0.001)) fail_msg("shape %zu: %g mm apart", i, apart);
    }
    apsm_alignment_free(&a);
    apsm_alignment_free(&b);
    close_cohort(&c);
    close_cohort(&d);
}

static void threads_do_not_matter(void **state)
{
    (void)state;
    cohort c;
    const apsm_align_options opt = apsm_align_defaults();
    open_cohort(&c, 5);
    apsm_alignment one = run(&c, &opt, 1, NULL), three = run(&c, &opt, 3, NULL);
    check_equal(&one, &three);
    apsm_alignment_free(&one);
    apsm_alignment_free(&three);
    close_cohort(&c);
}

/* Beyond 32 shapes the template is chosen by lot, but from the middle of the range. */
static void large_cohort_is_aligned_too(void **state)
{
    (void)state;
    cohort c;
    apsm_align_options opt = apsm_align_defaults();
    opt.mirror_check = APSM_MIRROR_OFF;
    opt.points = 100;
    open_cohort(&c, MOST);
    apsm_alignment a = run(&c, &opt, 2, NULL);
    if (!(a.template_index >= 16 && a.template_index <= 23))
        fail_msg("template %zu", a.template_index);
    check_aligned(&c, &a, 4.0);
    for (size_t i = 0; i < c.n; i++) assert_true(isinf(a.mirror_ratio[i]));
    apsm_alignment_free(&a);
    close_cohort(&c);
}

static void mirrored_shapes_are_found_and_fixed(void **state)
{
    (void)state;
    cohort c;
    apsm_align_options opt = apsm_align_defaults();
    open_cohort(&c, 6);
    reflect_shape(&c, 1);
    reflect_shape(&c, 4);
    for (int fix = 0; fix < 2; fix++) {
        counts n = { 0 };
        opt.mirror_check = fix ? APSM_MIRROR_FIX : APSM_MIRROR_WARN;
        apsm_alignment a = run(&c, &opt, 2, &n);
        for (size_t i = 0; i < 6; i++) {
            const bool is = i == 1 || i == 4;
            assert_int_equal(a.mirrored[i], is);
            assert_true((apsm_affine_det(a.M + 16 * i) < 0.0) == (fix && is));
        }
        assert_int_equal(fix ? n.infos : n.warnings, 2);
        assert_false(a.mirrored[a.template_index]);
        if (fix) check_aligned(&c, &a, 4.0);
        apsm_alignment_free(&a);
    }
    close_cohort(&c);
}

/* The shape of median area serves as provisional template; when it is the mirrored one, all
 * others look mirrored, and the verdict is turned round.  A given template is always right. */
static void majority_decides_who_is_mirrored(void **state)
{
    (void)state;
    cohort c;
    apsm_align_options opt = apsm_align_defaults();
    opt.mirror_check = APSM_MIRROR_FIX;
    open_cohort(&c, 3);
    for (size_t odd = 0; odd < 3; odd++) {
        reflect_shape(&c, odd);
        opt.template_index = APSM_TEMPLATE_AUTO;
        apsm_alignment a = run(&c, &opt, 2, NULL);
        for (size_t i = 0; i < 3; i++) assert_int_equal(a.mirrored[i], i == odd);
        assert_int_not_equal(a.template_index, odd);
        check_aligned(&c, &a, 8.0);
        apsm_alignment_free(&a);
        opt.template_index = odd;
        a = run(&c, &opt, 2, NULL);
        for (size_t i = 0; i < 3; i++) assert_int_equal(a.mirrored[i], i != odd);
        assert_int_equal(a.template_index, odd);
        check_aligned(&c, &a, 8.0);
        apsm_alignment_free(&a);
        reflect_shape(&c, odd);
    }
    close_cohort(&c);
}

static void sizes_are_removed_on_request(void **state)
{
    (void)state;
    cohort c;
    apsm_align_options opt = apsm_align_defaults();
    open_cohort(&c, 5);
    for (size_t i = 0; i < 5; i++) {
        double S[16];
        apsm_affine_identity(S);
        align_scale_pose(pow(2.0, (double)i - 1.0), S);
        apsm_mesh_transform(&c.local[i], S);
        apsm_affine_multiply(S, c.pose[i], c.pose[i]);
    }
    opt.align = APSM_ALIGN_SIMILARITY;
    apsm_alignment a = run(&c, &opt, 2, NULL);
    assert_int_equal(a.template_index, 2);
    for (size_t i = 0; i < 5; i++) {
        const double scale = cbrt(apsm_affine_det(a.M + 16 * i)) * pow(2.0, (double)i - 2.0);
        if (!(fabs(scale - 1.0) < 0.05)) fail_msg("shape %zu: scale %g", i, scale);
    }
    check_aligned(&c, &a, 2.0 * 4.0);
    apsm_alignment_free(&a);
    close_cohort(&c);
}

static void aligned_input_stays(void **state)
{
    (void)state;
    cohort c;
    apsm_align_options opt = apsm_align_defaults();
    opt.align = APSM_ALIGN_NONE;
    open_cohort(&c, 5);
    for (size_t i = 0; i < 5; i++) {
        double back[16];
        assert_int_equal(apsm_affine_invert(c.pose[i], back), APSM_OK);
        apsm_mesh_transform(&c.local[i], back);
    }
    apsm_alignment a = run(&c, &opt, 2, NULL);
    assert_int_equal(a.template_index, 2);
    for (size_t i = 0; i < 5 * 16; i++) assert_true(a.M[i] == (i % 16 % 5 == 0 ? 1.0 : 0.0));
    for (size_t i = 0; i < 5; i++) assert_true((a.residual[i] > 0.0) == (i != 2));
    apsm_alignment_free(&a);
    close_cohort(&c);
}

/* What lies beyond x > at is pressed into that plane: a flat end, as at the edge of an image. */
static void cut_off(apsm_mesh *mesh, double at)
{
    for (size_t v = 0; v < mesh->nv; v++) mesh->V[3 * v] = fmin(mesh->V[3 * v], at);
}

static void cut_shapes_are_aligned_by_what_they_share(void **state)
{
    (void)state;
    cohort c = { .n = 7 };
    counts n = { 0 };
    const char *names[7] = { "a", "b", "c", "d", "e", "f", "g" };
    const apsm_align_options opt = apsm_align_defaults();
    for (size_t i = 0; i < c.n; i++) {
        c.local[i] = align_shape(4, 60, 20, 14, 0.2, 0.5); /* x from -48 to 72 */
        if (i != 2) cut_off(&c.local[i], 15 + 6 * (double)i);
        align_random_pose(i, 200.0, c.pose[i]);
        apsm_mesh_transform(&c.local[i], c.pose[i]);
        c.mesh[i] = &c.local[i];
    }
    apsm_alignment a;
    apsm_context *ctx = apsm_context_new();
    if (!ctx) abort();
    apsm_context_set_log(ctx, count_lines, &n);
    assert_int_equal(apsm_align_cohort(ctx, c.n, c.mesh, names, &opt, &a), APSM_OK);
    check_aligned(&c, &a, 0.5);
    assert_int_equal(n.warnings, 0);
    assert_int_equal(n.infos, 1);
    apsm_context_free(ctx);
    apsm_alignment_free(&a);
    close_cohort(&c);
}

/* An ellipsoid but for 4 % of chance: each of its four poses fits about as well as the others. */
static apsm_mesh nearly_symmetric(size_t i)
{
    apsm_random rng = apsm_random_stream(5, APSM_STREAM_TEST, i, 0);
    apsm_mesh mesh = shape_icosphere(3);
    double k[4];
    for (size_t c = 0; c < 4; c++) k[c] = 0.04 * apsm_random_normal(&rng);
    for (size_t v = 0; v < mesh.nv; v++) {
        double *x = mesh.V + 3 * v;
        const double r =
            1 + k[0] * x[0] + k[1] * x[1] + k[2] * x[2] + 3 * k[3] * x[0] * x[1] * x[2];
        shape_set3(x, 27 * r * x[0], 20 * r * x[1], 14 * r * x[2]);
    }
    return mesh;
}

/* Turns by up to 25 degrees; the same for all shapes and in any direction if far. */
static void orient(size_t i, bool far, double M[16])
{
    double A[9], R[9];
    align_random_pose(far ? i : 0, 50.0, M);
    apsm_random rng = apsm_random_stream(6, APSM_STREAM_TEST, i, 0);
    for (size_t k = 0; k < 9; k++) A[k] = M[4 * (k / 3) + k % 3] + 0.1 * apsm_random_normal(&rng);
    apsm_nearest_rotation(A, R);
    for (size_t k = 0; k < 9; k++) M[4 * (k / 3) + k % 3] = R[k];
}

static void orientation_of_the_inputs_decides_between_equal_poses(void **state)
{
    (void)state;
    apsm_align_options opt = apsm_align_defaults();
    opt.mirror_check = APSM_MIRROR_OFF;
    for (int far = 0; far < 2; far++) {
        cohort c = { .n = 12 };
        counts n = { 0 };
        for (size_t i = 0; i < c.n; i++) {
            c.local[i] = nearly_symmetric(i);
            orient(i, far, c.pose[i]);
            apsm_mesh_transform(&c.local[i], c.pose[i]);
            c.mesh[i] = &c.local[i];
        }
        apsm_alignment a = run(&c, &opt, 2, &n);
        if (!far) check_aligned(&c, &a, 8.0);  /* other poses are off by up to 54 */
        assert_int_equal(n.warnings > 0, far); /* then nobody can know */
        apsm_alignment_free(&a);
        close_cohort(&c);
    }
}

/* Of nine shapes in one orientation the one of median area, the provisional template, is turned by
 * 180 degrees: the others share theirs, and it is the one that is told. */
static void a_turned_template_is_told_from_the_others(void **state)
{
    (void)state;
    enum { N = 9 };
    apsm_align_options opt = apsm_align_defaults();
    cohort c = { .n = N };
    size_t median = 0;
    for (size_t i = 0; i < N; i++) {
        c.local[i] = align_bone(0.15 + 0.03 * (double)i, 0.5);
        c.mesh[i] = &c.local[i];
    }
    for (size_t i = 0; i < N; i++) {
        size_t less = 0;
        for (size_t k = 0; k < N; k++)
            less += apsm_mesh_area(c.mesh[k]) < apsm_mesh_area(c.mesh[i]);
        if (less == N / 2) median = i;
        orient(i, false, c.pose[i]);
    }
    for (size_t k = 0; k < 12; k++) /* the half turn about the shape's z comes first */
        if (k % 4 < 2) c.pose[median][k] *= -1;
    for (size_t i = 0; i < N; i++) apsm_mesh_transform(&c.local[i], c.pose[i]);
    apsm_alignment a = run(&c, &opt, 2, NULL);
    check_aligned(&c, &a, 5.0);
    assert_true(a.oriented);
    for (size_t i = 0; i < N; i++) assert_int_equal(a.sought[i], i == median);
    apsm_alignment_free(&a);
    close_cohort(&c);
}

/* Ten shapes of a synthetic anatomy, all in the frame of their images. */
static void open_anatomy(cohort *c, const char *kind)
{
    const anatomy_spread as_they_come = { .strength = 1 };
    apsm_context *ctx = apsm_context_new();
    if (!ctx) abort();
    c->n = 10;
    for (size_t i = 0; i < c->n; i++) {
        const anatomy_map map = anatomy_draw(anatomy_find(kind), 0, i, &as_they_come);
        assert_int_equal(anatomy_template(ctx, map.kind, 2, -INFINITY, &c->local[i]), APSM_OK);
        anatomy_apply(&map, &c->local[i]);
        apsm_affine_identity(c->pose[i]);
        c->mesh[i] = &c->local[i];
    }
    apsm_context_free(ctx);
}

/* A cup and a thin shaft of which one end is like the other: sections differ from circles in ways
 * of each shape's own, so that the best fit of two surfaces may be turned in any way. */
static void shapes_do_not_turn_where_surfaces_hardly_say(void **state)
{
    (void)state;
    const char *const kind[] = { "myocardium", "fibula" };
    apsm_align_options opt = apsm_align_defaults();
    opt.mirror_check = APSM_MIRROR_OFF;
    for (int k = 0; k < 2; k++) {
        cohort c;
        open_anatomy(&c, kind[k]);
        apsm_alignment a = run(&c, &opt, 2, NULL);
        for (size_t i = 0; i < c.n; i++) {
            const double *M = a.M + 16 * i, cosine = 0.5 * (M[0] + M[5] + M[10] - 1);
            if (!(cosine > cos(30 * M_PI / 180)))
                fail_msg("%s %zu is turned by %g degrees", kind[k], i, acos(cosine) * 180 / M_PI);
        }
        apsm_alignment_free(&a);
        close_cohort(&c);
    }
}

static void one_shape_is_a_cohort(void **state)
{
    (void)state;
    cohort c;
    const apsm_align_options opt = apsm_align_defaults();
    open_cohort(&c, 2);
    close_cohort(&c);
    c.n = 1;
    c.local[0] = align_bone(0, 0.5);
    apsm_alignment a = run(&c, &opt, 1, NULL);
    assert_int_equal(a.template_index, 0);
    assert_true(a.residual[0] == 0.0);
    apsm_alignment_free(&a);
    close_cohort(&c);
}

static void mistakes_are_named(void **state)
{
    (void)state;
    cohort c;
    apsm_alignment a;
    apsm_align_options opt = apsm_align_defaults();
    const char *names[3] = { "a.ply", "b.ply", "c.ply" };
    apsm_context *ctx = apsm_context_new();
    if (!ctx) abort();
    open_cohort(&c, 3);
    assert_int_equal(apsm_align_cohort(ctx, 0, c.mesh, names, &opt, &a), APSM_ERR_ARG);
    opt.template_index = 3;
    assert_int_equal(apsm_align_cohort(ctx, 3, c.mesh, names, &opt, &a), APSM_ERR_ARG);
    opt = apsm_align_defaults();
    opt.trim = 1.0;
    assert_int_equal(apsm_align_cohort(ctx, 3, c.mesh, names, &opt, &a), APSM_ERR_ARG);
    opt = apsm_align_defaults();
    opt.points = 10;
    assert_int_equal(apsm_align_cohort(ctx, 3, c.mesh, names, &opt, &a), APSM_ERR_ARG);
    opt = apsm_align_defaults();
    for (size_t i = 0; i < 3 * c.local[1].nv; i++) c.local[1].V[i] = 0.0;
    assert_int_equal(apsm_align_cohort(ctx, 3, c.mesh, names, &opt, &a), APSM_ERR_GEOMETRY);
    assert_non_null(strstr(apsm_error_text(ctx), "b.ply"));
    assert_null(a.M);
    apsm_context_free(ctx);
    close_cohort(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(central_shape_becomes_the_template),
        cmocka_unit_test(poses_belong_to_the_surfaces),
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(large_cohort_is_aligned_too),
        cmocka_unit_test(mirrored_shapes_are_found_and_fixed),
        cmocka_unit_test(majority_decides_who_is_mirrored),
        cmocka_unit_test(sizes_are_removed_on_request),
        cmocka_unit_test(aligned_input_stays),
        cmocka_unit_test(cut_shapes_are_aligned_by_what_they_share),
        cmocka_unit_test(orientation_of_the_inputs_decides_between_equal_poses),
        cmocka_unit_test(a_turned_template_is_told_from_the_others),
        cmocka_unit_test(shapes_do_not_turn_where_surfaces_hardly_say),
        cmocka_unit_test(one_shape_is_a_cohort),
        cmocka_unit_test(mistakes_are_named),
    };
    return cmocka_run_group_tests_name("align_cohort", tests, NULL, NULL);
}
