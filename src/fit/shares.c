#include "fit/shares.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "files/files.h"
#include "fit/calibration_file.h"
#include "fit/parts.h"

/* ---- what job it is ---- */

static void add_options(apsm_sha256 *sha, const apsm_options *options)
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    for (size_t k = 0; k < n; k++) {
        char text[64] = "";
        if (apsm_options_get(options, table[k].name, text) != APSM_OK) continue;
        apsm_sha256_add_text(sha, table[k].name);
        apsm_sha256_add_text(sha, text);
    }
}

static void add_model(apsm_sha256 *sha, const apsm_fit_model *m)
{
    char numbers[65];
    fit_calibration_of(m, numbers);
    apsm_sha256_add_text(sha, numbers);
    apsm_sha256_add(sha, &m->calibration, sizeof m->calibration);
    apsm_sha256_add(sha, &m->cropped, sizeof m->cropped);
    apsm_sha256_add(sha, &m->oriented, sizeof m->oriented);
    if (m->oriented > 0) apsm_sha256_add(sha, m->common, sizeof m->common);
    apsm_sha256_add_text(sha, m->labels ? m->labels : "");
    add_options(sha, &m->options);
}

static journal_key scope_of(const apsm_fit_model *m, const fit_share_job *job)
{
    const apsm_fit_options *o = job->options;
    const landmark_list *l = job->landmarks;
    const int words[] = { o->hand, o->extent, o->aligned, o->force };
    const char *labels = job->settings->labels;
    const size_t layout[] = { sizeof(fit_row), sizeof(apsm_fit) }; /* of a piece */
    journal_key key;
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add_text(&sha, "fit");
    apsm_sha256_add_text(&sha, APSM_VERSION);
    add_model(&sha, m);
    apsm_sha256_add(&sha, layout, sizeof layout);
    apsm_sha256_add(&sha, words, sizeof words);
    apsm_sha256_add_text(&sha, labels ? labels : "");
    for (size_t k = 0; k < l->n; k++) apsm_sha256_add_text(&sha, l->name[k]);
    if (l->n > 0) apsm_sha256_add(&sha, l->x, 3 * l->n * sizeof *l->x);
    apsm_sha256_end(&sha, key.byte);
    return key;
}

/* The first piece of a journal says whose the others are. */
static const char job_word[] = "job of fits";

/* Of the job: *said.  Of another one: *other.  Neither: its first piece is damaged or not there
 * yet; the keys of the others hold the job as well. */
static apsm_status ask_job(apsm_context *ctx, const fit_shares *s, const journal *j, bool *said,
                           bool *other)
{
    void *data;
    size_t size;
    const journal_key key = journal_key_of(job_word);
    APSM_TRY(journal_find(ctx, j, &key, &data, &size));
    *said = data && size == sizeof s->scope && memcmp(data, &s->scope, size) == 0;
    *other = !*said && data;
    free(data);
    return APSM_OK;
}

/* ---- opening, closing ---- */

static apsm_status open_own(apsm_context *ctx, const char *path, fit_shares *s)
{
    bool said, other;
    const journal_key key = journal_key_of(job_word);
    APSM_TRY(journal_open(ctx, path, false, &s->own));
    APSM_TRY(ask_job(ctx, s, s->own, &said, &other));
    if (other ||
        (!said && journal_count(s->own) <= 1)) { /* of another job, or but a spoilt piece */
        journal_close(s->own);
        APSM_TRY(journal_open(ctx, path, true, &s->own));
    }
    return said ? APSM_OK : journal_add(ctx, s->own, &key, &s->scope, sizeof s->scope);
}

static apsm_status make_own(apsm_context *ctx, const char *state, const char *path, fit_shares *s)
{
    APSM_TRY(apsm_make_folder(ctx, state));
    return open_own(ctx, path, s);
}

static apsm_status open_share(apsm_context *ctx, const apsm_fit_settings *o, fit_shares *s)
{
    char *state = apsm_path_join(s->folder, "state"),
         *path = shard_path(s->folder, o->shard, o->shards);
    apsm_status status = state && path ? make_own(ctx, state, path, s) : APSM_ERR_MEMORY;
    if (status != APSM_OK && state && path && !apsm_is_folder(state))
        status = make_own(ctx, state, path, s); /* who gathered others' has removed it meanwhile */
    free(state);
    free(path);
    return status;
}

static apsm_status refuse_others(apsm_context *ctx, const fit_shares *s)
{
    for (size_t k = 0; k < s->kept.n; k++) {
        bool said, other;
        APSM_TRY(ask_job(ctx, s, s->kept.list[k], &said, &other));
        if (other)
            return apsm_fail(ctx, APSM_ERR_STATE,
                             "%s/state: holds what shares of another job have kept (another model "
                             "or other options); give theirs, or remove that folder",
                             s->folder);
    }
    return APSM_OK;
}

apsm_status fit_shares_open(apsm_context *ctx, const apsm_fit_model *model,
                            const fit_share_job *job, fit_shares *s)
{
    const apsm_fit_settings *o = job->settings;
    *s = (fit_shares){ .model = model, .folder = o->folder };
    if (o->shards == 0) APSM_TRY(journal_set_add_shards(ctx, &s->kept, s->folder));
    if (o->shards == 0 && s->kept.n == 0) return APSM_OK; /* nothing asks for the scope */
    s->scope = scope_of(model, job);
    return o->shards > 0 ? open_share(ctx, o, s) : refuse_others(ctx, s);
}

void fit_shares_close(fit_shares *s)
{
    journal_set_close(&s->kept);
    journal_close(s->own);
    *s = (fit_shares){ 0 };
}

/* Beside the first piece, which says whose they are. */
static bool holds_fits(const journal_set *kept)
{
    for (size_t k = 0; k < kept->n; k++)
        if (journal_count(kept->list[k]) > 1) return true;
    return false;
}

apsm_status fit_shares_end(apsm_context *ctx, fit_shares *s)
{
    if (s->kept.n == 0) return APSM_OK;
    if (s->found == 0 && holds_fits(&s->kept)) {
        apsm_log(ctx, APSM_LOG_WARNING,
                 "what shares have kept in %s/state is of other inputs: not used, and left there; "
                 "remove that folder if nobody wants it",
                 s->folder);
        return APSM_OK;
    }
    if (s->found > 0)
        apsm_log(ctx, APSM_LOG_INFO, "%zu fits that shares have kept were found in %s/state",
                 s->found, s->folder);
    APSM_TRY(shards_remove(ctx, s->folder, false));
    char *state = apsm_path_join(s->folder, "state");
    if (!state) return APSM_ERR_MEMORY;
    rmdir(state); /* what else is there stays */
    free(state);
    return APSM_OK;
}

/* ---- one fit: a fit_row without its pointers, and, if there are particles, their arrays ---- */

enum { FIELDS = 10 };
typedef struct field {
    void *at;
    size_t bytes;
} field;

/* All but what the model knows. */
static void fields_of(const apsm_fit *f, field list[FIELDS])
{
    const size_t J = f->J * sizeof(double), nv = f->mesh.nv * sizeof(double);
    const field all[FIELDS] = { { f->local, 3 * J },
                                { f->world, 3 * J },
                                { f->original, 3 * J },
                                { f->score, f->modes * sizeof *f->score },
                                { f->sd, J },
                                { f->sd_normal, J },
                                { f->mesh.V, 3 * nv },
                                { f->mesh_sd, nv },
                                { f->observed, f->J * sizeof *f->observed },
                                { f->mesh_observed, f->mesh.nv * sizeof *f->mesh_observed } };
    memcpy(list, all, sizeof all);
}

static size_t bytes_of(const field list[FIELDS])
{
    size_t bytes = 0;
    for (size_t k = 0; k < FIELDS; k++) bytes += list[k].bytes;
    return bytes;
}

static journal_key key_of(const fit_shares *s, const apsm_input_case *c, const fit_row *row)
{
    const int how[] = { (int)c->kind, c->reflect };
    journal_key key;
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add(&sha, &s->scope, sizeof s->scope);
    apsm_sha256_add_text(&sha, c->name);
    apsm_sha256_add_text(&sha, apsm_path_last(c->path));
    apsm_sha256_add_text(&sha, row->sha256);
    apsm_sha256_add(&sha, how, sizeof how);
    apsm_sha256_end(&sha, key.byte);
    return key;
}

apsm_status fit_shares_keep(apsm_context *ctx, const fit_shares *s, const apsm_input_case *c,
                            const fit_row *row)
{
    field list[FIELDS] = { { 0 } };
    if (row->figures.J > 0) fields_of(&row->figures, list);
    const size_t size = sizeof *row + bytes_of(list);
    unsigned char *data = calloc(1, size), *to = data;
    if (!data) return APSM_ERR_MEMORY;
    fit_row bare = *row;
    bare.name = bare.path = NULL;
    fit_forget_arrays(&bare.figures);
    bare.figures.score = NULL;
    memcpy(to, &bare, sizeof bare);
    to += sizeof bare;
    for (size_t k = 0; k < FIELDS; to += list[k++].bytes)
        if (list[k].bytes > 0) memcpy(to, list[k].at, list[k].bytes);
    const journal_key key = key_of(s, c, row);
    const apsm_status status = journal_add(ctx, s->own, &key, data, size);
    free(data);
    return status;
}

/* Whether a row that a file holds can be one of this model's: whatever its check sum, sizes and
 * ends are not believed. */
static bool is_sound(const apsm_fit_model *m, const fit_row *row)
{
    const apsm_fit *f = &row->figures;
    const bool sized = f->J == 0 ? f->verdict == APSM_FIT_REFUSED
                                 : f->J == m->model.J && f->modes == m->model.modes;
    return sized && (unsigned)f->verdict <= APSM_FIT_REFUSED &&
           memchr(row->problem, 0, sizeof row->problem) && memchr(f->reason, 0, sizeof f->reason);
}

/* fit (out): a piece's figures, and arrays of the model's sizes.  *sound: there is no more and no
 * less in the piece. */
static apsm_status unpack(const fit_shares *s, const unsigned char *data, size_t size, fit_row *row,
                          apsm_fit *fit, bool *sound)
{
    field list[FIELDS] = { { 0 } };
    *sound = size >= sizeof *row;
    if (*sound) memcpy(row, data, sizeof *row);
    *sound = *sound && is_sound(s->model, row);
    if (!*sound) return APSM_OK;
    fit_forget_arrays(&row->figures);
    row->figures.score = NULL;
    *fit = row->figures;
    if (fit->J > 0) {
        APSM_TRY(fit_alloc(s->model, fit));
        fields_of(fit, list);
    }
    *sound = size == sizeof *row + bytes_of(list);
    data += sizeof *row;
    for (size_t k = 0; k < FIELDS && *sound; data += list[k++].bytes)
        if (list[k].bytes > 0) memcpy(list[k].at, data, list[k].bytes);
    return APSM_OK;
}

/* The same; a piece that is not sound is of no use, and the fit is made. */
static apsm_status take(const fit_shares *s, const unsigned char *data, size_t size, fit_row *row,
                        apsm_fit *fit, bool *found)
{
    fit_row kept;
    APSM_TRY(unpack(s, data, size, &kept, fit, found));
    if (!*found) return apsm_fit_free(fit), APSM_OK;
    row->failed = false; /* those are not kept */
    memcpy(row->problem, kept.problem, sizeof row->problem);
    row->figures = *fit;
    return APSM_OK;
}

static apsm_status look_up(apsm_context *ctx, const fit_shares *s, const journal_key *key,
                           void **data, size_t *size)
{
    return s->own ? journal_find(ctx, s->own, key, data, size)
                  : journal_set_find(ctx, &s->kept, key, data, size);
}

apsm_status fit_shares_find(apsm_context *ctx, fit_shares *s, const apsm_input_case *c,
                            fit_row *row, apsm_fit *fit, bool *found)
{
    void *data;
    size_t size;
    *found = false;
    if (!s->own && s->kept.n == 0) return APSM_OK;
    const journal_key key = key_of(s, c, row);
    APSM_TRY(look_up(ctx, s, &key, &data, &size));
    if (!data) return APSM_OK;
    const apsm_status status = take(s, data, size, row, fit, found);
    free(data);
#pragma omp atomic
    s->found += *found;
    return status;
}
