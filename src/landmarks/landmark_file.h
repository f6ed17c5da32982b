/* landmark_file.h -- named points: of 3D Slicer (.mrk.json, .fcsv), a table (.csv: name,x,y,z), or
 * points without names, three numbers a line, as ShapeWorks keeps them. */
#ifndef APSM_LANDMARKS_LANDMARK_FILE_H
#define APSM_LANDMARKS_LANDMARK_FILE_H

#include <stdbool.h>

#include "apsm/context.h"

/* Owns its arrays; zero-initialise with {0}. */
typedef struct landmark_list {
    size_t n;
    char **name;
    double *x; /* n x 3, LPS */
} landmark_list;

/* Whether a file of this name has names for its points. */
bool landmark_is_file(const char *path);
/* Refused with file and place: no points, a point without a name or of a name that is there
 * already, coordinates that are not finite numbers, another frame than LPS or RAS, which is turned
 * into LPS.  Points that have not been placed are left out, with a warning.  All lists of a
 * .mrk.json are taken. */
apsm_status landmark_list_read(apsm_context *ctx, const char *path,
                               landmark_list *landmarks) APSM_NODISCARD;
/* The same of points without names, three numbers a line: the k-th gets names[k], beyond the n
 * names that there are its number from 1. */
apsm_status landmark_list_read_plain(apsm_context *ctx, const char *path, size_t n,
                                     const char *const *names,
                                     landmark_list *landmarks) APSM_NODISCARD;
/* Adds a point; refused as above, path naming the file. */
apsm_status landmark_list_add(apsm_context *ctx, const char *path, const char *name,
                              const double x[3], landmark_list *landmarks) APSM_NODISCARD;
/* Whether the coordinates are those of a place: finite, and not beyond all measure. */
bool landmark_is_place(const double x[3]);
/* As a point list of 3D Slicer, in LPS. */
apsm_status landmark_list_write(apsm_context *ctx, const char *path,
                                const landmark_list *landmarks) APSM_NODISCARD;
void landmark_list_free(landmark_list *landmarks);
/* Index of a name, or n. */
size_t landmark_list_find(const landmark_list *landmarks, const char *name);

/* Cuts a line at its commas, in place, without blanks and quotes around the fields; returns how
 * many there are, at most LANDMARK_FIELDS. */
enum { LANDMARK_FIELDS = 16 };
size_t landmark_cut_fields(char *line, char *field[LANDMARK_FIELDS]);

#endif
