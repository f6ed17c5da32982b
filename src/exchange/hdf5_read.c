/* Every step goes through a scan of the whole file, which never leaves it, and the steps are
 * counted, so that a damaged file ends in a message. */
#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "exchange/hdf5.h"
#include "exchange/hdf5_json.h"
#include "formats/input_file.h"
#include "formats/scan.h"

enum { PARTS_MOST = 64, STEPS_MOST = 100000 };

typedef struct walk {
    scan s;
    size_t steps;
} walk;

static walk walk_begin(const h5_in *in)
{
    walk w = { .s = scan_begin(in->ctx, in->path, in->bytes, in->size) };
    w.s.binary = true;
    return w;
}

static uint64_t whole(walk *w, size_t size)
{
    const unsigned char *const b = scan_bytes(&w->s, size);
    return b ? scalar_bits(b, size, false) : 0;
}

static void go(walk *w, uint64_t at)
{
    if (++w->steps > STEPS_MOST || at > w->s.size)
        scan_fail(&w->s, "points to where nothing is; the file is damaged: copy it again");
    else
        w->s.at = (size_t)at;
}

/* Whether the next four bytes are those, which are passed then. */
static bool next_is(walk *w, const char *mark)
{
    const bool is = scan_left(&w->s) >= 4 && memcmp(w->s.bytes + w->s.at, mark, 4) == 0;
    if (is) w->s.at += 4;
    return is;
}

static void expect(walk *w, const char *mark)
{
    if (scan_ok(&w->s) && !next_is(w, mark))
        scan_fail(&w->s, "expected %s; the file is damaged: copy it again", mark);
}

/* ---- the headers of objects ---- */

typedef struct header {
    bool second, ordered;
    size_t parts, part;
    size_t end; /* of the present part */
    struct {
        uint64_t at, size;
    } of[PARTS_MOST];
} header;

typedef struct message {
    int type;
    size_t at, end;
    bool shared;
} message;

static void add_part(walk *w, header *h, uint64_t at, uint64_t size)
{
    if (h->parts == PARTS_MOST || at > w->s.size || size > w->s.size - at)
        scan_fail(&w->s, "an object's header never ends; the file is damaged: copy it again");
    else
        h->of[h->parts].at = at, h->of[h->parts++].size = size;
}

/* From the mark of a header, or of a part of it, to the check sum behind it. */
static void check(walk *w, uint64_t from, uint64_t to)
{
    const size_t before = w->s.at;
    if (scan_ok(&w->s)) go(w, to);
    const uint32_t sum = (uint32_t)whole(w, 4);
    if (scan_ok(&w->s) &&
        sum != h5_checksum((const unsigned char *)w->s.bytes + from, (size_t)(to - from)))
        scan_fail(&w->s, "a check sum is wrong; the file is damaged: copy it again");
    w->s.at = before;
}

static header header_begin(walk *w, uint64_t at)
{
    header h = { 0 };
    go(w, at);
    h.second = next_is(w, "OHDR");
    const uint64_t version = whole(w, 1);
    if (scan_ok(&w->s) && version != (h.second ? 2 : 1))
        scan_fail(&w->s, "an object's header is of an unknown version, %u", (unsigned)version);
    if (h.second) {
        const uint64_t flags = whole(w, 1);
        h.ordered = flags & 4;
        (void)scan_bytes(&w->s, (flags & 0x20 ? 16 : 0) + (flags & 0x10 ? 4 : 0));
        const uint64_t size = whole(w, (size_t)1 << (flags & 3));
        add_part(w, &h, w->s.at, size);
        check(w, at, w->s.at + size);
    } else {
        (void)scan_bytes(&w->s, 7);
        const uint64_t size = whole(w, 4);
        (void)scan_bytes(&w->s, 4);
        add_part(w, &h, w->s.at, size);
    }
    return h;
}

static void read_continuation(walk *w, header *h)
{
    const uint64_t at = whole(w, 8), size = whole(w, 8), back = w->s.at;
    go(w, at);
    if (h->second) {
        expect(w, "OCHK");
        if (size < 8) scan_fail(&w->s, "a part of a header is too short; copy the file again");
        add_part(w, h, at + 4, size - 8);
        if (scan_ok(&w->s)) check(w, at, at + size - 4);
    } else {
        add_part(w, h, at, size);
    }
    if (scan_ok(&w->s)) go(w, back);
}

/* false: there is none any more, or a failure. */
static bool next_message(walk *w, header *h, message *m)
{
    const size_t head = h->second ? h->ordered ? 6 : 4 : 8;
    while (scan_ok(&w->s)) {
        if (h->end < w->s.at + head) {
            if (h->part == h->parts) return false;
            go(w, h->of[h->part].at);
            h->end = w->s.at + (size_t)h->of[h->part++].size;
            continue;
        }
        m->type = (int)whole(w, h->second ? 1 : 2);
        const size_t size = (size_t)whole(w, 2);
        m->shared = whole(w, 1) & 2;
        (void)scan_bytes(&w->s, head - (h->second ? 4 : 5));
        m->at = w->s.at;
        m->end = m->at + size;
        if (++w->steps > STEPS_MOST || m->end > h->end)
            scan_fail(&w->s, "an object's header is damaged: copy the file again");
        if (!scan_ok(&w->s)) return false;
        if (m->type != H5_CONTINUATION) return true;
        read_continuation(w, h);
        w->s.at = m->end;
    }
    return false;
}

/* ---- groups ---- */

typedef struct search {
    const char *name;
    size_t length;
    uint64_t heap;  /* where the names of an old group are */
    uint64_t found; /* the object's header; 0: nowhere yet */
} search;

static bool name_is(walk *w, const search *q, size_t at)
{
    return at <= w->s.size && w->s.size - at > q->length &&
           memcmp(w->s.bytes + at, q->name, q->length) == 0;
}

static void search_symbols(walk *w, search *q)
{
    (void)scan_bytes(&w->s, 2);
    for (size_t n = (size_t)whole(w, 2); n > 0 && !q->found && scan_ok(&w->s); n--) {
        const uint64_t name = whole(w, 8), at = whole(w, 8);
        (void)scan_bytes(&w->s, 24);
        if (++w->steps > STEPS_MOST)
            scan_fail(&w->s, "a group's tree is damaged: copy the file again");
        if (name > w->s.size || q->heap > w->s.size) continue;
        const size_t text = (size_t)(q->heap + name);
        if (scan_ok(&w->s) && name_is(w, q, text) && w->s.bytes[text + q->length] == '\0')
            q->found = at;
    }
}

/* A group's tree (version 1): nodes down to tables of symbols. */
static void search_tree(walk *w, search *q, uint64_t at, size_t above)
{
    go(w, at);
    if (scan_ok(&w->s) && next_is(w, "SNOD")) {
        search_symbols(w, q);
        return;
    }
    expect(w, "TREE");
    const uint64_t type = whole(w, 1);
    const size_t level = (size_t)whole(w, 1), n = (size_t)whole(w, 2);
    if (scan_ok(&w->s) && (type != 0 || level >= above))
        scan_fail(&w->s, "a group's tree is damaged: copy the file again");
    (void)scan_bytes(&w->s, 24); /* siblings, first key */
    for (size_t k = 0; k < n && !q->found && scan_ok(&w->s); k++) {
        const uint64_t child = whole(w, 8);
        (void)whole(w, 8);
        const size_t back = w->s.at;
        if (scan_ok(&w->s)) search_tree(w, q, child, level);
        if (scan_ok(&w->s)) go(w, back);
    }
}

static void search_old_group(walk *w, search *q)
{
    enum { DEEPEST = 16 };
    const uint64_t tree = whole(w, 8), heap = whole(w, 8);
    go(w, heap);
    expect(w, "HEAP");
    (void)scan_bytes(&w->s, 20);
    q->heap = whole(w, 8);
    search_tree(w, q, tree, DEEPEST);
}

static void search_link(walk *w, search *q)
{
    (void)whole(w, 1);
    const uint64_t flags = whole(w, 1), type = flags & 8 ? whole(w, 1) : 0;
    (void)scan_bytes(&w->s, (flags & 4 ? 8 : 0) + (flags & 16 ? 1 : 0));
    const uint64_t length = whole(w, (size_t)1 << (flags & 3));
    if (!scan_ok(&w->s) || length != q->length || !name_is(w, q, w->s.at)) return;
    (void)scan_bytes(&w->s, q->length);
    if (type == 0) q->found = whole(w, 8);
}

static void search_group(walk *w, search *q, uint64_t group)
{
    header h = header_begin(w, group);
    message m;
    bool dense = false;
    while (!q->found && next_message(w, &h, &m)) {
        if (m.type == H5_SYMBOLS) search_old_group(w, q);
        if (m.type == H5_LINK) search_link(w, q);
        if (m.type == H5_LINK_INFO) {
            const bool ordered = whole(w, 2) >> 8 & 1;
            (void)scan_bytes(&w->s, ordered ? 8 : 0);
            dense = whole(w, 8) != UINT64_MAX;
        }
        if (scan_ok(&w->s)) w->s.at = m.end;
    }
    if (dense && !q->found)
        scan_refuse(&w->s, APSM_ERR_UNSUPPORTED,
                    "a group has more members than a model's; save the model in a file of its own");
}

/* The header of the object of that name; 0: there is none, or a failure. */
static uint64_t find(walk *w, const h5_in *in, const char *name)
{
    uint64_t at = in->root;
    while (scan_ok(&w->s) && at) {
        name += strspn(name, "/");
        search q = { .name = name, .length = strcspn(name, "/") };
        if (q.length == 0) return at;
        search_group(w, &q, at);
        at = q.found;
        name += q.length;
    }
    return 0;
}

/* ---- datasets ---- */

typedef struct dataset {
    size_t axes;
    uint64_t axis[2];
    bool has_space, has_type, has_values;
    scalar type;
    bool big_endian;
    uint64_t values;
} dataset;

static void read_space(walk *w, dataset *d)
{
    const uint64_t version = whole(w, 1);
    d->axes = (size_t)whole(w, 1);
    (void)scan_bytes(&w->s, version == 1 ? 6 : 2);
    if (scan_ok(&w->s) && (version < 1 || version > 2 || d->axes > 2))
        scan_fail(&w->s, "has %zu axes; a model's have two at most", d->axes);
    d->axis[0] = d->axis[1] = 1;
    for (size_t a = 0; a < d->axes && scan_ok(&w->s); a++) d->axis[a] = whole(w, 8);
    d->has_space = true;
}

/* Integers of whole bytes, and the IEEE's two, whose exponents lie at bit 23 and 52. */
static void read_type(walk *w, dataset *d)
{
    const uint64_t kind = whole(w, 1) & 15, bits = whole(w, 3), size = whole(w, 4),
                   offset = whole(w, 2), precision = whole(w, 2);
    const bool one_of_ours = size == 1 || size == 2 || size == 4 || size == 8,
               plain = one_of_ours && offset == 0 && precision == 8 * size;
    d->big_endian = bits & 1;
    d->has_type = true;
    if (kind == 0 && plain) {
        const int octave = size == 1 ? 0 : size == 2 ? 1 : size == 4 ? 2 : 3;
        d->type = (scalar)(SCALAR_I8 + 2 * octave + !(bits & 8));
    } else if (kind == 1 && plain && size >= 4 && whole(w, 2) == (size == 4 ? 0x0817 : 0x0b34)) {
        d->type = size == 4 ? SCALAR_F32 : SCALAR_F64;
    } else if (scan_ok(&w->s)) {
        scan_fail(&w->s, "holds values that are no usual numbers");
    }
}

static void read_layout(walk *w, dataset *d)
{
    enum { COMPACT, CONTIGUOUS, CHUNKED };
    const uint64_t version = whole(w, 1);
    if (version < 3) (void)whole(w, 1); /* axes */
    const uint64_t layout = whole(w, 1);
    if (version < 3) (void)scan_bytes(&w->s, 5);
    d->has_values = true;
    if (layout == CONTIGUOUS) {
        d->values = whole(w, 8);
    } else if (layout == COMPACT && version >= 3) {
        (void)whole(w, 2);
        d->values = w->s.at;
    } else if (scan_ok(&w->s)) {
        scan_refuse(&w->s, APSM_ERR_UNSUPPORTED,
                    "is stored in chunks; 'h5repack -l CONTI -f NONE %s OTHER.h5' (package "
                    "hdf5-tools) writes it in one piece",
                    w->s.path);
    }
}

static void read_dataset(walk *w, uint64_t at, dataset *d)
{
    header h = header_begin(w, at);
    message m;
    while (next_message(w, &h, &m)) {
        if (m.shared && (m.type == H5_SPACE || m.type == H5_TYPE)) continue;
        if (m.type == H5_SPACE) read_space(w, d);
        if (m.type == H5_TYPE) read_type(w, d);
        if (m.type == H5_LAYOUT) read_layout(w, d);
        if (m.type == H5_EXTERNAL) d->values = UINT64_MAX;
        if (scan_ok(&w->s)) w->s.at = m.end;
    }
    if (scan_ok(&w->s) && !(d->has_space && d->has_type && d->has_values))
        scan_fail(&w->s, "is no dataset of numbers");
}

static double *read_values(walk *w, const dataset *d)
{
    const size_t each = scalar_size(d->type);
    if (scan_ok(&w->s)) go(w, d->values);
    if (!scan_ok(&w->s)) return NULL;
    const uint64_t most = scan_left(&w->s) / each;
    if (d->axis[0] == 0 || d->axis[1] == 0 || d->axis[0] > most / d->axis[1]) {
        scan_fail(&w->s,
                  "more values are promised than the file holds; it is cut short: copy it again");
        return NULL;
    }
    const size_t n = (size_t)(d->axis[0] * d->axis[1]);
    double *const x = malloc(n * sizeof *x);
    if (!x) scan_no_memory(&w->s);
    for (size_t k = 0; x && k < n; k++) x[k] = scan_real(&w->s, d->type, d->big_endian);
    return x;
}

/* ---- the file ---- */

static uint64_t read_superblock(walk *w)
{
    const unsigned char *const mark = scan_bytes(&w->s, 8);
    if (!mark || memcmp(mark, H5_SIGNATURE, 8) != 0) {
        w->s.status = APSM_OK; /* "cut short" would be the lesser truth */
        scan_refuse(&w->s, APSM_ERR_FORMAT, "is no HDF5 file, whatever its name says");
        return 0;
    }
    const uint64_t version = whole(w, 1);
    go(w, version < 2 ? 13 : 9);
    const uint64_t address = whole(w, 1), length = whole(w, 1);
    if (scan_ok(&w->s) && (version > 3 || address != 8 || length != 8))
        scan_refuse(&w->s, APSM_ERR_UNSUPPORTED,
                    "is HDF5 of a kind that is not read (superblock %u, addresses of %u bytes); "
                    "h5repack writes it anew",
                    (unsigned)version, (unsigned)address);
    if (version >= 2) check(w, 0, 44);
    go(w, version == 0 ? 40 : version == 1 ? 44 : 28);
    if (whole(w, 8) > w->s.size && scan_ok(&w->s))
        scan_refuse(&w->s, APSM_ERR_FORMAT, "is cut short; copy it again");
    go(w, version == 0 ? 64 : version == 1 ? 68 : 36);
    return whole(w, 8);
}

apsm_status h5_open(apsm_context *ctx, const char *path, h5_in *in)
{
    *in = (h5_in){ .ctx = ctx, .path = path };
    if (path_ends_in(path, ".json")) return apsm_json_read(ctx, path, &in->json);
    APSM_TRY(input_file_read(ctx, path, &in->bytes, &in->size));
    walk w = walk_begin(in);
    in->root = read_superblock(&w);
    if (!scan_ok(&w.s)) h5_close(in);
    return w.s.status;
}

void h5_close(h5_in *in)
{
    json_decref(in->json);
    free(in->bytes);
    *in = (h5_in){ 0 };
}

apsm_status h5_has(const h5_in *in, const char *name, bool *there)
{
    if (in->json) {
        *there = hdf5_json_find(in->json, name) != NULL;
        return APSM_OK;
    }
    walk w = walk_begin(in);
    *there = find(&w, in, name) != 0;
    return w.s.status;
}

static apsm_status lacks(const h5_in *in, const char *name, const char *how)
{
    return apsm_fail(in->ctx, APSM_ERR_FORMAT,
                     "%s: has no %s%s; a model file of Scalismo or Statismo is wanted", in->path,
                     how, name);
}

static apsm_status read_json(const h5_in *in, const char *name, size_t *rows, size_t *columns,
                             double **x)
{
    const json_t *const value = hdf5_json_find(in->json, name);
    size_t n, m;
    if (!value) return lacks(in, name, "");
    if (!hdf5_json_size(value, &n, &m)) return lacks(in, name, "readable ");
    double *const numbers = malloc(n * (m ? m : 1) * sizeof *numbers);
    if (!numbers) return apsm_fail(in->ctx, APSM_ERR_MEMORY, "%s: out of memory", in->path);
    if (!hdf5_json_get(value, n, m, numbers)) {
        free(numbers);
        return lacks(in, name, "readable ");
    }
    *x = numbers;
    *rows = n;
    *columns = m ? m : 1;
    return APSM_OK;
}

apsm_status h5_read(const h5_in *in, const char *name, size_t *rows, size_t *columns, double **x)
{
    walk w = walk_begin(in);
    dataset d = { .values = UINT64_MAX };
    *x = NULL;
    *rows = *columns = 0;
    if (in->json) return read_json(in, name, rows, columns, x);
    const uint64_t at = find(&w, in, name);
    if (scan_ok(&w.s) && !at) return lacks(in, name, "");
    if (scan_ok(&w.s)) read_dataset(&w, at, &d);
    *x = read_values(&w, &d);
    if (!scan_ok(&w.s)) return w.s.status;
    *rows = (size_t)d.axis[0];
    *columns = (size_t)d.axis[1];
    return APSM_OK;
}
