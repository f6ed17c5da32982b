/* The file is laid out in memory: place for the superblock, the values as they are put, then the
 * headers of the objects from the last to the root, so that every header knows where those are that
 * it names. */
#include <stdlib.h>
#include <string.h>

#include "exchange/hdf5.h"

enum { SUPERBLOCK = 48, OBJECTS_MOST = 64, ATTRIBUTES_MOST = 8, ALIGNED = 8 };
static const uint64_t nowhere = UINT64_MAX;

typedef enum kind { GROUP, FLOATS, INTS, TEXT } kind;

typedef struct object {
    char name[32];
    size_t parent; /* object */
    kind kind;
    size_t axes, axis[2], size; /* size: bytes of its values */
    size_t values, header;      /* where they begin */
} object;

typedef struct attribute {
    size_t group; /* object */
    const char *name, *text;
} attribute;

struct h5_out {
    unsigned char *bytes;
    size_t used, room;
    bool failed;
    size_t n_objects, n_attributes;
    object object[OBJECTS_MOST]; /* parents first; 0: the root */
    attribute attribute[ATTRIBUTES_MOST];
};

uint32_t h5_checksum(const unsigned char *k, size_t size)
{
#define ROTATED(x, n) ((x) << (n) | (x) >> (32 - (n)))
    uint32_t a = 0xdeadbeef + (uint32_t)size, b = a, c = a;
    uint32_t *const of[3] = { &a, &b, &c };
    if (size == 0) return c;
    for (size_t left = size;; left -= 12, k += 12) {
        for (size_t n = 0; n < 12 && n < left; n++) *of[n / 4] += (uint32_t)k[n] << 8 * (n % 4);
        if (left <= 12) break;
        a -= c, a ^= ROTATED(c, 4), c += b;
        b -= a, b ^= ROTATED(a, 6), a += c;
        c -= b, c ^= ROTATED(b, 8), b += a;
        a -= c, a ^= ROTATED(c, 16), c += b;
        b -= a, b ^= ROTATED(a, 19), a += c;
        c -= b, c ^= ROTATED(b, 4), b += a;
    }
    c ^= b, c -= ROTATED(b, 14);
    a ^= c, a -= ROTATED(c, 11);
    b ^= a, b -= ROTATED(a, 25);
    c ^= b, c -= ROTATED(b, 16);
    a ^= c, a -= ROTATED(c, 4);
    b ^= a, b -= ROTATED(a, 14);
    c ^= b, c -= ROTATED(b, 24);
    return c;
#undef ROTATED
}

/* ---- bytes ---- */

static unsigned char *more(h5_out *o, size_t n)
{
    if (!o->failed && n > o->room - o->used) {
        const size_t room = 2 * o->room > o->used + n ? 2 * o->room : o->used + n;
        unsigned char *const bytes = realloc(o->bytes, room);
        o->failed = !bytes;
        if (bytes) o->bytes = bytes, o->room = room;
    }
    if (o->failed) return NULL;
    o->used += n;
    return o->bytes + o->used - n;
}

static void put(h5_out *o, uint64_t value, size_t size)
{
    unsigned char *const to = more(o, size);
    for (size_t k = 0; to && k < size; k++) to[k] = (unsigned char)(value >> 8 * k);
}

static void put_at(h5_out *o, size_t at, uint64_t value, size_t size)
{
    for (size_t k = 0; !o->failed && k < size; k++)
        o->bytes[at + k] = (unsigned char)(value >> 8 * k);
}

static void put_bytes(h5_out *o, const void *bytes, size_t n)
{
    unsigned char *const to = more(o, n);
    if (to && n) memcpy(to, bytes, n);
}

static void align(h5_out *o)
{
    while (o->used % ALIGNED && !o->failed) put(o, 0, 1);
}

static void put_checksum(h5_out *o, size_t from)
{
    put(o, o->failed ? 0 : h5_checksum(o->bytes + from, o->used - from), 4);
}

h5_out *h5_begin(void)
{
    h5_out *const o = calloc(1, sizeof *o);
    if (!o) return NULL;
    o->n_objects = 1;
    unsigned char *const superblock = more(o, SUPERBLOCK);
    if (superblock) memset(superblock, 0, SUPERBLOCK);
    return o;
}

/* ---- objects ---- */

static size_t child(const h5_out *o, size_t parent, const char *name, size_t length)
{
    for (size_t k = 1; k < o->n_objects; k++)
        if (o->object[k].parent == parent && strlen(o->object[k].name) == length &&
            memcmp(o->object[k].name, name, length) == 0)
            return k;
    return o->n_objects;
}

/* The object of that path; those on the way, and it, are made where they are not there. */
static object *place(h5_out *o, const char *path)
{
    size_t at = 0;
    while (*path) {
        path += strspn(path, "/");
        const size_t length = strcspn(path, "/"), next = child(o, at, path, length);
        if (length == 0) break;
        if (next == OBJECTS_MOST || length >= sizeof o->object[0].name) {
            o->failed = true;
            return &o->object[0];
        }
        if (next == o->n_objects) {
            o->object[o->n_objects++] = (object){ .parent = at };
            memcpy(o->object[next].name, path, length);
        }
        at = next;
        path += length;
    }
    return &o->object[at];
}

/* A dataset whose values are put next. */
static void begin_values(h5_out *o, const char *path, object as)
{
    object *const set = place(o, path);
    align(o);
    memcpy(as.name, set->name, sizeof as.name);
    as.parent = set->parent;
    as.values = o->used;
    *set = as;
}

static object array_of(kind as, size_t rows, size_t columns)
{
    const size_t n = columns ? rows * columns : rows;
    return (
        object){ .kind = as, .axes = columns ? 2 : 1, .axis = { rows, columns }, .size = 4 * n };
}

void h5_put_floats(h5_out *o, const char *path, size_t rows, size_t columns, const float *x)
{
    const object as = array_of(FLOATS, rows, columns);
    begin_values(o, path, as);
    for (size_t k = 0; k < as.size / 4; k++) {
        uint32_t bits;
        memcpy(&bits, &x[k], sizeof bits);
        put(o, bits, 4);
    }
}

void h5_put_ints(h5_out *o, const char *path, size_t rows, size_t columns, const int *x)
{
    const object as = array_of(INTS, rows, columns);
    begin_values(o, path, as);
    for (size_t k = 0; k < as.size / 4; k++) put(o, (uint32_t)x[k], 4);
}

void h5_put_int(h5_out *o, const char *path, int x)
{
    begin_values(o, path, (object){ .kind = INTS, .size = 4 });
    put(o, (uint32_t)x, 4);
}

void h5_put_text(h5_out *o, const char *path, const char *text)
{
    begin_values(o, path, (object){ .kind = TEXT, .size = strlen(text) + 1 });
    put_bytes(o, text, strlen(text) + 1);
}

void h5_put_group(h5_out *o, const char *path)
{
    (void)place(o, path);
}

void h5_put_attribute(h5_out *o, const char *group, const char *name, const char *text)
{
    const size_t at = (size_t)(place(o, group) - o->object);
    if (o->n_attributes == ATTRIBUTES_MOST)
        o->failed = true;
    else
        o->attribute[o->n_attributes++] = (attribute){ at, name, text };
}

/* ---- headers ---- */

/* Where the message begins, for end_message. */
static size_t begin_message(h5_out *o, int type)
{
    put(o, (uint64_t)type, 1);
    put(o, 0, 3); /* size, flags */
    return o->used;
}

static void end_message(h5_out *o, size_t begun)
{
    put_at(o, begun - 3, o->used - begun, 2);
}

/* Version 1 of the types: class, bits of the class, size, properties. */
static void put_type(h5_out *o, kind as, size_t size)
{
    static const unsigned char of_float[] = { 0x11, 0x20, 31, 0, 4, 0,  0,   0, 0, 0,
                                              32,   0,    23, 8, 0, 23, 127, 0, 0, 0 },
                               of_int[] = { 0x10, 0x08, 0, 0, 4, 0, 0, 0, 0, 0, 32, 0 };
    if (as == FLOATS) put_bytes(o, of_float, sizeof of_float);
    if (as == INTS) put_bytes(o, of_int, sizeof of_int);
    if (as != TEXT) return;
    put(o, 0x13, 4); /* ended by NUL, ASCII */
    put(o, size, 4);
}

static void put_space(h5_out *o, size_t axes, const size_t *axis)
{
    put(o, 2, 1);
    put(o, axes, 1);
    put(o, 0, 1);
    put(o, axes > 0, 1); /* 0: a scalar */
    for (size_t a = 0; a < axes; a++) put(o, axis[a], 8);
}

static void put_dataset(h5_out *o, const object *set)
{
    size_t at = begin_message(o, H5_SPACE);
    put_space(o, set->axes, set->axis);
    end_message(o, at);
    at = begin_message(o, H5_TYPE);
    put_type(o, set->kind, set->size);
    end_message(o, at);
    at = begin_message(o, H5_FILL);
    put(o, 3, 1);
    put(o, 0x0a, 1); /* what libhdf5 writes if none is asked for */
    end_message(o, at);
    at = begin_message(o, H5_LAYOUT);
    put(o, 3, 1);
    put(o, 1, 1); /* in one piece */
    put(o, set->values, 8);
    put(o, set->size, 8);
    end_message(o, at);
}

static void put_attribute(h5_out *o, const attribute *a)
{
    const size_t name = strlen(a->name) + 1, text = strlen(a->text) + 1,
                 at = begin_message(o, H5_ATTRIBUTE);
    put(o, 3, 2);    /* version, flags */
    put(o, name, 2); /* sizes of name, type, space */
    put(o, 8, 2);
    put(o, 4, 2);
    put(o, 0, 1); /* ASCII */
    put_bytes(o, a->name, name);
    put_type(o, TEXT, text);
    put_space(o, 0, NULL);
    put_bytes(o, a->text, text);
    end_message(o, at);
}

static void put_group(h5_out *o, size_t group)
{
    size_t at = begin_message(o, H5_LINK_INFO);
    put(o, 0, 2);
    put(o, nowhere, 8); /* links are in the header */
    put(o, nowhere, 8);
    end_message(o, at);
    at = begin_message(o, H5_GROUP_INFO);
    put(o, 0, 2);
    end_message(o, at);
    for (size_t k = group + 1; k < o->n_objects; k++) {
        if (o->object[k].parent != group) continue;
        const size_t length = strlen(o->object[k].name);
        at = begin_message(o, H5_LINK);
        put(o, 1, 2); /* version, flags */
        put(o, length, 1);
        put_bytes(o, o->object[k].name, length);
        put(o, o->object[k].header, 8);
        end_message(o, at);
    }
    for (size_t a = 0; a < o->n_attributes; a++)
        if (o->attribute[a].group == group) put_attribute(o, &o->attribute[a]);
}

static void put_header(h5_out *o, size_t k)
{
    align(o);
    o->object[k].header = o->used;
    put_bytes(o, "OHDR", 4);
    put(o, 2, 1);
    put(o, 2, 1); /* four bytes for the size */
    const size_t size = o->used;
    put(o, 0, 4);
    if (o->object[k].kind == GROUP)
        put_group(o, k);
    else
        put_dataset(o, &o->object[k]);
    put_at(o, size, o->used - size - 4, 4);
    put_checksum(o, o->object[k].header);
}

static void put_superblock(h5_out *o)
{
    const size_t end = o->used;
    o->used = 0;
    put_bytes(o, H5_SIGNATURE, 8);
    put(o, 2, 1); /* version */
    put(o, 8, 1); /* bytes of an address, of a length */
    put(o, 8, 1);
    put(o, 0, 1);
    put(o, 0, 8);
    put(o, nowhere, 8);
    put(o, end, 8);
    put(o, o->object[0].header, 8);
    put_checksum(o, 0);
    o->used = end;
}

bool h5_end(h5_out *o, apsm_writer *w)
{
    for (size_t k = o->n_objects; k-- > 0;) put_header(o, k);
    if (!o->failed) put_superblock(o);
    const bool good = !o->failed;
    if (good) apsm_writer_write(w, o->bytes, o->used);
    free(o->bytes);
    free(o);
    return good;
}
