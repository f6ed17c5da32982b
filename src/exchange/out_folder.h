/* out_folder.h -- a folder of files for others, with a list of them (a JSON file), so that the next
 * call knows what it may replace: the files of the list, and nothing else.  Until it is whole the
 * names are in LIST.unfinished, so that the next call clears up after one that was interrupted. */
#ifndef APSM_EXCHANGE_OUT_FOLDER_H
#define APSM_EXCHANGE_OUT_FOLDER_H

#include <stdarg.h>
#include <stdbool.h>

#include "apsm/context.h"

struct json_t;

typedef struct out_folder {
    apsm_context *ctx;
    const char *path;
    const char *list, *format; /* the list's name and "format" */
    bool overwrite;
    struct json_t *files; /* names so far; owned */
    char *unfinished;     /* path of the file of their names; owned */
} out_folder;

/* Makes the folder; what an interrupted call has left goes, and with overwrite what a whole one
 * has. Refused: a file, a folder that holds anything else. */
apsm_status out_folder_open(out_folder *f) APSM_NODISCARD;
/* *path (malloc'ed) <- a file in the folder, whose name, made as by printf, is noted and must be
 * new. */
apsm_status out_folder_file(out_folder *f, char **path, const char *format, ...) APSM_NODISCARD
    APSM_PRINTF(3, 4);
apsm_status out_folder_place(out_folder *f, char **path, const char *format,
                             va_list words) APSM_NODISCARD;
/* Writes the list, root (taken over) with "files". */
apsm_status out_folder_close(out_folder *f, struct json_t *root) APSM_NODISCARD;
void out_folder_free(out_folder *f);

#endif
