/* header_line.h -- a line "key = value" or "key: value" of a header in text. */
#ifndef APSM_FORMATS_HEADER_LINE_H
#define APSM_FORMATS_HEADER_LINE_H

#include "formats/scan.h"

typedef struct header_line {
    word key, value; /* without blanks around them */
} header_line;

word word_trim(word w);
/* Taken apart at the first of the signs; false if there is none. */
bool header_split(word line, const char *signs, header_line *parts);
/* The next word of a list, in *rest; empty at its end. */
word word_next(word *rest);
/* Exactly n (at most 16) numbers, which may stand in brackets with commas; false if the value is
 * anything else. */
bool word_numbers(word value, size_t n, double *x);

#endif
