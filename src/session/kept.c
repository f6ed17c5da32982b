#include "session/kept.h"

#include <stdlib.h>
#include <string.h>

#include "files/shards.h"
#include "session/manifest.h"
#include "session/settings.h"

struct kept_work {
    journal *journal;   /* NULL: nothing is added */
    journal_set others; /* what other processes have kept; read only */
    size_t added;       /* pieces since the last meeting */
    size_t found;       /* pieces of others */
    apsm_keeper keeper;
    journal_key scope; /* what the keeper's pieces belong to */
    char *job;         /* of the grooming that was taken up; NULL: none */
    size_t job_size;
};

/* ---- opening, closing ---- */

/* Each process that helps has a journal of its own: state/shard-2-of-7.journal. */
static char *own_path(const apsm_run *run)
{
    if (!run->helps) return run_path(run, RUN_JOURNAL);
    return shard_path(run->folder, run->shard, run->shards);
}

/* All journals but the own one, as they are now. */
static apsm_status open_others(apsm_run *run)
{
    journal_set *others = &run->kept->others;
    journal_set_close(others);
    if (run->helps) APSM_TRY(journal_set_add(run->ctx, others, run_path(run, RUN_JOURNAL)));
    return journal_set_add_shards(run->ctx, others, run->folder);
}

static apsm_status open_journal(apsm_run *run, bool fresh)
{
    char *path = own_path(run);
    run->kept = calloc(1, sizeof *run->kept);
    apsm_status status = path && run->kept ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = journal_open(run->ctx, path, fresh, &run->kept->journal);
    free(path);
    if (status == APSM_OK) status = open_others(run);
    if (status != APSM_OK) kept_close(run);
    return status;
}

apsm_status kept_begin(apsm_run *run)
{
    if (run->kept || run_is_in_memory(run)) return APSM_OK; /* with --resume it was taken up */
    char *folder = run_path(run, "state");
    const apsm_status status = folder ? apsm_make_folder(run->ctx, folder) : APSM_ERR_MEMORY;
    free(folder);
    return status == APSM_OK ? open_journal(run, run->overwrite && !run->helps) : status;
}

/* evaluate keeps nothing but shares. */
apsm_status kept_begin_shares(apsm_run *run)
{
    if (run_is_in_memory(run) || run->company) return APSM_OK;
    if (run->helps) return kept_begin(run);
    kept_close(run);
    run->kept = calloc(1, sizeof *run->kept);
    if (!run->kept) return APSM_ERR_MEMORY;
    const apsm_status status = open_others(run);
    if (status != APSM_OK || run->kept->others.n == 0) kept_close(run);
    return status;
}

void kept_close(apsm_run *run)
{
    apsm_context_set_keeper(run->ctx, NULL);
    if (run->kept) {
        journal_set_close(&run->kept->others);
        journal_close(run->kept->journal);
        free(run->kept->job);
    }
    free(run->kept);
    run->kept = NULL;
}

bool kept_is_there(const apsm_run *run)
{
    char *path = run_path(run, RUN_JOURNAL);
    const bool there = path && apsm_file_exists(path);
    free(path);
    return there;
}

apsm_status kept_end(apsm_run *run)
{
    kept_close(run);
    if (run_is_in_memory(run)) return APSM_OK;
    APSM_TRY(shards_remove(run->ctx, run->folder, run->company));
    return run_remove(run, run_path(run, RUN_JOURNAL));
}

apsm_status kept_end_shares(apsm_run *run)
{
    if (!run->kept) return APSM_OK;
    const size_t found = run->kept->found;
    kept_close(run);
    if (found == 0) {
        apsm_log(run->ctx, APSM_LOG_WARNING,
                 "what shares have kept in %s/state is of another step or of other particles or "
                 "options: not used, and left there; remove its shard-*.journal if nobody wants "
                 "them",
                 run->folder);
        return APSM_OK;
    }
    apsm_log(run->ctx, APSM_LOG_INFO, "%zu results that shares have kept were found in %s/state",
             found, run->folder);
    return shards_remove(run->ctx, run->folder, false);
}

/* ---- shares ---- */

/* Those who know each other wait for each other.  Who works alone ends with the first loop to which
 * it had something to add: the next may need what others have not kept yet. */
static apsm_status meet(apsm_context *ctx, void *user)
{
    apsm_run *run = user;
    APSM_TRY(journal_flush(ctx, run->kept->journal));
    const size_t added = run->kept->added;
    run->kept->added = 0;
    if (run->company)
        run->company->meet(run->company->user, 0);
    else if (run->helps && added > 0)
        return run->share_kept = true, APSM_ERR_INTERRUPTED;
    return open_others(run);
}

static void deal(apsm_run *run, apsm_status (*meets)(apsm_context *, void *))
{
    if (run->shards == 0 || !run->kept) return;
    run->deal = (apsm_deal){ run->shard, run->shards, run, meets, NULL };
    apsm_context_set_deal(run->ctx, &run->deal);
}

void kept_deal(apsm_run *run)
{
    deal(run, meet);
}

/* What has been kept until now. */
static apsm_status look_around(apsm_context *ctx, void *user)
{
    apsm_run *run = user;
    APSM_TRY(journal_flush(ctx, run->kept->journal));
    return open_others(run);
}

void kept_deal_shares(apsm_run *run)
{
    deal(run, look_around);
}

apsm_status kept_end_share(apsm_run *run, apsm_status status)
{
    apsm_context_set_deal(run->ctx, NULL);
    if (!run->helps) return status;
    kept_close(run);
    if (status == APSM_OK || (status == APSM_ERR_INTERRUPTED && !apsm_interrupted(run->ctx)))
        run->share_kept = true; /* others have to keep theirs first */
    if (!run->share_kept) return status;
    apsm_log(run->ctx, APSM_LOG_INFO,
             "share %zu of %zu is kept in %s/state; when all are, the same without --shard goes on",
             run->shard + 1, run->shards, run->folder);
    return APSM_OK;
}

/* ---- what all journals hold ---- */

/* In the own journal, or else in another's. */
static apsm_status find(apsm_context *ctx, const struct kept_work *kept, const journal_key *key,
                        void **data, size_t *size)
{
    apsm_status status = APSM_OK;
    *data = NULL;
    if (kept->journal) status = journal_find(ctx, kept->journal, key, data, size);
    if (status != APSM_OK || *data) return status;
    return journal_set_find(ctx, &kept->others, key, data, size);
}

static apsm_status add(apsm_context *ctx, struct kept_work *kept, const journal_key *key,
                       const void *data, size_t size)
{
    if (!kept->journal) return APSM_OK;
#pragma omp atomic
    kept->added++;
    return journal_add(ctx, kept->journal, key, data, size);
}

/* ---- the job: "input=PATH", "shape=NAME", "option.NAME=VALUE", each ended by a zero byte ---- */

static const char job_word[] = "job";
static const char input_word[] = "input=", shape_word[] = "shape=", option_word[] = "option.";

/* *text grows by "WORD NAME = VALUE"; name may be "". */
static bool add_line(char **text, size_t *size, const char *word, const char *name,
                     const char *value)
{
    const char *const parts[] = { word, name, *name ? "=" : "", value };
    size_t length = 1;
    for (size_t k = 0; k < 4; k++) length += strlen(parts[k]);
    char *grown = realloc(*text, *size + length);
    if (!grown) return false;
    *text = grown;
    for (size_t k = 0; k < 4; k++) {
        const size_t n = strlen(parts[k]);
        memcpy(*text + *size, parts[k], n);
        *size += n;
    }
    (*text)[(*size)++] = '\0';
    return true;
}

apsm_status kept_add_job(apsm_run *run, const apsm_input_list *list)
{
    char *text = NULL;
    size_t size = 0;
    bool ok = true;
    if (!run->kept || run->helps) return APSM_OK;
    for (size_t k = 0; k < run->n_inputs && ok; k++)
        ok = add_line(&text, &size, input_word, "", run->inputs[k]);
    for (size_t i = 0; i < list->n && ok; i++)
        ok = add_line(&text, &size, shape_word, "", list->cases[i].name);
    const size_t n = apsm_project_count(&run->project, "apsm");
    for (size_t k = 0; k < n && ok; k++) {
        const char *key, *value;
        apsm_project_pair(&run->project, "apsm", k, &key, &value);
        if (strcmp(key, "template_used") != 0) /* of an earlier model */
            ok = add_line(&text, &size, option_word, key, value);
    }
    const journal_key key = journal_key_of(job_word);
    const apsm_status status =
        ok ? journal_add(run->ctx, run->kept->journal, &key, text, size) : APSM_ERR_MEMORY;
    free(text);
    return status;
}

static apsm_status take_input(apsm_run *run, const char *path)
{
    char **grown = realloc(run->inputs, (run->n_inputs + 2) * sizeof *grown);
    if (!grown) return APSM_ERR_MEMORY;
    run->inputs = grown;
    run->inputs[run->n_inputs] = NULL;
    APSM_TRY(apsm_text_set(&run->inputs[run->n_inputs], path));
    run->n_inputs++;
    return APSM_OK;
}

static apsm_status take_option(apsm_run *run, const char *line)
{
    char key[64];
    const char *value = strchr(line, '=');
    const size_t length = value ? (size_t)(value - line) : sizeof key;
    if (length >= sizeof key) return APSM_OK; /* no name of ours */
    memcpy(key, line, length);
    key[length] = '\0';
    return apsm_project_set(&run->project, "apsm", key, value + 1);
}

static apsm_status take_job(apsm_run *run)
{
    const bool wants_inputs = run->n_inputs == 0;
    const char *text = run->kept->job;
    const size_t size = run->kept->job_size;
    const size_t i = strlen(input_word), o = strlen(option_word);
    apsm_project_clear(&run->project, "apsm");
    APSM_TRY(stage_undo(run, "groom"));
    for (const char *line = text; line < text + size; line += strlen(line) + 1) {
        if (strncmp(line, input_word, i) == 0 && wants_inputs) APSM_TRY(take_input(run, line + i));
        if (strncmp(line, option_word, o) == 0) APSM_TRY(take_option(run, line + o));
    }
    return APSM_OK;
}

apsm_status kept_take_up(apsm_run *run)
{
    const journal_key key = journal_key_of(job_word);
    if (!kept_is_there(run)) return APSM_OK;
    APSM_TRY(open_journal(run, false));
    struct kept_work *kept = run->kept;
    void *job;
    APSM_TRY(find(run->ctx, kept, &key, &job, &kept->job_size));
    kept->job = job;
    if (kept->job) return take_job(run);
    /* Of initialize, which may have ended and then been killed before it could tidy up. */
    return stage_is_done(run, "initialize") && !run->helps ? kept_end(run) : APSM_OK;
}

static bool is_listed(const apsm_input_list *list, const char *name)
{
    for (size_t low = 0, high = list->n; low < high;) { /* they are sorted */
        const size_t mid = low + (high - low) / 2;
        const int order = strcmp(list->cases[mid].name, name);
        if (order == 0) return true;
        if (order < 0)
            low = mid + 1;
        else
            high = mid;
    }
    return false;
}

apsm_status kept_compare_shapes(apsm_run *run, const apsm_input_list *list)
{
    const struct kept_work *kept = run->kept;
    const char *missing = NULL;
    size_t n = 0;
    if (!kept || !kept->job) return APSM_OK;
    for (const char *line = kept->job; line < kept->job + kept->job_size;
         line += strlen(line) + 1) {
        if (strncmp(line, shape_word, strlen(shape_word)) != 0) continue;
        n++;
        if (!missing && !is_listed(list, line + strlen(shape_word)))
            missing = line + strlen(shape_word);
    }
    if (missing)
        return apsm_fail(run->ctx, APSM_ERR_STATE,
                         "%s: the run that --resume continues has a shape %s, which is not among "
                         "these inputs (%zu); put it back, or start anew without --resume",
                         run->folder, missing, list->n);
    if (list->n == n) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s: the run that --resume continues has %zu shapes, these inputs are %zu; "
                     "start anew without --resume",
                     run->folder, n, list->n);
}

/* ---- groomed meshes ---- */

static journal_key mesh_key(const apsm_run *run, const apsm_input_case *c, const char sha256[65])
{
    const int64_t kind = c->kind;
    journal_key key;
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add_text(&sha, "mesh");
    settings_hash(run, &sha);
    apsm_sha256_add_text(&sha, apsm_run_text(run, "labels"));
    apsm_sha256_add_text(&sha, c->name);
    apsm_sha256_add_text(&sha, apsm_path_last(c->path));
    apsm_sha256_add_text(&sha, sha256);
    apsm_sha256_add(&sha, &kind, sizeof kind);
    apsm_sha256_end(&sha, key.byte);
    return key;
}

/* Content: two uint64, the numbers of vertices and faces, kept_groomed, the arrays V and F, and its
 * texts, each ended by a zero byte; an empty one stands for none.  Without the texts: */
static size_t mesh_bytes(uint64_t nv, uint64_t nf)
{
    return 2 * sizeof(uint64_t) + sizeof(kept_groomed) + (size_t)nv * 3 * sizeof(double) +
           (size_t)nf * 3 * sizeof(uint32_t);
}

static apsm_status unpack_texts(const char *text, size_t size, kept_groomed *groomed)
{
    const char *const end = memchr(text, 0, size);
    if (!end || !memchr(end + 1, 0, size - (size_t)(end + 1 - text))) return APSM_ERR_FORMAT;
    if (*text) APSM_TRY(apsm_text_set(&groomed->notes, text));
    return end[1] ? apsm_text_set(&groomed->picked, end + 1) : APSM_OK;
}

static apsm_status unpack_mesh(const unsigned char *data, size_t size, apsm_mesh *mesh,
                               kept_groomed *groomed)
{
    uint64_t n[2];
    if (size < sizeof n) return APSM_ERR_FORMAT;
    memcpy(n, data, sizeof n);
    if (n[0] > size || n[1] > size || size < mesh_bytes(n[0], n[1])) return APSM_ERR_FORMAT;
    APSM_TRY(apsm_mesh_alloc(mesh, (size_t)n[0], (size_t)n[1]));
    const size_t bytes = 3 * mesh->nv * sizeof *mesh->V, whole = mesh_bytes(n[0], n[1]);
    const unsigned char *const from = data + sizeof n;
    memcpy(groomed, from, sizeof *groomed);
    groomed->notes = groomed->picked = NULL;
    memcpy(mesh->V, from + sizeof *groomed, bytes);
    memcpy(mesh->F, from + sizeof *groomed + bytes, 3 * mesh->nf * sizeof *mesh->F);
    for (size_t k = 0; k < 3 * mesh->nf; k++)
        if (mesh->F[k] >= mesh->nv) return APSM_ERR_FORMAT;
    return unpack_texts((const char *)data + whole, size - whole, groomed);
}

apsm_status kept_find_mesh(apsm_context *ctx, const apsm_run *run, const apsm_input_case *c,
                           const char sha256[65], apsm_mesh *mesh, kept_groomed *groomed)
{
    void *data;
    size_t size;
    *mesh = (apsm_mesh){ 0 };
    if (!run->kept) return APSM_OK;
    const journal_key key = mesh_key(run, c, sha256);
    APSM_TRY(find(ctx, run->kept, &key, &data, &size));
    const apsm_status status = data ? unpack_mesh(data, size, mesh, groomed) : APSM_OK;
    free(data);
    if (status != APSM_ERR_FORMAT) return status;
    apsm_mesh_free(mesh); /* of another program's layout, whatever its check sum: made again */
    free(groomed->notes);
    free(groomed->picked);
    *groomed = (kept_groomed){ 0 };
    return APSM_OK;
}

apsm_status kept_add_mesh(apsm_context *ctx, const apsm_run *run, const apsm_input_case *c,
                          const char sha256[65], const apsm_mesh *mesh, const kept_groomed *groomed)
{
    const uint64_t n[2] = { mesh->nv, mesh->nf };
    const char *const notes = groomed->notes ? groomed->notes : "";
    const char *const picked = groomed->picked ? groomed->picked : "";
    const size_t bytes = 3 * mesh->nv * sizeof *mesh->V, corners = 3 * mesh->nf * sizeof *mesh->F;
    const size_t size = mesh_bytes(n[0], n[1]) + strlen(notes) + strlen(picked) + 2;
    if (!run->kept) return APSM_OK;
    unsigned char *data = malloc(size), *to = data;
    if (!data) return APSM_ERR_MEMORY;
    memcpy(to, n, sizeof n);
    to += sizeof n;
    memcpy(to, groomed, sizeof *groomed);
    to += sizeof *groomed;
    memcpy(to, mesh->V, bytes);
    memcpy(to + bytes, mesh->F, corners);
    to += bytes + corners;
    memcpy(to, notes, strlen(notes) + 1);
    memcpy(to + strlen(notes) + 1, picked, strlen(picked) + 1);
    const journal_key key = mesh_key(run, c, sha256);
    const apsm_status status = add(ctx, run->kept, &key, data, size);
    free(data);
    return status;
}

/* ---- pieces of the steps ---- */

static journal_key piece_key(const struct kept_work *kept, const char *kind, uint64_t i)
{
    journal_key key;
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add(&sha, &kept->scope, sizeof kept->scope);
    apsm_sha256_add_text(&sha, kind);
    apsm_sha256_add(&sha, &i, sizeof i);
    apsm_sha256_end(&sha, key.byte);
    return key;
}

static bool recall(void *user, const char *kind, size_t i, size_t size, void *data)
{
    struct kept_work *kept = user;
    const journal_key key = piece_key(kept, kind, i);
    void *found;
    size_t bytes;
    if (find(NULL, kept, &key, &found, &bytes) != APSM_OK || !found) return false;
    const bool fits = bytes == size;
    if (fits) memcpy(data, found, size);
    free(found);
#pragma omp atomic
    kept->found += fits;
    return fits;
}

static apsm_status keep(apsm_context *ctx, void *user, const char *kind, size_t i, size_t size,
                        const void *data)
{
    struct kept_work *kept = user;
    const journal_key key = piece_key(kept, kind, i);
    return add(ctx, kept, &key, data, size);
}

static void set_keeper(apsm_run *run, apsm_sha256 *scope)
{
    struct kept_work *kept = run->kept;
    if (!kept) return;
    apsm_sha256_end(scope, kept->scope.byte);
    kept->keeper = (apsm_keeper){ kept, recall, keep };
    apsm_context_set_keeper(run->ctx, &kept->keeper);
}

void kept_pieces_of_inputs(apsm_run *run, const apsm_input_list *list, char (*sha256)[65],
                           const double *turn)
{
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add_text(&sha, "poses");
    settings_hash(run, &sha);
    apsm_sha256_add_text(&sha, apsm_run_text(run, "labels"));
    apsm_sha256_add_text(&sha, apsm_run_text(run, "template"));
    for (size_t i = 0; i < list->n; i++) {
        const apsm_input_case *c = &list->cases[i];
        apsm_sha256_add_text(&sha, c->name);
        apsm_sha256_add_text(&sha, apsm_path_last(c->path));
        apsm_sha256_add_text(&sha, sha256[i]);
        apsm_sha256_add_text(&sha, c->reflect ? "mirrored" : "as it is");
        if (turn) apsm_sha256_add(&sha, turn + 9 * i, 9 * sizeof *turn);
    }
    set_keeper(run, &sha);
}

void kept_pieces_of_parts(apsm_run *run, size_t n, const apsm_mesh *const *meshes)
{
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add_text(&sha, "parts");
    settings_hash(run, &sha);
    apsm_sha256_add_text(&sha, apsm_run_text(run, "template"));
    for (size_t i = 0; i < n; i++) {
        apsm_sha256_add(&sha, meshes[i]->V, 3 * meshes[i]->nv * sizeof *meshes[i]->V);
        apsm_sha256_add(&sha, meshes[i]->F, 3 * meshes[i]->nf * sizeof *meshes[i]->F);
    }
    set_keeper(run, &sha);
}

void kept_pieces_of_shapes(apsm_run *run, const char *identity)
{
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add_text(&sha, "first particles");
    apsm_sha256_add_text(&sha, identity);
    set_keeper(run, &sha);
}

void kept_pieces_of_particles(apsm_run *run, const char *identity, size_t n, const double *P)
{
    static const char *const options[] = { "definition", "specificity_samples", "specificity_modes",
                                           "surface_distance", "other_templates" };
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add_text(&sha, "evaluate");
    apsm_sha256_add_text(&sha, identity);
    for (size_t k = 0; k < sizeof options / sizeof options[0]; k++) {
        char text[64] = "";
        if (apsm_options_get(&run->options, options[k], text) == APSM_OK)
            apsm_sha256_add_text(&sha, text);
    }
    apsm_sha256_add(&sha, P, n * sizeof *P);
    set_keeper(run, &sha);
}
