/* warp: particle sets to meshes. */
#include <stdlib.h>
#include <string.h>

#include "apsm/exchange.h"
#include "apsm/formats.h"
#include "files/files.h"
#include "folder/model_folder.h"
#include "particle_sets.h"
#include "verbs.h"

typedef struct warp_work {
    apsm_context *ctx;
    const cli_args *args;
    cli_sets in;
    apsm_mesh mesh;
    double *P0, *P; /* the template's particles; those of the shapes */
    const char **names;
    size_t I, J, n_attached;
    char *words; /* of --attach, cut */
    const char **attached;
} warp_work;

static apsm_status no_memory(const warp_work *w)
{
    return apsm_fail(w->ctx, APSM_ERR_MEMORY, "out of memory");
}

/* The template of a model folder, in the world's frame. */
static apsm_status take_model(warp_work *w)
{
    model_folder m;
    APSM_TRY(
        model_folder_read(w->ctx, w->args->inputs[0], FOLDER_PARTICLES | FOLDER_EVALUATED, &m));
    apsm_status status = APSM_OK;
    if (m.parts > 1)
        status = apsm_fail(w->ctx, APSM_ERR_UNSUPPORTED,
                           "%s: is a model of %zu parts; warp the parts in its folder parts/",
                           w->args->inputs[0], m.parts);
    if (status == APSM_OK) status = model_folder_mesh(w->ctx, &m, m.template_index, &w->mesh);
    w->J = m.J;
    w->P0 = malloc(3 * m.J * sizeof *w->P0);
    if (status == APSM_OK && !w->P0) status = no_memory(w);
    if (status == APSM_OK) memcpy(w->P0, m.P + m.template_index * 3 * m.J, 3 * m.J * sizeof *w->P0);
    model_folder_free(&m);
    return status;
}

/* A mesh, and the particles on it, which are the first of the sets. */
static apsm_status take_mesh(warp_work *w)
{
    APSM_TRY(apsm_read_mesh(w->ctx, w->args->inputs[0], &w->mesh));
    w->J = w->in.sets[0].n;
    w->P0 = malloc(3 * w->J * sizeof *w->P0);
    if (!w->P0) return no_memory(w);
    memcpy(w->P0, w->in.sets[0].P, 3 * w->J * sizeof *w->P0);
    return APSM_OK;
}

/* Sets from `first` on. */
static apsm_status take_sets(warp_work *w, size_t first)
{
    w->I = w->in.n - first;
    if (w->I == 0)
        return apsm_fail(w->ctx, APSM_ERR_ARG,
                         "%s: only its own particles are given; name those of other shapes, too",
                         w->args->inputs[0]);
    w->P = malloc(w->I * 3 * w->J * sizeof *w->P);
    w->names = calloc(w->I, sizeof *w->names);
    if (!w->P || !w->names) return no_memory(w);
    for (size_t i = 0; i < w->I; i++) {
        const cli_set *set = &w->in.sets[first + i];
        if (set->n != w->J)
            return apsm_fail(w->ctx, APSM_ERR_FORMAT,
                             "%s: holds %zu particles, the template has %zu", set->file, set->n,
                             w->J);
        memcpy(w->P + i * 3 * w->J, set->P, 3 * w->J * sizeof *w->P);
        w->names[i] = set->name;
    }
    return APSM_OK;
}

/* "a.vtk,b.csv" */
static apsm_status take_attached(warp_work *w)
{
    if (!w->args->attach) return APSM_OK;
    size_t most = 1;
    for (const char *c = w->args->attach; *c; c++) most += *c == ',';
    w->words = strdup(w->args->attach);
    w->attached = calloc(most, sizeof *w->attached);
    if (!w->words || !w->attached) return no_memory(w);
    char *rest = NULL;
    for (char *file = strtok_r(w->words, ",", &rest); file; file = strtok_r(NULL, ",", &rest)) {
        if (!apsm_file_exists(file))
            return apsm_fail(w->ctx, APSM_ERR_IO, "--attach %s: no such file", file);
        w->attached[w->n_attached++] = file;
    }
    return APSM_OK;
}

static apsm_status warp(warp_work *w, cli_ui *ui)
{
    const bool model = apsm_is_folder(w->args->inputs[0]);
    size_t inverted = 0;
    APSM_TRY(take_attached(w));
    APSM_TRY(cli_sets_read(w->ctx, w->args->n_inputs - 1, w->args->inputs + 1, &w->in));
    if (w->in.n == 0) return apsm_fail(w->ctx, APSM_ERR_ARG, "no particles are given");
    APSM_TRY(model ? take_model(w) : take_mesh(w));
    APSM_TRY(take_sets(w, model ? 0 : 1));
    const apsm_warp_settings settings = { .mesh = &w->mesh,
                                          .mesh_path = model ? NULL : w->args->inputs[0],
                                          .J = w->J,
                                          .I = w->I,
                                          .P0 = w->P0,
                                          .P = w->P,
                                          .names = w->names,
                                          .n_attached = w->n_attached,
                                          .attached = w->attached,
                                          .extension = w->args->to ? w->args->to : "ply",
                                          .folder = w->args->out_dir,
                                          .overwrite = w->args->overwrite };
    APSM_TRY(apsm_warp_files(w->ctx, &settings, &inverted));
    cli_say(ui, "warped: %zu shape%s, in %s", w->I, w->I == 1 ? "" : "s", w->args->out_dir);
    if (inverted > 0)
        cli_say(ui, "%zu tetrahedra are inside out; %s/warp.json lists them", inverted,
                w->args->out_dir);
    return APSM_OK;
}

apsm_status apsm_cli_warp(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    warp_work w = { .ctx = ctx, .args = args };
    const apsm_status status = warp(&w, ui);
    cli_sets_free(&w.in);
    apsm_mesh_free(&w.mesh);
    free(w.P0);
    free(w.P);
    free(w.names);
    free(w.words);
    free(w.attached);
    return status;
}
