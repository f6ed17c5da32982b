/* checkpoint_file.h -- named blocks of bytes in one file that is either whole or refused: what a
 * long step needs to go on after an interruption.  Layout in docs/formats.md. */
#ifndef APSM_CHECKPOINT_FILE_H
#define APSM_CHECKPOINT_FILE_H

#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { APSM_SECTION_NAME = 32 }; /* with the final NUL */

/* ---- Writing: open, add ..., commit ---- */
typedef struct apsm_checkpoint_writer apsm_checkpoint_writer;

/* The file appears under path at commit only, replacing an earlier one in one step. */
apsm_status apsm_checkpoint_open(apsm_context *ctx, const char *path,
                                 apsm_checkpoint_writer **writer) APSM_NODISCARD;
/* A block of size bytes (data may be NULL if size is 0), at once on its way to the disk.  name: 1
 * to 31 characters, each name once.  Failures stick and are told by commit. */
void apsm_checkpoint_add(apsm_checkpoint_writer *writer, const char *name, const void *data,
                         size_t size);
/* Ends the file with its SHA-256 and puts it in place.  Frees writer either way. */
apsm_status apsm_checkpoint_commit(apsm_checkpoint_writer *writer) APSM_NODISCARD;
void apsm_checkpoint_abort(apsm_checkpoint_writer *writer); /* NULL is allowed */

/* ---- Reading ---- */
typedef struct apsm_checkpoint apsm_checkpoint;

/* Reads the whole file and checks every byte: truncated, extended or altered files, foreign ones
 * and those of another byte order or newer version are refused (APSM_ERR_FORMAT). */
apsm_status apsm_checkpoint_read(apsm_context *ctx, const char *path,
                                 apsm_checkpoint **checkpoint) APSM_NODISCARD;
void apsm_checkpoint_free(apsm_checkpoint *checkpoint); /* NULL is allowed */
/* The block of that name (aligned for doubles, lives as long as checkpoint), or NULL. */
const void *apsm_checkpoint_find(const apsm_checkpoint *checkpoint, const char *name, size_t *size);
/* Copies the block to data if it has exactly size bytes; else APSM_ERR_STATE with a line that
 * says what is there. */
apsm_status apsm_checkpoint_get(apsm_context *ctx, const apsm_checkpoint *checkpoint,
                                const char *name, void *data, size_t size) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
