/* A model from the folder that a run has left. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "fit/calibration_file.h"
#include "fit/model_file.h"
#include "folder/manifest_json.h"
#include "folder/model_folder.h"
#include "folder/names.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"

/* Particles of another program are aligned, and how their shapes lay may not be known. */
static bool are_poses_known(const model_folder *f, const apsm_options *o)
{
    double first[16], M[16];
    if (o->align.align == APSM_ALIGN_NONE) return true;
    model_folder_to_world(f, 0, first);
    for (size_t i = 1; i < f->I; i++) {
        model_folder_to_world(f, i, M);
        if (memcmp(M, first, sizeof M) != 0) return true;
    }
    return false;
}

/* The rotation that most shapes' alignments share, within 60 degrees, if four fifths do: from the
 * orientation in which shapes come to the world's. */
static void find_orientation(const model_folder *f, apsm_fit_model *m)
{
    size_t near = 0;
    for (size_t k = 0; k < 9; k++) m->common[k] = k % 4 == 0 ? 1 : 0;
    for (int round = 0; round < 3; round++) {
        double sum[9] = { 0 };
        near = 0;
        for (size_t i = 0; i < f->I; i++) {
            double M[16], trace = 0;
            model_folder_to_world(f, i, M);
            const double scale = vec3_norm(M);
            for (size_t k = 0; k < 9; k++) trace += m->common[k] * M[4 * (k / 3) + k % 3] / scale;
            if (round > 0 && !(trace > 2)) continue;
            near++;
            for (size_t k = 0; k < 9; k++) sum[k] += M[4 * (k / 3) + k % 3] / scale;
        }
        apsm_nearest_rotation(sum, m->common);
    }
    m->oriented = are_poses_known(f, &m->options) && 5 * near >= 4 * f->I ? 1 : 0;
}

/* Two-way distances of the shapes, if they were measured; h is not yet known. */
static void find_distances(const model_folder *f, apsm_fit_model *m)
{
    const json_t *distance = json_object_get(f->evaluation, "surface_distance"), *shape;
    size_t k;
    m->calibration.distance = json_number_value(json_object_get(distance, "mean"));
    json_array_foreach(json_object_get(distance, "per_shape"), k, shape)
    {
        const double mean = json_number_value(json_object_get(shape, "mean"));
        m->calibration.distance_most = fmax(m->calibration.distance_most, mean);
    }
}

/* How the cohort's images were read, and what its lengths are. */
static apsm_status take_words(const model_folder *f, apsm_fit_model *m)
{
    const char *labels = apsm_project_get(&f->project, "apsm", "labels");
    if (labels && *labels) APSM_TRY(apsm_text_set(&m->labels, labels));
    const char *unit = manifest_unit(f->manifest);
    return unit ? apsm_text_set(&m->unit, unit) : APSM_OK;
}

static apsm_status tell_regions(apsm_context *ctx, const char *folder)
{
    char *whole = apsm_path_join(folder, "groomed/whole");
    if (!whole) return APSM_ERR_MEMORY;
    if (apsm_is_folder(whole))
        apsm_log(
            ctx, APSM_LOG_WARNING,
            "%s: is a model of what constraints leave of the shapes: new shapes have to be cut "
            "alike, and are given as open surfaces",
            folder);
    free(whole);
    return APSM_OK;
}

static apsm_status take_folder(apsm_context *ctx, model_folder *f, apsm_fit_model *m)
{
    apsm_mesh mesh = { 0 };
    const size_t D = 3 * f->J;
    if (f->I < 3)
        return apsm_fail(ctx, APSM_ERR_STATE,
                         "%s: a model of %zu shapes cannot be fitted; it needs 3 at least", m->path,
                         f->I);
    if (f->parts > 1)
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "%s: is a model of %zu parts a subject; fits are of models of one part",
                         m->path, f->parts);
    m->T = malloc(D * sizeof *m->T);
    if (!m->T) return APSM_ERR_MEMORY;
    memcpy(m->T, f->P + f->template_index * D, D * sizeof *m->T);
    APSM_TRY(apsm_options_of_project(ctx, &f->project, &m->options));
    APSM_TRY(model_folder_mesh(ctx, f, f->template_index, &mesh));
    APSM_TRY(fit_model_take_mesh(ctx, &mesh, m));
    APSM_TRY(take_words(f, m));
    m->cropped = json_object_get(f->manifest, "cropped") ? 1 : 0;
    find_orientation(f, m);
    find_distances(f, m);
    m->model = f->model; /* taken over */
    f->model = (apsm_shape_model){ 0 };
    return APSM_OK;
}

static apsm_status read_folder(apsm_context *ctx, apsm_fit_model *m)
{
    model_folder f;
    const unsigned parts = FOLDER_PARTICLES | FOLDER_SCORES | FOLDER_EVALUATED | FOLDER_MANIFESTED;
    APSM_TRY(model_folder_read(ctx, m->path, parts, &f));
    const apsm_status status = take_folder(ctx, &f, m);
    model_folder_free(&f);
    return status;
}

static apsm_status load_folder(apsm_context *ctx, apsm_fit_model *m)
{
    APSM_TRY(read_folder(ctx, m));
    APSM_TRY(tell_regions(ctx, m->path));
    return fit_calibration_read(ctx, m);
}

static apsm_status load(apsm_context *ctx, apsm_fit_model *m)
{
    APSM_TRY(apsm_is_folder(m->path) ? load_folder(ctx, m) : fit_model_read_file(ctx, m));
    const apsm_status status = fit_model_prepare(ctx, m);
    if (status == APSM_OK && m->calibration.modes < 1)
        apsm_log(ctx, APSM_LOG_WARNING,
                 "%s: its %zu shapes are too few for a mode that others follow: how unusual a new "
                 "shape is cannot be told",
                 m->path, m->model.I);
    /* Its kernels know no file, and not all of them have a line. */
    if (status == APSM_OK || status == APSM_ERR_MEMORY || status == APSM_ERR_INTERRUPTED)
        return status;
    char why[256];
    snprintf(why, sizeof why, "%s", apsm_error_text(ctx));
    return apsm_fail(ctx, status, "%s: no shape can be fitted with it (%s); export the model again",
                     m->path, *why ? why : apsm_status_text(status));
}

/* ---- the calibration that a folder keeps ---- */

static apsm_status calibrate_and_write(apsm_context *ctx, const char *path, apsm_fit_model *m,
                                       bool *made)
{
    char of[65];
    fit_calibration_of(m, of);
    const apsm_status status = fit_model_prepare(ctx, m);
    *made = status == APSM_OK && fit_calibration_makes_sense(&m->calibration);
    if (*made) return fit_calibration_write(ctx, path, &m->calibration, of);
    return status == APSM_ERR_MEMORY || status == APSM_ERR_INTERRUPTED ? status : APSM_OK;
}

apsm_status fit_calibrate_folder(apsm_context *ctx, const char *folder, bool *made)
{
    *made = false;
    apsm_fit_model *m = calloc(1, sizeof *m);
    char *path = apsm_path_join(folder, FOLDER_CALIBRATION);
    if (m) m->path = strdup(folder);
    apsm_status status = m && path && m->path ? read_folder(ctx, m) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = calibrate_and_write(ctx, path, m, made);
    apsm_fit_model_free(m);
    free(path);
    return status;
}

apsm_status apsm_fit_model_load(apsm_context *ctx, const char *path, apsm_fit_model **model)
{
    if (!path || !model)
        return apsm_fail(ctx, APSM_ERR_ARG, "apsm_fit_model_load: an argument is NULL");
    apsm_fit_model *m = calloc(1, sizeof *m);
    *model = NULL;
    if (m) m->path = strdup(path);
    apsm_status status = m && m->path ? load(ctx, m) : APSM_ERR_MEMORY;
    if (status == APSM_ERR_MEMORY) status = apsm_fail(ctx, status, "%s: out of memory", path);
    if (status == APSM_OK)
        *model = m;
    else
        apsm_fit_model_free(m);
    return status;
}
