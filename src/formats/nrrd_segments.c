#include "formats/nrrd_segments.h"

#include <stdlib.h>

enum { MOST_SEGMENTS = 4096 };

/* N of "SegmentN_..."; the rest of the key goes to *rest.  -1 for another key. */
static int64_t number_of(word key, word *rest)
{
    static const char start[] = "Segment";
    const size_t length = sizeof start - 1;
    if (key.length <= length || memcmp(key.text, start, length) != 0) return -1;
    const char *const line = memchr(key.text, '_', key.length);
    int64_t n;
    if (!line || !word_integer((word){ key.text + length, (size_t)(line - key.text) - length }, &n))
        return -1;
    *rest = (word){ line + 1, key.length - (size_t)(line - key.text) - 1 };
    return n >= 0 && n < MOST_SEGMENTS ? n : -1;
}

/* Segments up to number n, those new without a name and with the label 1 + their number. */
static bool make_room(apsm_volume *v, size_t n)
{
    if (n < v->segments) return true;
    apsm_segment *const larger = realloc(v->segment, (n + 1) * sizeof *larger);
    if (!larger) return false;
    v->segment = larger;
    for (; v->segments <= n; v->segments++)
        larger[v->segments] = (apsm_segment){ .label = (int32_t)v->segments + 1 };
    return true;
}

static void set_name(scan *s, apsm_segment *segment, word value)
{
    char *const name = malloc(value.length + 1);
    if (!name) {
        scan_no_memory(s);
        return;
    }
    memcpy(name, value.text, value.length);
    name[value.length] = '\0';
    for (char *c = name; *c; c++)
        if ((unsigned char)*c < ' ' || *c == '\x7f') *c = '?'; /* it may be shown */
    free(segment->name);
    segment->name = name;
}

void read_segment_line(scan *s, const header_line *l, apsm_volume *volume)
{
    word what;
    int64_t value = 0;
    const int64_t n = number_of(l->key, &what);
    if (n < 0) return;
    if (!make_room(volume, (size_t)n)) {
        scan_no_memory(s);
        return;
    }
    apsm_segment *const segment = &volume->segment[n];
    if (word_is(what, "Name")) set_name(s, segment, l->value);
    if (word_is(what, "LabelValue") && word_integer(l->value, &value) && value >= INT32_MIN &&
        value <= INT32_MAX)
        segment->label = (int32_t)value;
    if (word_is(what, "Layer") && word_integer(l->value, &value) && value >= 0)
        segment->layer = (size_t)value;
}
