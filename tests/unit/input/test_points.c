/* Particle sets in every format: what is written is what is read, other programs' spellings are
 * understood, and nothing damaged passes. */
#include "cmocka_all.h"

#include "apsm/formats.h"
#include "apsm/particles.h"
#include "check.h"
#include "folder.h"
#include "locale_comma.h"
#include "scratch.h"

enum { MOST = 200 };

static double *read_back(apsm_context *ctx, const char *path, size_t n)
{
    size_t found;
    double *P;
    if (apsm_points_read(ctx, path, &found, &P) != APSM_OK)
        fail_msg("%s: %s", path, apsm_error_text(ctx));
    assert_int_equal(found, n);
    return P;
}

/* Coordinates of all sizes, with the awkward ones first. */
static void fill(uint64_t index, size_t n, double *P)
{
    const double awkward[] = {
        -0.0, 0.1, 1e-300, 5e-324, -1.7976931348623157e308, 1e17, 1.0 / 3.0, 123456789012345680.0,
        -1e22
    };
    double exponent[3 * MOST];
    check_uniform(index, 3 * n, -1.0, 1.0, P);
    check_uniform(index + 1000, 3 * n, -20.0, 20.0, exponent);
    for (size_t k = 0; k < 3 * n; k++) P[k] = ldexp(P[k], (int)exponent[k]);
    for (size_t k = 0; k < 9 && k < 3 * n; k++) P[k] = awkward[k];
}

static void test_every_bit_is_kept(void **state)
{
    static const char *const names[] = { "p.csv", "p.npy", "p.mrk.json", "p.vtk",
                                         "p.vtp", "P.CSV", "p.MRK.json" };
    apsm_context *ctx = apsm_context_new();
    double P[3 * MOST];
    char path[TEST_PATH];
    for (size_t n = 1; n <= MOST; n = 3 * n + 2)
        for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
            fill(n, n, P);
            assert_int_equal(apsm_points_write(ctx, folder_path(state, names[k], path), n, P),
                             APSM_OK);
            double *Q = read_back(ctx, path, n);
            if (memcmp(P, Q, 3 * n * sizeof *P) != 0) fail_msg("%s: not the same bits", names[k]);
            free(Q);
        }
    apsm_context_free(ctx);
}

static void test_particles_keep_nine_digits(void **state)
{
    static const char *const names[] = { "p.particles", "p.lpts", "p.wpts" };
    apsm_context *ctx = apsm_context_new();
    double P[3 * MOST];
    char path[TEST_PATH];
    check_uniform(5, 3 * MOST, -100.0, 100.0, P);
    for (size_t k = 0; k < 3; k++) {
        assert_int_equal(apsm_points_write(ctx, folder_path(state, names[k], path), MOST, P),
                         APSM_OK);
        double *Q = read_back(ctx, path, MOST);
        for (size_t i = 0; i < 3 * (size_t)MOST; i++)
            if (!(fabs(P[i] - Q[i]) <= 0.51e-8 * 100.0)) fail_msg("%.17g, %.17g", P[i], Q[i]);
        free(Q);
    }
    apsm_context_free(ctx);
}

static void test_a_comma_locale_changes_nothing(void **state)
{
    static const char *const names[] = { "p.csv", "p.mrk.json", "p.particles", "p.npy", "p.vtp" };
    const double P[3] = { 0.5, -1.25, 1e-7 };
    apsm_context *ctx = apsm_context_new();
    char path[TEST_PATH];
    for (size_t k = 0; k < 5; k++) {
        if (!use_decimal_comma(*state)) {
            apsm_context_free(ctx);
            setlocale(LC_ALL, "C");
            print_message("no locale with a decimal comma\n");
            skip();
        }
        const apsm_status status = apsm_points_write(ctx, folder_path(state, names[k], path), 1, P);
        assert_int_equal(status, APSM_OK);
        double *Q = read_back(ctx, path, 1);
        assert_memory_equal(P, Q, sizeof P);
        free(Q);
        setlocale(LC_ALL, "C");
        Q = read_back(ctx, path, 1);
        assert_memory_equal(P, Q, sizeof P);
        free(Q);
    }
    apsm_context_free(ctx);
}

static void test_cohort(void **state)
{
    apsm_context *ctx = apsm_context_new();
    double P[2 * 3 * 5], *Q;
    size_t I, n, size;
    char path[TEST_PATH];
    fill(1, 10, P);
    folder_path(state, "all.npy", path);
    assert_int_equal(apsm_points_write_cohort(ctx, path, 2, 5, P), APSM_OK);
    assert_int_equal(apsm_points_read_cohort(ctx, path, &I, &n, &Q), APSM_OK);
    assert_int_equal(I, 2);
    assert_int_equal(n, 5);
    assert_memory_equal(P, Q, sizeof P);
    free(Q);
    expect_failure(ctx, apsm_points_read(ctx, path, &n, &Q), APSM_ERR_FORMAT, "all.npy",
                   "2 shapes");
    char *bytes = scratch_read(path, &size); /* as NumPy lays it out */
    assert_int_equal(size, 128 + sizeof P);
    assert_memory_equal(bytes,
                        "\x93NUMPY\1\0\x76\0{'descr': '<f8', 'fortran_order': False, "
                        "'shape': (2, 5, 3), } ",
                        71);
    assert_int_equal(bytes[127], '\n');
    free(bytes);
    assert_int_equal(apsm_points_write(ctx, path, 4, P), APSM_OK);
    assert_int_equal(apsm_points_read_cohort(ctx, path, &I, &n, &Q), APSM_OK);
    assert_int_equal(I, 0);
    assert_int_equal(n, 4);
    free(Q);
    folder_path(state, "all.csv", path);
    expect_failure(ctx, apsm_points_write_cohort(ctx, path, 2, 5, P), APSM_ERR_UNSUPPORTED,
                   "all.csv", "only .npy");
    apsm_context_free(ctx);
}

static void put_text(void **state, const char *name, const char *text)
{
    folder_put(state, name, text, strlen(text));
}

#define LIST(system, points)                                                                       \
    "{\"markups\": [{\"type\": \"Fiducial\"" system ", \"controlPoints\": [" points "]}]}"

static void test_other_spellings(void **state)
{
    static const struct {
        const char *name, *text;
    } files[] = {
        { "a.csv", "\xef\xbb\xbfX, Y ,z\r\n1, 2,+3\r\n\r\n4e0,5.0, 6" },
        { "a.mrk.json", LIST(", \"coordinateSystem\": \"LPS\"",
                             "{\"position\": [1, 2, 3]}, {\"position\": [4.0, 5e0, 6]}") },
        { "b.mrk.json", LIST("", "{\"position\": [1, 2, 3]}, {\"position\": [4.0, 5e0, 6]}") },
        { "ras.mrk.json", LIST(", \"coordinateSystem\": \"RAS\"",
                               "{\"position\": [-1, -2, 3]}, {\"position\": [-4.0, -5e0, 6]}") },
        { "a.vtk", "# vtk DataFile Version 2.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 2 float\n"
                   "1 2 3 4 5 6\n" },
        { "a.particles", "1 2 3\n4 5 6\n" },
    };
    const double want[6] = { 1, 2, 3, 4, 5, 6 };
    apsm_context *ctx = apsm_context_new();
    char path[TEST_PATH];
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) {
        put_text(state, files[k].name, files[k].text);
        double *Q = read_back(ctx, folder_path(state, files[k].name, path), 2);
        for (size_t i = 0; i < 6; i++)
            if (Q[i] != want[i]) fail_msg("%s: %g at %zu", files[k].name, Q[i], i);
        free(Q);
    }
    apsm_context_free(ctx);
}

static void test_damaged_text_is_refused(void **state)
{
    static const struct {
        const char *name, *text, *word;
    } files[] = {
        { "a.csv", "", "no particles" },
        { "b.csv", "x,y,z\n", "no particles" },
        { "c.csv", "1,2,3\n", "c.csv:1: the first line" },
        { "d.csv", "x,y,z\n1,2,3\n1,2\n", "d.csv:3: 2 fields" },
        { "e.csv", "x,y,z\n1,2,3,4\n", "e.csv:2: 4 fields" },
        { "f.csv", "x,y,z\n1,nan,3\n", "f.csv:2: 'nan'" },
        { "g.csv", "x,y,z\n1,,3\n", "g.csv:2: ''" },
        { "h.csv", "x;y;z\n1;2;3\n", "h.csv:1: the first line" },
        { "i.csv", "x,y,z\n1,1e999,3\n", "i.csv:2: '1e999'" },
        { "j.csv", "z,y,x\n1,2,3\n", "j.csv:1: the first line" },
        { "a.mrk.json", "{", "a.mrk.json:1" },
        { "b.mrk.json", "[]", "holds 0 markups" },
        { "c.mrk.json", LIST(", \"coordinateSystem\": \"XYZ\"", ""), "neither LPS nor RAS" },
        { "d.mrk.json", LIST("", "{\"position\": [1, 2]}"), "control point 0" },
        { "e.mrk.json", LIST("", "{\"position\": [1, 2, 3]}, {\"label\": \"x\"}"),
          "control point 1" },
        { "f.mrk.json", LIST("", "{\"position\": [1, 2, 3], \"positionStatus\": \"undefined\"}"),
          "has not been placed" },
        { "g.mrk.json", LIST("", ""), "no particles" },
        { "h.mrk.json", "{\"markups\": [{\"type\": \"Line\", \"controlPoints\": []}]}",
          "type Fiducial" },
        { "i.mrk.json", "{\"markups\": [{}, {}]}", "holds 2 markups" },
        { "a.vtk", "# vtk DataFile Version 2.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 2 float\n1 2 3",
          "a.vtk" },
        { "b.vtk",
          "# vtk DataFile Version 2.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n"
          "0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 2\n",
          "a mesh, not particles" },
        { "c.vtk", "# vtk DataFile Version 2.0\nx\nASCII\nDATASET POLYDATA\n", "no particles" },
        { "a.vtp", "<VTKFile>", "a.vtp" },
        { "a.particles", "1 2\n", "a.particles:1" },
    };
    apsm_context *ctx = apsm_context_new();
    char path[TEST_PATH];
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) {
        size_t n;
        double *P;
        put_text(state, files[k].name, files[k].text);
        const apsm_status status =
            apsm_points_read(ctx, folder_path(state, files[k].name, path), &n, &P);
        expect_failure(ctx, status, APSM_ERR_FORMAT, files[k].name, files[k].word);
        assert_null(P);
        assert_int_equal(n, 0);
    }
    apsm_context_free(ctx);
}

/* A .npy with that dictionary and that many bytes of zeros. */
static void put_npy(void **state, const char *dictionary, size_t zeros)
{
    char bytes[1024] = "\x93NUMPY\1";
    const size_t length = strlen(dictionary) + 1;
    bytes[8] = (char)length;
    snprintf(bytes + 10, 300, "%s\n", dictionary);
    folder_put(state, "a.npy", bytes, 10 + length + zeros);
}

static void test_npy_headers(void **state)
{
#define NPY(descr, order, shape)                                                                   \
    "{'descr': '" descr "', 'fortran_order': " order ", 'shape': (" shape "), }"
    static const struct {
        const char *dictionary;
        size_t zeros;
        const char *word; /* NULL: good */
    } files[] = {
        { NPY("<f8", "False", "2, 3"), 48, NULL },
        { "{\"shape\":(2,3,),\"descr\":\"<f8\",\"fortran_order\":False}     ", 48, NULL },
        { NPY("<f8", "False", "2, 3"), 47, "do not fit" },
        { NPY("<f8", "False", "2, 3"), 49, "do not fit" },
        { NPY("<f8", "False", "2, 3"), 72, "do not fit" },
        { NPY("<f8", "False", "3, 3"), 48, "do not fit" },
        { NPY("<f8", "False", "768614336404564651, 3"), 48, "do not fit" },
        { NPY("<f8", "False", "4294967296, 4294967296, 3"), 0, "do not fit" },
        { NPY("<f8", "False", "99999999999999999999, 3"), 48, "cannot be understood" },
        { NPY("<f8", "False", "0, 3"), 0, "no particles" },
        { NPY("<f8", "False", "0, 5, 3"), 0, "no particles" },
        { NPY("<f8", "False", "6"), 48, "n x 3" },
        { NPY("<f8", "False", ""), 8, "n x 3" },
        { NPY("<f8", "False", "3, 2"), 48, "n x 3" },
        { NPY("<f8", "False", "1, 1, 2, 3"), 48, "n x 3" },
        { NPY("<f8", "False", "-2, 3"), 48, "cannot be understood" },
        { NPY("<f8", "False", "2 3"), 48, "cannot be understood" },
        { NPY("<f8", "True", "2, 3"), 48, "column by column" },
        { NPY("<f8", "Maybe", "2, 3"), 48, "cannot be understood" },
        { NPY(">f8", "False", "2, 3"), 48, "'>f8'" },
        { NPY("<f4", "False", "2, 3"), 24, "astype" },
        { "{'descr': '<f8', 'shape': (2, 3)}", 48, "cannot be understood" },
        { "{'descr': '<f8', 'descr': '<f8', 'fortran_order': False, 'shape': (2, 3)}", 48,
          "cannot be understood" },
        { NPY("<f8", "False", "2, 3") " x", 48, "cannot be understood" },
        { "", 48, "cannot be understood" },
    };
    apsm_context *ctx = apsm_context_new();
    char path[TEST_PATH];
    folder_path(state, "a.npy", path);
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) {
        size_t n;
        double *P;
        put_npy(state, files[k].dictionary, files[k].zeros);
        if (!files[k].word) {
            free(read_back(ctx, path, 2));
            continue;
        }
        const apsm_status status = apsm_points_read(ctx, path, &n, &P);
        expect_failure(ctx, status, APSM_ERR_FORMAT, "a.npy", files[k].word);
        assert_null(P);
    }
    apsm_context_free(ctx);
}

/* Every shortened and many altered files of each format: refused or finite, never a crash. */
static void test_no_shortened_file_passes(void **state)
{
    static const char *const names[] = { "p.npy", "p.mrk.json", "p.vtk" };
    apsm_context *ctx = apsm_context_new();
    double P[9];
    char path[TEST_PATH];
    check_uniform(2, 9, -1.0, 1.0, P);
    for (size_t k = 0; k < 3; k++) {
        size_t size, n;
        double *Q;
        assert_int_equal(apsm_points_write(ctx, folder_path(state, names[k], path), 3, P), APSM_OK);
        char *bytes = scratch_read(path, &size);
        for (size_t length = 0; length + 32 < size; length++) {
            folder_put(state, names[k], bytes, length);
            const apsm_status status = apsm_points_read(ctx, path, &n, &Q);
            /* the vertex cells of .vtk come after the points and are not needed */
            if (k < 2 && status == APSM_OK) fail_msg("%s: %zu bytes pass", names[k], length);
            if (status == APSM_OK) assert_memory_equal(P, Q, sizeof P);
            free(Q);
        }
        for (size_t i = 0; i < size; i++) {
            const char before = bytes[i];
            bytes[i] = (char)(before ^ (1 << i % 8));
            folder_put(state, names[k], bytes, size);
            bytes[i] = before;
            if (apsm_points_read(ctx, path, &n, &Q) == APSM_OK)
                for (size_t j = 0; j < 3 * n; j++) assert_true(isfinite(Q[j]));
            free(Q);
        }
        free(bytes);
    }
    apsm_context_free(ctx);
}

static void test_not_finite_is_refused(void **state)
{
    static const char *const names[] = { "p.csv", "p.npy",       "p.mrk.json", "p.vtk",
                                         "p.vtp", "p.particles", "p.wpts" };
    const double bad[6] = { 1, 2, 3, 4, NAN, 6 };
    apsm_context *ctx = apsm_context_new();
    char path[TEST_PATH];
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        folder_path(state, names[k], path);
        expect_failure(ctx, apsm_points_write(ctx, path, 2, bad), APSM_ERR_NONFINITE, names[k],
                       "particle 1");
    }
    assert_int_equal(folder_count(*state), 0);
    double one[3] = { 1, 2, 3 }, *P;
    size_t size, n;
    folder_path(state, "p.npy", path);
    assert_int_equal(apsm_points_write(ctx, path, 1, one), APSM_OK);
    char *bytes = scratch_read(path, &size);
    memset(bytes + size - 8, 0xff, 8);
    folder_put(state, "p.npy", bytes, size);
    free(bytes);
    expect_failure(ctx, apsm_points_read(ctx, path, &n, &P), APSM_ERR_NONFINITE, "p.npy",
                   "coordinate 2 of particle 0");
    apsm_context_free(ctx);
}

static void test_extensions(void **state)
{
    apsm_context *ctx = apsm_context_new();
    const double P[3] = { 0 };
    double *Q;
    size_t n;
    char path[TEST_PATH];
    assert_string_equal(apsm_points_extension("a/b.c.Mrk.Json"), ".mrk.json");
    assert_string_equal(apsm_points_extension("x.NPY"), ".npy");
    assert_null(apsm_points_extension("x.json"));
    assert_null(apsm_points_extension("npy"));
    folder_path(state, "x.json", path);
    expect_failure(ctx, apsm_points_write(ctx, path, 1, P), APSM_ERR_UNSUPPORTED, "x.json",
                   ".mrk.json");
    expect_failure(ctx, apsm_points_read(ctx, path, &n, &Q), APSM_ERR_UNSUPPORTED, "x.json",
                   ".npy");
    folder_path(state, "x.ply", path);
    expect_failure(ctx, apsm_write_mesh_points(ctx, path, 1, P), APSM_ERR_UNSUPPORTED, "x.ply",
                   ".vtp");
    assert_int_equal(folder_count(*state), 0);
    apsm_context_free(ctx);
}

int main(void)
{
#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        IN_FOLDER(test_every_bit_is_kept),
        IN_FOLDER(test_particles_keep_nine_digits),
        IN_FOLDER(test_a_comma_locale_changes_nothing),
        IN_FOLDER(test_cohort),
        IN_FOLDER(test_other_spellings),
        IN_FOLDER(test_damaged_text_is_refused),
        IN_FOLDER(test_npy_headers),
        IN_FOLDER(test_no_shortened_file_passes),
        IN_FOLDER(test_not_finite_is_refused),
        IN_FOLDER(test_extensions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
