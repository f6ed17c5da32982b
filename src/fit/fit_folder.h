/* fit_folder.h -- the folder that a verb of this room writes into: made, if nothing of anybody
 * else's would be replaced. */
#ifndef APSM_FIT_FIT_FOLDER_H
#define APSM_FIT_FIT_FOLDER_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"
#include "files/files.h"

/* All borrowed. */
typedef struct fit_folder {
    const char *path;
    const char *what;   /* "fits": what is in it when it is whole, */
    const char *maker;  /* "fit": and what makes one */
    const char *marker; /* the file that is written last, and says that the rest is ours */
    size_t files;
    const char *const *file; /* others: without the marker they are somebody's */
    size_t folders;
    const char *const *folder; /* made here; without the marker they may be of a call that did not
                                  end, and are taken if asked to overwrite */
    bool overwrite;
} fit_folder;

/* Makes nothing.  APSM_ERR_ARG, with a line: it is "/".  APSM_ERR_STATE: it is a model folder,
 * holds files that nothing of ours has left, or is whole and not to be overwritten. */
apsm_status fit_folder_check(apsm_context *ctx, const fit_folder *f) APSM_NODISCARD;
/* Then: the folders in it. */
apsm_status fit_folder_make(apsm_context *ctx, const fit_folder *f) APSM_NODISCARD;
/* Both. */
apsm_status fit_folder_claim(apsm_context *ctx, const fit_folder *f) APSM_NODISCARD;
/* As the check, for one process at a time, until *lock (out, also of failures) is given up: the
 * folder is made, those in it are not. */
apsm_status fit_folder_lock(apsm_context *ctx, const fit_folder *f, apsm_lock *lock) APSM_NODISCARD;

#endif
