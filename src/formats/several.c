#include "formats/several.h"

#include <stdlib.h>

#include "formats/inflate.h"

enum { LONGEST_NAME = 1024 };

typedef struct joining {
    const several *files;
    name_series names;
    size_t count, share; /* files, and bytes of each */
    unsigned char *out;  /* owned */
} joining;

static void begin(scan *s, joining *j)
{
    const word names = j->files->names;
    char shown[WORD_SHOWN];
    if (j->files->pattern ? !name_series_of_pattern(names, &j->names)
                          : !name_series_of_lines(names, &j->names))
        scan_refuse(s, APSM_ERR_FORMAT,
                    "'%s' is no pattern of files such as 'slice%%03d.raw 1 20 1'; correct the "
                    "header",
                    word_show(names, shown));
    j->count = j->names.count;
}

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
        const inflated how = inflate_bytes(m->data, m->size, j->share, own);
        if (how == INFLATED) return *own;
        if (how == INFLATE_NO_MEMORY) scan_no_memory(s); /* the first failure counts */
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
    char name[LONGEST_NAME] = "", last[LONGEST_NAME] = "";
    begin(s, &j);
    divide(s, m, &j);
    for (size_t k = 0; k < j.count && scan_ok(s); k++) {
        memcpy(last, name, sizeof last);
        if (!name_series_next(&j.names, name, sizeof name))
            scan_refuse(s, APSM_ERR_FORMAT, "names a data file of more than %d bytes; rename it",
                        LONGEST_NAME - 1);
        if (strcmp(last, name) == 0)
            scan_refuse(s, APSM_ERR_FORMAT, "names the same data file twice; correct the header");
        if (scan_ok(s)) join_one(s, m, &j, k, name);
    }
    m->detached = (char *)j.out;
    m->data = j.out;
    m->size = j.count * j.share;
    m->packing = PLAIN;
}
