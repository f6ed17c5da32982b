/* name_series.h -- the names of files that a header lists or counts: lines, each a name, or
 * "slice%03d.raw FIRST LAST STEP". */
#ifndef APSM_FORMATS_NAME_SERIES_H
#define APSM_FORMATS_NAME_SERIES_H

#include "formats/scan.h"

typedef struct name_series {
    word rest;    /* lines that are still to come */
    bool pattern; /* else they are counted: */
    word before, after;
    int digits; /* the number is filled up with zeros to so many */
    int64_t number, step;
    size_t count; /* of names that are to come */
} name_series;

/* Whether a header's word for its data ("LIST", or with '%') means several files; by a pattern. */
bool name_series_is(word file);
bool name_series_is_pattern(word file);
/* *n <- the names of lines, or of a pattern; false if that is none. */
bool name_series_of_lines(word lines, name_series *n);
bool name_series_of_pattern(word pattern, name_series *n);
/* name <- the next one; false if it needs more room. */
bool name_series_next(name_series *n, char *name, size_t room);

#endif
