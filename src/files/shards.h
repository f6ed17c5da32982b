/* shards.h -- the journals that the shares of a job keep in its folder, one each:
 * state/shard-2-of-7.journal.  All of them are found; how many there are does not matter. */
#ifndef APSM_FILES_SHARDS_H
#define APSM_FILES_SHARDS_H

#include "files/journal.h"

/* Path of the journal of a share, counted from 0: malloc'ed, NULL if out of memory. */
char *shard_path(const char *folder, size_t shard, size_t shards);

/* Whether it is the path of such a journal in some folder. */
bool shard_is_one(const char *path);

/* Journals of other processes, to find pieces in. */
typedef struct journal_set {
    journal **list; /* n */
    size_t n;
} journal_set;

/* Adds the journal at path, if it is one; path is freed (NULL: out of memory). */
apsm_status journal_set_add(apsm_context *ctx, journal_set *set, char *path) APSM_NODISCARD;
/* Adds those of all shares, as they are now. */
apsm_status journal_set_add_shards(apsm_context *ctx, journal_set *set,
                                   const char *folder) APSM_NODISCARD;
void journal_set_close(journal_set *set);

/* As journal_find, in the first that has it. */
apsm_status journal_set_find(apsm_context *ctx, const journal_set *set, const journal_key *key,
                             void **data, size_t *size) APSM_NODISCARD;

/* Removes those of all shares that have ended; of others it is said that they are left.  company:
 * all have, whatever else is still open. */
apsm_status shards_remove(apsm_context *ctx, const char *folder, bool company) APSM_NODISCARD;

#endif
