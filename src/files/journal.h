/* journal.h -- finished pieces of a step that is under way, one after the other in a file, so that
 * an interruption costs no more than the pieces that were being made.  A piece is found by a key,
 * the SHA-256 of everything that decides its content.  Layout in docs/formats.md.
 *
 * Nothing is forced to the disk piece by piece: after a power cut those that did not get there are
 * missed by their check sums, and made again. */
#ifndef APSM_FILES_JOURNAL_H
#define APSM_FILES_JOURNAL_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

typedef struct journal journal;
typedef struct journal_key {
    unsigned char byte[32];
} journal_key;

/* Of a piece that a word says enough of. */
journal_key journal_key_of(const char *word);

/* Opens the file for more pieces.  fresh: whatever was there is dropped; else it is made if need
 * be, and what follows its last whole piece is cut off.  APSM_ERR_STATE: a file is there that is no
 * journal, and is left alone. */
apsm_status journal_open(apsm_context *ctx, const char *path, bool fresh,
                         journal **j) APSM_NODISCARD;
/* Opens a file that another process has written or is writing, to find what is whole in it by now;
 * nothing can be added.  *j is NULL if there is none, or none of ours. */
apsm_status journal_open_other(apsm_context *ctx, const char *path, journal **j) APSM_NODISCARD;
void journal_close(journal *j); /* NULL is allowed */
/* Whether the file at path begins as a journal does. */
bool journal_is_one(const char *path);
/* Whether the file that is written is still the one at its path. */
bool journal_is_there(const journal *j);
/* Removes the file if it is a journal; *busy: not yet, as another process is writing it.
 * busy NULL: that is not asked. */
apsm_status journal_remove(apsm_context *ctx, const char *path, bool *busy) APSM_NODISCARD;

/* Pieces that were there when it was opened. */
size_t journal_count(const journal *j);
/* Such a piece: *data is malloc'ed, NULL if there is none or it is damaged.  Any thread. */
apsm_status journal_find(apsm_context *ctx, const journal *j, const journal_key *key, void **data,
                         size_t *size) APSM_NODISCARD;

/* Sees to it that what was added is on the disk, where other machines find it. */
apsm_status journal_flush(apsm_context *ctx, journal *j) APSM_NODISCARD;

/* One more piece.  Any thread. */
apsm_status journal_add(apsm_context *ctx, journal *j, const journal_key *key, const void *data,
                        size_t size) APSM_NODISCARD;

#endif
