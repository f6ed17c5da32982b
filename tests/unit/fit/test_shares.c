/* Fits that a share has kept: found as they were, and nothing that a file says is believed. */
#include "cmocka_all.h"

#include <stdlib.h>
#include <string.h>

#include "fit/shares.h"
#include "scratch.h"
#include "shapes.h"

enum { J = 5, MODES = 2 };

typedef struct room {
    apsm_context *ctx;
    char folder[SCRATCH_LENGTH];
    double variance[MODES];
    apsm_shape shape;
    apsm_fit_model model;
    fit_shares shares;
} room;

static const char journal_name[] = "one.journal";
static const apsm_input_case input = { .name = "s0", .path = "in/s0.ply" };

static void open_journal(room *r)
{
    const char *path = scratch_path(r->folder, journal_name);
    r->shares = (fit_shares){ .model = &r->model, .folder = r->folder };
    assert_int_equal(journal_open(r->ctx, path, false, &r->shares.own), APSM_OK);
}

static int make_room(void **state)
{
    room *r = *state = calloc(1, sizeof *r);
    r->ctx = apsm_context_new();
    scratch_make(r->folder);
    r->shape.mesh = shape_icosphere(0);
    r->variance[0] = 4;
    r->variance[1] = 1;
    r->model.model.J = J;
    r->model.model.modes = MODES;
    r->model.model.variance = r->variance;
    r->model.cohort.shape = &r->shape;
    open_journal(r);
    return 0;
}

static int leave_room(void **state)
{
    room *r = *state;
    fit_shares_close(&r->shares);
    apsm_mesh_free(&r->shape.mesh);
    scratch_remove(r->folder);
    apsm_context_free(r->ctx);
    free(r);
    return 0;
}

/* A fit by a model of so many particles and modes. */
static apsm_fit fit_of(room *r, size_t particles, size_t modes)
{
    apsm_fit fit = { 0 };
    fit.J = particles;
    fit.modes = modes;
    fit.local = calloc(3 * particles + 1, sizeof(double));
    fit.world = calloc(3 * particles + 1, sizeof(double));
    fit.original = calloc(3 * particles + 1, sizeof(double));
    fit.score = calloc(modes + 1, sizeof(double));
    fit.sd = calloc(particles + 1, sizeof(double));
    fit.sd_normal = calloc(particles + 1, sizeof(double));
    fit.observed = calloc(particles + 1, sizeof(bool));
    fit.mesh_sd = calloc(r->shape.mesh.nv, sizeof(double));
    fit.mesh_observed = calloc(r->shape.mesh.nv, sizeof(bool));
    assert_int_equal(apsm_mesh_copy(&r->shape.mesh, &fit.mesh), APSM_OK);
    for (size_t k = 0; k < 3 * particles; k++) fit.world[k] = (double)k;
    for (size_t k = 0; k < modes; k++) fit.score[k] = 7 + (double)k;
    return fit;
}

static fit_row row_of(const apsm_fit *fit)
{
    fit_row row = { .name = input.name, .path = input.path, .figures = *fit };
    memset(row.sha256, 'a', sizeof row.sha256 - 1);
    strcpy(row.problem, "look at it");
    return row;
}

static void keep(room *r, const fit_row *row)
{
    assert_int_equal(fit_shares_keep(r->ctx, &r->shares, &input, row), APSM_OK);
    fit_shares_close(&r->shares);
    open_journal(r);
}

static bool find(room *r, const apsm_input_case *c, fit_row *row, apsm_fit *fit)
{
    bool found;
    *fit = (apsm_fit){ 0 };
    *row = row_of(fit);
    row->problem[0] = 0;
    assert_int_equal(fit_shares_find(r->ctx, &r->shares, c, row, fit, &found), APSM_OK);
    return found;
}

static void as_it_was(void **state)
{
    room *r = *state;
    apsm_fit kept = fit_of(r, J, MODES), fit;
    fit_row row = row_of(&kept);
    const apsm_input_case elsewhere = { .name = "s0", .path = "/other/place/s0.ply" },
                          other = { .name = "s0", .path = "in/s0.stl" };
    keep(r, &row);
    assert_true(find(r, &input, &row, &fit));
    assert_string_equal(row.problem, "look at it");
    assert_ptr_equal(row.path, input.path);
    assert_memory_equal(fit.world, kept.world, 3 * J * sizeof *fit.world);
    assert_memory_equal(fit.score, kept.score, MODES * sizeof *fit.score);
    assert_memory_equal(fit.variance, r->variance, sizeof r->variance);
    apsm_fit_free(&fit);
    assert_true(find(r, &elsewhere, &row, &fit));
    apsm_fit_free(&fit);
    assert_false(find(r, &other, &row, &fit));
    apsm_fit_free(&kept);
}

/* What is kept like this is not found, and leaves row and fit as they were. */
static void is_made_again(room *r, const fit_row *kept)
{
    fit_row row;
    apsm_fit fit;
    keep(r, kept);
    assert_false(find(r, &input, &row, &fit));
    assert_true(fit.J == 0 && !fit.world && !fit.mesh.V);
    assert_string_equal(row.problem, "");
    assert_ptr_equal(row.path, input.path);
}

static void of_other_sizes(void **state)
{
    room *r = *state;
    const size_t size[][2] = { { 9 * J, MODES }, { J, 5000 }, { J - 1, MODES }, { J, 0 } };
    for (size_t k = 0; k < sizeof size / sizeof size[0]; k++) {
        apsm_fit fit = fit_of(r, size[k][0], size[k][1]);
        const fit_row row = row_of(&fit);
        is_made_again(r, &row);
        apsm_fit_free(&fit);
    }
    apsm_fit longer = fit_of(r, J, MODES); /* the template has fewer vertices */
    apsm_mesh_free(&longer.mesh);
    longer.mesh = shape_icosphere(1);
    longer.mesh_sd = realloc(longer.mesh_sd, longer.mesh.nv * sizeof *longer.mesh_sd);
    memset(longer.mesh_sd, 0, longer.mesh.nv * sizeof *longer.mesh_sd);
    longer.mesh_observed = realloc(longer.mesh_observed, longer.mesh.nv);
    memset(longer.mesh_observed, 0, longer.mesh.nv);
    const fit_row row = row_of(&longer);
    is_made_again(r, &row);
    apsm_fit_free(&longer);
}

static void of_values_that_cannot_be(void **state)
{
    room *r = *state;
    apsm_fit fit = fit_of(r, J, MODES);
    fit_row row = row_of(&fit);
    row.figures.verdict = (apsm_fit_verdict)77;
    is_made_again(r, &row);
    row = row_of(&fit);
    memset(row.figures.reason, 'x', sizeof row.figures.reason);
    is_made_again(r, &row);
    row = row_of(&fit);
    memset(row.problem, 'x', sizeof row.problem);
    is_made_again(r, &row);
    row = row_of(&fit);
    row.figures.J = 0; /* good, but without particles */
    is_made_again(r, &row);
    apsm_fit_free(&fit);
}

static void refused_ones(void **state)
{
    room *r = *state;
    apsm_fit stranger = { .verdict = APSM_FIT_REFUSED }, fit;
    fit_row row = row_of(&stranger);
    keep(r, &row);
    assert_true(find(r, &input, &row, &fit));
    assert_int_equal(fit.verdict, APSM_FIT_REFUSED);
    assert_true(!fit.world && !fit.score && !row.figures.score);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(as_it_was, make_room, leave_room),
        cmocka_unit_test_setup_teardown(of_other_sizes, make_room, leave_room),
        cmocka_unit_test_setup_teardown(of_values_that_cannot_be, make_room, leave_room),
        cmocka_unit_test_setup_teardown(refused_ones, make_room, leave_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
