/* Damaged projects, spreadsheets, points, landmarks, tables, definitions, models and checkpoints:
 * whatever the bytes, the readers return, soon, with one line if they refuse.  Sums that would hide
 * the parser behind them are made right again. */
#include "cmocka_all.h"

#include <time.h>

#include "apsm/formats.h"
#include "apsm/run.h"
#include "core/random.h"
#include "readers.h"
#include "scratch_fixture.h"
#include "shapes.h"

static uint64_t rounds = 40; /* of each file; `make test-fuzz` does more */
static const char *only;     /* NULL, or the one file */
static const char *seeds;    /* folder */
enum { MOST_SECONDS = 5 };

static void expect_ok(const fixture *f, apsm_status status)
{
    if (status != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
}

/* ---- what is damaged ---- */

static const char *const sound[ANY_READERS] = {
    "{\"data\": [{\"name\": \"a\", \"shape_1\": \"a.ply\", \"alignment_1\": \"1 0 0 0 0 1 0 0 0 0 "
    "1 0 0 0 0 "
    "1\", \"excluded\": \"no\"}, {\"shape_1\": \"b.ply\", \"group_sex\": \"f\", \"mirrored\": "
    "\"yes\"}], "
    "\"optimize\": {\"number_of_particles\": \"128\"}, \"project\": {\"version\": \"2\"}}",
    "<worksheet><sheetData><row r=\"1\"><c r=\"A1\" t=\"inlineStr\"><is><t>name</t></is></c><c "
    "r=\"B1\" "
    "t=\"str\"><v>shape_1</v></c></row><row r=\"2\"><c r=\"A2\"><v>1.5</v></c><c r=\"B2\" "
    "t=\"str\"><v>a.ply"
    "</v></c></row><row r=\"3\"><c r=\"A3\" t=\"b\"><v>1</v></c><c r=\"AB3\" "
    "t=\"str\"><v>b</v></c></row>"
    "</sheetData></worksheet>",
    "1 2 3\n-1.5e1 .25 1e-3\n4 5 6\n",
    NULL,
    "x,y,z\n1,2,3\n4,5,6.5\n",
    "{\"markups\": [{\"type\": \"Fiducial\", \"coordinateSystem\": \"RAS\", \"controlPoints\": "
    "[{\"label\": "
    "\"p\", \"position\": [1, 2, 3]}, {\"label\": \"q\", \"position\": [-1.0, 2, 3e0], "
    "\"positionStatus\": "
    "\"defined\"}]}]}",
    "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n# columns = "
    "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n1,1,2,3,0,0,0,1,1,1,0,p,,\n"
    "2,4,5,6,0,0,0,1,1,1,0,\"q\",,\n",
    "name,x,y,z\np,1,2,3\n\"q\",4,5,6\n",
    "shape,name,x,y,z\na,p,1,2,3\nb,p,1,2,4\na,q,0,0,0\nz,p,1,1,1\n",
    "{\"planes\": [{\"points\": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}, {\"normal\": [0, 0, 1], "
    "\"center\": [0, "
    "0, 1]}], \"free_form_constraints\": {\"field\": {\"points\": [[0, 0, 1], [1, 1, 1]], "
    "\"scalars\": [1, "
    "0]}}}",
    "{\"measurements\": [{\"name\": \"d\", \"kind\": \"distance\", \"points\": [0, [1, 2, 3]]}, "
    "{\"name\": "
    "\"s\", \"kind\": \"sphere\", \"points\": [1], \"radius\": 2.5, \"part\": \"tibia\"}, "
    "{\"name\": \"v\", "
    "\"kind\": \"volume\"}]}",
    "name,age,sex\na,12.5,f\nb,NA,\"m\"\nc,3,f\n",
    "name\tage\tsex\na\t12\tf\nc\t3\tm\n",
};

static void copy(const fixture *f, const char *from, const char *to)
{
    size_t size;
    char *const bytes = scratch_read(from, &size);
    scratch_write(scratch_path(f->folder, to), bytes, size);
    free(bytes);
}

/* sound NAME: the file with the given bytes, or what a writer of ours makes. */
static void write_texts(const fixture *f)
{
    const double P[] = { 1, 2, 3, 4, 5, 6 };
    for (int k = 0; k < ANY_READERS; k++)
        if (sound[k])
            scratch_write(scratch_path(f->folder, any_reader[k].name), sound[k], strlen(sound[k]));
    expect_ok(f, apsm_points_write(f->ctx, scratch_path(f->folder, "d.npy"), 2, P));
    const journal_key key = { { 1 } };
    journal *j;
    expect_ok(f, journal_open(f->ctx, scratch_path(f->folder, "q.journal"), true, &j));
    expect_ok(f, journal_add(f->ctx, j, &key, P, sizeof P));
    expect_ok(f, journal_add(f->ctx, j, &key, P, 5));
    journal_close(j);
    copy(f, APSM_TEST_DATA "/cases/hdf5/old.h5", "r.h5");
    copy(f, APSM_TEST_DATA "/cases/hdf5/scalismo.h5.json", "s.h5.json");
}

/* A model of four eggs, its checkpoint, and its one file. */
static void make_model(const fixture *f)
{
    const char *const set[][2] = { { "particles", "16" },      { "faces", "300" },
                                   { "stage1_epochs", "1" },   { "stage2_epochs", "1" },
                                   { "settle_epochs", "0" },   { "fidelity_rounds", "1" },
                                   { "other_templates", "0" }, { "specificity_samples", "10" } };
    const char *const inputs[] = { scratch_path(f->folder, "in") };
    char model[2 * SCRATCH_LENGTH];
    apsm_fit_model *m;
    apsm_run *run;
    expect_ok(f, apsm_make_folder(f->ctx, inputs[0]));
    for (int i = 0; i < 4; i++) {
        apsm_mesh mesh = shape_icosphere(2);
        char name[32];
        snprintf(name, sizeof name, "in/s%d.ply", i);
        for (size_t v = 0; v < mesh.nv; v++) {
            mesh.V[3 * v] *= 10 + i;
            mesh.V[3 * v + 1] *= 7 + (i & 1);
            mesh.V[3 * v + 2] *= 5 + .2 * i * i + .1 * mesh.V[3 * v];
        }
        expect_ok(f, apsm_write_mesh(f->ctx, scratch_path(f->folder, name), &mesh));
        apsm_mesh_free(&mesh);
    }
    snprintf(model, sizeof model, "%s/model", f->folder);
    const apsm_run_settings settings = { .folder = model,
                                         .n_inputs = 1,
                                         .inputs = inputs,
                                         .n_set = sizeof set / sizeof *set,
                                         .set = set };
    expect_ok(f, apsm_run_open(f->ctx, &settings, &run));
    expect_ok(f, apsm_run_all(run));
    apsm_run_close(run);
    expect_ok(f, apsm_fit_model_load(f->ctx, model, &m));
    expect_ok(f, apsm_fit_model_write(f->ctx, m, scratch_path(f->folder, "p.apsm")));
    apsm_fit_model_free(m);
}

static int setup_model(void **state)
{
    if (setup(state) != 0) return -1;
    fixture *const f = *state;
    apsm_context_set_threads(f->ctx, 1);
    write_texts(f);
    make_model(f);
    copy(f, scratch_path(f->folder, "model/model.json"), "n.json");
    copy(f, scratch_path(f->folder, "model/state/optimize.ckpt"), "o.ckpt");
    return 0;
}

/* ---- damage ---- */

static const char *const words[] = {
    "nan",     "-1",       "1e999",       "4294967295", "99999999999999999999",
    "{",       "]",        "\"",          ",",          "null",
    "\\u0000", "\xff\xfe", "[[",          "<c>",        "-0",
    "",        "\n",       "ZZZ99999999", "true",       "&#0;"
};

/* Up to 4 bits, bytes or words are changed, or the end is cut off.  room: 64 bytes more than size.
 */
static size_t damage(apsm_random *rng, const char *bytes, size_t size, char *out)
{
    const size_t head = apsm_random_below(rng, 2) && size > 400 ? 400 : size;
    memcpy(out, bytes, size);
    for (uint64_t times = 1 + apsm_random_below(rng, 4); times > 0; times--) {
        const size_t at = apsm_random_below(rng, head);
        const char *const word = words[apsm_random_below(rng, sizeof words / sizeof *words)];
        const uint64_t what = apsm_random_below(rng, 4);
        if (what == 0) out[at] = (char)(out[at] ^ (1 << apsm_random_below(rng, 8)));
        if (what == 1) out[at] = (char)apsm_random_below(rng, 256);
        if (what == 2) out[at] = apsm_random_below(rng, 2) ? '\0' : (char)0xff;
        if (what == 3 && at + strlen(word) <= size) memcpy(out + at, word, strlen(word));
    }
    return apsm_random_below(rng, 8) ? size : apsm_random_below(rng, size);
}

/* The damaged bytes as they stand in the file: in a workbook that is whole, or sealed again. */
static void write_damaged(const struct any_reader *r, const char *path, char *bytes, size_t size,
                          bool sealed)
{
    const bool sum = strstr(r->name, ".ckpt") || strstr(r->name, ".apsm");
    if (strstr(r->name, ".xlsx")) {
        size_t length;
        char *const zip = reader_workbook(bytes, size, &length);
        scratch_write(path, zip, length);
        free(zip);
        return;
    }
    if (sum && sealed) reader_seal(bytes, size);
    scratch_write(path, bytes, size);
}

static void expect_survived(const fixture *f, const struct any_reader *r, const char *path)
{
    const clock_t start = clock();
    const apsm_status status = r->read(f->ctx, path);
    if (clock() - start > MOST_SECONDS * CLOCKS_PER_SEC) fail_msg("%s: takes too long", path);
    if (status == APSM_OK) return;
    const char *const line = apsm_error_text(f->ctx);
    if (!*line || strchr(line, '\n')) fail_msg("%s: not one line: '%s'", path, line);
}

static void damaged_files_are_survived(void **state)
{
    const fixture *const f = *state;
    for (int k = 0; k < ANY_READERS; k++) {
        const struct any_reader *const r = &any_reader[k];
        size_t size;
        if (only && strcmp(only, r->name) != 0) continue;
        char *const bytes = scratch_read(scratch_path(f->folder, r->name), &size);
        char *const out = malloc(size + 64), path[2 * SCRATCH_LENGTH];
        snprintf(path, sizeof path, "%s/bad-%s", f->folder, r->name);
        memcpy(out, bytes, size);
        write_damaged(r, path, out, size, true);
        if (r->read(f->ctx, path) != APSM_OK)
            fail_msg("%s is refused as it was: %s", r->name, apsm_error_text(f->ctx));
        for (uint64_t round = 0; round < rounds; round++) {
            apsm_random rng = apsm_random_stream((uint64_t)k, APSM_STREAM_TEST, round, 1);
            write_damaged(r, path, out, damage(&rng, bytes, size, out), round % 8 != 0);
            expect_survived(f, r, path);
        }
        free(bytes);
        free(out);
    }
}

/* Fields were once counted by one rule and cut by another. */
static void quotes_of_tables_are_closed_or_refused(void **state)
{
    const fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "quotes.csv");
    static const char good[] =
        "name,age,note\r\na,1,\"x, \"\"y\"\" z\"\r\nb,2,\"two\r\nlines\"\r\nc,3,q\r\n";
    static const char *const bad[] = { "name,age\na,1\"2,3\"\n", "name,age\na,\"1\"2\n",
                                       "name,age\na,\"1,2\n", "name,\"age\na,1\n" };
    apsm_table table = { .I = READER_SHAPES };
    scratch_write(path, good, strlen(good));
    expect_ok(f, apsm_table_read(f->ctx, path, READER_SHAPES, reader_shapes, &table));
    const apsm_column *const note = apsm_table_find(&table, "note");
    assert_true(note && note->levels == 3);
    assert_string_equal(note->level[(size_t)note->value[0]], "x, \"y\" z");
    assert_string_equal(note->level[(size_t)note->value[1]], "two\r\nlines");
    apsm_table_free(&table);
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        table = (apsm_table){ .I = READER_SHAPES };
        scratch_write(path, bad[k], strlen(bad[k]));
        expect_failure(f->ctx, apsm_table_read(f->ctx, path, READER_SHAPES, reader_shapes, &table),
                       APSM_ERR_FORMAT, "quotes.csv", "");
        apsm_table_free(&table);
    }
}

/* Sound by its sum, but with a number whose square is infinite: once neighbours were looked for at
 * infinite distances. */
static void huge_numbers_of_models_are_survived(void **state)
{
    const fixture *const f = *state;
    static const double huge[] = { 1e200, -1e-200, NAN };
    const struct any_reader *r = any_reader;
    size_t size;
    while (strcmp(r->name, "p.apsm") != 0) r++;
    char *const bytes = scratch_read(scratch_path(f->folder, r->name), &size);
    char *const out = malloc(size), path[2 * SCRATCH_LENGTH];
    snprintf(path, sizeof path, "%s/huge-%s", f->folder, r->name);
    for (size_t at = 56; at + 40 < size; at += 136) {
        memcpy(out, bytes, size);
        memcpy(out + at, &huge[at / 8 % 3], sizeof *huge);
        write_damaged(r, path, out, size, true);
        expect_survived(f, r, path);
    }
    free(bytes);
    free(out);
}

/* The undamaged files, each behind the byte that chooses its reader, for the fuzzer. */
static void write_seeds(void **state)
{
    const fixture *const f = *state;
    for (int k = 0; k < ANY_READERS; k++) {
        char path[2 * SCRATCH_LENGTH];
        size_t size;
        char *bytes = scratch_read(scratch_path(f->folder, any_reader[k].name), &size);
        snprintf(path, sizeof path, "%s/%s", seeds, any_reader[k].name);
        bytes = realloc(bytes, size + 1);
        memmove(bytes + 1, bytes, size);
        bytes[0] = (char)k;
        scratch_write(path, bytes, size + 1);
        free(bytes);
    }
}

/* [ROUNDS [FILE]], or: seeds FOLDER */
int main(int argc, char **argv)
{
    const struct CMUnitTest seed[] = { cmocka_unit_test(write_seeds) };
    if (argc > 2 && strcmp(argv[1], "seeds") == 0) {
        seeds = argv[2];
        return cmocka_run_group_tests_name("seeds", seed, setup_model, teardown);
    }
    if (argc > 1) rounds = strtoull(argv[1], NULL, 10);
    if (argc > 2) only = argv[2];
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quotes_of_tables_are_closed_or_refused),
        cmocka_unit_test(damaged_files_are_survived),
        cmocka_unit_test(huge_numbers_of_models_are_survived),
    };
    return cmocka_run_group_tests_name("damaged files", tests, setup_model, teardown);
}
