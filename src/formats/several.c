#include "formats/several.h"

#include <stdio.h>
#include <stdlib.h>

#include "formats/header_line.h"
#include "formats/inflate.h"
#include "formats/input_file.h"

enum { LONGEST_NAME = 1024, MOST_FILES = 1 << 20, MOST_DIGITS = 12 };

typedef struct joining {
    const several *files;
    size_t count, share; /* files, and bytes of each */
    word before, after;  /* of a pattern's number */
    int digits;          /* the number is filled up with zeros to so many */
    int64_t first, step;
    unsigned char *out; /* owned */
} joining;

bool several_is_pattern(word file)
{
    return memchr(file.text, '%', file.length) != NULL;
}

bool several_files(word file)
{
    return several_is_pattern(file) || (file.length >= 4 && memcmp(file.text, "LIST", 4) == 0);
}

/* ---- names ---- */

/* The next line that is not empty; empty at the end. */
static word next_line(word *rest)
{
    word line = { rest->text, 0 };
    while (rest->length && !line.length) {
        const char *const end = memchr(rest->text, '\n', rest->length);
        const size_t length = end ? (size_t)(end - rest->text) : rest->length;
        line = word_trim((word){ rest->text, length });
        rest->text += length + (end != NULL);
        rest->length -= length + (end != NULL);
    }
    return line;
}

static void refuse_pattern(scan *s, word names)
{
    char shown[WORD_SHOWN];
    scan_refuse(s, APSM_ERR_FORMAT,
                "'%s' is no pattern of files such as 'slice%%03d.raw 1 20 1'; correct the header",
                word_show(names, shown));
}

/* "%d" or "%03d", taken apart, in the pattern's first word. */
static bool split_number(word name, joining *j)
{
    const char *const mark = memchr(name.text, '%', name.length);
    if (!mark) return false;
    j->before = (word){ name.text, (size_t)(mark - name.text) };
    word rest = { mark + 1, name.length - j->before.length - 1 };
    for (; rest.length && *rest.text >= '0' && *rest.text <= '9'; rest.text++, rest.length--)
        if ((j->digits = 10 * j->digits + (*rest.text - '0')) > MOST_DIGITS) return false;
    if (!rest.length || !strchr("diu", *rest.text)) return false;
    j->after = (word){ rest.text + 1, rest.length - 1 };
    return !memchr(j->after.text, '%', j->after.length);
}

static void read_pattern(scan *s, joining *j)
{
    word rest = j->files->names;
    const word name = word_next(&rest);
    int64_t last = 0;
    const bool good = split_number(name, j) && word_integer(word_next(&rest), &j->first) &&
                      word_integer(word_next(&rest), &last) &&
                      word_integer(word_next(&rest), &j->step) && j->first >= 0 && last >= 0 &&
                      j->first < MOST_FILES && last < MOST_FILES && j->step != 0 &&
                      (last - j->first) / j->step >= 0;
    if (good)
        j->count = (size_t)((last - j->first) / j->step) + 1;
    else
        refuse_pattern(s, j->files->names);
}

static void count_lines(joining *j)
{
    word rest = j->files->names;
    while (next_line(&rest).length) j->count++;
}

/* name <- of file k; of a list, the next of *rest. */
static void name_of(scan *s, const joining *j, size_t k, word *rest, char name[LONGEST_NAME])
{
    int length;
    if (j->files->pattern) {
        const long long number = (long long)(j->first + (int64_t)k * j->step);
        length =
            snprintf(name, LONGEST_NAME, "%.*s%0*lld%.*s", (int)j->before.length, j->before.text,
                     j->digits ? j->digits : 1, number, (int)j->after.length, j->after.text);
    } else {
        const word line = next_line(rest);
        length = snprintf(name, LONGEST_NAME, "%.*s", (int)line.length, line.text);
    }
    if (length >= LONGEST_NAME)
        scan_refuse(s, APSM_ERR_FORMAT, "names a data file of more than %d bytes; rename it",
                    LONGEST_NAME - 1);
}

/* ---- bytes ---- */

/* The count has to divide the slices, so that every file holds whole ones. */
static void divide(scan *s, const image *m, joining *j)
{
    if (!scan_ok(s)) return;
    if (j->count == 0 || m->n[2] % j->count != 0) {
        scan_refuse(s, APSM_ERR_FORMAT,
                    "names %zu data files for %zu slices; they have to be as many, or each of as "
                    "many slices: correct the header",
                    j->count, m->n[2]);
        return;
    }
    const double bytes = (double)m->layers * (double)m->n[0] * (double)m->n[1] *
                         (double)(m->n[2] / j->count) * (double)scalar_size(m->type);
    if (!(bytes * (double)j->count < 4e18))
        scan_refuse(s, APSM_ERR_FORMAT,
                    "its header promises more voxels than files can hold; it is "
                    "damaged: export it again");
    else
        j->share = m->layers * m->n[0] * m->n[1] * (m->n[2] / j->count) * scalar_size(m->type);
}

/* The share of one file, which m has loaded: *own is freed by the caller, NULL if it is m's. */
static const unsigned char *share_of(scan *s, const joining *j, const image *m, const char *name,
                                     unsigned char **own)
{
    char shown[WORD_SHOWN];
    const size_t skip = j->files->skip > 0 ? (size_t)j->files->skip : 0;
    *own = NULL;
    if (!scan_ok(s)) return NULL;
    if (j->files->packed) {
        if (inflate_bytes(m->data, m->size, j->share, own) == INFLATED) return *own;
    } else if (m->size >= j->share && m->size - j->share >= skip) {
        return m->data + (j->files->skip < 0 ? m->size - j->share : skip);
    }
    scan_refuse(s, APSM_ERR_FORMAT,
                "its data file '%s' holds fewer voxels than it should, or is damaged; copy or "
                "export it again",
                word_show((word){ name, strlen(name) }, shown));
    return NULL;
}

/* Appends file k.  Room grows with what is really there. */
static void join_one(scan *s, image *m, joining *j, size_t k, const char *name)
{
    unsigned char *own;
    image_load_data(s, m, name);
    const unsigned char *const voxels = share_of(s, j, m, name, &own);
    unsigned char *const larger = voxels ? realloc(j->out, (k + 1) * j->share) : NULL;
    if (larger) {
        j->out = larger;
        memcpy(larger + k * j->share, voxels, j->share);
    } else {
        scan_no_memory(s);
    }
    free(own);
    free(m->detached);
    m->detached = NULL;
    m->data = NULL;
}

void several_load(scan *s, image *m, const several *files)
{
    joining j = { .files = files };
    word rest = files->names;
    char name[LONGEST_NAME] = "", last[LONGEST_NAME] = "";
    if (files->pattern)
        read_pattern(s, &j);
    else
        count_lines(&j);
    divide(s, m, &j);
    for (size_t k = 0; k < j.count && scan_ok(s); k++) {
        memcpy(last, name, sizeof last);
        name_of(s, &j, k, &rest, name);
        if (strcmp(last, name) == 0)
            scan_refuse(s, APSM_ERR_FORMAT, "names the same data file twice; correct the header");
        if (scan_ok(s)) join_one(s, m, &j, k, name);
    }
    m->detached = (char *)j.out;
    m->data = j.out;
    m->size = j.count * j.share;
    m->packing = PLAIN;
}
