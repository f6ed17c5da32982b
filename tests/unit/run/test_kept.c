/* Groomed meshes that an interrupted step has kept: found as they were, and a piece whose faces
 * have vertices that it has not is made again. */
#include "cmocka_all.h"

#include <string.h>

#include "folder.h"
#include "session/kept.h"
#include "shapes.h"

static const apsm_input_case input = { .name = "s0", .path = "in/s0.ply" };
static const char sha256[65] = "of the file";

/* *found <- what the next process finds of a mesh that this one keeps. */
static void keep_and_find(void **state, apsm_context *ctx, const apsm_mesh *mesh, apsm_mesh *found)
{
    char path[TEST_PATH];
    char notes[] = "noted";
    apsm_run *run;
    const kept_groomed kept = { .voxel = 2, .notes = notes };
    kept_groomed groomed = { 0 };
    const apsm_run_settings settings = { .folder = folder_path(state, "model", path) };
    assert_int_equal(apsm_run_open(ctx, &settings, &run), APSM_OK);
    assert_int_equal(kept_begin(run), APSM_OK);
    assert_int_equal(kept_add_mesh(ctx, run, &input, sha256, mesh, &kept), APSM_OK);
    kept_close(run);
    assert_int_equal(kept_begin(run), APSM_OK);
    assert_int_equal(kept_find_mesh(ctx, run, &input, sha256, found, &groomed), APSM_OK);
    assert_true(found->V ? groomed.voxel == 2 && strcmp(groomed.notes, notes) == 0
                         : groomed.voxel == 0 && !groomed.notes);
    free(groomed.notes);
    apsm_run_close(run);
}

static void meshes_are_found(void **state)
{
    apsm_context *ctx = apsm_context_new();
    apsm_mesh mesh = shape_icosphere(1), found;
    keep_and_find(state, ctx, &mesh, &found);
    assert_int_equal(found.nf, mesh.nf);
    assert_memory_equal(found.V, mesh.V, 3 * mesh.nv * sizeof *mesh.V);
    assert_memory_equal(found.F, mesh.F, 3 * mesh.nf * sizeof *mesh.F);
    apsm_mesh_free(&found);
    apsm_mesh_free(&mesh);
    apsm_context_free(ctx);
}

static void faces_without_vertices_are_not(void **state)
{
    apsm_context *ctx = apsm_context_new();
    apsm_mesh mesh = shape_icosphere(1), found;
    mesh.F[3 * mesh.nf - 1] = (uint32_t)mesh.nv;
    keep_and_find(state, ctx, &mesh, &found);
    assert_true(!found.V && !found.F);
    apsm_mesh_free(&mesh);
    apsm_context_free(ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(meshes_are_found, folder_set_up, folder_tear_down),
        cmocka_unit_test_setup_teardown(faces_without_vertices_are_not, folder_set_up,
                                        folder_tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
