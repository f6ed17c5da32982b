/* A job in memory: arrays in and out, without a file, to the last bit what a job in a folder
 * gives for the same shapes. */
#include "cmocka_all.h"

#include <math.h>
#include <string.h>
#include <unistd.h>

#include "apsm/formats.h"
#include "apsm/run.h"
#include "files/files.h"
#include "files/particles_file.h"
#include "folder.h"
#include "model/shape_model.h"
#include "synthetic.h"

enum { I = 5, LEVEL = 3, GRID = 24 };
static const char *const names[I] = { "s0", "s1", "s2", "s3", "s4" };
static const char *const quick[][2] = {
    { "particles", "32" },    { "faces", "600" },         { "stage1_epochs", "2" },
    { "stage2_epochs", "2" }, { "fidelity_rounds", "2" }, { "specificity_samples", "50" },
    { "seed", "3" }
};
enum { QUICK = sizeof quick / sizeof *quick };

static apsm_mesh mesh_of(size_t i)
{
    apsm_mesh mesh = synthetic_shape(SYNTHETIC_BUMP, i, I, LEVEL);
    for (size_t x = 0; x < 3 * mesh.nv; x++) mesh.V[x] = (double)(float)mesh.V[x];
    return mesh;
}

/* An ellipsoid that grows with i, in voxels of three sizes on a turned grid. */
static apsm_volume volume_of(size_t i)
{
    apsm_volume v = { .n = { GRID, GRID, GRID },
                      .origin = { 10, -20, 5 },
                      .spacing = { 1, 1.25, 1.5 },
                      .direction = { 0, -1, 0, 1, 0, 0, 0, 0, 1 } };
    v.label = calloc((size_t)GRID * GRID * GRID, sizeof *v.label);
    assert_non_null(v.label);
    for (size_t k = 0; k < GRID * GRID * GRID; k++) {
        const double x = (double)(k % GRID) - 11.5, y = (double)(k / GRID % GRID) - 11.5,
                     z = (double)(k / GRID / GRID) - 11.5, r = 7 + 0.4 * (double)i;
        v.label[k] = (x * x + y * y) / (r * r) + z * z / 36 < 1 ? 2 : 0;
    }
    return v;
}

static apsm_run *open_job(apsm_context *ctx, const char *folder, const char *input)
{
    apsm_run *run;
    const apsm_run_settings settings = {
        .folder = folder, .n_inputs = input ? 1 : 0, .inputs = &input, .n_set = QUICK, .set = quick
    };
    if (apsm_run_open(ctx, &settings, &run) != APSM_OK) fail_msg("%s", apsm_error_text(ctx));
    return run;
}

static void do_all(apsm_context *ctx, apsm_run *run)
{
    if (apsm_run_all(run) != APSM_OK) fail_msg("%s", apsm_error_text(ctx));
}

static apsm_run *job_in_folder(void **state, apsm_context *ctx, bool meshes)
{
    char path[TEST_PATH], name[64], inputs[TEST_PATH];
    assert_int_equal(apsm_make_folder(ctx, folder_path(state, "shapes", inputs)), APSM_OK);
    for (size_t i = 0; i < I; i++) {
        snprintf(name, sizeof name, "shapes/%s.%s", names[i], meshes ? "ply" : "nrrd");
        folder_path(state, name, path);
        apsm_mesh mesh = meshes ? mesh_of(i) : (apsm_mesh){ 0 };
        apsm_volume volume = meshes ? (apsm_volume){ 0 } : volume_of(i);
        assert_int_equal(meshes ? apsm_write_mesh(ctx, path, &mesh)
                                : apsm_write_volume(ctx, path, &volume),
                         APSM_OK);
        apsm_mesh_free(&mesh);
        apsm_volume_free(&volume);
    }
    apsm_run *run = open_job(ctx, folder_path(state, "model", path), inputs);
    do_all(ctx, run);
    return run;
}

/* In another order, which must not matter. */
static apsm_run *job_in_memory(apsm_context *ctx, bool meshes)
{
    apsm_run *run = open_job(ctx, NULL, NULL);
    for (size_t i = I; i-- > 0;) {
        apsm_mesh mesh = meshes ? mesh_of(i) : (apsm_mesh){ 0 };
        apsm_volume volume = meshes ? (apsm_volume){ 0 } : volume_of(i);
        assert_int_equal(
            meshes ? apsm_run_add_mesh(run, names[i], false, mesh.nv, mesh.V, mesh.nf, mesh.F)
                   : apsm_run_add_volume(run, names[i], false, &volume),
            APSM_OK);
        apsm_mesh_free(&mesh);
        apsm_volume_free(&volume);
    }
    do_all(ctx, run);
    return run;
}

static void same_figures(const apsm_run *a, const apsm_run *b)
{
    static const char *const figures[] = { "variances",      "compactness",
                                           "generalization", "generalization_standard_error",
                                           "specificity",    "specificity_standard_error",
                                           "surface_mean",   "surface_p95",
                                           "surface_max" };
    for (size_t k = 0; k < sizeof figures / sizeof *figures; k++) {
        size_t n, m;
        const double *x = apsm_figures_get(apsm_run_figures(a), figures[k], &n);
        const double *y = apsm_figures_get(apsm_run_figures(b), figures[k], &m);
        assert_int_equal(n, m);
        assert_true(n > 0);
        assert_memory_equal(x, y, n * sizeof *x);
    }
    size_t n;
    assert_null(apsm_figures_get(apsm_run_figures(a), "beauty", &n));
    assert_int_equal(n, 0);
}

static void same_results(const apsm_run *a, const apsm_run *b)
{
    size_t J, K;
    const double *P = apsm_run_particles(a, &J), *Q = apsm_run_particles(b, &K);
    assert_int_equal(J, 32);
    assert_int_equal(K, 32);
    assert_memory_equal(P, Q, I * J * 3 * sizeof *P);
    assert_int_equal(apsm_run_shapes(a), I);
    assert_int_equal(apsm_run_template(a), apsm_run_template(b));
    for (size_t i = 0; i < I; i++) {
        double M[16], N[16];
        apsm_run_to_world(a, i, M);
        apsm_run_to_world(b, i, N);
        assert_memory_equal(M, N, sizeof M);
        assert_string_equal(apsm_run_shape_name(a, i), names[i]);
        assert_string_equal(apsm_run_shape_name(b, i), names[i]);
        assert_int_equal(apsm_run_is_certified(a, i), apsm_run_is_certified(b, i));
        assert_true(apsm_run_is_certified(b, i) == (apsm_run_review(b, i, 0) == NULL));
    }
    const apsm_shape_model *m = apsm_run_model(a), *n = apsm_run_model(b);
    assert_int_equal(m->modes, n->modes);
    assert_memory_equal(m->mean, n->mean, J * 3 * sizeof *m->mean);
    assert_memory_equal(m->mode, n->mode, m->modes * J * 3 * sizeof *m->mode);
    assert_memory_equal(m->score, n->score, I * m->modes * sizeof *m->score);
    same_figures(a, b);
}

static void same_as_files(void **state, apsm_context *ctx, const apsm_run *run)
{
    size_t J;
    const double *P = apsm_run_particles(run, &J);
    for (size_t i = 0; i < I; i++) {
        char name[64], path[TEST_PATH];
        double p[32 * 3];
        snprintf(name, sizeof name, "model/particles/%s_world.particles", names[i]);
        assert_int_equal(apsm_particles_read_n(ctx, folder_path(state, name, path), J, p), APSM_OK);
        assert_memory_equal(p, P + i * J * 3, sizeof p);
    }
}

static void compare(void **state, bool meshes)
{
    char here[TEST_PATH], elsewhere[TEST_PATH];
    apsm_context *one = apsm_context_new(), *two = apsm_context_new();
    apsm_context_set_threads(two, 2);
    apsm_run *in_folder = job_in_folder(state, one, meshes);
    folder_path(state, "elsewhere", elsewhere);
    assert_int_equal(apsm_make_folder(one, elsewhere), APSM_OK);
    assert_non_null(getcwd(here, sizeof here));
    assert_int_equal(chdir(elsewhere), 0);
    apsm_run *in_memory = job_in_memory(two, meshes);
    assert_int_equal(chdir(here), 0);
    assert_int_equal(folder_count(elsewhere), 0);
    same_results(in_folder, in_memory);
    same_as_files(state, one, in_memory);
    apsm_run_close(in_folder);
    apsm_run_close(in_memory);
    apsm_context_free(one);
    apsm_context_free(two);
}

static void meshes_in_memory_give_what_files_give(void **state)
{
    compare(state, true);
}

static void voxels_in_memory_give_what_files_give(void **state)
{
    compare(state, false);
}

/* ---- the doors ---- */

static void what_cannot_be_a_shape_is_refused(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_run *run = open_job(ctx, NULL, NULL);
    double V[9] = { 0, 0, 0, 1, 0, 0, 0, 1, 0 };
    uint32_t F[3] = { 0, 1, 2 };
    char longer[202];
    memset(longer, 'a', sizeof longer - 1);
    longer[sizeof longer - 1] = '\0';
    const char *const bad[] = { "", "a/b", "a\nb", "\xff\xfe", longer };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++)
        assert_int_equal(apsm_run_add_mesh(run, bad[k], false, 3, V, 1, F), APSM_ERR_ARG);
    assert_int_equal(apsm_run_add_mesh(run, NULL, false, 3, V, 1, F), APSM_ERR_ARG);
    assert_int_equal(apsm_run_add_mesh(NULL, "a", false, 3, V, 1, F), APSM_ERR_ARG);
    assert_int_equal(apsm_run_add_mesh(run, "a", false, 3, NULL, 1, F), APSM_ERR_ARG);
    assert_int_equal(apsm_run_add_mesh(run, "a", false, 3, V, 1, NULL), APSM_ERR_ARG);
    assert_int_equal(apsm_run_add_mesh(run, "a", false, 0, V, 1, F), APSM_ERR_ARG);
    assert_int_equal(apsm_run_add_mesh(run, "a", false, 3, V, SIZE_MAX / 2, F), APSM_ERR_ARG);
    assert_int_equal(apsm_run_add_mesh(run, "a", false, 2, V, 1, F), APSM_ERR_ARG);
    V[4] = NAN;
    assert_int_equal(apsm_run_add_mesh(run, "a", false, 3, V, 1, F), APSM_ERR_ARG);
    V[4] = 0;
    assert_int_equal(apsm_run_add_mesh(run, "a", false, 3, V, 1, F), APSM_OK);
    assert_int_equal(apsm_run_add_mesh(run, "a", false, 3, V, 1, F), APSM_ERR_ARG);
    assert_int_equal(apsm_run_initialize(run), APSM_ERR_STATE);
    assert_int_equal(apsm_run_evaluate(run), APSM_ERR_STATE);
    assert_int_equal(apsm_run_report(run), APSM_ERR_STATE);
    apsm_run_close(run);
    apsm_context_free(ctx);
}

static void refuse_volume(apsm_run *run, apsm_volume v)
{
    assert_int_equal(apsm_run_add_volume(run, "v", false, &v), APSM_ERR_ARG);
}

static void what_cannot_be_a_grid_is_refused(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_run *run = open_job(ctx, NULL, NULL);
    apsm_volume good = volume_of(0), v = good;
    v.label = NULL, refuse_volume(run, v), v = good;
    v.n[1] = 0, refuse_volume(run, v), v = good;
    v.n[0] = v.n[1] = v.n[2] = (size_t)1 << 31, refuse_volume(run, v), v = good;
    v.spacing[2] = 0, refuse_volume(run, v), v = good;
    v.spacing[2] = INFINITY, refuse_volume(run, v), v = good;
    v.origin[0] = NAN, refuse_volume(run, v), v = good;
    v.direction[0] = NAN, refuse_volume(run, v), v = good;
    v.direction[0] = 0.5, refuse_volume(run, v), v = good;
    v.direction[1] = -2, refuse_volume(run, v);
    assert_int_equal(apsm_run_add_volume(run, "v", false, NULL), APSM_ERR_ARG);
    assert_int_equal(apsm_run_add_volume(run, "v", false, &good), APSM_OK);
    apsm_volume_free(&good);
    apsm_run_close(run);
    apsm_context_free(ctx);
}

static void a_job_in_memory_takes_nothing_of_files(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_run *run;
    const char *const input[] = { "x.ply" };
    const apsm_run_settings bad[] = {
        { .n_inputs = 1, .inputs = input }, { .memory = 1 }, { .resume = true }, { .dry = true }
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++)
        assert_int_equal(apsm_run_open(ctx, &bad[k], &run), APSM_ERR_ARG);
    run = open_job(ctx, NULL, NULL);
    assert_int_equal(apsm_run_groom(run), APSM_ERR_ARG); /* no shapes */
    size_t J;
    assert_null(apsm_run_particles(run, &J));
    assert_null(apsm_run_model(run));
    assert_null(apsm_run_review(run, 0, 0));
    assert_false(apsm_run_is_certified(run, 0));
    apsm_run_close(run);
    apsm_context_free(ctx);
}

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, folder_set_up, folder_tear_down)
int main(void)
{
    const struct CMUnitTest tests[] = { IN_FOLDER(meshes_in_memory_give_what_files_give),
                                        IN_FOLDER(voxels_in_memory_give_what_files_give),
                                        cmocka_unit_test(what_cannot_be_a_shape_is_refused),
                                        cmocka_unit_test(what_cannot_be_a_grid_is_refused),
                                        cmocka_unit_test(a_job_in_memory_takes_nothing_of_files) };
    return cmocka_run_group_tests_name("memory", tests, NULL, NULL);
}
