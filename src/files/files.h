/* files.h -- reading and writing files so that nobody ever meets half of one.
 *
 * Nothing here depends on the process's locale: a number is written with a point and read with
 * a point, wherever the program runs.  Paths are UTF-8 as the system gives them. */
#ifndef APSM_FILES_FILES_H
#define APSM_FILES_FILES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "apsm/context.h"
#include "core/number.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Writing ---------------------------------------------------------------------------- */

/* A file being written beside its final place.  Until commit the old content of path stays as it
 * was; after commit the new content is whole and on the disk. */
typedef struct apsm_writer apsm_writer;

/* Opens path + ".PID.tmp" in the same folder.  *writer (out) is owned by the caller, who ends it
 * by commit or abort; NULL on failure.  ctx is borrowed until then. */
apsm_status apsm_writer_open(apsm_context *ctx, const char *path,
                             apsm_writer **writer) APSM_NODISCARD;

/* Buffered writing.  The first failure sticks and is told by commit, so these need no check. */
void apsm_writer_write(apsm_writer *writer, const void *data, size_t size);
void apsm_writer_printf(apsm_writer *writer, const char *format, ...) APSM_PRINTF(2, 3);
void apsm_writer_number(apsm_writer *writer, double x); /* shortest text that reads back as x */
/* A CSV field (RFC 4180): quoted if it holds a comma, a quote or a line end. */
void apsm_writer_csv(apsm_writer *writer, const char *text);
/* True once a write has failed: a long loop may stop early. */
bool apsm_writer_failed(const apsm_writer *writer);

/* Flush, fsync, rename onto path, fsync of the folder.  On failure (APSM_ERR_IO) the temporary
 * file is removed and path is untouched.  Frees writer either way; NULL is an error. */
apsm_status apsm_writer_commit(apsm_writer *writer) APSM_NODISCARD;
/* Removes the temporary file and frees writer; NULL is allowed. */
void apsm_writer_abort(apsm_writer *writer);

/* The last steps of commit for a file that another library has written under the name temp (in
 * the folder of path): fsync, rename, fsync of the folder; on failure temp is removed. */
apsm_status apsm_replace_file(apsm_context *ctx, const char *temp, const char *path) APSM_NODISCARD;

/* ---- Reading ---------------------------------------------------------------------------- */

/* The whole file, followed by one NUL byte that is not counted.  *data is malloc'ed.  A file of
 * more than limit bytes is refused (APSM_ERR_FORMAT). */
apsm_status apsm_read_file(apsm_context *ctx, const char *path, size_t limit, char **data,
                           size_t *size) APSM_NODISCARD;
/* The same of a text: without a mark of byte order, and where lines end in a bare CR, in LF. */
apsm_status apsm_read_text(apsm_context *ctx, const char *path, size_t limit, char **data,
                           size_t *size) APSM_NODISCARD;
/* Whether a text is UTF-8, and so can be held by files of JSON. */
bool apsm_is_utf8(const char *text);
/* Whether the bytes begin like a text in UTF-16. */
bool apsm_is_utf16(const char *data, size_t size);

/* ---- Folders and paths ------------------------------------------------------------------ */

/* Turns the backslashes of a path from Windows. */
void apsm_path_from_windows(char *path);

/* mkdir -p. */
apsm_status apsm_make_folder(apsm_context *ctx, const char *path) APSM_NODISCARD;
/* *n <- how many folders apsm_make_folder would make. */
apsm_status apsm_missing_folders(apsm_context *ctx, const char *path, size_t *n) APSM_NODISCARD;
/* Removes so many, the last first, of those in which nothing is. */
void apsm_remove_empty_folders(const char *path, size_t n);
bool apsm_file_exists(const char *path); /* anything that is not a folder */
bool apsm_is_folder(const char *path);
/* APSM_ERR_IO, with a line: there is none of that name, or it is a file. */
apsm_status apsm_require_folder(apsm_context *ctx, const char *path) APSM_NODISCARD;
/* APSM_ERR_ARG, with a line: it is "/", by whatever name. */
apsm_status apsm_refuse_root(apsm_context *ctx, const char *path) APSM_NODISCARD;

/* *holds: whether the folder has a file or folder of that name.  APSM_ERR_MEMORY: not known. */
apsm_status apsm_folder_holds(const char *folder, const char *name, bool *holds) APSM_NODISCARD;

apsm_status apsm_file_size(apsm_context *ctx, const char *path, long long *bytes) APSM_NODISCARD;

/* A file's name without its folder, which says nothing about the shape: within path. */
const char *apsm_path_last(const char *path);

/* All return malloc'ed text, NULL only if out of memory. */
char *apsm_path_join(const char *folder, const char *name); /* name itself if it is absolute */
char *apsm_path_folder(const char *path);                   /* "." if path has no slash */
/* path as seen from folder ("../x/y").  Existing parts are resolved first (symbolic links, "..").
 */
char *apsm_path_relative(const char *folder, const char *path);
/* Last component without its extension; ".nii.gz" and ".gz" of others count as one extension. */
char *apsm_path_stem(const char *path);

/* Paths of files, from a folder on, sorted by their bytes.  Owns its texts; zero-initialise with
 * {0}.
 */
typedef struct apsm_file_list {
    size_t n, capacity;
    char **path;
} apsm_file_list;

/* The files in a folder, with deep also in the folders in it.  Links are listed, not followed. */
apsm_status apsm_list_files(apsm_context *ctx, const char *folder, bool deep,
                            apsm_file_list *list) APSM_NODISCARD;
void apsm_file_list_free(apsm_file_list *list);

/* ---- One run at a time ------------------------------------------------------------------ */

/* An advisory lock on a folder (flock on FOLDER/.apsm.lock).  It vanishes with the process,
 * however that ends. */
typedef struct apsm_lock {
    int fd;     /* -1: not held */
    int folder; /* open: the lock is found again if the folder is moved meanwhile */
} apsm_lock;

/* APSM_ERR_STATE if another process holds it: the line names that process; or if a link, or a file
 * that no lock of ours can be, is in its place.  On file systems without locks a warning is logged
 * and the call succeeds. */
apsm_status apsm_lock_folder(apsm_context *ctx, const char *folder, apsm_lock *lock) APSM_NODISCARD;
/* The same of a folder that is made first, with those above it; made (out): how many are new.  Of a
 * folder that cannot be locked none stays, unless another has locked it (APSM_ERR_STATE, made 0).
 */
apsm_status apsm_make_locked_folder(apsm_context *ctx, const char *folder, size_t *made,
                                    apsm_lock *lock) APSM_NODISCARD;
/* Removes the lock file; a lock that is zeroed or not held is allowed. */
void apsm_unlock_folder(apsm_lock *lock);

/* ---- SHA-256 (FIPS 180-4) --------------------------------------------------------------- */

typedef struct apsm_sha256 {
    uint32_t h[8];
    uint64_t length; /* bytes so far */
    unsigned char block[64];
} apsm_sha256;

void apsm_sha256_begin(apsm_sha256 *sha);
void apsm_sha256_add(apsm_sha256 *sha, const void *data, size_t size);
/* With the zero byte at its end, so that "ab", "c" is not "a", "bc". */
void apsm_sha256_add_text(apsm_sha256 *sha, const char *text);
void apsm_sha256_end(apsm_sha256 *sha, unsigned char digest[32]);
void apsm_sha256_hex(const unsigned char digest[32], char hex[65]);
/* Of a file, read in pieces: O(1) memory. */
apsm_status apsm_sha256_file(apsm_context *ctx, const char *path, char hex[65]) APSM_NODISCARD;
/* Of n files, their bytes one after the other. */
apsm_status apsm_sha256_files(apsm_context *ctx, size_t n, const char *const *paths,
                              char hex[65]) APSM_NODISCARD;
/* Of a folder: of each of the files in it and below, in the order of apsm_list_files, the 64 digits
 * of its SHA-256, its path and a zero byte. */
apsm_status apsm_sha256_folder(apsm_context *ctx, const char *path, char hex[65]) APSM_NODISCARD;

/* ---- JSON ------------------------------------------------------------------------------- */

struct json_t; /* of jansson: include <jansson.h> to look inside */

/* Reads a file holding one JSON value.  Syntax errors and repeated keys are refused with
 * file:line:column.  *root is a new reference. */
apsm_status apsm_json_read(apsm_context *ctx, const char *path,
                           struct json_t **root) APSM_NODISCARD;
/* Writes root (borrowed) atomically: keys in the order of insertion, indent 4, an array of plain
 * values on one line, 17 significant digits.  root NULL: APSM_ERR_NONFINITE, since jansson makes
 * no number of NaN. */
apsm_status apsm_json_write(apsm_context *ctx, const char *path,
                            const struct json_t *root) APSM_NODISCARD;
/* A long list, of which one value at a time is in memory.  value: a new reference to value i, NULL
 * (with APSM_OK) if there is no room for it or a number of it is not finite. */
typedef struct apsm_json_list {
    const char *key;
    size_t n;
    apsm_status (*value)(apsm_context *ctx, size_t i, void *user, struct json_t **value);
    void *user;
} apsm_json_list;
/* As apsm_json_write for an object (head) with the list under one key more. */
apsm_status apsm_json_write_list(apsm_context *ctx, const char *path, const struct json_t *head,
                                 const apsm_json_list *list) APSM_NODISCARD;
/* Reads what that has written: *head (new reference) without the list, whose values (borrowed) go
 * to each, one after the other; where it fails, that is the end.  key: of the list. */
typedef apsm_status apsm_json_each(apsm_context *ctx, size_t i, const struct json_t *value,
                                   void *user);
apsm_status apsm_json_read_list(apsm_context *ctx, const char *path, const char *key,
                                struct json_t **head, apsm_json_each *each,
                                void *user) APSM_NODISCARD;
/* As apsm_json_write for an object, with a last key "sha256": the SHA-256 of all bytes of the file
 * before that key.  Whatever root has under this key is left out. */
apsm_status apsm_json_write_sealed(apsm_context *ctx, const char *path,
                                   struct json_t *root) APSM_NODISCARD;
/* *intact: the file ends in the key "sha256", and what it says is true. */
apsm_status apsm_json_is_intact(apsm_context *ctx, const char *path, bool *intact) APSM_NODISCARD;
/* Refuses root unless it is an object with "format": format and "version" 1..version. */
apsm_status apsm_json_check(apsm_context *ctx, const char *path, const struct json_t *root,
                            const char *format, int version) APSM_NODISCARD;

/* New references; NULL if out of memory, the first two also if a value is not finite. */
struct json_t *apsm_json_vector(size_t n, const double *x);
struct json_t *apsm_json_matrix(size_t n, size_t m, const double *x); /* n rows of m */
/* A text, with a decimal point under every locale; NULL: out of memory, or no UTF-8. */
struct json_t *apsm_json_vtext(const char *format, va_list args);
struct json_t *apsm_json_number_or_null(double x); /* null stands for "not defined" */
/* The way back, into x (n x m); false if json (NULL allowed) has another shape or holds
 * anything but numbers.  m = 0: one array of n numbers. */
bool apsm_json_get_matrix(const struct json_t *json, size_t n, size_t m, double *x);

#ifdef __cplusplus
}
#endif
#endif
