/* Particles and surfaces of another program become a model folder. */
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "core/sized.h"
#include "geometry/topology.h"
#include "run/memory.h"
#include "run/particles.h"
#include "run/shapes.h"
#include "session/guard.h"
#include "session/manifest.h"

enum { LEAST_SHAPES = 3 };

/* Files are written under them: none may lead elsewhere, and no two to the same. */
static apsm_status check_names(apsm_run *run, const apsm_import *in)
{
    for (size_t i = 0; in->names && i < in->I; i++) {
        const char *name = in->names[i] ? in->names[i] : "";
        APSM_TRY(run_check_name(run, name));
        for (size_t k = 0; k < i; k++)
            if (strcmp(in->names[k], name) == 0)
                return apsm_fail(run->ctx, APSM_ERR_ARG,
                                 "%s: two shapes have this name; rename one", name);
    }
    return APSM_OK;
}

static apsm_status check_input(apsm_run *run, const apsm_import *in)
{
    if (run_is_in_memory(run))
        return apsm_fail(run->ctx, APSM_ERR_STATE, "an import needs a folder");
    if (!in || !in->names || !in->P || !in->meshes || !in->to_world || !in->paths ||
        in->template_index >= in->I)
        return apsm_fail(run->ctx, APSM_ERR_ARG, "apsm_run_import: an argument is missing");
    if (in->I < LEAST_SHAPES)
        return apsm_fail(run->ctx, APSM_ERR_ARG, "%zu shapes make no model; %d do", in->I,
                         LEAST_SHAPES);
    if (run->project.n > 0 || run->has_manifest)
        return apsm_fail(run->ctx, APSM_ERR_STATE,
                         "%s: holds a model already; import into another folder", run->folder);
    return APSM_OK;
}

/* What later steps need of a surface. */
static apsm_status check_mesh(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const apsm_import *in = user;
    apsm_mesh_defects defects;
    APSM_TRY(apsm_mesh_inspect(&in->meshes[i], &defects));
    if (defects.nonmanifold_edges + defects.nonmanifold_vertices == 0) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                     "%s: three faces meet at an edge, or parts at a point; give the groomed "
                     "mesh, or make the model anew by apsm run",
                     in->paths[i]);
}

static apsm_status add_subject(apsm_run *run, const apsm_import *in, size_t i)
{
    apsm_subject *s;
    char groomed[1024], *shape = apsm_path_relative(run->folder, in->paths[i]);
    if (!shape) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_project_add(&run->project, in->names[i], shape, &s);
    free(shape);
    APSM_TRY(status);
    snprintf(groomed, sizeof groomed, "groomed/%s.ply", in->names[i]);
    s->has_alignment = s->has_procrustes = true;
    memcpy(s->alignment, in->to_world + 16 * i, sizeof s->alignment);
    APSM_TRY(apsm_text_set(&s->groomed, groomed));
    char *path = run_path(run, groomed);
    const apsm_status written =
        path ? apsm_write_mesh(run->ctx, path, &in->meshes[i]) : APSM_ERR_MEMORY;
    free(path);
    return written;
}

static json_t *describe_shapes(const apsm_import *in)
{
    json_t *list = json_array();
    for (size_t i = 0; i < in->I; i++)
        json_array_append_new(list, json_pack("{s:s, s:s, s:f}", "name", in->names[i], "kind",
                                              in->drawn ? "drawn from a model" : "imported",
                                              "volume", apsm_mesh_volume(&in->meshes[i])));
    return list;
}

static apsm_status describe_inputs(apsm_run *run, const apsm_import *in)
{
    char(*sha256)[65] = calloc(in->I, sizeof *sha256);
    apsm_status status = sha256 ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; i < in->I && status == APSM_OK; i++)
        status = apsm_sha256_file(run->ctx, in->paths[i], sha256[i]);
    if (status == APSM_OK) status = manifest_set_inputs(run, in->I, in->names, in->paths, sha256);
    if (status == APSM_OK) status = manifest_set_groomed(run, describe_shapes(in));
    free(sha256);
    return status;
}

static apsm_status import_shapes(apsm_run *run, const apsm_import *in)
{
    const stage_clock clock = stage_begin();
    char particles[32], *folder = run_path(run, "groomed");
    APSM_TRY(stage_start(run, "groom"));
    apsm_status status = folder ? apsm_make_folder(run->ctx, folder) : APSM_ERR_MEMORY;
    free(folder);
    for (size_t i = 0; i < in->I && status == APSM_OK; i++) status = add_subject(run, in, i);
    snprintf(particles, sizeof particles, "%zu", in->J);
    if (status == APSM_OK)
        status = apsm_options_set(run->ctx, &run->options, "particles", particles);
    if (status == APSM_OK)
        status =
            apsm_project_set(&run->project, "apsm", "template_used", in->names[in->template_index]);
    if (status == APSM_OK) status = describe_inputs(run, in);
    if (status == APSM_OK) status = run_write_project(run);
    if (status == APSM_OK) status = manifest_set_options(run);
    return status == APSM_OK ? stage_end(run, "groom", &clock) : status;
}

static apsm_status import_particles(apsm_run *run, const apsm_import *in)
{
    const stage_clock clock = stage_begin();
    APSM_TRY(stage_end(run, "initialize", &clock)); /* there is nothing to begin with */
    APSM_TRY(stage_start(run, "optimize"));
    APSM_TRY(run_load_meshes(run));
    APSM_TRY(run_write_particles(run, in->J, in->P));
    return stage_end(run, "optimize", &clock);
}

static apsm_status import_all(apsm_run *run, const apsm_import *in)
{
    APSM_TRY(check_input(run, in));
    APSM_TRY(guard_files(run, "groom", NULL));
    APSM_TRY(apsm_parallel_for(run->ctx, in->I, check_mesh, (void *)in, NULL));
    APSM_TRY(import_shapes(run, in));
    APSM_TRY(import_particles(run, in));
    APSM_TRY(apsm_run_evaluate(run));
    return apsm_run_report(run);
}

/* Shapes that no file holds: their groomed meshes are their inputs. */
static apsm_status import_arrays(apsm_run *run, apsm_import in)
{
    char **paths = calloc(in.I + 1, sizeof *paths), groomed[1024];
    apsm_status status = paths ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; i < in.I && status == APSM_OK; i++) {
        snprintf(groomed, sizeof groomed, "groomed/%s.ply", in.names[i]);
        if (!(paths[i] = run_path(run, groomed))) status = APSM_ERR_MEMORY;
    }
    in.paths = (const char *const *)paths;
    status = status == APSM_OK ? import_all(run, &in)
                               : apsm_fail(run->ctx, status, "out of memory for %zu shapes", in.I);
    for (size_t i = 0; paths && i < in.I; i++) free(paths[i]);
    free(paths);
    return status;
}

apsm_status apsm_run_import_sized(apsm_run *run, const apsm_import *given, size_t size)
{
    apsm_import input = { 0 };
    if (!run) return APSM_ERR_ARG;
    APSM_TRY(apsm_take_settings(run->ctx, "apsm_run_import", given, size, &input, sizeof input));
    APSM_TRY(check_names(run, &input));
    const bool of_arrays = input.names && !input.paths && !run_is_in_memory(run);
    return of_arrays ? import_arrays(run, input) : import_all(run, &input);
}
