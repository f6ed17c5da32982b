/* foreign.h -- formats of shapes that others write and that are not read here. */
#ifndef APSM_INPUT_FOREIGN_H
#define APSM_INPUT_FOREIGN_H

/* What the file is by its extension, and how to bring it: the rest of a message after "PATH: ". */
const char *foreign_remedy(const char *path);

#endif
