#include "files/shards.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "files/io.h"

char *shard_path(const char *folder, size_t shard, size_t shards)
{
    char name[80];
    snprintf(name, sizeof name, "state/shard-%zu-of-%zu.journal", shard + 1, shards);
    return apsm_path_join(folder, name);
}

/* The name of one, without its folder. */
static bool is_shard(const char *name)
{
    size_t shard, shards;
    int end = -1;
    return sscanf(name, "shard-%zu-of-%zu.journal%n", &shard, &shards, &end) == 2 && end > 0 &&
           !name[end];
}

bool shard_is_one(const char *path)
{
    static const char state[] = "/state/";
    const char *slash = strrchr(path, '/');
    const size_t n = sizeof state - 1;
    return slash && (size_t)(slash + 1 - path) >= n && strncmp(slash + 1 - n, state, n) == 0 &&
           is_shard(slash + 1);
}

/* For every journal of a share: calls use with its path, which use frees, and goes on while that is
 * APSM_OK. */
static apsm_status for_shards(apsm_context *ctx, const char *folder,
                              apsm_status (*use)(apsm_context *, void *, char *), void *user)
{
    char *state = apsm_path_join(folder, "state");
    DIR *dir = state ? opendir(state) : NULL;
    apsm_status status = state ? APSM_OK : APSM_ERR_MEMORY;
    struct dirent *entry;
    while (status == APSM_OK && dir && (entry = readdir(dir)))
        if (is_shard(entry->d_name)) status = use(ctx, user, apsm_path_join(state, entry->d_name));
    if (dir) closedir(dir);
    free(state);
    return status;
}

apsm_status journal_set_add(apsm_context *ctx, journal_set *set, char *path)
{
    journal *one = NULL;
    apsm_status status = path ? journal_open_other(ctx, path, &one) : APSM_ERR_MEMORY;
    free(path);
    if (status != APSM_OK || !one) return status;
    journal **grown = realloc(set->list, (set->n + 1) * sizeof *grown);
    if (!grown) return journal_close(one), APSM_ERR_MEMORY;
    set->list = grown;
    set->list[set->n++] = one;
    return APSM_OK;
}

static apsm_status add_shard(apsm_context *ctx, void *user, char *path)
{
    return journal_set_add(ctx, user, path);
}

apsm_status journal_set_add_shards(apsm_context *ctx, journal_set *set, const char *folder)
{
    return for_shards(ctx, folder, add_shard, set);
}

void journal_set_close(journal_set *set)
{
    for (size_t k = 0; k < set->n; k++) journal_close(set->list[k]);
    free(set->list);
    *set = (journal_set){ 0 };
}

apsm_status journal_set_find(apsm_context *ctx, const journal_set *set, const journal_key *key,
                             void **data, size_t *size)
{
    *data = NULL;
    *size = 0;
    for (size_t k = 0; k < set->n && !*data; k++)
        APSM_TRY(journal_find(ctx, set->list[k], key, data, size));
    return APSM_OK;
}

static apsm_status remove_shard(apsm_context *ctx, void *user, char *path)
{
    const bool *company = user;
    bool busy = false;
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = journal_remove(ctx, path, *company ? NULL : &busy);
    if (status == APSM_OK && busy)
        apsm_log(ctx, APSM_LOG_WARNING, "%s: this share is still at work; left there", path);
    free(path);
    return status;
}

apsm_status shards_remove(apsm_context *ctx, const char *folder, bool company)
{
    return for_shards(ctx, folder, remove_shard, &company);
}
