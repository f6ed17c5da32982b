/* `apsm fit`: inputs to files.  Each shape is read, groomed as the cohort was, fitted and written
 * by one task, so a thread holds one shape at a time and no shape depends on another. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "apsm/particles.h"
#include "core/deal.h"
#include "core/sized.h"
#include "files/io.h"
#include "fit/fit_folder.h"
#include "fit/landmarks.h"
#include "fit/outputs.h"
#include "fit/reading.h"
#include "fit/shares.h"
#include "landmarks/landmark_file.h"

typedef struct session {
    const apsm_fit_settings *settings;
    apsm_fit_options options;
    apsm_fit_model *model;
    fit_origin origin;
    apsm_input_list list;
    fit_reading reading;
    landmark_list landmarks; /* on the mean; none: point files are clouds */
    fit_shares shares;
    fit_rows rows;  /* of no share */
    apsm_lock lock; /* of no share */
} session;

/* ---- points ---- */

/* A file of points, not of a surface. */
static bool is_point_file(const char *path)
{
    apsm_input_kind kind;
    if (apsm_is_folder(path) || apsm_input_kind_of(path, &kind)) return false;
    return apsm_points_extension(path) || landmark_is_file(path);
}

/* A list of landmarks by what it begins with: "name,x,y,z", or Slicer's markups. */
static bool holds_names(const char *path)
{
    char first[16] = "";
    int fd;
    if (!landmark_is_file(path) || apsm_open_regular(NULL, path, &fd) != APSM_OK) return false;
    const ssize_t n = read(fd, first, sizeof first - 1);
    close(fd);
    if (n < 0) return false; /* whoever reads it says why */
    return strncasecmp(first, "name,", 5) == 0 || strncasecmp(first, "label,", 6) == 0 ||
           strncmp(first, "# Markups", 9) == 0;
}

/* Points with names, of which nobody has said where they are on the mean: a cloud. */
static apsm_status fit_nameless(apsm_context *ctx, const session *s, const char *path,
                                const apsm_fit_options *options, apsm_fit *fit)
{
    landmark_list l;
    APSM_TRY(landmark_list_read(ctx, path, &l));
    apsm_log(
        ctx, APSM_LOG_WARNING,
        "%s: is fitted as a cloud of %zu points of the surface; if they are landmarks, say where "
        "they are on the mean shape, --landmarks",
        path, l.n);
    const apsm_status status = apsm_fit_points(ctx, s->model, path, l.n, l.x, options, fit);
    landmark_list_free(&l);
    return status;
}

static apsm_status fit_cloud(apsm_context *ctx, const session *s, const char *path,
                             const apsm_fit_options *options, apsm_fit *fit)
{
    size_t n;
    double *x = NULL;
    if (holds_names(path)) return fit_nameless(ctx, s, path, options, fit);
    APSM_TRY(apsm_points_read(ctx, path, &n, &x));
    const apsm_status status = apsm_fit_points(ctx, s->model, path, n, x, options, fit);
    free(x);
    return status;
}

/* Of the file's points those whose names the model's have; that some have none is said. */
static void pair_landmarks(apsm_context *ctx, const session *s, const char *path,
                           const landmark_list *l, double *at, fit_landmark_set *paired)
{
    double *x = at + 3 * l->n;
    const char **name = (const char **)(x + 3 * l->n);
    size_t n = 0;
    for (size_t k = 0; k < l->n; k++) {
        const size_t i = landmark_list_find(&s->landmarks, l->name[k]);
        if (i == s->landmarks.n) continue;
        memcpy(at + 3 * n, s->landmarks.x + 3 * i, 3 * sizeof *at);
        memcpy(x + 3 * n, l->x + 3 * k, 3 * sizeof *x);
        name[n++] = l->name[k];
    }
    *paired = (fit_landmark_set){ n, at, x, name };
    if (n >= 3 && n < l->n)
        apsm_log(ctx, APSM_LOG_WARNING,
                 "%s: %zu of %zu points have names that %s has not; left out", path, l->n - n, l->n,
                 s->settings->landmarks);
}

static apsm_status fit_named(apsm_context *ctx, const session *s, const char *path,
                             const apsm_fit_options *options, apsm_fit *fit)
{
    landmark_list l;
    fit_landmark_set paired;
    const apsm_fit_call call = { options, sizeof *options, fit, sizeof *fit };
    APSM_TRY(landmark_list_read(ctx, path, &l));
    double *store = malloc(l.n * (6 * sizeof *store + sizeof *l.name) + 1);
    apsm_status status = APSM_ERR_MEMORY;
    if (store) {
        pair_landmarks(ctx, s, path, &l, store, &paired);
        status =
            paired.n < 3
                ? apsm_fail(ctx, APSM_ERR_GEOMETRY,
                            "%s: %zu of its points (the first is '%s') have names that %s has; 3 "
                            "at least are needed",
                            path, paired.n, l.name[0], s->settings->landmarks)
                : fit_named_landmarks(ctx, s->model, path, &paired, &call);
    }
    free(store);
    landmark_list_free(&l);
    return status;
}

/* ---- one shape ---- */

static apsm_status fit_input(apsm_context *ctx, const session *s, const apsm_input_case *c,
                             apsm_fit *fit)
{
    apsm_mesh mesh = { 0 };
    apsm_fit_options options = s->options;
    if (is_point_file(c->path))
        return s->landmarks.n > 0 ? fit_named(ctx, s, c->path, &options, fit)
                                  : fit_cloud(ctx, s, c->path, &options, fit);
    APSM_TRY(fit_read_surface(ctx, &s->reading, c, &mesh, &options.extent));
    if (c->reflect) options.hand = APSM_HAND_OTHER;
    const apsm_status status = apsm_fit_surface(ctx, s->model, c->path, &mesh, &options, fit);
    apsm_mesh_free(&mesh);
    return status;
}

/* Figures and scores are for the tables; the rest goes. */
static apsm_status keep_row(apsm_context *ctx, const session *s, size_t i, fit_row *row)
{
    fit_forget_arrays(&row->figures);
    return fit_rows_put(ctx, &s->rows, i, row);
}

/* The row and figures of a fit that is made here. */
static apsm_status make_fit(apsm_context *ctx, const session *s, const apsm_input_case *c,
                            apsm_status hashed, fit_row *row, apsm_fit *fit)
{
    const apsm_status status = hashed == APSM_OK ? fit_input(ctx, s, c, fit) : hashed;
    if (status == APSM_ERR_MEMORY || status == APSM_ERR_INTERRUPTED) return status;
    const char *line = apsm_error_text(ctx);
    row->failed = status != APSM_OK;
    snprintf(row->problem, sizeof row->problem, "%s",
             !row->failed ? fit->reason
             : *line      ? line
                          : apsm_status_text(status));
    row->figures = *fit;
    return APSM_OK;
}

/* The same as a share has kept it, or made here; *kept: which. */
static apsm_status obtain_fit(apsm_context *ctx, session *s, const apsm_input_case *c, fit_row *row,
                              apsm_fit *fit, bool *kept)
{
    *kept = false;
    const apsm_status hashed = apsm_input_hash(ctx, c->path, row->sha256);
    if (hashed == APSM_OK) APSM_TRY(fit_shares_find(ctx, &s->shares, c, row, fit, kept));
    return *kept ? APSM_OK : make_fit(ctx, s, c, hashed, row, fit);
}

static apsm_status fit_case(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    session *s = user;
    const apsm_input_case *c = &s->list.cases[i];
    fit_row row = { .name = c->name, .path = c->path };
    apsm_fit fit = { 0 };
    bool kept;
    apsm_status status = obtain_fit(ctx, s, c, &row, &fit, &kept);
    if (status == APSM_OK && !row.failed)
        status = fit_write_shape(ctx, s->settings->folder, &s->origin, &row, &fit);
    if (status == APSM_OK) status = keep_row(ctx, s, i, &row);
    apsm_fit_free(&fit);
    return status;
}

/* One of a share: it is kept, and nothing is written.  What fails is left to the job that gathers,
 * which tells it again. */
static apsm_status fit_case_of_share(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    session *s = user;
    const apsm_input_case *c = &s->list.cases[i];
    fit_row row = { .name = c->name, .path = c->path };
    apsm_fit fit = { 0 };
    bool kept;
    apsm_status status = obtain_fit(ctx, s, c, &row, &fit, &kept);
    if (status == APSM_OK && row.failed)
        apsm_log(ctx, APSM_LOG_WARNING, "%s: failed: %s", row.name, row.problem);
    else if (status == APSM_OK && !kept)
        status = fit_shares_keep(ctx, &s->shares, c, &row);
    apsm_fit_free(&fit);
    return status;
}

/* ---- the folder ---- */

static fit_folder folder_of(const apsm_fit_settings *o)
{
    static const char *const files[] = { FIT_CSV, "report.html" };
    static const char *const folders[] = { "particles", "meshes", "shapes" };
    return (fit_folder){ .path = o->folder,
                         .what = "fits",
                         .maker = "fit",
                         .marker = FIT_JSON,
                         .files = 2,
                         .file = files,
                         .folders = 3,
                         .folder = folders,
                         .overwrite = o->overwrite };
}

/* ---- which inputs ---- */

/* The file name without its extension; ".mrk.json" counts as one. */
static char *stem_of(const char *path)
{
    char *name = strdup(apsm_path_last(path));
    char *dot = name ? strrchr(name, '.') : NULL;
    if (dot && dot != name) *dot = 0;
    dot = name ? strrchr(name, '.') : NULL;
    if (dot && strcmp(dot, ".mrk") == 0) *dot = 0;
    return name;
}

static apsm_status add_point_file(apsm_context *ctx, const char *path, apsm_input_list *list)
{
    apsm_input_case one = { .name = stem_of(path), .path = strdup(path) };
    apsm_input_case *cases = realloc(list->cases, (list->n + 1) * sizeof *cases);
    if (cases) list->cases = cases;
    apsm_status status = cases && one.name && one.path ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; status == APSM_OK && i < list->n; i++)
        if (strcmp(list->cases[i].name, one.name) == 0)
            status = apsm_fail(ctx, APSM_ERR_ARG, "%s: another input is called '%s'; rename one",
                               path, one.name);
    if (status == APSM_OK) {
        list->cases[list->n++] = one;
        return APSM_OK;
    }
    free(one.name);
    free(one.path);
    return status;
}

/* Surfaces as always, and files of points. */
static apsm_status list_inputs(apsm_context *ctx, session *s)
{
    const apsm_fit_settings *o = s->settings;
    size_t n = 0;
    const char **surfaces = malloc((o->n_inputs + 1) * sizeof *surfaces);
    if (!surfaces) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < o->n_inputs; k++)
        if (!is_point_file(o->inputs[k])) surfaces[n++] = o->inputs[k];
    apsm_status status = APSM_OK;
    if (n > 0) status = apsm_input_expand(ctx, n, surfaces, o->exclude, o->reflect_match, &s->list);
    for (size_t k = 0; k < o->n_inputs && status == APSM_OK; k++)
        if (is_point_file(o->inputs[k])) status = add_point_file(ctx, o->inputs[k], &s->list);
    free(surfaces);
    return status;
}

/* ---- all ---- */

static bool is_any_image(const apsm_input_list *list)
{
    for (size_t i = 0; i < list->n; i++) {
        apsm_input_kind kind;
        if (apsm_is_folder(list->cases[i].path)) return true;
        if (apsm_input_kind_of(list->cases[i].path, &kind) && kind != APSM_INPUT_MESH) return true;
    }
    return false;
}

/* Unless told otherwise, the labels that the model's shapes had. */
static apsm_status take_labels(apsm_context *ctx, session *s)
{
    const char *labels = s->model->labels, *own = s->settings->labels;
    if (own && *own && !is_any_image(&s->list))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "--label %s: no input is an image, and nothing else has labels; leave the "
                         "option out",
                         own);
    if (!labels || (own && *own)) return APSM_OK;
    apsm_labels_free(&s->reading.labels);
    APSM_TRY(apsm_labels_parse(ctx, labels, &s->reading.labels));
    s->reading.labels.if_several = true;
    if (is_any_image(&s->list))
        apsm_log(ctx, APSM_LOG_INFO, "labels of segmentations are those of the model's shapes: %s",
                 labels);
    return APSM_OK;
}

static apsm_status open_session(apsm_context *ctx, session *s)
{
    const apsm_fit_settings *o = s->settings;
    const fit_folder folder = folder_of(o);
    const fit_share_job job = { o, &s->options, &s->landmarks };
    APSM_TRY(apsm_labels_parse(ctx, o->labels ? o->labels : "", &s->reading.labels));
    APSM_TRY(list_inputs(ctx, s));
    if (o->landmarks) APSM_TRY(landmark_list_read(ctx, o->landmarks, &s->landmarks));
    APSM_TRY(apsm_fit_model_load(ctx, o->model, &s->model));
    APSM_TRY(take_labels(ctx, s));
    APSM_TRY(o->shards > 0 ? fit_folder_check(ctx, &folder)
                           : fit_folder_lock(ctx, &folder, &s->lock));
    fit_origin_of(s->model, o->model, &s->options, &s->origin);
    s->reading.groom = fit_model_groom(s->model);
    APSM_TRY(fit_shares_open(ctx, s->model, &job, &s->shares));
    if (o->shards > 0) return APSM_OK;
    APSM_TRY(fit_folder_make(ctx, &folder));
    return fit_rows_open(ctx, o->folder, s->list.n, s->model->model.modes, &s->rows);
}

static void close_session(session *s)
{
    fit_rows_close(&s->rows);
    fit_shares_close(&s->shares);
    landmark_list_free(&s->landmarks);
    apsm_labels_free(&s->reading.labels);
    apsm_input_list_free(&s->list);
    apsm_fit_model_free(s->model);
    apsm_unlock_folder(&s->lock);
}

static apsm_status count(apsm_context *ctx, session *s, apsm_fit_totals *totals)
{
    for (size_t i = 0; i < s->list.n; i++) {
        APSM_TRY(fit_rows_get(ctx, &s->rows, i));
        const fit_row *row = s->rows.row;
        const apsm_fit_verdict v = row->figures.verdict;
        size_t *of[] = { &totals->good, &totals->review, &totals->refused };
        ++*(row->failed ? &totals->failed : of[v]);
        if (row->failed || v != APSM_FIT_GOOD)
            apsm_log(ctx, APSM_LOG_WARNING, "%s: %s: %s", row->name,
                     row->failed ? "failed" : apsm_fit_verdict_text(v), row->problem);
    }
    return APSM_OK;
}

static apsm_status fit_own(apsm_context *ctx, session *s)
{
    const apsm_deal deal = { .rank = s->settings->shard, .size = s->settings->shards };
    const apsm_shared_loop loop = {
        .n = s->list.n, .fn = fit_case_of_share, .user = s, .stage = "fit"
    };
    apsm_context_set_deal(ctx, &deal);
    const apsm_status status = apsm_shared_for(ctx, &loop);
    apsm_context_set_deal(ctx, NULL);
    return status;
}

static apsm_status fit_share(apsm_context *ctx, session *s)
{
    const apsm_fit_settings *o = s->settings;
    APSM_TRY(fit_own(ctx, s));
    APSM_TRY(journal_flush(ctx, s->shares.own));
    if (!journal_is_there(s->shares.own)) {
        apsm_log(ctx, APSM_LOG_WARNING,
                 "share %zu of %zu: its journal in %s/state was removed meanwhile; the job without "
                 "--shard did not wait for it",
                 o->shard + 1, o->shards, o->folder);
        return APSM_OK;
    }
    apsm_log(ctx, APSM_LOG_INFO,
             "share %zu of %zu is kept in %s/state; when all are, the same without --shard writes "
             "the fits",
             o->shard + 1, o->shards, o->folder);
    return APSM_OK;
}

static apsm_status fit_all(apsm_context *ctx, session *s, apsm_fit_totals *totals)
{
    const char *folder = s->settings->folder;
    APSM_TRY(fit_write_mean(ctx, folder, s->model));
    APSM_TRY(apsm_parallel_for(ctx, s->list.n, fit_case, s, "fit"));
    APSM_TRY(fit_write_tables(ctx, folder, &s->origin, &s->rows));
    APSM_TRY(fit_shares_end(ctx, &s->shares));
    return count(ctx, s, totals);
}

apsm_status fit_take_settings(apsm_context *ctx, const char *door, const apsm_fit_settings *given,
                              size_t size, apsm_fit_settings *settings, apsm_fit_options *options)
{
    APSM_TRY(apsm_take_settings(ctx, door, given, size, settings, sizeof *settings));
    if (!settings->model || !settings->folder || !settings->inputs)
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: an argument is NULL", door);
    if (settings->shards > 0 && settings->shard >= settings->shards)
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: share %zu of %zu, counted from 0", door,
                         settings->shard, settings->shards);
    *options = apsm_fit_defaults();
    if (!settings->options) return APSM_OK;
    APSM_TRY(apsm_take_settings(ctx, door, settings->options, settings->options_size, options,
                                sizeof *options));
    if (options->start)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "%s: start is the pose of one shape; give it to apsm_fit_surface", door);
    return APSM_OK;
}

apsm_status apsm_fit_run_sized(apsm_context *ctx, const apsm_fit_settings *given, size_t size,
                               apsm_fit_totals *totals, size_t totals_size)
{
    apsm_fit_settings known = { 0 }, *const settings = &known;
    apsm_fit_totals counted = { 0 };
    session s = { .settings = settings, .rows.file.fd = -1 };
    if (!totals) return apsm_fail(ctx, APSM_ERR_ARG, "apsm_fit_run: no place for the totals");
    APSM_TRY(fit_take_settings(ctx, "apsm_fit_run", given, size, settings, &s.options));
    apsm_status status = open_session(ctx, &s);
    if (status == APSM_OK)
        status = settings->shards > 0 ? fit_share(ctx, &s) : fit_all(ctx, &s, &counted);
    apsm_give_sized(&counted, sizeof counted, totals, totals_size);
    close_session(&s);
    return status;
}
