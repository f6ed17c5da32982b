/* input_file.h -- the bytes of a data file, and how those are refused that are something else than
 * their name says. */
#ifndef APSM_FORMATS_INPUT_FILE_H
#define APSM_FORMATS_INPUT_FILE_H

#include "files/files.h"

/* As apsm_read_file, without limit; refuses an empty file, a pointer of Git LFS and a web page. */
apsm_status input_file_read(apsm_context *ctx, const char *path, char **bytes,
                            size_t *size) APSM_NODISCARD;
/* Whether path ends in the extension (with its dot), in any case of letters. */
bool path_ends_in(const char *path, const char *extension);
/* The extension of the last component, with its dot, or "". */
const char *path_extension(const char *path);

#endif
