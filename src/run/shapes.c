/* The groomed shapes of a model folder in memory. */
#include "run/shapes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "files/stored.h"
#include "geometry/affine.h"
#include "geometry/stored.h"
#include "optimize/optimizer.h"
#include "run/features.h"
#include "run/fixed.h"
#include "run/landmarks.h"
#include "session/kept.h"
#include "session/session.h"

static void unload_cohort(apsm_run *run)
{
    apsm_cohort_free(&run->cohort);
    run->loaded = RUN_NOT_LOADED;
}

void run_unload(apsm_run *run)
{
    unload_cohort(run);
    for (size_t i = 0; run->mesh && i < run->mesh_count; i++)
        run_free_mesh(&run->mesh[i], run->meshes_stored);
    landmark_table_free(&run->landmarks);
    features_free(&run->features);
    run->identity[0] = '\0';
    run->meshes_stored = false;
    free(run->mesh);
    free(run->names);
    free(run->transforms);
    run->mesh = NULL;
    run->mesh_count = 0;
    run->names = NULL;
    run->transforms = NULL;
}

static apsm_status load_mesh(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const apsm_run *run = user;
    char *path = apsm_project_path(&run->project, run->project.subjects[i].groomed);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = apsm_read_mesh(ctx, path, &run->mesh[i]);
    free(path);
    if (status == APSM_OK && run->store) {
        array_list arrays = { 0 };
        mesh_arrays(&run->mesh[i], &arrays);
        status = store_put(ctx, run->store, &arrays);
        if (status != APSM_OK) apsm_mesh_free(&run->mesh[i]);
    }
    return status;
}

static apsm_status load_groomed(apsm_run *run)
{
    enum { MANY = 1000 }; /* reading fewer needs no progress */
    const size_t n = run->project.n;
    run->names = calloc(n, sizeof *run->names);
    run->transforms = calloc(n * 16, sizeof *run->transforms);
    run->mesh = calloc(n, sizeof *run->mesh);
    if (!run->names || !run->transforms || !run->mesh) return APSM_ERR_MEMORY;
    run->mesh_count = n;
    apsm_store *store;
    APSM_TRY(run_open_store(run, &store));
    run->meshes_stored = store != NULL;
    for (size_t i = 0; i < n; i++) {
        run->names[i] = run->project.subjects[i].name;
        memcpy(run->transforms + 16 * i, run->project.subjects[i].alignment, 16 * sizeof(double));
    }
    return apsm_parallel_for(run->ctx, n, load_mesh, run, n < MANY ? NULL : "read");
}

apsm_status run_no_project(const apsm_run *run)
{
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s: no project here; start with `apsm groom INPUT... -o %s`", run->folder,
                     run->folder);
}

apsm_status run_load_meshes(apsm_run *run)
{
    if (run->mesh) return APSM_OK;
    if (run->project.n == 0 && kept_is_there(run))
        return apsm_fail(run->ctx, APSM_ERR_STATE,
                         "%s: grooming has not ended; go on with `apsm run --resume -o %s`",
                         run->folder, run->folder);
    if (run_is_in_memory(run))
        return apsm_fail(run->ctx, APSM_ERR_STATE, "job in memory: groom its shapes first");
    if (run->project.n == 0) return run_no_project(run);
    for (size_t i = 0; i < run->project.n; i++)
        if (!run->project.subjects[i].groomed)
            return apsm_fail(run->ctx, APSM_ERR_STATE,
                             "%s: %s has not been groomed; run `apsm groom -o %s`", run->folder,
                             run->project.subjects[i].name, run->folder);
    const apsm_status status = load_groomed(run);
    if (status != APSM_OK) run_unload(run);
    return status;
}

size_t run_template_index(const apsm_run *run)
{
    return apsm_project_find(&run->project, apsm_run_text(run, "template_used"));
}

static double world_area(const apsm_run *run, size_t i)
{
    const double s = cbrt(fabs(apsm_affine_det(run->transforms + 16 * i))); /* of the transform */
    return s * s * apsm_mesh_area(&run->mesh[i]);
}

/* A distance field has the template's voxels, and grows with the square of a shape's size: one in
 * metres among others in mm would fill any memory. */
static apsm_status refuse_giants(const apsm_run *run, size_t t)
{
    static const double most = 32.0;
    const double usual = world_area(run, t);
    for (size_t i = 0; i < run->project.n; i++) {
        const double times = sqrt(world_area(run, i) / usual);
        if (times > most)
            return apsm_fail(run->ctx, APSM_ERR_GEOMETRY,
                             "%s: about %.0f times as large as the template %s: in another unit? "
                             "Give all shapes in one, or leave it out with --exclude",
                             run->names[i], times, run->names[t]);
    }
    return APSM_OK;
}

run_fields run_fields_wanted(const apsm_run *run, run_fields otherwise)
{
    const apsm_optimize_options *o = &run->options.optimize;
    const apsm_optimizer_state first = { .stage = APSM_STAGE_1 };
    if (o->method == APSM_METHOD_PSM) return RUN_NO_FIELDS;
    return apsm_draws_points(o, &first) ? RUN_OWN_FIELDS : otherwise;
}

static apsm_status build_cohort(apsm_run *run, run_fields wanted)
{
    APSM_TRY(run_load_meshes(run));
    const size_t t = run_template_index(run);
    if (t >= run->project.n)
        return apsm_fail(run->ctx, APSM_ERR_STATE, "%s: the project names no template; groom again",
                         run->folder);
    const apsm_options *o = &run->options;
    const double h = apsm_expected_spacing(world_area(run, t), (size_t)o->optimize.particles);
    const bool fieldless = wanted <= RUN_NO_FIELDS;
    if (!fieldless) APSM_TRY(refuse_giants(run, t));
    const apsm_field_plan fields = {
        .voxel = fieldless ? 0 : o->field.field_voxel * h,
        .band = 1.1 * o->optimize.rbf.band * o->optimize.rbf.dipole *
                h, /* h is seldom expected too small by more */
        .template_alone = wanted == RUN_TEMPLATE_FIELD,
        .bare = wanted == RUN_OWN_SURFACES,
        .share = run->shard,
        .shares = run_is_shared(run) || wanted == RUN_OWN_SURFACES ? run->shards : 0,
    };
    apsm_store *store;
    APSM_TRY(run_open_store(run, &store));
    const apsm_cohort_input in = { run->project.n, run->names, run->mesh, run->transforms, t };
    APSM_TRY(apsm_cohort_build_in(run->ctx, store, &in, &fields, &run->cohort));
    if (wanted == RUN_OWN_SURFACES) return APSM_OK; /* nothing guides particles that are finished */
    APSM_TRY(fixed_flag(run));
    APSM_TRY(features_load(run));
    return landmarks_anchor(run);
}

apsm_status run_load_cohort(apsm_run *run, run_fields wanted)
{
    if (run->loaded >= wanted) return APSM_OK;
    unload_cohort(run);
    const apsm_status status = build_cohort(run, wanted);
    if (status == APSM_OK)
        run->loaded = wanted;
    else
        unload_cohort(run);
    return status;
}
