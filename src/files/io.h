/* io.h -- what the files of this room share. */
#ifndef APSM_FILES_IO_H
#define APSM_FILES_IO_H

#include <stdbool.h>
#include <stdint.h>

#include "core/number.h"
#include "files/files.h"

/* Fails with "PATH: WHAT: reason; remedy" for the given errno; ENOMEM gives APSM_ERR_MEMORY. */
apsm_status apsm_fail_errno(apsm_context *ctx, const char *path, const char *what, int error);

/* *fd <- path opened for reading; pipes, devices and folders are refused. */
apsm_status apsm_open_regular(apsm_context *ctx, const char *path, int *fd) APSM_NODISCARD;

/* A new file in the folder that has no name any more, or -1 and an errno. */
int apsm_open_unnamed(const char *folder, int *error);
/* All of data to that place of the file; 0 or an errno. */
int apsm_write_at(int fd, const unsigned char *data, size_t size, size_t offset);

/* Brings the entry of path in its folder to the disk; 0 or an errno. */
int apsm_sync_folder_of(const char *path);

/* Length of text that is shown of a user's token in a message. */
enum { APSM_SHOWN = 40 };

#endif
