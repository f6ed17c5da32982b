/* INPUT arguments to cases, and labels to masks. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <unistd.h>

#include "apsm/formats.h"
#include "input/input.h"
#include "scratch.h"
#include "shapes.h"

/* What the log received. */
typedef struct fixture {
    apsm_context *ctx;
    char folder[SCRATCH_LENGTH];
    char log[1024];
} fixture;

static void keep_log(void *user, apsm_log_level level, const char *text)
{
    fixture *const f = user;
    const size_t used = strlen(f->log);
    snprintf(f->log + used, sizeof f->log - used, "%d:%s\n", level, text);
}

static int setup(void **state)
{
    fixture *const f = calloc(1, sizeof *f);
    f->ctx = apsm_context_new();
    apsm_context_set_log(f->ctx, keep_log, f);
    scratch_make(f->folder);
    *state = f;
    return 0;
}

static int teardown(void **state)
{
    fixture *const f = *state;
    scratch_remove(f->folder);
    apsm_context_free(f->ctx);
    free(f);
    return 0;
}

/* Files and folders ("x/") of these names. */
static void make_files(fixture *f, const char *const *names)
{
    for (; *names; names++) {
        const char *const path = scratch_path(f->folder, *names);
        if (path[strlen(path) - 1] == '/')
            assert_int_equal(mkdir(path, 0777), 0);
        else
            scratch_write(path, "x", 1);
    }
}

static apsm_status expand(fixture *f, const char *const *names, const char *exclude,
                          const char *reflect, apsm_input_list *list)
{
    const char *paths[8];
    size_t n = 0;
    for (; names[n]; n++) paths[n] = scratch_path(f->folder, names[n]);
    f->log[0] = '\0';
    return apsm_input_expand(f->ctx, n, paths, exclude, reflect, list);
}

static void expect_names(fixture *f, apsm_status status, const apsm_input_list *list,
                         const char *wanted)
{
    char names[256] = "";
    if (status != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    for (size_t i = 0; i < list->n; i++)
        snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s ", list->cases[i].name,
                 list->cases[i].reflect ? "*" : "");
    assert_string_equal(names, wanted);
}

#define NAMES(...)                                                                                 \
    (const char *const[])                                                                          \
    {                                                                                              \
        __VA_ARGS__, NULL                                                                          \
    }

static void folders_and_files_mix_in_order_of_names(void **state)
{
    fixture *const f = *state;
    make_files(f, NAMES("d/", "d/b.ply", "d/a.nii.gz", "d/B.STL", "d/a-b.obj", "d/notes.txt",
                        "d/.hidden.ply", "d/sub/", "d/sub/c.ply", "z.vtp", "Y.mha"));
    apsm_input_list list;
    apsm_status status = expand(f, NAMES("z.vtp", "d/", "Y.mha"), NULL, "", &list);
    expect_names(f, status, &list, "B Y a a-b b z ");
    assert_int_equal(list.cases[1].kind, APSM_INPUT_VOLUME);
    assert_int_equal(list.cases[2].kind, APSM_INPUT_VOLUME);
    assert_int_equal(list.cases[3].kind, APSM_INPUT_MESH);
    assert_int_equal(list.skipped, 1);
    assert_non_null(strstr(f->log, "0:1 file skipped that holds no shape: notes.txt\n"));
    apsm_input_list_free(&list);
}

/* Those that hold the voxels of a header are none of them. */
static void files_without_shapes_are_named(void **state)
{
    fixture *const f = *state;
    const char *const meta = "NDims = 3\nElementDataFile = m.raw\n",
                      *const nrrd = "NRRD0004\ntype: uchar\ndata file: n.raw\n\nbytes";
    make_files(f, NAMES("d/", "d/m.raw", "d/n.raw", "d/o.raw", "d/z.txt", "d/y.txt", "d/x.txt"));
    scratch_write(scratch_path(f->folder, "d/m.mhd"), meta, strlen(meta));
    scratch_write(scratch_path(f->folder, "d/n.nhdr"), nrrd, strlen(nrrd));
    apsm_input_list list;
    const apsm_status status = expand(f, NAMES("d"), NULL, NULL, &list);
    expect_names(f, status, &list, "m n ");
    assert_int_equal(list.skipped, 4);
    assert_string_equal(f->log, "0:4 files skipped that hold no shape: o.raw, x.txt, y.txt, ...\n");
    apsm_input_list_free(&list);
}

static void check_data_file(fixture *f, const char *name, const char *text, const char *wanted)
{
    apsm_file_list data;
    char all[512] = "";
    scratch_write(scratch_path(f->folder, name), text, strlen(text));
    assert_int_equal(apsm_input_data_files(scratch_path(f->folder, name), &data), APSM_OK);
    for (size_t k = 0; k < data.n; k++) {
        assert_memory_equal(data.path[k], f->folder, strlen(f->folder));
        strcat(strcat(all, k ? " " : ""), data.path[k] + strlen(f->folder) + 1);
    }
    assert_string_equal(all, wanted ? wanted : "");
    apsm_file_list_free(&data);
}

static void data_files_of_headers_are_found(void **state)
{
    fixture *const f = *state;
    check_data_file(f, "a.mhd", "NDims = 3\r\nElementDataFile =  b c.raw \r\n", "b c.raw");
    check_data_file(f, "a.mha", "ElementDataFile = LOCAL\nElementDataFile = x.raw\n", NULL);
    check_data_file(f, "b.mhd", "ElementDataFile = s%03d.raw 8 10 1\n",
                    "s008.raw s009.raw s010.raw");
    check_data_file(f, "c.mhd", "NDims = 3\n", NULL);
    check_data_file(f, "a.nhdr", "NRRD0004\ndata file: ./b.raw.gz\n", "./b.raw.gz");
    check_data_file(f, "b.nrrd", "NRRD0004\ntype: uchar\n\ndata file: b.raw\n", NULL);
    check_data_file(f, "c.nhdr", "NRRD0004\ndata file: LIST\nb.raw\r\n\nc.raw", "b.raw c.raw");
    check_data_file(f, "d.nhdr", "NRRD0004\ndata file: LIST 2\nb.raw\n", "b.raw");
    check_data_file(f, "d.mhd", "ElementDataFile = LIST2D\nb.raw\n", "b.raw");
    check_data_file(f, "e.nhdr", "NRRD0004\ndata file: LISTER_01.raw\nb\n", "LISTER_01.raw");
    check_data_file(f, "f.nhdr", "NRRD0004\ndata file: LIST01.raw\nb\n", "LIST01.raw");
    check_data_file(f, "a.nii", "ElementDataFile = b.raw\n", NULL);
}

static void only_ranges_that_are_some_are_counted(void **state)
{
    fixture *const f = *state;
    check_data_file(f, "a.mhd", "ElementDataFile = s%d.raw 5 3 -1\n", "s5.raw s4.raw s3.raw");
    check_data_file(f, "a.mhd", "ElementDataFile = s%d.raw 5 5 -1\n", "s5.raw");
    check_data_file(f, "a.mhd", "ElementDataFile = s%d.raw 5 3 10\n", NULL);
    check_data_file(f, "a.mhd", "ElementDataFile = s%d.raw 3 5 -10\n", NULL);
    check_data_file(f, "a.mhd", "ElementDataFile = s%d.raw 1 1 9223372036854775807\n", NULL);
}

/* A TIFF without fields: 8 bytes of head, then no entries, and where the next page is. */
static void put_tiff(const fixture *f, const char *name, bool big, char next)
{
    char bytes[14] = { 'I', 'I', 42, 0, 8 };
    if (big) memcpy(bytes, "MM\0\052\0\0\0\010", 8);
    bytes[big ? 13 : 10] = next;
    scratch_write(scratch_path(f->folder, name), bytes, sizeof bytes);
}

/* One page beside shapes is a picture; all of a folder, or by their names, they are slices that
 * whoever reads them refuses. */
static void pictures_beside_shapes_are_left_out(void **state)
{
    fixture *const f = *state;
    apsm_input_list list;
    make_files(f, NAMES("d/", "d/a.ply", "d/b.ply"));
    put_tiff(f, "d/p.tif", false, 0);
    put_tiff(f, "d/q.TIFF", true, 0);
    put_tiff(f, "d/stack.tif", false, 8);
    f->log[0] = '\0';
    apsm_status status = expand(f, NAMES("d"), NULL, NULL, &list);
    expect_names(f, status, &list, "a b stack ");
    assert_int_equal(list.skipped, 2);
    assert_non_null(strstr(f->log, "d/p.tif: a flat picture"));
    assert_non_null(strstr(f->log, "d/q.TIFF: a flat picture"));
    apsm_input_list_free(&list);
    status = expand(f, NAMES("d/p.tif", "d/a.ply"), NULL, NULL, &list);
    expect_names(f, status, &list, "a p ");
    apsm_input_list_free(&list);
    make_files(f, NAMES("e/"));
    put_tiff(f, "e/s1.tif", false, 0);
    put_tiff(f, "e/s2.tif", false, 0);
    status = expand(f, NAMES("e"), NULL, NULL, &list);
    expect_names(f, status, &list, "s1 s2 ");
    apsm_input_list_free(&list);
}

static void names_that_capitals_tell_apart_are_warned_of(void **state)
{
    fixture *const f = *state;
    apsm_input_list list;
    make_files(f, NAMES("d/", "d/e0.ply", "d/E0.ply", "d/e1.ply"));
    f->log[0] = '\0';
    const apsm_status status = expand(f, NAMES("d"), NULL, NULL, &list);
    expect_names(f, status, &list, "E0 e0 e1 ");
    assert_non_null(strstr(f->log, "differ in capitals alone"));
    apsm_input_list_free(&list);
}

static void names_that_no_file_can_have_are_refused(void **state)
{
    fixture *const f = *state;
    char longer[220], file[224];
    memset(longer, 'x', 201);
    strcpy(longer + 201, ".ply");
    snprintf(file, sizeof file, "d/%s", longer);
    apsm_input_list list;
    make_files(f, NAMES("d/", "d/good.ply", file));
    expect_failure(f->ctx, expand(f, NAMES("d"), NULL, NULL, &list), APSM_ERR_ARG,
                   "longer than 200", "rename");
    apsm_input_list_free(&list);
    assert_int_equal(expand(f, NAMES("d"), "^x", NULL, &list), APSM_OK); /* if it is left out */
    apsm_input_list_free(&list);
    make_files(f, NAMES("n/", "n/a\nb.ply", "u/", "u/a\xff.ply"));
    expect_failure(f->ctx, expand(f, NAMES("n"), NULL, NULL, &list), APSM_ERR_ARG, "a?b.ply",
                   "control character");
    expect_failure(f->ctx, expand(f, NAMES("u"), NULL, NULL, &list), APSM_ERR_ARG, "UTF-8",
                   "rename");
}

static void expressions_choose_by_file_name(void **state)
{
    fixture *const f = *state;
    make_files(f, NAMES("d/", "d/k_L_1.ply", "d/k_R_1.ply", "d/k_L_2.stl", "d/bad.ply"));
    apsm_input_list list;
    apsm_status status = expand(f, NAMES("d"), "^bad|[.]stl$", "_L_", &list);
    expect_names(f, status, &list, "k_L_1* k_R_1 ");
    assert_int_equal(list.excluded, 2);
    assert_string_equal(f->log, "");
    apsm_input_list_free(&list);
    status = expand(f, NAMES("d"), "nosuch", "x{2}", &list);
    expect_names(f, status, &list, "bad k_L_1 k_L_2 k_R_1 ");
    assert_non_null(strstr(f->log, "1:--exclude 'nosuch' matches none"));
    assert_non_null(strstr(f->log, "1:--reflect-match 'x{2}' matches none"));
    apsm_input_list_free(&list);
    expect_failure(f->ctx, expand(f, NAMES("d"), "(", NULL, &list), APSM_ERR_ARG, "--exclude '('",
                   "regular expression");
    expect_failure(f->ctx, expand(f, NAMES("d"), NULL, "[", &list), APSM_ERR_ARG,
                   "--reflect-match '['", "regular expression");
    expect_failure(f->ctx, expand(f, NAMES("d"), ".", NULL, &list), APSM_ERR_ARG, "4 input files",
                   "--exclude");
}

static void bad_inputs_are_refused(void **state)
{
    fixture *const f = *state;
    make_files(f, NAMES("e/", "t/", "t/readme.txt", "d/", "d/a.ply", "a.nii.gz", "x.png"));
    apsm_input_list list;
    expect_failure(f->ctx, expand(f, NAMES("e"), NULL, NULL, &list), APSM_ERR_IO, "no shapes",
                   "/e");
    expect_failure(f->ctx, expand(f, NAMES("t"), NULL, NULL, &list), APSM_ERR_IO, "no shapes",
                   "/t");
    make_files(f, NAMES("d/a.stl"));
    expect_failure(f->ctx, expand(f, NAMES("d"), NULL, NULL, &list), APSM_ERR_ARG, "case 'a'",
                   "a.stl");
    expect_failure(f->ctx, expand(f, NAMES("d", "d/a.ply"), NULL, NULL, &list), APSM_ERR_ARG,
                   "case 'a'", "a.ply");
    expect_failure(f->ctx, expand(f, NAMES("none.ply"), NULL, NULL, &list), APSM_ERR_IO,
                   "No such file", "none.ply");
    expect_failure(f->ctx, expand(f, NAMES("x.png"), NULL, NULL, &list), APSM_ERR_UNSUPPORTED,
                   "x.png", ".nrrd");
    const char *const null = "/dev/null";
    expect_failure(f->ctx, apsm_input_expand(f->ctx, 1, &null, NULL, NULL, &list), APSM_ERR_IO,
                   "/dev/null", "neither");
    expect_failure(f->ctx, apsm_input_expand(f->ctx, 0, NULL, NULL, NULL, &list), APSM_ERR_ARG,
                   "no inputs", "");
    assert_int_equal(list.n, 0);
    assert_null(list.cases);
}

static void dicom_folders_are_cases(void **state)
{
    fixture *const f = *state;
    char slice[200] = { 0 };
    memcpy(slice + 128, "DICM", 4);
    make_files(f, NAMES("all/", "all/p1/", "all/p2/", "all/none/", "all/none/x.txt"));
    const char *const slices[] = { "all/p1/1", "all/p1/2.dcm", "all/p2/1" };
    for (int k = 0; k < 3; k++)
        scratch_write(scratch_path(f->folder, slices[k]), slice, sizeof slice);
    apsm_input_list list;
    apsm_status status = expand(f, NAMES("all/p1/"), NULL, NULL, &list);
    expect_names(f, status, &list, "p1 ");
    assert_int_equal(list.cases[0].kind, APSM_INPUT_DICOM);
    apsm_input_list_free(&list);
    status = expand(f, NAMES("all"), NULL, "2", &list);
    expect_names(f, status, &list, "p1 p2* ");
    apsm_input_list_free(&list);
}

static apsm_status choose(fixture *f, const char *folder, const char *pattern, const char *exclude,
                          apsm_input_list *list)
{
    const char *const path = scratch_path(f->folder, folder);
    const apsm_input_choice c = {
        .n = 1, .inputs = &path, .pattern = pattern, .exclude = exclude, .reflect_match = "left"
    };
    f->log[0] = '\0';
    return apsm_input_choose(f->ctx, &c, list);
}

static void names_are_what_differs_in_the_paths(void **state)
{
    fixture *const f = *state;
    static const struct {
        const char *const files[12];
        const char *names;
    } trees[] = {
        { { "t0/", "t0/s1/", "t0/s2/", "t0/s1/seg.nii.gz", "t0/s2/seg.nii.gz" }, "s1 s2 " },
        { { "t1/", "t1/left/", "t1/right/", "t1/left/p1.ply", "t1/left/p2.ply", "t1/right/p1.ply" },
          "left_p1* left_p2* right_p1 " },
        { { "t2/", "t2/sub-01/", "t2/sub-01/anat/", "t2/sub-02/", "t2/sub-02/anat/",
            "t2/sub-01/anat/sub-01_dseg.nii", "t2/sub-02/anat/sub-02_dseg.nii" },
          "sub-01_dseg sub-02_dseg " },
        { { "t3/", "t3/a/", "t3/a/x/", "t3/a/x/m.ply", "t3/b/", "t3/b/m.ply" }, "a_x b " },
        { { "t4/", "t4/a/", "t4/a/in/", "t4/a/in/1/", "t4/a/in/1/m.ply", "t4/b/", "t4/b/in/",
            "t4/b/in/1/", "t4/b/in/1/m.ply", "t4/b/in/1/n.ply" },
          "a_m b_m b_n " },
        { { "t5/", "t5/Thumbs.db", "t5/.DS_Store", "t5/._a.ply", "t5/desktop.ini", "t5/__MACOSX/",
            "t5/__MACOSX/b.ply", "t5/a.ply" },
          "a " },
    };
    for (size_t k = 0; k < sizeof trees / sizeof *trees; k++) {
        char folder[8];
        apsm_input_list list;
        snprintf(folder, sizeof folder, "t%zu", k);
        make_files(f, trees[k].files);
        const apsm_status status = choose(f, folder, NULL, NULL, &list);
        expect_names(f, status, &list, trees[k].names);
        assert_int_equal(list.skipped, 0);
        apsm_input_list_free(&list);
    }
}

static void shapes_in_folders_below_are_found_or_named(void **state)
{
    fixture *const f = *state;
    apsm_input_list list;
    make_files(f, NAMES("d/", "d/a.ply", "d/more/", "d/more/b.ply", "d/more/c.ply", "d/m/",
                        "d/m/manifest.json", "d/m/project.swproj", "d/m/g/", "d/m/g/x.ply"));
    apsm_status status = choose(f, "d", NULL, NULL, &list);
    expect_names(f, status, &list, "a ");
    assert_non_null(strstr(f->log, "2 shapes in folders below (more/b.ply, more/c.ply) left out"));
    apsm_input_list_free(&list);
    status = choose(f, "d", "**/*", NULL, &list);
    expect_names(f, status, &list, "a b c ");
    assert_non_null(strstr(f->log, "a model folder"));
    apsm_input_list_free(&list);
    status = choose(f, "d", "**/*", "more/b", &list);
    expect_names(f, status, &list, "a c ");
    apsm_input_list_free(&list);
    status = choose(f, "d", "c.*", NULL, &list);
    expect_names(f, status, &list, "c ");
    assert_non_null(strstr(f->log, "2 shapes are not meant by --pattern 'c.*'"));
    apsm_input_list_free(&list);
    expect_failure(f->ctx, choose(f, "d", "*/*/liver.ply", NULL, &list), APSM_ERR_ARG,
                   "none of the 3 shapes", "--pattern");
}

/* Of a model that was written among the shapes, or of fits beside them. */
static void results_are_no_inputs(void **state)
{
    fixture *const f = *state;
    apsm_input_list list;
    make_files(f, NAMES("d/", "d/manifest.json", "d/project.swproj", "d/groomed/", "d/meshes/",
                        "d/groomed/x.ply", "d/meshes/mean.ply", "d/fits/", "d/fits/fit.json",
                        "d/fits/fit.csv", "d/fits/meshes/", "d/fits/meshes/y.ply"));
    for (int k = 0; k < 2; k++)
        expect_failure(f->ctx, choose(f, "d", k ? "**/*.ply" : NULL, NULL, &list), APSM_ERR_IO,
                       "results are not taken for inputs", "d/groomed");
    apsm_status status = choose(f, "d/groomed", NULL, NULL, &list);
    expect_names(f, status, &list, "x ");
    apsm_input_list_free(&list);
    make_files(f, NAMES("d/p1/", "d/p1/a.ply"));
    status = choose(f, "d", NULL, NULL, &list);
    expect_names(f, status, &list, "a ");
    apsm_input_list_free(&list);
}

/* What the manifest lists is the model's, whatever else lies in folders of these names is not. */
static void shapes_in_folders_with_names_of_a_models(void **state)
{
    static const char finished[] = "{\"outputs\": {\"meshes/mean.ply\": [], \"state/x.ckpt\": []}}",
                      joint[] = "{\"joint\": {}, \"outputs\": {}}",
                      begun[] = "{\"begun\": [\"groom\"], \"outputs\": {}}";
    fixture *const f = *state;
    apsm_input_list list;
    make_files(f, NAMES("d/", "d/manifest.json", "d/project.swproj", "d/meshes/", "d/parts/",
                        "d/state/", "d/other/", "d/meshes/mean.ply", "d/meshes/own.ply",
                        "d/state/x.ckpt", "d/parts/a.ply", "d/other/b.ply"));
    scratch_write(scratch_path(f->folder, "d/manifest.json"), finished, sizeof finished - 1);
    for (int k = 0; k < 2; k++) {
        expect_names(f, choose(f, "d", k ? "**/*.ply" : NULL, NULL, &list), &list, "a b own ");
        assert_null(strstr(f->log, "not searched"));
        apsm_input_list_free(&list);
    }
    scratch_write(scratch_path(f->folder, "d/manifest.json"), joint, sizeof joint - 1);
    expect_names(f, choose(f, "d", NULL, NULL, &list), &list, "b mean own ");
    apsm_input_list_free(&list);
    scratch_write(scratch_path(f->folder, "d/manifest.json"), begun, sizeof begun - 1);
    expect_names(f, choose(f, "d", NULL, NULL, &list), &list, "a b ");
    assert_non_null(strstr(f->log, "not finished"));
    apsm_input_list_free(&list);
}

static void trees_of_many_organs_are_chosen_from(void **state)
{
    fixture *const f = *state;
    apsm_input_list list;
    make_files(f, NAMES("d/", "d/s1/", "d/s1/seg/", "d/s2/", "d/s2/seg/", "d/s1/ct.nii.gz",
                        "d/s2/ct.nii.gz", "d/s1/seg/liver.nii.gz", "d/s2/seg/liver.nii.gz",
                        "d/s1/seg/spleen.nii.gz", "d/s2/seg/spleen.nii.gz"));
    static const char *const patterns[] = { "**/liver.nii.gz", "liver.nii.gz", "*/seg/l*.nii.gz",
                                            "s?/**/liver*" };
    for (size_t k = 0; k < 4; k++) {
        const apsm_status status = choose(f, "d", patterns[k], NULL, &list);
        expect_names(f, status, &list, "s1 s2 ");
        apsm_input_list_free(&list);
    }
    const apsm_status status = choose(f, "d", "*/seg/*", NULL, &list);
    expect_names(f, status, &list, "s1_liver s1_spleen s2_liver s2_spleen ");
    apsm_input_list_free(&list);
}

/* Links are followed, each folder once, whatever circles they make. */
static void links_are_followed_once(void **state)
{
    fixture *const f = *state;
    apsm_input_list list;
    char target[SCRATCH_LENGTH];
    make_files(f, NAMES("d/", "d/a/", "d/a/m.ply", "d/b/", "away/", "away/n.ply"));
    snprintf(target, sizeof target, "%s", scratch_path(f->folder, "away"));
    assert_int_equal(symlink(target, scratch_path(f->folder, "d/b/l")), 0);
    assert_int_equal(symlink("..", scratch_path(f->folder, "d/a/up")), 0);
    assert_int_equal(symlink("../a", scratch_path(f->folder, "d/b/again")), 0);
    assert_int_equal(symlink("nowhere", scratch_path(f->folder, "d/b/z")), 0);
    const apsm_status status = choose(f, "d", NULL, NULL, &list);
    expect_names(f, status, &list, "m n ");
    assert_non_null(strstr(f->log, "a/up: leads to a folder that was searched already"));
    apsm_input_list_free(&list);
}

static void series_beside_series_in_folders_are_all_found(void **state)
{
    fixture *const f = *state;
    apsm_input_list list;
    char slice[200] = { 0 };
    memcpy(slice + 128, "DICM", 4);
    make_files(f,
               NAMES("all/", "all/p1/", "all/p2/", "all/p2/series/", "all/p3/", "all/p3/series/"));
    const char *const slices[] = { "all/p1/1", "all/p2/series/1", "all/p3/series/1" };
    for (int k = 0; k < 3; k++)
        scratch_write(scratch_path(f->folder, slices[k]), slice, sizeof slice);
    const apsm_status status = choose(f, "all", NULL, NULL, &list);
    expect_names(f, status, &list, "p1 p2_series p3_series ");
    apsm_input_list_free(&list);
}

static void names_may_be_given(void **state)
{
    fixture *const f = *state;
    apsm_input_list list;
    make_files(f, NAMES("a/", "a/seg.ply", "b/", "b/seg.ply"));
    char first[SCRATCH_LENGTH];
    snprintf(first, sizeof first, "%s", scratch_path(f->folder, "a/seg.ply"));
    const char *const paths[] = { first, scratch_path(f->folder, "b/seg.ply") }, *const names[] = {
        "two", "one"
    };
    const apsm_input_choice c = { .n = 2, .inputs = paths, .names = names };
    const apsm_status status = apsm_input_choose(f->ctx, &c, &list);
    expect_names(f, status, &list, "one two ");
    apsm_input_list_free(&list);
}

static void labels_are_parsed(void **state)
{
    fixture *const f = *state;
    apsm_labels l;
    assert_int_equal(apsm_labels_parse(f->ctx, "7,-2,7,1", &l), APSM_OK);
    assert_int_equal(l.n, 3);
    assert_int_equal(l.label[0], -2);
    assert_int_equal(l.label[2], 7);
    apsm_labels_free(&l);
    assert_int_equal(apsm_labels_parse(f->ctx, "all", &l), APSM_OK);
    assert_true(l.all);
    assert_int_equal(apsm_labels_parse(f->ctx, "", &l), APSM_OK);
    assert_int_equal(apsm_labels_parse(f->ctx, NULL, &l), APSM_OK);
    assert_true(!l.all && l.n == 0);
    const char *const bad[] = { "0",  "1,",  ",1",  "1,,2",       ">",
                                "<a", "1 2", "1.5", "3000000000", "1,0" };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++)
        expect_failure(f->ctx, apsm_labels_parse(f->ctx, bad[k], &l), APSM_ERR_ARG, bad[k],
                       "--label");
}

static apsm_status unite(fixture *f, const char *labels, const int32_t values[8], char mask[9])
{
    int32_t voxels[8];
    memcpy(voxels, values, sizeof voxels);
    apsm_volume v = { .n = { 2, 2, 2 }, .label = voxels };
    apsm_labels l;
    f->log[0] = '\0';
    assert_int_equal(apsm_labels_parse(f->ctx, labels, &l), APSM_OK);
    const apsm_status status = apsm_label_union(f->ctx, "file.nrrd", &l, &v);
    for (int i = 0; i < 8; i++) mask[i] = (char)('0' + voxels[i]);
    mask[8] = '\0';
    apsm_labels_free(&l);
    return status;
}

static void labels_are_united(void **state)
{
    fixture *const f = *state;
    const int32_t several[8] = { 0, 5, 3, 3, 0, -1, 5, 0 }, one[8] = { 0, 4, 4 }, none[8] = { 0 };
    char mask[9];
    assert_int_equal(unite(f, "", one, mask), APSM_OK);
    assert_string_equal(mask, "01100000");
    assert_int_equal(unite(f, "3,5", several, mask), APSM_OK);
    assert_string_equal(mask, "01110010");
    assert_string_equal(f->log, "");
    assert_int_equal(unite(f, "all", several, mask), APSM_OK);
    assert_string_equal(mask, "01110110");
    assert_int_equal(unite(f, "3,9", several, mask), APSM_OK);
    assert_string_equal(mask, "00110000");
    assert_non_null(strstr(f->log, "file.nrrd: label 9"));
    expect_failure(f->ctx, unite(f, "", several, mask), APSM_ERR_GEOMETRY, "-1, 3, 5", "file.nrrd");
    expect_failure(f->ctx, unite(f, "9", several, mask), APSM_ERR_GEOMETRY, "-1, 3, 5", "none of");
    expect_failure(f->ctx, unite(f, "", none, mask), APSM_ERR_GEOMETRY, "every voxel is 0", "");
    expect_failure(f->ctx, unite(f, "all", none, mask), APSM_ERR_GEOMETRY, "every voxel is 0", "");
}

static void cases_are_read(void **state)
{
    fixture *const f = *state;
    const char *const paths[] = { APSM_TEST_DATA "/KSBL_R_01_talus.ply",
                                  APSM_DATA "/hippocampus/hippocampus_001.nii.gz" };
    apsm_input_list list;
    apsm_input_shape shape;
    apsm_labels none = { 0 }, both;
    assert_int_equal(apsm_input_expand(f->ctx, 2, paths, NULL, NULL, &list), APSM_OK);
    assert_string_equal(list.cases[1].name, "hippocampus_001");
    assert_int_equal(apsm_input_read(f->ctx, &list.cases[0], &none, &shape), APSM_OK);
    assert_true(shape.is_mesh && shape.mesh.nf == 40000 && !shape.volume.label);
    apsm_input_shape_free(&shape);
    expect_failure(f->ctx, apsm_input_read(f->ctx, &list.cases[1], &none, &shape),
                   APSM_ERR_GEOMETRY, "1, 2", "hippocampus_001.nii.gz");
    assert_true(!shape.volume.label && !shape.volume.small);
    assert_int_equal(apsm_labels_parse(f->ctx, "1,2", &both), APSM_OK);
    assert_int_equal(apsm_input_read(f->ctx, &list.cases[1], &both, &shape), APSM_OK);
    assert_true(!shape.is_mesh && shape.volume.small && !shape.mesh.V);
    apsm_input_shape_free(&shape);
    apsm_labels_free(&both);
    apsm_input_list_free(&list);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(folders_and_files_mix_in_order_of_names),
        TEST(expressions_choose_by_file_name),
        TEST(files_without_shapes_are_named),
        TEST(data_files_of_headers_are_found),
        TEST(only_ranges_that_are_some_are_counted),
        TEST(names_that_no_file_can_have_are_refused),
        TEST(bad_inputs_are_refused),
        TEST(dicom_folders_are_cases),
        TEST(names_are_what_differs_in_the_paths),
        TEST(shapes_in_folders_below_are_found_or_named),
        TEST(results_are_no_inputs),
        TEST(shapes_in_folders_with_names_of_a_models),
        TEST(trees_of_many_organs_are_chosen_from),
        TEST(links_are_followed_once),
        TEST(series_beside_series_in_folders_are_all_found),
        TEST(names_may_be_given),
        TEST(labels_are_parsed),
        TEST(labels_are_united),
        TEST(pictures_beside_shapes_are_left_out),
        TEST(names_that_capitals_tell_apart_are_warned_of),
        TEST(cases_are_read),
    };
    return cmocka_run_group_tests_name("expand", tests, NULL, NULL);
}
