/* `apsm landmarks`: points that are placed once, on the template, carried to every shape, the mean
 * and its modes by the warp of docs/method.md, "Metrics"; of several parts each point by the part
 * whose particles are nearest. */
#include "landmarks/landmark_table.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/statistics.h"
#include "core/sized.h"
#include "files/files.h"
#include "files/project_columns.h"
#include "folder/model_folder.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "model/warp.h"

enum { MODES_MOST = 10 };
static const double deviations = 2;

typedef struct placing {
    apsm_context *ctx;
    const apsm_landmark_settings *s;
    model_folder m;
    landmark_list marks; /* on the template, in the world */
    size_t *part_of;     /* of every landmark */
    double *P;           /* J x 3 */
    double *Y;           /* n x 3 */
    landmark_table all;
} placing;

/* From the frame of shape i's input to the world. */
static apsm_status input_to_world(const placing *p, size_t i, double M[16])
{
    double R[16];
    bool plain;
    const char *text = apsm_subject_column(&p->m.project.subjects[i], "reflection");
    model_folder_to_world(&p->m, i, M);
    if (!text || !*text) return APSM_OK;
    if (apsm_transform_parse(text, R, &plain) != 16)
        return apsm_fail(p->ctx, APSM_ERR_FORMAT,
                         "%s: its reflection in the project is not 16 "
                         "numbers",
                         p->m.names[i]);
    apsm_affine_multiply(M, R, M);
    return APSM_OK;
}

/* The mean that points can be placed on: of several parts each has one. */
static const char *mean_file(const placing *p)
{
    return p->m.parts > 1 ? "meshes/mean_PART.ply" : "meshes/mean.ply";
}

static apsm_status read_marks(placing *p)
{
    double M[16];
    if (!landmark_is_file(p->s->file))
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "%s: give named points: .mrk.json, .fcsv or .csv (name,x,y,z)",
                         p->s->file);
    if (p->m.parts > 1 && !p->s->aligned)
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "%s: a model of several parts has a template for each; give points in the "
                         "world frame, on %s, and --aligned",
                         p->s->folder, mean_file(p));
    APSM_TRY(landmark_list_read(p->ctx, p->s->file, &p->marks));
    if (p->s->aligned) return APSM_OK;
    APSM_TRY(input_to_world(p, p->m.template_index, M));
    apsm_affine_apply(M, p->marks.n, p->marks.x, p->marks.x);
    return APSM_OK;
}

/* Where the points are given: on the template, or with aligned on the mean. */
static const double *source_of(const placing *p, size_t d)
{
    return p->s->aligned ? p->m.model.mean : p->m.P + 3 * p->m.part[d].template_index * p->m.J;
}

/* Of all particles that the points are given on. */
static double size_of_source(const placing *p)
{
    double lo[3] = { INFINITY, INFINITY, INFINITY }, hi[3] = { -INFINITY, -INFINITY, -INFINITY };
    for (size_t d = 0; d < p->m.parts; d++)
        for (size_t k = 0; k < 3 * p->m.part[d].J; k++) {
            const double x = source_of(p, d)[3 * p->m.part[d].first + k];
            lo[k % 3] = fmin(lo[k % 3], x);
            hi[k % 3] = fmax(hi[k % 3], x);
        }
    return sqrt(vec3_distance2(lo, hi));
}

/* Nothing is known of what lies farther from the surface than that is long. */
static apsm_status find_parts(placing *p)
{
    const double size = size_of_source(p);
    for (size_t l = 0; l < p->marks.n; l++) {
        double least = INFINITY;
        for (size_t d = 0; d < p->m.parts; d++) {
            const model_part *part = &p->m.part[d];
            const double *x = source_of(p, d) + 3 * part->first;
            for (size_t j = 0; j < part->J; j++) {
                const double d2 = vec3_distance2(x + 3 * j, p->marks.x + 3 * l);
                if (d2 < least) least = d2, p->part_of[l] = d;
            }
        }
        if (!(sqrt(least) <= size))
            return apsm_fail(p->ctx, APSM_ERR_GEOMETRY,
                             "%s: '%s' lies %.3g from the nearest particle of %s, which is %.3g "
                             "long; give it in the frame of %s",
                             p->s->file, p->marks.name[l], sqrt(least),
                             p->s->aligned ? "the mean" : p->m.names[p->m.template_index], size,
                             p->s->aligned ? mean_file(p) : "its input");
    }
    return APSM_OK;
}

/* Y <- the landmarks on particles P, of all parts; w: a warp of all landmarks for each part. */
static void carry(const placing *p, const apsm_warp *w, const double *P)
{
    for (size_t l = 0; l < p->marks.n; l++) {
        const size_t d = p->part_of[l];
        const double *a = w[d].W + l * w[d].J, *x = P + 3 * p->m.part[d].first;
        memset(p->Y + 3 * l, 0, 3 * sizeof *p->Y);
        for (size_t j = 0; j < w[d].J; j++) vec3_add_scaled(p->Y + 3 * l, a[j], x + 3 * j);
    }
}

/* OUT/NAME.mrk.json with the points of Y. */
static apsm_status write_points(const placing *p, const char *name)
{
    const size_t room = strlen(p->s->out) + strlen(name) + 16;
    char *path = malloc(room);
    const landmark_list list = { p->marks.n, p->marks.name, p->Y };
    if (!path) return APSM_ERR_MEMORY;
    snprintf(path, room, "%s/%s.mrk.json", p->s->out, name);
    const apsm_status status = landmark_list_write(p->ctx, path, &list);
    free(path);
    return status;
}

static apsm_status write_shape(placing *p, const apsm_warp *w, size_t i)
{
    double M[16], back[16];
    const landmark_list list = { p->marks.n, p->marks.name, p->Y };
    carry(p, w, p->m.P + 3 * i * p->m.J);
    if (!p->s->aligned) {
        APSM_TRY(input_to_world(p, i, M));
        APSM_TRY(apsm_affine_invert(M, back));
        apsm_affine_apply(back, p->marks.n, p->Y, p->Y);
    }
    APSM_TRY(landmark_table_take(&p->all, i, &list));
    return write_points(p, p->m.names[i]);
}

static apsm_status write_mode(const placing *p, const apsm_warp *w, size_t k, double sd)
{
    const apsm_shape_model *m = &p->m.model;
    char name[64];
    const double b = sd * sqrt(m->variance[k]);
    for (size_t x = 0; x < 3 * p->m.J; x++) p->P[x] = m->mean[x] + b * m->mode[k * 3 * p->m.J + x];
    carry(p, w, p->P);
    snprintf(name, sizeof name, "mode_%02zu_%s2sd", k + 1, sd < 0 ? "minus" : "plus");
    return write_points(p, name);
}

static apsm_status write_table(const placing *p)
{
    char *path = apsm_path_join(p->s->out, "landmarks.csv");
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = landmark_table_write(p->ctx, path, p->m.names, &p->all);
    free(path);
    return status;
}

/* What is there may be somebody's. */
static apsm_status make_place(const placing *p)
{
    apsm_file_list files = { 0 };
    APSM_TRY(apsm_make_folder(p->ctx, p->s->out));
    APSM_TRY(apsm_list_files(p->ctx, p->s->out, false, &files));
    const size_t n = files.n;
    apsm_file_list_free(&files);
    if (n == 0) return APSM_OK;
    return apsm_fail(p->ctx, APSM_ERR_STATE, "%s: is not empty; name a new folder", p->s->out);
}

static apsm_status write_all(placing *p, const apsm_warp *w)
{
    const size_t modes = p->m.model.modes < MODES_MOST ? p->m.model.modes : MODES_MOST;
    APSM_TRY(make_place(p));
    for (size_t i = 0; i < p->m.I; i++) APSM_TRY(write_shape(p, w, i));
    carry(p, w, p->m.model.mean);
    APSM_TRY(write_points(p, "mean"));
    for (size_t k = 0; k < modes; k++) {
        APSM_TRY(write_mode(p, w, k, -deviations));
        APSM_TRY(write_mode(p, w, k, deviations));
    }
    return write_table(p);
}

static apsm_status place(placing *p)
{
    APSM_TRY(read_marks(p));
    p->part_of = calloc(p->marks.n, sizeof *p->part_of);
    p->P = malloc(3 * p->m.J * sizeof *p->P);
    p->Y = malloc(3 * p->marks.n * sizeof *p->Y);
    apsm_warp *w = calloc(p->m.parts, sizeof *w);
    apsm_status status = p->part_of && p->P && p->Y && w ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = find_parts(p);
    for (size_t d = 0; d < p->m.parts && status == APSM_OK; d++)
        status = apsm_warp_build(p->ctx, APSM_PHI_R, p->marks.n, p->marks.x, p->m.part[d].J,
                                 source_of(p, d) + 3 * p->m.part[d].first, &w[d]);
    landmark_table_begin(p->m.I, &p->all);
    if (status == APSM_OK) status = write_all(p, w);
    for (size_t d = 0; w && d < p->m.parts; d++) apsm_warp_free(&w[d]);
    free(w);
    return status;
}

static apsm_status place_landmarks(apsm_context *ctx, const apsm_landmark_settings *settings)
{
    if (!settings->folder || !settings->file || !settings->out)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "landmarks: a model folder, a file and a place for the "
                         "results are needed");
    placing p = { .ctx = ctx, .s = settings };
    APSM_TRY(model_folder_read(ctx, settings->folder, FOLDER_PARTICLES | FOLDER_EVALUATED, &p.m));
    const apsm_status status = place(&p);
    if (status == APSM_OK)
        apsm_log(ctx, APSM_LOG_INFO, "%zu landmarks on %zu shapes: %s/landmarks.csv", p.marks.n,
                 p.m.I, settings->out);
    landmark_table_free(&p.all);
    landmark_list_free(&p.marks);
    free(p.part_of);
    free(p.P);
    free(p.Y);
    model_folder_free(&p.m);
    return status;
}

APSM_BY_SIZE(apsm_statistics_landmarks, apsm_landmark_settings, place_landmarks)
