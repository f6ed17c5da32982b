/* Spreadsheets: what is written is read, what other programs write is understood, and a damaged
 * file is refused with its place. */
#include "cmocka_all.h"

#include <jansson.h>
#include <minizip/zip.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"
#include "files/files.h"
#include "files/sheets.h"
#include "folder.h"

static apsm_context *ctx;

/* ---- Files as other programs make them ---- */

typedef struct entry {
    const char *name, *text;
} entry;

static const char *make_zip(void **state, size_t n, const entry *entries, char path[TEST_PATH])
{
    zipFile zip = zipOpen64(folder_path(state, "made.xlsx", path), APPEND_STATUS_CREATE);
    assert_non_null(zip);
    for (size_t k = 0; k < n; k++) {
        assert_int_equal(zipOpenNewFileInZip(zip, entries[k].name, NULL, NULL, 0, NULL, 0, NULL,
                                             Z_DEFLATED, Z_DEFAULT_COMPRESSION),
                         ZIP_OK);
        assert_int_equal(
            zipWriteInFileInZip(zip, entries[k].text, (unsigned)strlen(entries[k].text)), ZIP_OK);
        zipCloseFileInZip(zip);
    }
    assert_int_equal(zipClose(zip, NULL), ZIP_OK);
    return path;
}

#define MAIN "xmlns=\"http://schemas.openxmlformats.org/spreadsheetml/2006/main\""
#define RELS "http://schemas.openxmlformats.org/officeDocument/2006/relationships"

/* One sheet "data" with the given rows, and the given shared strings. */
static const char *make_sheet(void **state, const char *rows, const char *strings,
                              char path[TEST_PATH])
{
    static char cells[4096], shared[4096];
    snprintf(cells, sizeof cells, "<worksheet " MAIN "><sheetData>%s</sheetData></worksheet>",
             rows);
    snprintf(shared, sizeof shared, "<sst " MAIN ">%s</sst>", strings);
    const entry entries[] = {
        { "xl/workbook.xml",
          "<?xml version=\"1.0\" encoding=\"UTF-8\"?><x:workbook xmlns:x=\"http:"
          "//schemas.openxmlformats.org/spreadsheetml/2006/main\" xmlns:r=\"" RELS
          "\"><x:sheets><x:sheet name=\"data\" sheetId=\"7\" r:id=\"rId3\"/>"
          "</x:sheets></x:workbook>" },
        { "xl/_rels/workbook.xml.rels",
          "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">"
          "<Relationship Id=\"rId3\" Type=\"" RELS
          "/worksheet\" Target=\"/xl/worksheets/first.xml\"/>"
          "<Relationship Id=\"rId9\" Type=\"" RELS "/sharedStrings\" Target=\"strings.xml\"/>"
          "</Relationships>" },
        { "xl/worksheets/first.xml", cells },
        { "xl/strings.xml", shared },
    };
    return make_zip(state, sizeof entries / sizeof *entries, entries, path);
}

static void other_programs_are_understood(void **state)
{
    char path[TEST_PATH];
    workbook w;
    make_sheet(
        state,
        "<row r=\"1\"><c r=\"A1\" t=\"s\"><v>0</v></c><c r=\"B1\" t=\"s\"><v>1</v></c></row>"
        "<row r=\"3\"><c r=\"A3\" t=\"inlineStr\"><is><r><t>two</t></r><r><t> runs</t></r></is>"
        "</c><c r=\"AB3\"><f>1/8</f><v>0.125</v></c></row>"
        "<row><c t=\"b\"><v>1</v></c><c t=\"str\"><v>a &lt;b&gt; &#233;</v></c><c/>"
        "<c><v>5.0000000000000003E-2</v></c><c t=\"b\"><v>0</v></c></row>",
        "<si><t>name</t></si><si><r><t>sha</t></r><rPh sb=\"0\" eb=\"1\"><t>NOT</t></rPh><r><t>pe_1"
        "</t></r></si>",
        path);
    if (workbook_read(ctx, path, &w) != APSM_OK) fail_msg("%s", apsm_error_text(ctx));
    assert_int_equal(w.n, 1);
    const sheet *s = &w.sheets[0];
    assert_string_equal(s->name, "data");
    assert_int_equal(s->rows, 4);
    assert_int_equal(s->columns, 28);
    char *const *cell = s->cell;
    assert_string_equal(cell[0], "name");
    assert_string_equal(cell[1], "shape_1");
    assert_null(cell[28]);
    assert_string_equal(cell[2 * 28], "two runs");
    assert_string_equal(cell[2 * 28 + 27], "0.125");
    assert_string_equal(cell[3 * 28], "true");
    assert_string_equal(cell[3 * 28 + 1], "a <b> \xc3\xa9");
    assert_null(cell[3 * 28 + 2]);
    assert_string_equal(cell[3 * 28 + 3], "0.05");
    assert_string_equal(cell[3 * 28 + 4], "false");
    workbook_free(&w);
}

static void refuse(const char *path, const char *words)
{
    workbook w;
    assert_int_not_equal(workbook_read(ctx, path, &w), APSM_OK);
    assert_int_equal(w.n, 0);
    if (!strstr(apsm_error_text(ctx), words))
        fail_msg("'%s' is not in: %s", words, apsm_error_text(ctx));
    assert_null(strchr(apsm_error_text(ctx), '\n'));
}

static void damaged_files_are_refused(void **state)
{
    static const struct {
        const char *rows, *words;
    } cases[] = {
        { "<row><c r=\"B2\" t=\"s\"><v>1</v></c></row>", "sheet data, cell B2" },
        { "<row><c r=\"B2\" t=\"s\"><v>-1</v></c></row>", "sheet data, cell B2" },
        { "<row><c r=\"C4\" t=\"e\"><v>#REF!</v></c></row>", "cell C4: holds the error #REF!" },
        { "<row><c r=\"4C\"><v>1</v></c></row>", "'4C' is no cell" },
        { "<row><c r=\"ZZZZ1\"><v>1</v></c></row>", "is no cell" },
        { "<row><c r=\"A9999999\"><v>1</v></c></row>", "is no cell" },
        { "<row><c r=\"XFD1048576\"><v>1</v></c></row>", "too many cells" },
        { "<row><c>", "damaged" },
    };
    char path[TEST_PATH];
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++)
        refuse(make_sheet(state, cases[k].rows, "<si><t>one</t></si>", path), cases[k].words);
    const entry bomb[] = {
        { "xl/_rels/workbook.xml.rels",
          "<!DOCTYPE x [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]><x>"
          "&b;</x>" },
        { "xl/workbook.xml", "<x/>" },
    };
    refuse(make_zip(state, 2, bomb, path), "document type");
    const entry other[] = { { "word/document.xml", "<x/>" } };
    refuse(make_zip(state, 1, other, path), "xl/_rels/workbook.xml.rels");
    folder_put(state, "text.xlsx", "name,shape_1\n", 13);
    refuse(folder_path(state, "text.xlsx", path), "is no .xlsx");
    refuse(folder_path(state, "none.xlsx", path), "none.xlsx");
}

/* Bytes turned over anywhere: read or refused, never worse. */
static void no_byte_brings_it_down(void **state)
{
    char path[TEST_PATH], *data;
    size_t size;
    make_sheet(state, "<row><c t=\"s\"><v>0</v></c><c><v>7</v></c></row>", "<si><t>one</t></si>",
               path);
    assert_int_equal(apsm_read_file(ctx, path, 1 << 20, &data, &size), APSM_OK);
    for (size_t k = 0; k < size; k++) {
        workbook w;
        const char before = data[k];
        data[k] = (char)(before ^ (1 << k % 8));
        folder_put(state, "flipped.xlsx", data, size);
        if (workbook_read(ctx, folder_path(state, "flipped.xlsx", path), &w) == APSM_OK)
            workbook_free(&w);
        folder_put(state, "flipped.xlsx", data, k);
        if (workbook_read(ctx, path, &w) == APSM_OK) workbook_free(&w);
        data[k] = before;
    }
    free(data);
}

/* ---- What we write ---- */

static const char *random_text(apsm_random *random, char text[32])
{
    static const char *const letters[] = { "a",  "Z", "7",  ".",        "_",
                                           "&",  "<", "\"", "\xc3\xa9", "\xe8\x82\x9d",
                                           " x", "'", "=",  "-" };
    const size_t n = 1 + (size_t)apsm_random_below(random, 7);
    text[0] = '\0';
    for (size_t k = 0; k < n; k++) strcat(text, letters[(size_t)apsm_random_below(random, 14)]);
    return text;
}

static void what_is_written_is_read(void **state)
{
    char path[TEST_PATH], second[TEST_PATH], text[32];
    for (uint64_t trial = 0; trial < 12; trial++) {
        apsm_random random = apsm_random_stream(5, APSM_STREAM_TEST, trial, 0);
        workbook w = { 0 }, back;
        for (size_t k = 0; k < 1 + trial % 3; k++) {
            static const char *const names[] = { "data", "optimize", "caf\xc3\xa9 & co" };
            sheet *s = workbook_add(&w, names[k], 1 + (3 * trial + k) % 9, 1 + (trial + 2 * k) % 5);
            for (size_t i = 0; i < s->rows * s->columns; i++) {
                const bool corner = i == 0 || i + 1 == s->rows * s->columns;
                if (corner || apsm_random_uniform(&random) < 0.7)
                    assert_true(
                        sheet_set(s, i / s->columns, i % s->columns, random_text(&random, text)));
            }
        }
        assert_int_equal(workbook_write(ctx, folder_path(state, "a.xlsx", path), &w), APSM_OK);
        if (workbook_read(ctx, path, &back) != APSM_OK) fail_msg("%s", apsm_error_text(ctx));
        assert_int_equal(back.n, w.n);
        for (size_t k = 0; k < w.n; k++) {
            const sheet *a = &w.sheets[k], *b = &back.sheets[k];
            assert_string_equal(a->name, b->name);
            assert_int_equal(a->rows, b->rows);
            assert_int_equal(a->columns, b->columns);
            for (size_t i = 0; i < a->rows * a->columns; i++)
                if ((a->cell[i] == NULL) != (b->cell[i] == NULL) ||
                    (a->cell[i] && strcmp(a->cell[i], b->cell[i]) != 0))
                    fail_msg("'%s' became '%s'", a->cell[i], b->cell[i]);
        }
        /* The same bytes at any time, and nothing beside. */
        char *one, *two;
        size_t size_one, size_two;
        if (trial == 0) sleep(1);
        assert_int_equal(workbook_write(ctx, folder_path(state, "b.xlsx", second), &back), APSM_OK);
        assert_int_equal(apsm_read_file(ctx, path, 1 << 24, &one, &size_one), APSM_OK);
        assert_int_equal(apsm_read_file(ctx, second, 1 << 24, &two, &size_two), APSM_OK);
        assert_int_equal(size_one, size_two);
        assert_memory_equal(one, two, size_one);
        assert_int_equal(folder_count(*state), 2);
        free(one);
        free(two);
        workbook_free(&w);
        workbook_free(&back);
    }
}

static void no_place_to_write(void **state)
{
    char path[TEST_PATH];
    workbook w = { 0 };
    sheet *s = workbook_add(&w, "data", 1, 1);
    assert_true(sheet_set(s, 0, 0, "name"));
    assert_int_equal(workbook_write(ctx, folder_path(state, "none/a.xlsx", path), &w), APSM_ERR_IO);
    assert_non_null(strstr(apsm_error_text(ctx), "none/a.xlsx"));
    workbook_free(&w);
}

/* ---- Projects ---- */

static json_t *parse(const char *text)
{
    json_error_t error;
    json_t *root = json_loads(text, 0, &error);
    if (!root) fail_msg("%s at %d", error.text, error.position);
    return root;
}

static size_t warnings;
static void count_warnings(void *user, apsm_log_level level, const char *text)
{
    (void)user, (void)text;
    warnings += level == APSM_LOG_WARNING;
}

static void there_and_back(const char *text, const char *wanted, size_t warned)
{
    workbook w;
    json_t *root = parse(text), *want = parse(wanted), *back;
    warnings = 0;
    apsm_context_set_log(ctx, count_warnings, NULL);
    if (sheets_from_project(ctx, "p.xlsx", root, &w) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    apsm_context_set_log(ctx, NULL, NULL);
    if (project_from_sheets(ctx, "p.xlsx", &w, &back) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    if (!json_equal(want, back)) fail_msg("%s became %s", wanted, json_dumps(back, 0));
    assert_int_equal(warnings, warned);
    workbook_free(&w);
    json_decref(root);
    json_decref(want);
    json_decref(back);
}

static void projects_survive_as_sheets(void **state)
{
    (void)state;
#define DATA "\"data\":[{\"name\":\"a\",\"shape_1\":\"a.ply\"},{\"name\":\"b\",\"group_x\":\"1\"}]"
    there_and_back("{" DATA "}", "{" DATA "}", 0);
    static const char whole[] =
        "{" DATA
        ",\"groom\":{\"1\":{\"blur\":\"true\",\"spacing\":\"0 0 0\"},\"2\":{\"blur\":\"false\"}},"
        "\"optimize\":{\"number_of_particles\":\"64\"},\"studio\":{},\"project\":{\"version\":"
        "\"2\"},"
        "\"landmarks\":[{\"domain\":\"1\",\"color\":\"#ffaf4e\"}]}";
    there_and_back(whole, whole, 0);
    /* Values of other kinds become texts; nulls and blanks are none. */
    there_and_back(
        "{\"data\":[{\"name\":\"a\",\"n\":3,\"x\":0.5,\"t\":true,\"none\":null,\"e\":\"\"}],"
        "\"studio\":null}",
        "{\"data\":[{\"name\":\"a\",\"n\":\"3\",\"x\":\"0.5\",\"t\":\"true\"}]}", 0);
    /* What fits into no table is left out, and said to be. */
    there_and_back(
        "{" DATA
        ",\"a/b\":{\"k\":\"v\"},\"DATA\":{},\"number\":3,\"o\":{\"k\":\"v\",\"list\":[1]}}",
        "{" DATA ",\"o\":{\"k\":\"v\"}}", 4);
}

static workbook one_sheet(const char *name, size_t rows, size_t columns, const char *const *cells)
{
    workbook w = { 0 };
    sheet *s = workbook_add(&w, name, rows, columns);
    for (size_t k = 0; k < rows * columns; k++)
        assert_true(sheet_set(s, k / columns, k % columns, cells[k]));
    return w;
}

/* ShapeWorks writes an empty column "value" before those of the domains, and takes the first sheet
 * if none is called data. */
static void the_layout_of_shapeworks(void **state)
{
    (void)state;
    const char *const shapes[] = { "name", "shape_1", NULL, NULL, "", NULL, "a", "a.ply" };
    const char *const groom[] = { "key",  "value", "value_1", "blur", NULL,
                                  "true", "crop",  NULL,      NULL };
    json_t *root, *want = parse("{\"data\":[{\"name\":\"a\",\"shape_1\":\"a.ply\"}],"
                                "\"groom\":{\"1\":{\"blur\":\"true\"}}}");
    workbook w = one_sheet("Sheet1", 4, 2, shapes);
    sheet *s = workbook_add(&w, "groom", 3, 3);
    for (size_t k = 0; k < 9; k++) assert_true(sheet_set(s, k / 3, k % 3, groom[k]));
    assert_int_equal(project_from_sheets(ctx, "p.xlsx", &w, &root), APSM_OK);
    assert_true(json_equal(root, want));
    json_decref(root);
    json_decref(want);
    workbook_free(&w);
    const char *const twice[] = { "name", "name", "a", "b" };
    w = one_sheet("data", 2, 2, twice);
    assert_int_equal(project_from_sheets(ctx, "p.xlsx", &w, &root), APSM_ERR_FORMAT);
    assert_non_null(strstr(apsm_error_text(ctx), "two columns are called 'name'"));
    workbook_free(&w);
}

int main(void)
{
#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        IN_FOLDER(other_programs_are_understood),
        IN_FOLDER(damaged_files_are_refused),
        IN_FOLDER(no_byte_brings_it_down),
        IN_FOLDER(what_is_written_is_read),
        IN_FOLDER(no_place_to_write),
        cmocka_unit_test(projects_survive_as_sheets),
        cmocka_unit_test(the_layout_of_shapeworks),
    };
    ctx = apsm_context_new();
    const int failed = cmocka_run_group_tests_name("sheets", tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
