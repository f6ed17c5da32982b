/* Segmentations of known bodies, voxels long and short, mirrored and turned. */
#include "cmocka_all.h"

#include "geometry/bvh.h"
#include "geometry/topology.h"
#include "groom/groom.h"
#include "groom/handles.h"
#include "groom/mask.h"
#include "solids.h"

typedef struct outcome {
    double rms, most;   /* of the faces' middles from the true surface */
    double volume;      /* relative to the mask's */
    double volume_true; /* signed volume of the mesh */
    apsm_groom_report report;
} outcome;

static outcome judge(solid_fn f, const apsm_mesh *mesh, const apsm_groom_report *r)
{
    outcome o = { .report = *r, .volume_true = apsm_mesh_volume(mesh) };
    o.volume = o.volume_true / r->mask_volume - 1.0;
    double sum = 0.0;
    for (size_t i = 0; i < mesh->nf; i++) {
        double x[3];
        const apsm_surface_point p = { (uint32_t)i, { 1.0 / 3, 1.0 / 3, 1.0 / 3 } };
        apsm_surface_position(mesh, &p, x);
        const double d = fabs(f(x));
        sum += d * d;
        o.most = fmax(o.most, d);
    }
    o.rms = sqrt(sum / (double)mesh->nf);
    return o;
}

static outcome groomed(solid_fn f, double slice, int mirrored, uint64_t seed)
{
    apsm_context *ctx = apsm_context_new();
    apsm_groom_options opt = apsm_groom_defaults();
    apsm_groom_report r;
    apsm_mesh mesh;
    apsm_mesh_defects d;
    opt.remesh = false;
    apsm_volume v = solid_mask(f, (const double[3]){ 1, 1, slice }, mirrored, seed);
    if (apsm_groom_segmentation(ctx, "mask", &v, &opt, &mesh, &r) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    assert_ok(apsm_mesh_inspect(&mesh, &d));
    assert_true(apsm_mesh_is_closed_manifold(&d));
    const outcome o = judge(f, &mesh, &r);
    apsm_mesh_free(&mesh);
    apsm_volume_free(&v);
    apsm_context_free(ctx);
    return o;
}

/* Bounds in voxels: about 1.3 times what is measured over six poses. */
static void surfaces_are_smooth_and_true(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        solid_fn f;
        long genus;
        double slice, rms, most;
    } cases[] = {
        { "ball", solid_ball12, 0, 1, 0.07, 0.4 },
        { "ball", solid_ball12, 0, 3, 0.18, 1.0 },
        { "ball", solid_ball12, 0, 5, 0.40, 2.0 },
        { "small ball", solid_ball4, 0, 1, 0.13, 0.4 },
        { "ellipsoid", solid_ellipsoid, 0, 1, 0.15, 0.75 },
        { "torus", solid_torus, 1, 1, 0.10, 0.4 },
        { "torus", solid_torus, 1, 3, 0.23, 1.0 },
        { "plate", solid_plate1, 0, 1, 0.23, 1.0 },
        { "plate", solid_plate3, 0, 3, 0.52, 2.0 },
        { "bone", solid_bone, 0, 1, 0.20, 1.1 },
        { "bone", solid_bone, 0, 3, 0.37, 1.8 },
        { "tip", solid_tip, 0, 1, 0.17, 1.0 },
    };
    int failed = 0;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (int mirrored = 0; mirrored < 2; mirrored++) {
            const outcome o = groomed(cases[i].f, cases[i].slice, mirrored, 40 + i);
            if (!(o.rms <= cases[i].rms && o.most <= cases[i].most && o.volume_true > 0.0 &&
                  fabs(o.volume) <= 0.01 && o.report.genus == cases[i].genus))
                failed++,
                    print_message("%s, slices %g: rms %g, largest %g, volume %+g, genus %ld\n",
                                  cases[i].name, cases[i].slice, o.rms, o.most, o.volume,
                                  o.report.genus);
        }
    assert_int_equal(failed, 0);
}

/* A box of voxels [lo, hi] set to label in an image of n^3. */
static void set_box(apsm_volume *v, const size_t lo[3], const size_t hi[3], int32_t label)
{
    for (size_t z = lo[2]; z <= hi[2]; z++)
        for (size_t y = lo[1]; y <= hi[1]; y++)
            for (size_t x = lo[0]; x <= hi[0]; x++)
                v->label[x + v->n[0] * (y + v->n[1] * z)] = label;
}

static apsm_volume image(size_t n)
{
    apsm_volume v = { .n = { n, n, n },
                      .spacing = { 1, 1, 1 },
                      .direction = { 1, 0, 0, 0, 1, 0, 0, 0, 1 } };
    v.label = calloc(n * n * n, sizeof *v.label);
    if (!v.label) abort();
    return v;
}

static apsm_groom_report cleaned(apsm_volume *v, const apsm_groom_options *opt, double *volume)
{
    apsm_context *ctx = apsm_context_new();
    apsm_groom_report r;
    apsm_mesh mesh;
    if (apsm_groom_segmentation(ctx, "mask", v, opt, &mesh, &r) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    *volume = apsm_mesh_volume(&mesh);
    apsm_mesh_free(&mesh);
    apsm_volume_free(v);
    apsm_context_free(ctx);
    return r;
}

static void cavities_strays_and_borders_are_reported(void **state)
{
    (void)state;
    double volume;
    apsm_groom_options opt = apsm_groom_defaults();
    opt.remesh_options.faces = 2000;
    apsm_volume v = image(30);
    set_box(&v, (const size_t[3]){ 8, 0, 8 }, (const size_t[3]){ 19, 11, 19 }, 3);
    set_box(&v, (const size_t[3]){ 12, 4, 12 }, (const size_t[3]){ 14, 6, 14 }, 0);
    set_box(&v, (const size_t[3]){ 26, 26, 26 }, (const size_t[3]){ 27, 26, 26 }, 3);
    const apsm_groom_report r = cleaned(&v, &opt, &volume);
    assert_int_equal(r.filled_voxels, 27);
    assert_int_equal(r.voxels, 12 * 12 * 12);
    assert_int_equal(r.dropped_parts, 1);
    assert_int_equal(r.dropped_voxels, 2);
    assert_int_equal(r.border, 4);
    assert_true(r.border_normal[2][1] == -1.0 && r.border_normal[3][1] == 0.0);
    assert_near(volume, 1728.0, 17.0);
}

/* Inside or not, by the solid that the surface is: dice and departure by definition. */
static void agreement_is_what_it_says(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    for (uint64_t seed = 1; seed < 5; seed++) {
        apsm_volume v = solid_mask(solid_ellipsoid, (const double[3]){ 1, 1, 2 }, seed % 2, seed);
        apsm_groom_report r;
        apsm_mesh mesh;
        apsm_bvh *tree;
        double M[16], most = 0;
        size_t both = 0, all = 0;
        assert_ok(apsm_groom_segmentation(ctx, "mask", &v, NULL, &mesh, &r));
        assert_ok(apsm_bvh_build(&mesh, &tree));
        apsm_volume_index_to_lps(&v, M);
        for (size_t i = 0; i < v.n[0] * v.n[1] * v.n[2]; i++) {
            const size_t row = i / v.n[0];
            double x[3] = { (double)(i % v.n[0]), (double)(row % v.n[1]), (double)(row / v.n[1]) };
            apsm_closest hit;
            apsm_affine_apply(M, 1, x, x);
            const double d = apsm_bvh_signed_distance(tree, x, &hit);
            const bool a = v.label[i] != 0, b = d < 0;
            both += a && b;
            all += (size_t)a + b;
            if (a != b) most = fmax(most, fabs(d));
        }
        assert_near(r.dice, 2 * (double)both / (double)all, 1e-4);
        assert_near(r.departure, most, 1e-4);
        apsm_bvh_free(tree);
        apsm_mesh_free(&mesh);
        apsm_volume_free(&v);
    }
    apsm_context_free(ctx);
}

/* A ball of radius 12 with a dent and k tunnels of radius 1.5 along z, off the middle. */
static apsm_volume pierced(int k)
{
    apsm_volume v = solid_mask(solid_ball12, (const double[3]){ 1, 1, 1 }, 0, 7);
    double M[16], inverse[16];
    apsm_volume_index_to_lps(&v, M);
    assert_ok(apsm_affine_invert(M, inverse));
    for (size_t i = 0; i < v.n[0] * v.n[1] * v.n[2]; i++) {
        const size_t row = i / v.n[0];
        double x[3] = { (double)(i % v.n[0]), (double)(row % v.n[1]), (double)(row / v.n[1]) };
        apsm_affine_apply(M, 1, x, x);
        for (int t = 0; t < k; t++)
            if (hypot(x[0] - 6 * cos(2.1 * t), x[1] - 6 * sin(2.1 * t)) < 1.5) v.label[i] = 0;
    }
    return v;
}

/* The ball with a rod along z. */
static apsm_volume spiked(void)
{
    apsm_volume v = solid_mask(solid_ball12, (const double[3]){ 1, 1, 1 }, 0, 7);
    double M[16];
    apsm_volume_index_to_lps(&v, M);
    for (size_t i = 0; i < v.n[0] * v.n[1] * v.n[2]; i++) {
        const size_t row = i / v.n[0];
        double x[3] = { (double)(i % v.n[0]), (double)(row % v.n[1]), (double)(row / v.n[1]) };
        apsm_affine_apply(M, 1, x, x);
        if (hypot(x[0], x[1]) < 1.5 && x[2] > 0 && x[2] < 20) v.label[i] = 1;
    }
    return v;
}

/* The ball with a rod of radius 1.5 that sticks out by 8: opened by 3 in either unit, it is off;
 * and a closing given as a length does what the share of that length does. */
static void radii_are_shares_or_lengths(void **state)
{
    (void)state;
    apsm_groom_options opt = apsm_groom_defaults();
    apsm_context *const ctx = apsm_context_new();
    double volume, same_volume;
    const double size = cbrt(4.0 / 3.0 * 3.14159265358979 * 12 * 12 * 12);
    opt.remesh_options.faces = 3000;
    for (int in_mm = 0; in_mm < 2; in_mm++) {
        apsm_volume v = spiked();
        opt.opening = in_mm ? 0.0 : 3.0 / size;
        opt.opening_length = in_mm ? 3.0 : 0.0;
        const apsm_groom_report r = cleaned(&v, &opt, &volume);
        assert_near(r.opening, 3.0, 0.1);
        assert_true(r.opened_voxels > 30);
        assert_near(volume, 4.0 / 3.0 * 3.14159265358979 * 12 * 12 * 12, 0.04 * volume);
    }
    opt.opening_length = 100.0;
    apsm_volume gone = spiked();
    apsm_mesh mesh;
    assert_int_equal(apsm_groom_segmentation(ctx, "gone", &gone, &opt, &mesh, NULL),
                     APSM_ERR_GEOMETRY);
    assert_non_null(strstr(apsm_error_text(ctx), "leaves nothing"));
    apsm_volume_free(&gone);
    opt = apsm_groom_defaults();
    apsm_volume a = pierced(2), b = pierced(2);
    opt.closing_length = 2.5;
    const apsm_groom_report r = cleaned(&a, &opt, &volume);
    opt.closing_length = 0.0;
    opt.closing = 2.5 / mask_size(&b, r.voxels - r.closed_voxels);
    const apsm_groom_report s = cleaned(&b, &opt, &same_volume);
    assert_true(r.genus == 0 && s.genus == 0 && r.closed_voxels == s.closed_voxels);
    assert_near(volume, same_volume, 1e-9 * volume);
    apsm_context_free(ctx);
}

static void handles_of_cohorts_are_told_apart(void **state)
{
    (void)state;
    long common, scratch[20];
    const long kidneys[] = { 7, 7, 8, 1, 4, 4, 1, 16, 5, 14 }, none[10] = { 0 };
    const long vertebrae[] = { 1, 1, 1, 3, 1, 1, 0, 1, 1, 1 },
               wide[] = { 1, 1, 0, 1, 1, 1, 0, 1, 1, 1 };
    const long pelves[] = { 10, 9, 12, 14, 10, 8, 10, 13, 11, 10 },
               large[] = { 2, 2, 2, 2, 2, 2, 2, 2, 2, 2 };
    const long few[] = { 0, 1, 0, 0, 2, 0, 0, 9, 0, 0 };
    assert_int_equal(handles_judge(10, kidneys, none, &common, scratch), HANDLES_SINUS);
    assert_int_equal(handles_judge(10, vertebrae, wide, &common, scratch), HANDLES_ANATOMY);
    assert_int_equal(common, 1);
    /* Handles that are too wide to be mended are no sinus. */
    assert_int_equal(handles_judge(10, pelves, large, &common, scratch), HANDLES_DEBRIS);
    assert_int_equal(handles_judge(10, few, none, &common, scratch), HANDLES_DEBRIS);
    assert_int_equal(handles_judge(10, none, none, &common, scratch), HANDLES_DEBRIS);
    assert_int_equal(handles_judge(3, kidneys, none, &common, scratch), HANDLES_DEBRIS);
    assert_int_equal(handles_judge(0, NULL, NULL, &common, scratch), HANDLES_DEBRIS);
}

/* Thin tunnels go, whatever their number; of a torus the hole, wide as it is, stays; and nothing is
 * filled where there is no handle. */
static void tunnels_are_closed_and_anatomy_stays(void **state)
{
    (void)state;
    apsm_groom_options opt = apsm_groom_defaults();
    opt.remesh_options.faces = 3000;
    double volume;
    const double ball = 4.0 / 3.0 * 3.14159265358979 * 12 * 12 * 12;
    for (int k = 1; k <= 3; k++) {
        apsm_volume v = pierced(k), same = pierced(k);
        opt.closing = -1.0;
        const apsm_groom_report r = cleaned(&v, &opt, &volume);
        assert_int_equal(r.genus, 0);
        assert_int_equal(r.handles_before, k);
        assert_true(r.closing > 1.0 && r.closing < 2.6 && r.closed_voxels > 0);
        assert_near(volume, ball, 0.03 * ball);
        opt.closing = 0.0;
        const apsm_groom_report open = cleaned(&same, &opt, &volume);
        assert_int_equal(open.genus, k);
        assert_int_equal(open.closed_voxels, 0);
    }
    opt.closing = -1.0;
    apsm_volume torus = solid_mask(solid_torus, (const double[3]){ 1, 1, 1 }, 0, 3);
    const apsm_groom_report r = cleaned(&torus, &opt, &volume);
    assert_true(r.genus == 1 && r.closing == 0.0 && r.closed_voxels == 0);
    apsm_volume whole = solid_mask(solid_ellipsoid, (const double[3]){ 1, 1, 3 }, 0, 3);
    const apsm_groom_report e = cleaned(&whole, &opt, &volume);
    assert_true(e.genus == 0 && e.closed_voxels == 0);
}

/* Single voxels and a ridge on a block go; a fin of one voxel and a pin stay. */
static void raggedness_is_smoothed_and_fins_are_kept(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_groom_options opt = apsm_groom_defaults();
    apsm_volume v = image(40);
    apsm_mesh mesh;
    double lo[3], hi[3];
    opt.remesh = false;
    set_box(&v, (const size_t[3]){ 10, 10, 10 }, (const size_t[3]){ 25, 25, 25 }, 1);
    for (size_t k = 12; k < 24; k += 3)
        set_box(&v, (const size_t[3]){ k, 26, k }, (const size_t[3]){ k, 26, k }, 1);
    set_box(&v, (const size_t[3]){ 14, 14, 9 }, (const size_t[3]){ 20, 14, 9 }, 1);
    set_box(&v, (const size_t[3]){ 12, 17, 26 }, (const size_t[3]){ 22, 17, 33 }, 1);
    set_box(&v, (const size_t[3]){ 26, 18, 18 }, (const size_t[3]){ 37, 19, 19 }, 1);
    assert_ok(apsm_groom_segmentation(ctx, "mask", &v, &opt, &mesh, NULL));
    apsm_mesh_bounds(&mesh, lo, hi);
    /* A voxel kept would stand out by about 1, and single ones have to go below their centre; a
     * ridge of seven is lowered by its flanks only. */
    assert_near(hi[1], 25.5, 0.49);
    assert_near(lo[2], 9.5, 0.60);
    assert_true(hi[2] > 33.0);
    assert_true(hi[0] > 37.0);
    apsm_mesh_free(&mesh);
    apsm_volume_free(&v);
    apsm_context_free(ctx);
}

static void corner_contact_does_not_lose_a_sheet(void **state)
{
    (void)state;
    double volume;
    apsm_groom_options opt = apsm_groom_defaults();
    opt.remesh = false;
    apsm_volume v = image(30);
    for (size_t x = 4; x < 26; x++) /* a flight of steps, one voxel thick, joined by edges */
        set_box(&v, (const size_t[3]){ x, 4, x }, (const size_t[3]){ x, 25, x }, 1);
    const apsm_groom_report r = cleaned(&v, &opt, &volume);
    assert_int_equal(r.dropped_voxels, 0);
    assert_near(volume, 484.0, 5.0);
}

static void unusable_labels_are_refused(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_mesh mesh;
    apsm_volume v = image(20);
    assert_int_equal(apsm_groom_segmentation(ctx, "m", &v, NULL, &mesh, NULL), APSM_ERR_GEOMETRY);
    assert_non_null(strstr(apsm_error_text(ctx), "no voxel"));
    set_box(&v, (const size_t[3]){ 2, 2, 2 }, (const size_t[3]){ 6, 6, 6 }, 1);
    set_box(&v, (const size_t[3]){ 12, 2, 2 }, (const size_t[3]){ 16, 6, 6 }, 1);
    assert_int_equal(apsm_groom_segmentation(ctx, "m", &v, NULL, &mesh, NULL), APSM_ERR_GEOMETRY);
    assert_non_null(strstr(apsm_error_text(ctx), "separate parts"));
    apsm_volume_free(&v);
    apsm_context_free(ctx);
}

/* Slices that slip sideways, as from a tilted gantry: the surface has the volume of the voxels. */
static void sheared_grid_keeps_the_volume(void **state)
{
    (void)state;
    const double tilt = 20 * M_PI / 180;
    apsm_context *ctx = apsm_context_new();
    apsm_groom_options opt = apsm_groom_defaults();
    apsm_groom_report r;
    apsm_mesh mesh;
    opt.remesh = false;
    apsm_volume v = solid_mask(solid_ball12, (const double[3]){ 1, 1, 1 }, 0, 7);
    for (int c = 0; c < 3; c++)
        v.direction[3 * c + 2] =
            cos(tilt) * v.direction[3 * c + 2] + sin(tilt) * v.direction[3 * c + 1];
    assert_ok(apsm_groom_segmentation(ctx, "mask", &v, &opt, &mesh, &r));
    const double wanted = (double)r.voxels * cos(tilt);
    if (!(fabs(apsm_mesh_volume(&mesh) / wanted - 1.0) < 0.01))
        fail_msg("volume %g, not %g", apsm_mesh_volume(&mesh), wanted);
    apsm_mesh_free(&mesh);
    apsm_volume_free(&v);
    apsm_context_free(ctx);
}

static apsm_mesh remeshed(apsm_context *ctx, const apsm_volume *v, apsm_groom_report *r)
{
    apsm_mesh mesh;
    apsm_groom_options opt = apsm_groom_defaults();
    opt.remesh_options.faces = 1500;
    if (apsm_groom_segmentation(ctx, "mask", v, &opt, &mesh, r) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    return mesh;
}

/* Lengths that are equal on a grid, and there are many, are equal in every unit: the triangles are
 * the same.  Headers are in single precision. */
static void another_unit_gives_the_same_triangles(void **state)
{
    (void)state;
    static const double scales[] = { 1000, 0.001, 25.4 };
    apsm_context *ctx = apsm_context_new();
    const double voxels[] = { 1, 0.8, 0.3 };
    for (size_t k = 0; k < 3; k++) {
        const double voxel = voxels[k];
        apsm_groom_report r[2];
        apsm_volume v =
            solid_mask(solid_bone, (const double[3]){ voxel, voxel, 2 * voxel }, 0, 50 + k);
        apsm_mesh one = remeshed(ctx, &v, &r[0]);
        for (int c = 0; c < 3; c++) {
            v.spacing[c] = (double)(float)((float)v.spacing[c] * (float)scales[k]);
            v.origin[c] = (double)(float)((float)v.origin[c] * (float)scales[k]);
        }
        apsm_mesh two = remeshed(ctx, &v, &r[1]);
        assert_int_equal(one.nv, two.nv);
        assert_int_equal(one.nf, two.nf);
        assert_memory_equal(one.F, two.F, 3 * one.nf * sizeof *one.F);
        for (size_t x = 0; x < 3 * one.nv; x++)
            assert_true(fabs(two.V[x] / scales[k] - one.V[x]) < 1e-4 * voxel);
        const double s = scales[k];
        assert_true(fabs(r[1].remesh.edge / s / r[0].remesh.edge - 1) < 1e-6);
        assert_true(fabs(r[1].mask_volume / (s * s * s) / r[0].mask_volume - 1) < 1e-6);
        apsm_mesh_free(&one);
        apsm_mesh_free(&two);
        apsm_volume_free(&v);
    }
    apsm_context_free(ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(surfaces_are_smooth_and_true),
        cmocka_unit_test(tunnels_are_closed_and_anatomy_stays),
        cmocka_unit_test(radii_are_shares_or_lengths),
        cmocka_unit_test(handles_of_cohorts_are_told_apart),
        cmocka_unit_test(agreement_is_what_it_says),
        cmocka_unit_test(sheared_grid_keeps_the_volume),
        cmocka_unit_test(cavities_strays_and_borders_are_reported),
        cmocka_unit_test(raggedness_is_smoothed_and_fins_are_kept),
        cmocka_unit_test(corner_contact_does_not_lose_a_sheet),
        cmocka_unit_test(unusable_labels_are_refused),
        cmocka_unit_test(another_unit_gives_the_same_triangles),
    };
    return cmocka_run_group_tests_name("segmentation", tests, NULL, NULL);
}
