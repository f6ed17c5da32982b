/* What is loaded of a cohort is known, not guessed from the fields that shapes happen to have. */
#include "cmocka_all.h"

#include "run/shapes.h"
#include "synthetic.h"

enum { I = 3 };

static apsm_run *groomed_job(apsm_context *ctx)
{
    static const char *const names[I] = { "a", "b", "c" };
    static const char *const set[][2] = { { "particles", "32" }, { "faces", "600" } };
    const apsm_run_settings settings = { .n_set = 2, .set = set };
    apsm_run *run;
    assert_int_equal(apsm_run_open(ctx, &settings, &run), APSM_OK);
    for (size_t i = 0; i < I; i++) {
        apsm_mesh m = synthetic_shape(SYNTHETIC_BUMP, i, I, 3);
        assert_int_equal(apsm_run_add_mesh(run, names[i], false, m.nv, m.V, m.nf, m.F), APSM_OK);
        apsm_mesh_free(&m);
    }
    assert_int_equal(apsm_run_groom(run), APSM_OK);
    return run;
}

/* How many shapes have fields, and how many have their tree. */
static void loaded(apsm_run *run, run_fields wanted, size_t fields, size_t trees)
{
    assert_int_equal(run_load_cohort(run, wanted), APSM_OK);
    for (size_t i = 0; i < I; i++) {
        fields -= run->cohort.shape[i].field != NULL;
        trees -= run->cohort.shape[i].bvh != NULL;
    }
    assert_int_equal(fields, 0);
    assert_int_equal(trees, 0);
}

/* Rank 7 of 9 has none of three shapes. */
static void bare_shapes_do_for_nothing_else(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_run *run = groomed_job(ctx);
    run->shard = 7;
    run->shards = 9;
    loaded(run, RUN_OWN_SURFACES, 0, 1);
    loaded(run, RUN_NO_FIELDS, 0, I);
    loaded(run, RUN_OWN_SURFACES, 0, I);
    loaded(run, RUN_TEMPLATE_FIELD, 1, I);
    loaded(run, RUN_OWN_FIELDS, I, I);
    loaded(run, RUN_NO_FIELDS, I, I);
    apsm_run_close(run);
    apsm_context_free(ctx);
}

static void gather_nothing(void *user, size_t bytes, const void *own, void *all)
{
    (void)user, (void)bytes, (void)own, (void)all;
}

static void a_rank_without_shapes_loads_once(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_run *run = groomed_job(ctx);
    const apsm_company company = { .gather = gather_nothing };
    run->company = &company;
    run->shard = 7;
    run->shards = 9;
    loaded(run, RUN_OWN_FIELDS, 1, I);
    run->cohort.shape[0].half_thickness = 123; /* what is built anew has not */
    loaded(run, RUN_OWN_FIELDS, 1, I);
    assert_true(run->cohort.shape[0].half_thickness == 123);
    apsm_run_close(run);
    apsm_context_free(ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(bare_shapes_do_for_nothing_else),
                                        cmocka_unit_test(a_rank_without_shapes_loads_once) };
    return cmocka_run_group_tests_name("shapes", tests, NULL, NULL);
}
