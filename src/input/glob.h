/* glob.h -- which paths a pattern means, such as liver.nii.gz in any of the folders. */
#ifndef APSM_INPUT_GLOB_H
#define APSM_INPUT_GLOB_H

#include <stdbool.h>

/* Whether the pattern means the path.  In a component * ? [...] are as in a shell; a component **
 * stands for any number of folders, also none.  A pattern of one component is searched in every
 * folder.  O(pattern * path). */
bool glob_matches(const char *pattern, const char *path);

#endif
