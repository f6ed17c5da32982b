/* readers.h -- the readers of everything that is neither mesh nor image, one call each by the name
 * of the file; for tests of damage and for the fuzzer. */
#ifndef APSM_TEST_READERS_H
#define APSM_TEST_READERS_H

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "apsm/exchange.h"
#include "apsm/fit.h"
#include "apsm/particles.h"
#include "files/checkpoint_file.h"
#include "files/constraints_file.h"
#include "files/files.h"
#include "files/journal.h"
#include "files/project.h"
#include "folder/model_json.h"
#include "landmarks/landmark_table.h"
#include "statistics/measurement.h"
#include "statistics/table.h"

static const char *const reader_shapes[] = { "a", "b", "c" };
enum { READER_SHAPES = 3 };

static inline apsm_status reader_project(apsm_context *ctx, const char *path)
{
    apsm_project p;
    const apsm_status status = apsm_project_read(ctx, path, &p);
    apsm_project_free(&p);
    return status;
}

static inline apsm_status reader_points(apsm_context *ctx, const char *path)
{
    size_t I, n;
    double *P;
    const apsm_status status = apsm_points_read_cohort(ctx, path, &I, &n, &P);
    if (status == APSM_OK) free(P);
    return status;
}

static inline apsm_status reader_landmarks(apsm_context *ctx, const char *path)
{
    landmark_list list = { 0 };
    const apsm_status status = landmark_list_read(ctx, path, &list);
    landmark_list_free(&list);
    return status;
}

static inline apsm_status reader_landmark_table(apsm_context *ctx, const char *path)
{
    landmark_table t = { 0 };
    size_t others;
    const apsm_status status =
        landmark_table_read(ctx, path, READER_SHAPES, reader_shapes, &t, &others);
    landmark_table_free(&t);
    return status;
}

static inline apsm_status reader_constraints(apsm_context *ctx, const char *path)
{
    apsm_region region = { 0 };
    const apsm_status status = apsm_constraints_read(ctx, path, &region);
    apsm_region_free(&region);
    return status;
}

static inline apsm_status reader_table(apsm_context *ctx, const char *path)
{
    apsm_table table = { .I = READER_SHAPES };
    const apsm_status status = apsm_table_read(ctx, path, READER_SHAPES, reader_shapes, &table);
    apsm_table_free(&table);
    return status;
}

static inline apsm_status reader_measurements(apsm_context *ctx, const char *path)
{
    double P[12] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1 };
    char name[] = "tibia";
    model_part part = { .name = name, .J = 4 };
    const model_folder m = { .I = 1, .J = 4, .P = P, .parts = 1, .part = &part };
    measurement_list list = { 0 };
    const apsm_status status = measurement_list_read(ctx, path, &m, &list);
    measurement_list_free(&list);
    return status;
}

static inline apsm_status reader_model(apsm_context *ctx, const char *path)
{
    apsm_shape_model model = { 0 };
    const apsm_status status = model_json_read(ctx, path, &model);
    apsm_shape_model_free(&model);
    return status;
}

static inline apsm_status reader_checkpoint(apsm_context *ctx, const char *path)
{
    apsm_checkpoint *c = NULL;
    const apsm_status status = apsm_checkpoint_read(ctx, path, &c);
    apsm_checkpoint_free(c);
    return status;
}

static inline apsm_status reader_fit_model(apsm_context *ctx, const char *path)
{
    apsm_fit_model *m = NULL;
    const apsm_status status = apsm_fit_model_load(ctx, path, &m);
    apsm_fit_model_free(m);
    return status;
}

static inline apsm_status reader_journal(apsm_context *ctx, const char *path)
{
    static const journal_key key = { { 1 } };
    journal *j = NULL;
    void *data = NULL;
    size_t size;
    apsm_status status = journal_open(ctx, path, false, &j);
    if (status == APSM_OK) status = journal_find(ctx, j, &key, &data, &size);
    free(data);
    journal_close(j);
    return status;
}

static inline apsm_status reader_statismo(apsm_context *ctx, const char *path)
{
    apsm_foreign_model m = { 0 };
    const apsm_status status = apsm_read_statismo(ctx, path, 8, &m);
    if (status == APSM_OK) apsm_foreign_model_free(&m);
    return status;
}

static const struct any_reader {
    const char *name; /* of the file */
    apsm_status (*read)(apsm_context *ctx, const char *path);
} any_reader[] = {
    { "a.swproj", reader_project },     { "b.xlsx", reader_project },
    { "c.particles", reader_points },   { "d.npy", reader_points },
    { "e.csv", reader_points },         { "f.mrk.json", reader_landmarks },
    { "g.fcsv", reader_landmarks },     { "h.csv", reader_landmarks },
    { "i.csv", reader_landmark_table }, { "j.json", reader_constraints },
    { "k.json", reader_measurements },  { "l.csv", reader_table },
    { "m.tsv", reader_table },          { "n.json", reader_model },
    { "o.ckpt", reader_checkpoint },    { "p.apsm", reader_fit_model },
    { "q.journal", reader_journal },    { "r.h5", reader_statismo },
    { "s.h5.json", reader_statismo },
};
enum { ANY_READERS = sizeof any_reader / sizeof *any_reader };

/* ---- files that are whole, whatever is in them ---- */

/* A checkpoint's sum, in its last 32 bytes, is made right again. */
static inline void reader_seal(char *bytes, size_t size)
{
    if (size < 32) return;
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add(&sha, bytes, size - 32);
    apsm_sha256_end(&sha, (unsigned char *)bytes + size - 32);
}

static inline char *reader_put(char *to, unsigned long value, int bytes)
{
    for (int b = 0; b < bytes; b++, value >>= 8) *to++ = (char)(value & 255);
    return to;
}

/* A workbook of one sheet: entries that are stored as they are, with sums that fit.  The sheet's
 * XML is `sheet`.  Returns what the caller frees. */
static inline char *reader_workbook(const char *sheet, size_t length, size_t *size)
{
    static const char *const names[] = { "xl/workbook.xml", "xl/_rels/workbook.xml.rels",
                                         "xl/worksheets/sheet1.xml" };
    const char *const text[] = {
        "<workbook xmlns:r=\"r\"><sheets><sheet name=\"data\" sheetId=\"1\" "
        "r:id=\"rId1\"/></sheets>"
        "</workbook>",
        "<Relationships><Relationship Id=\"rId1\" Type=\"/worksheet\" "
        "Target=\"worksheets/sheet1.xml\"/>"
        "</Relationships>",
        sheet
    };
    enum { ENTRIES = 3, FIELDS = 200 };
    char *const zip = malloc(length + 2000), *to = zip, central[ENTRIES * FIELDS], *next = central;
    if (!zip) abort();
    for (int k = 0; k < ENTRIES; k++) {
        const size_t n = k == 2 ? length : strlen(text[k]), name = strlen(names[k]);
        const unsigned long sum = crc32(0, (const Bytef *)text[k], (uInt)n);
        char fields[26], *f = fields;
        f = reader_put(f, 20, 2), f = reader_put(f, 0, 8), f = reader_put(f, sum, 4);
        f = reader_put(f, n, 4), f = reader_put(f, n, 4), f = reader_put(f, name, 2);
        f = reader_put(f, 0, 2);
        const size_t offset = (size_t)(to - zip);
        to = reader_put(to, 0x04034b50, 4);
        memcpy(to, fields, 26), memcpy(to + 26, names[k], name);
        memcpy(to + 26 + name, text[k], n);
        to += 26 + name + n;
        next = reader_put(next, 0x02014b50, 4), next = reader_put(next, 20, 2);
        memcpy(next, fields, 26), next += 26;
        next = reader_put(next, 0, 10), next = reader_put(next, offset, 4);
        memcpy(next, names[k], name), next += name;
    }
    const size_t offset = (size_t)(to - zip), n = (size_t)(next - central);
    memcpy(to, central, n), to += n;
    to = reader_put(to, 0x06054b50, 4), to = reader_put(to, 0, 4);
    to = reader_put(to, ENTRIES, 2), to = reader_put(to, ENTRIES, 2);
    to = reader_put(to, n, 4), to = reader_put(to, offset, 4), to = reader_put(to, 0, 2);
    *size = (size_t)(to - zip);
    return zip;
}

#endif
