/* scan.h -- walks through the bytes of a file, in words or in binary values, never beyond the
 * end, and knows the line for messages.  The first failure sticks: what is read after it is 0 or
 * empty, so that a loop needs to look at scan_ok alone. */
#ifndef APSM_FORMATS_SCAN_H
#define APSM_FORMATS_SCAN_H

#include "apsm/context.h"
#include "formats/scalar.h"

typedef struct word {
    const char *text; /* not ended by NUL */
    size_t length;
} word;

typedef struct scan {
    apsm_context *ctx;
    const char *path; /* for messages */
    const char *bytes;
    size_t size, at, line;
    bool binary;  /* messages name the byte, not the line */
    bool bare_cr; /* lines end in CR without LF, as on the first Macintoshes */
    apsm_status status;
} scan;

/* A mark of byte order (UTF-8) at the beginning is passed. */
scan scan_begin(apsm_context *ctx, const char *path, const char *bytes, size_t size);

static inline bool scan_ok(const scan *s)
{
    return s->status == APSM_OK;
}
static inline size_t scan_left(const scan *s)
{
    return s->size - s->at;
}

/* Fails with the path and the present line or byte before the text; scan_refuse: with the path
 * alone.  Both do nothing after a failure. */
void scan_fail(scan *s, const char *format, ...) APSM_PRINTF(2, 3);
void scan_refuse(scan *s, apsm_status status, const char *format, ...) APSM_PRINTF(3, 4);
void scan_no_memory(scan *s);
/* "expected WHAT, found 'WORD'", or that the file ends. */
void scan_expected(scan *s, const char *what, word found);

/* ---- words ---- */

/* To the next word; false if there is none, in the rest of the line or of the file. */
bool scan_skip_blanks(scan *s, bool over_lines);
word scan_word(scan *s);                       /* empty at the end of the file */
word scan_word_in_line(scan *s);               /* empty at the end of the line */
word scan_rest_of_line(scan *s);               /* without the line end, which is passed */
void scan_expect(scan *s, const char *wanted); /* the next word, in any case of letters */
double scan_number(scan *s, const char *what); /* finite */
int64_t scan_integer(scan *s, const char *what);
/* A number of things of which each takes at least `bytes` bytes of the rest of the file. */
size_t scan_count(scan *s, const char *what, size_t bytes);
size_t scan_check_count(scan *s, int64_t n, const char *what, size_t bytes);

bool word_is(word w, const char *text);
bool word_is_any_case(word w, const char *text);
/* The whole of w as a number, '+' allowed; 1e-400 is 0, 1e400 and "inf" are infinite. */
bool word_number(word w, double *value);
bool word_integer(word w, int64_t *value);
/* For a message: printable characters of w, as many as fit. */
enum { WORD_SHOWN = 48 };
const char *word_show(word w, char shown[WORD_SHOWN]);

/* ---- binary ---- */

/* The next n bytes, which are passed; NULL, and a failure, if there are fewer. */
const unsigned char *scan_bytes(scan *s, size_t n);
double scan_real(scan *s, scalar type, bool big_endian);
int64_t scan_whole(scan *s, scalar type, bool big_endian);

#endif
