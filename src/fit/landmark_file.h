/* landmark_file.h -- named points: of 3D Slicer (.mrk.json, .fcsv) or a table (.csv: name,x,y,z).
 */
#ifndef APSM_FIT_LANDMARK_FILE_H
#define APSM_FIT_LANDMARK_FILE_H

#include <stdbool.h>

#include "apsm/context.h"

/* Owns its arrays; zero-initialise with {0}. */
typedef struct fit_landmarks {
    size_t n;
    char **name;
    double *x; /* n x 3, LPS */
} fit_landmarks;

bool fit_is_landmark_file(const char *path);
/* Refused with file and place: no points, a point without a name or of a name that is there
 * already, coordinates that are not finite numbers.  RAS is turned into LPS.  Points that have not
 * been placed are left out. */
apsm_status fit_landmarks_read(apsm_context *ctx, const char *path,
                               fit_landmarks *landmarks) APSM_NODISCARD;
void fit_landmarks_free(fit_landmarks *landmarks);
/* Index of a name, or n. */
size_t fit_landmarks_find(const fit_landmarks *landmarks, const char *name);

#endif
