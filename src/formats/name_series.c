#include "formats/name_series.h"

#include <stdio.h>

#include "formats/header_line.h"

enum { MOST_FILES = 1 << 20, MOST_DIGITS = 12 };

bool name_series_is_pattern(word file)
{
    return memchr(file.text, '%', file.length) != NULL;
}

/* "LIST", "LIST 2", "LIST2" or "LIST 2D": how many axes each file has follows from the count. */
static bool is_list(word file)
{
    size_t at = 4;
    if (file.length < at || memcmp(file.text, "LIST", at) != 0) return false;
    if (at < file.length && (file.text[at] == ' ' || file.text[at] == '\t')) return true;
    while (at < file.length && file.text[at] >= '0' && file.text[at] <= '9') at++;
    if (at < file.length && file.text[at] == 'D') at++;
    return at == file.length;
}

bool name_series_is(word file)
{
    return name_series_is_pattern(file) || is_list(file);
}

/* The next line that is not empty; empty at the end. */
static word next_line(word *rest)
{
    word line = { rest->text, 0 };
    while (rest->length && !line.length) {
        size_t length = 0;
        while (length < rest->length && rest->text[length] != '\n' && rest->text[length] != '\r')
            length++;
        line = word_trim((word){ rest->text, length });
        length += length < rest->length;
        rest->text += length;
        rest->length -= length;
    }
    return line;
}

bool name_series_of_lines(word lines, name_series *n)
{
    *n = (name_series){ .rest = lines };
    while (next_line(&lines).length) n->count++;
    return true;
}

/* From first to last in steps of that width: no sum of them leaves what an integer holds. */
static bool is_range(int64_t first, int64_t last, int64_t step)
{
    return first >= 0 && first < MOST_FILES && last >= 0 && last < MOST_FILES && step != 0 &&
           step > -MOST_FILES && step < MOST_FILES &&
           (last == first || (last > first) == (step > 0));
}

/* "%d" or "%03d", taken apart. */
static bool split_number(word name, name_series *n)
{
    const char *const mark = memchr(name.text, '%', name.length);
    if (!mark) return false;
    n->before = (word){ name.text, (size_t)(mark - name.text) };
    word rest = { mark + 1, name.length - n->before.length - 1 };
    for (; rest.length && *rest.text >= '0' && *rest.text <= '9'; rest.text++, rest.length--)
        if ((n->digits = 10 * n->digits + (*rest.text - '0')) > MOST_DIGITS) return false;
    if (!rest.length || !strchr("diu", *rest.text)) return false;
    n->after = (word){ rest.text + 1, rest.length - 1 };
    return !memchr(n->after.text, '%', n->after.length);
}

bool name_series_of_pattern(word pattern, name_series *n)
{
    const word name = word_next(&pattern);
    int64_t last = 0;
    *n = (name_series){ .pattern = true };
    const bool good = split_number(name, n) && word_integer(word_next(&pattern), &n->number) &&
                      word_integer(word_next(&pattern), &last) &&
                      word_integer(word_next(&pattern), &n->step) &&
                      is_range(n->number, last, n->step);
    if (good) n->count = (size_t)((last - n->number) / n->step) + 1;
    return good;
}

bool name_series_next(name_series *n, char *name, size_t room)
{
    int length;
    if (n->pattern) {
        length = snprintf(name, room, "%.*s%0*lld%.*s", (int)n->before.length, n->before.text,
                          n->digits ? n->digits : 1, (long long)n->number, (int)n->after.length,
                          n->after.text);
        n->number += n->step;
    } else {
        const word line = next_line(&n->rest);
        length = snprintf(name, room, "%.*s", (int)line.length, line.text);
    }
    n->count--;
    return length >= 0 && (size_t)length < room;
}
