/* HDF5 as libhdf5 writes it (tests/data/cases/hdf5, by h5py), and as we do. */
#include "cmocka_all.h"

#include "apsm/exchange.h"
#include "exchange/hdf5.h"
#include "scratch.h"
#include "scratch_fixture.h"

#define CASES APSM_TEST_DATA "/cases/hdf5/"

/* lookup3's own driver prints these. */
static void check_sums_are_those_of_lookup3(void **state)
{
    (void)state;
    static const char text[] = "Four score and seven years ago";
    assert_int_equal(h5_checksum((const unsigned char *)text, strlen(text)), 0x17770551);
    assert_int_equal(h5_checksum((const unsigned char *)text, 0), 0xdeadbeef);
}

static apsm_foreign_model read_model(apsm_context *ctx, const char *path)
{
    apsm_foreign_model m;
    if (apsm_read_statismo(ctx, path, 12, &m) != APSM_OK) fail_msg("%s", apsm_error_text(ctx));
    return m;
}

/* A shape of an icosahedron with a mean coordinate of 10, and both modes at -sqrt(3/4) deviations.
 */
static void every_way_of_writing_gives_the_same_shapes(void **state)
{
    apsm_context *const ctx = ((fixture *)*state)->ctx;
    static const char *const others[] = { CASES "new.h5", CASES "big_endian.h5",
                                          CASES "scalismo.h5.json" };
    apsm_foreign_model old = read_model(ctx, CASES "old.h5");
    assert_true(old.I == 4 && old.J == 12 && old.of_shapes);
    assert_true(old.meshes[0].nv == 12 && old.meshes[0].nf == 20);
    const double *const v = old.meshes[0].V; /* the first vertex is (-10, 16.18, 0) */
    assert_true(fabs(v[0] - -8.8617) < 1e-4 && fabs(v[1] - 15.4433) < 1e-4 && fabs(v[2]) < 1e-9);
    for (size_t k = 0; k < 3; k++) {
        apsm_foreign_model other = read_model(ctx, others[k]);
        assert_true(other.I == 4 && other.J == 12 && other.of_shapes);
        assert_memory_equal(other.P, old.P, 4 * 12 * 3 * sizeof *old.P);
        assert_memory_equal(other.meshes[3].F, old.meshes[3].F, 60 * sizeof *old.meshes[3].F);
        apsm_foreign_model_free(&other);
    }
    apsm_foreign_model_free(&old);
}

static void expect_refused(apsm_context *ctx, const char *path, const char *words)
{
    apsm_foreign_model m;
    assert_int_not_equal(apsm_read_statismo(ctx, path, 12, &m), APSM_OK);
    if (!strstr(apsm_error_text(ctx), words)) fail_msg("no '%s': %s", words, apsm_error_text(ctx));
}

static void what_is_not_read_is_named(void **state)
{
    const fixture *const f = *state;
    size_t size;
    expect_refused(f->ctx, CASES "chunks.h5", "h5repack -l CONTI");
    expect_refused(f->ctx, CASES "none.h5", "No such file");
    for (int second = 0; second < 2; second++) {
        char *const bytes = scratch_read(second ? CASES "new.h5" : CASES "old.h5", &size);
        const char *const path = scratch_path(f->folder, "cut.h5");
        for (size_t length = 8; length < size; length += 97) {
            scratch_write(path, bytes, length);
            expect_refused(f->ctx, path, "cut.h5");
        }
        free(bytes);
    }
}

/* Names end where they end; numbers come back; the same values give the same bytes. */
static char *write_some(const fixture *f, const char *name, size_t *size)
{
    const float x[] = { 1, -2.5F, 1e-30F, 4, 5, 6 };
    const int k[] = { 7, -8 };
    const char *const path = scratch_path(f->folder, name);
    apsm_writer *w;
    assert_int_equal(apsm_writer_open(f->ctx, path, &w), APSM_OK);
    h5_out *const o = h5_begin();
    h5_put_floats(o, "/a/table", 2, 3, x);
    h5_put_ints(o, "/a/b/row", 2, 0, k);
    h5_put_int(o, "/a/b/rowing", -1);
    h5_put_text(o, "/a/text", "hello");
    h5_put_attribute(o, "/a", "kind", "none");
    assert_true(h5_end(o, w));
    assert_int_equal(apsm_writer_commit(w), APSM_OK);
    return scratch_read(path, size);
}

static void what_is_written_is_read(void **state)
{
    const fixture *const f = *state;
    size_t size[2], rows, columns;
    char *const bytes = write_some(f, "a.h5", &size[0]), *const again =
                                                             write_some(f, "b.h5", &size[1]);
    double *x;
    bool there;
    h5_in in;
    assert_true(size[0] == size[1]);
    assert_memory_equal(bytes, again, size[0]);
    assert_int_equal(h5_open(f->ctx, scratch_path(f->folder, "a.h5"), &in), APSM_OK);
    assert_int_equal(h5_read(&in, "/a/table", &rows, &columns, &x), APSM_OK);
    assert_true(rows == 2 && columns == 3 && x[1] == -2.5 && x[2] == (double)1e-30F && x[5] == 6);
    free(x);
    assert_int_equal(h5_read(&in, "a/b/row", &rows, &columns, &x), APSM_OK);
    assert_true(rows == 2 && columns == 1 && x[0] == 7 && x[1] == -8);
    free(x);
    assert_int_equal(h5_read(&in, "a/b/rowing", &rows, &columns, &x), APSM_OK);
    assert_true(rows == 1 && columns == 1 && x[0] == -1);
    free(x);
    assert_int_equal(h5_has(&in, "/a/b/ro", &there), APSM_OK);
    assert_false(there);
    assert_int_equal(h5_read(&in, "/a/text", &rows, &columns, &x), APSM_ERR_FORMAT);
    assert_int_equal(h5_read(&in, "/a/b", &rows, &columns, &x), APSM_ERR_FORMAT);
    h5_close(&in);
    bytes[size[0] - 6] ^= 1; /* in the root's header, the last */
    scratch_write(scratch_path(f->folder, "a.h5"), bytes, size[0]);
    expect_refused(f->ctx, scratch_path(f->folder, "a.h5"), "check sum");
    free(bytes);
    free(again);
}

static void put(char **at, uint64_t value, size_t size)
{
    for (; size > 0; size--, value >>= 8) *(*at)++ = (char)(value & 0xff);
}

/* A group of the old kind at 104, with its tree at 144, which names one table of 65535 symbols four
 * times. */
static char *crowded_file(size_t *size)
{
    enum { TREE = 144, CHILDREN = 4, HEAP = 256, TABLE = 288, SYMBOLS = 65535 };
    char *const bytes = calloc(*size = TABLE + 8 + 40 * SYMBOLS, 1), *at = bytes + 40;
    assert_non_null(bytes);
    memcpy(bytes, "\x89HDF\r\n\x1a\n\0\0\0\0\0\x8\x8", 15);
    put(&at, *size, 8);
    at = bytes + 64, put(&at, 104, 8);
    at = bytes + 104, put(&at, 1, 1), at += 7, put(&at, 24, 4), at += 4;
    put(&at, 0x11, 2), put(&at, 16, 2), at += 4, put(&at, TREE, 8), put(&at, HEAP, 8);
    at = bytes + TREE + 8;
    memcpy(bytes + TREE, "TREE\0\0\x4", 8);
    at += 24;
    for (int k = 0; k < CHILDREN; k++) put(&at, TABLE, 8), put(&at, 0, 8);
    memcpy(bytes + HEAP, "HEAP", 4);
    at = bytes + HEAP + 24, put(&at, HEAP, 8);
    memcpy(bytes + TABLE, "SNOD\1\0\xff\xff", 8);
    return bytes;
}

/* Else a few megabytes would take minutes. */
static void crowded_groups_are_given_up(void **state)
{
    const fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "crowd.h5");
    size_t size;
    bool there;
    h5_in in;
    char *const bytes = crowded_file(&size);
    scratch_write(path, bytes, size);
    free(bytes);
    assert_int_equal(h5_open(f->ctx, path, &in), APSM_OK);
    assert_int_equal(h5_has(&in, "/model", &there), APSM_ERR_FORMAT);
    assert_non_null(strstr(apsm_error_text(f->ctx), "group's tree is damaged"));
    h5_close(&in);
}

/* A long row and many short ones: a table of all would be of 320 GB. */
static void ragged_tables_cost_nothing(void **state)
{
    enum { ROWS = 200000 };
    const fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "ragged.json"),
                      *const head = "{\"root\":\"g\",\"groups\":{\"g\":{\"links\":[{\"title\":"
                                    "\"x\",\"collection\":\"datasets\",\"id\":\"d\"}]}},"
                                    "\"datasets\":{\"d\":{\"value\":[[0";
    char *const text = malloc(strlen(head) + 5 * ROWS + 8), *at = text;
    size_t rows, columns;
    double *x;
    h5_in in;
    assert_non_null(text);
    at += sprintf(at, "%s", head);
    for (int k = 1; k < ROWS; k++) at += sprintf(at, ",0");
    *at++ = ']';
    for (int k = 1; k < ROWS; k++) at += sprintf(at, ",[]");
    at += sprintf(at, "]}}}");
    scratch_write(path, text, (size_t)(at - text));
    free(text);
    assert_int_equal(h5_open(f->ctx, path, &in), APSM_OK);
    assert_int_equal(h5_read(&in, "/x", &rows, &columns, &x), APSM_ERR_FORMAT);
    assert_non_null(strstr(apsm_error_text(f->ctx), "has no readable"));
    h5_close(&in);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(check_sums_are_those_of_lookup3),
        cmocka_unit_test_setup_teardown(every_way_of_writing_gives_the_same_shapes, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(what_is_not_read_is_named, setup, teardown),
        cmocka_unit_test_setup_teardown(what_is_written_is_read, setup, teardown),
        cmocka_unit_test_setup_teardown(crowded_groups_are_given_up, setup, teardown),
        cmocka_unit_test_setup_teardown(ragged_tables_cost_nothing, setup, teardown),
    };
    return cmocka_run_group_tests_name("hdf5", tests, NULL, NULL);
}
