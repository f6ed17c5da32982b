/* Particles of shapes to meshes of them, by the warp of docs/method.md that takes the template's
 * particles to a shape's: it is defined in all of space, so whatever lies on or in the template
 * goes along. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "core/sized.h"
#include "exchange/exporting.h"
#include "formats/vtk_grid.h"
#include "geometry/bvh.h"
#include "landmarks/landmark_file.h"
#include "model/warp.h"

typedef struct warping {
    apsm_context *ctx;
    const apsm_warp_settings *s;
    out_folder folder;
    json_t *inverted; /* file name: numbers of cells */
    size_t n_inverted;
} warping;

static apsm_status no_memory(const warping *w)
{
    return apsm_fail(w->ctx, APSM_ERR_MEMORY, "%s: out of memory", w->s->folder);
}

/* In pieces, so that W stays small. */
apsm_status apsm_warp_points_sized(apsm_context *ctx, const apsm_warp_points_input *given,
                                   size_t size, double *Y)
{
    enum { PIECE = 4096 };
    apsm_warp_points_input known = { 0 }, *const in = &known;
    APSM_TRY(apsm_take_settings(ctx, "apsm_warp_points", given, size, in, sizeof known));
    if (!in->P0 || !in->P || !in->X || !Y)
        return apsm_fail(ctx, APSM_ERR_ARG, "apsm_warp_points: an argument is NULL");
    for (size_t first = 0; first < in->n; first += PIECE) {
        const size_t m = in->n - first < PIECE ? in->n - first : PIECE;
        apsm_warp warp = { 0 };
        APSM_TRY(apsm_warp_build(ctx, APSM_PHI_R, m, in->X + 3 * first, in->J, in->P0, &warp));
        for (size_t i = 0; i < in->I; i++)
            apsm_warp_apply(&warp, in->P + i * 3 * in->J, Y + 3 * (i * in->n + first));
        apsm_warp_free(&warp);
    }
    return APSM_OK;
}

/* Y (I x n x 3, out) <- the points X (n x 3) on every shape. */
static apsm_status warp_points(const warping *w, size_t n, const double *X, double *Y)
{
    const apsm_warp_points_input in = { w->s->J, w->s->I, n, w->s->P0, w->s->P, X };
    return apsm_warp_points(w->ctx, &in, Y);
}

static apsm_status place(warping *w, size_t i, const char *stem, const char *extension, char **path)
{
    return stem ? out_folder_file(&w->folder, path, "%s_%s.%s", w->s->names[i], stem, extension)
                : out_folder_file(&w->folder, path, "%s.%s", w->s->names[i], extension);
}

/* ---- surfaces ---- */

static apsm_status write_meshes(warping *w, const apsm_mesh *mesh, const char *stem,
                                const double *Y)
{
    for (size_t i = 0; i < w->s->I; i++) {
        char *path = NULL;
        apsm_mesh moved = *mesh;
        moved.V = (double *)Y + i * 3 * mesh->nv;
        apsm_status status = place(w, i, stem, w->s->extension, &path);
        if (status == APSM_OK) status = apsm_write_mesh(w->ctx, path, &moved);
        free(path);
        APSM_TRY(status);
    }
    return APSM_OK;
}

static apsm_status warp_mesh(warping *w, const apsm_mesh *mesh, const char *stem)
{
    double *Y = malloc(w->s->I * 3 * mesh->nv * sizeof *Y);
    apsm_status status = Y ? warp_points(w, mesh->nv, mesh->V, Y) : no_memory(w);
    if (status == APSM_OK) status = write_meshes(w, mesh, stem, Y);
    free(Y);
    return status;
}

/* ---- legacy VTK, with all that is in it ---- */

/* Names the cells that have turned inside out. */
static apsm_status tell_inverted(warping *w, const char *path, size_t n, const uint32_t *list)
{
    enum { SHOWN = 8 };
    char text[SHOWN * 12 + 8] = "";
    size_t used = 0;
    json_t *numbers = json_array();
    for (size_t k = 0; k < n; k++) json_array_append_new(numbers, json_integer(list[k]));
    for (size_t k = 0; k < n && k < SHOWN; k++)
        used += (size_t)snprintf(text + used, sizeof text - used, "%s%u", k ? ", " : "", list[k]);
    w->n_inverted += n;
    apsm_log(w->ctx, APSM_LOG_WARNING, "%s: %zu tetrahedr%s inside out: %s%s", path, n,
             n == 1 ? "on is" : "a are", text, n > SHOWN ? ", ..." : "");
    return json_object_set_new(w->inverted, apsm_path_last(path), numbers) ? no_memory(w) : APSM_OK;
}

static apsm_status write_grid(warping *w, const vtk_grid *g, const char *stem, const double *y,
                              size_t i)
{
    char *path = NULL;
    uint32_t *list = malloc((g->tets + 1) * sizeof *list);
    apsm_status status = list ? place(w, i, stem, "vtk", &path) : no_memory(w);
    if (status == APSM_OK) status = vtk_grid_write(w->ctx, path, g, y);
    const size_t n = status == APSM_OK ? vtk_grid_inverted(g, g->x, y, list) : 0;
    if (n > 0) status = tell_inverted(w, path, n, list);
    free(list);
    free(path);
    return status;
}

static apsm_status warp_grid(warping *w, const char *file, const char *stem)
{
    vtk_grid g;
    APSM_TRY(vtk_grid_read(w->ctx, file, &g));
    double *Y = malloc((w->s->I * 3 * g.n + 1) * sizeof *Y);
    apsm_status status = Y ? warp_points(w, g.n, g.x, Y) : no_memory(w);
    for (size_t i = 0; i < w->s->I && status == APSM_OK; i++)
        status = write_grid(w, &g, stem, Y + i * 3 * g.n, i);
    free(Y);
    vtk_grid_free(&g);
    return status;
}

/* ---- landmarks ---- */

static apsm_status write_landmarks(warping *w, const landmark_list *marks, const char *stem,
                                   double *Y)
{
    for (size_t i = 0; i < w->s->I; i++) {
        char *path = NULL;
        const landmark_list moved = { marks->n, marks->name, Y + i * 3 * marks->n };
        apsm_status status = place(w, i, stem, "mrk.json", &path);
        if (status == APSM_OK) status = landmark_list_write(w->ctx, path, &moved);
        free(path);
        APSM_TRY(status);
    }
    return APSM_OK;
}

static apsm_status warp_landmarks(warping *w, const char *file, const char *stem)
{
    landmark_list marks = { 0 };
    APSM_TRY(landmark_list_read(w->ctx, file, &marks));
    double *Y = malloc((w->s->I * 3 * marks.n + 1) * sizeof *Y);
    apsm_status status = Y ? warp_points(w, marks.n, marks.x, Y) : no_memory(w);
    if (status == APSM_OK) status = write_landmarks(w, &marks, stem, Y);
    free(Y);
    landmark_list_free(&marks);
    return status;
}

/* ---- all ---- */

static bool ends_in(const char *path, const char *end)
{
    const size_t n = strlen(path), m = strlen(end);
    return n > m && strcmp(path + n - m, end) == 0;
}

/* Name of the file without folders and extensions. */
static char *stem_of(const char *file)
{
    char *stem = apsm_path_stem(file);
    if (stem && ends_in(stem, ".mrk")) stem[strlen(stem) - 4] = '\0';
    return stem;
}

static apsm_status warp_attached(warping *w, const char *file)
{
    char *stem = stem_of(file);
    apsm_status status = stem ? APSM_OK : no_memory(w);
    if (status == APSM_OK && ends_in(file, ".vtk"))
        status = warp_grid(w, file, stem);
    else if (status == APSM_OK && landmark_is_file(file))
        status = warp_landmarks(w, file, stem);
    else if (status == APSM_OK)
        status = apsm_fail(w->ctx, APSM_ERR_ARG,
                           "--attach %s: give landmarks (.mrk.json, .fcsv, .csv) or a mesh as .vtk",
                           file);
    free(stem);
    return status;
}

static apsm_status write_all(warping *w)
{
    const apsm_warp_settings *s = w->s;
    const bool keeps =
        strcmp(s->extension, "vtk") == 0 && s->mesh_path && ends_in(s->mesh_path, ".vtk");
    APSM_TRY(keeps ? warp_grid(w, s->mesh_path, NULL) : warp_mesh(w, s->mesh, NULL));
    for (size_t k = 0; k < s->n_attached; k++) APSM_TRY(warp_attached(w, s->attached[k]));
    json_t *root =
        json_pack("{s:s, s:i, s:I, s:I, s:O}", "format", "apsm-warp", "version", 1, "particles",
                  (json_int_t)s->J, "shapes", (json_int_t)s->I, "inverted", w->inverted);
    return out_folder_close(&w->folder, root);
}

/* Mean squared distance of the particles from the mesh, relative to their own spread: a tenth of
 * the size off is another shape, or another frame. */
static apsm_status check_template(apsm_context *ctx, const apsm_warp_settings *s)
{
    double mean[3] = { 0 }, off = 0, spread = 0;
    apsm_bvh *tree = NULL;
    APSM_TRY(apsm_bvh_build_unsigned(s->mesh, &tree));
    for (size_t x = 0; x < 3 * s->J; x++) mean[x % 3] += s->P0[x] / (double)s->J;
    for (size_t j = 0; j < s->J; j++) {
        apsm_closest at;
        apsm_bvh_closest(tree, s->P0 + 3 * j, INFINITY, &at);
        off += at.distance2;
        for (size_t c = 0; c < 3; c++)
            spread += (s->P0[3 * j + c] - mean[c]) * (s->P0[3 * j + c] - mean[c]);
    }
    apsm_bvh_free(tree);
    if (off <= 0.01 * spread) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                     "%s: the first particle set is not on it; give the particles of this mesh, in "
                     "its frame",
                     s->mesh_path ? s->mesh_path : "the template's mesh");
}

static apsm_status check_settings(apsm_context *ctx, const apsm_warp_settings *s)
{
    static const char *const known[] = { "ply", "vtp", "stl", "obj", "vtk" };
    size_t k = 0;
    if (!s || !s->mesh || !s->P0 || !s->P || !s->names || !s->extension || !s->folder)
        return apsm_fail(ctx, APSM_ERR_ARG, "apsm_warp_files: an argument is NULL");
    while (k < 5 && strcmp(known[k], s->extension) != 0) k++;
    if (k == 5)
        return apsm_fail(ctx, APSM_ERR_ARG, "--to %s: give ply, vtp, stl, obj or vtk",
                         s->extension);
    for (size_t i = 0; i < s->I; i++)
        for (size_t j = 0; j < i; j++)
            if (strcmp(s->names[i], s->names[j]) == 0)
                return apsm_fail(ctx, APSM_ERR_ARG,
                                 "two particle sets are called %s; rename one of the files",
                                 s->names[i]);
    return check_template(ctx, s);
}

apsm_status apsm_warp_files_sized(apsm_context *ctx, const apsm_warp_settings *given, size_t size,
                                  size_t *inverted)
{
    apsm_warp_settings known = { 0 }, *const settings = &known;
    APSM_TRY(apsm_take_settings(ctx, "apsm_warp_files", given, size, settings, sizeof known));
    APSM_TRY(check_settings(ctx, settings));
    warping w = { .ctx = ctx,
                  .s = settings,
                  .folder = { ctx, settings->folder, "warp.json", "apsm-warp", settings->overwrite,
                              NULL, NULL },
                  .inverted = json_object() };
    apsm_status status = w.inverted ? out_folder_open(&w.folder) : no_memory(&w);
    if (status == APSM_OK) status = write_all(&w);
    if (inverted) *inverted = w.n_inverted;
    json_decref(w.inverted);
    out_folder_free(&w.folder);
    return status;
}
