/* Projects: what ShapeWorks writes is read, what we write keeps all we do not know. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <jansson.h>
#include <math.h>
#include <string.h>

#include "files/files.h"
#include "files/particles_file.h"
#include "files/project.h"
#include "folder.h"

static apsm_context *ctx;

#define IDENTITY                                                                                   \
    "1.000000 0.000000 0.000000 0.000000 0.000000 1.000000 0.000000 0.000000 "                     \
    "0.000000 0.000000 1.000000 0.000000 0.000000 0.000000 0.000000 1.000000"

/* The layout of ShapeWorks' own projects: all strings, an empty name, groups of other programs'
 * business, further columns, a legacy transform. */
static const char shapeworks[] =
    "{\n"
    "    \"data\": [\n"
    "        {\n"
    "            \"name\": \"\",\n"
    "            \"shape_1\": \"ellipsoid_00.vtk\",\n"
    "            \"landmarks_file_1\": \"marks/ellipsoid_00.csv\",\n"
    "            \"groomed_1\": \"groomed/ellipsoid_00_groomed.vtk\",\n"
    "            \"local_particles_1\": \"p/ellipsoid_00_groomed_local.particles\",\n"
    "            \"world_particles_1\": \"p/ellipsoid_00_groomed_world.particles\",\n"
    "            \"alignment_1\": \"1.000000 0.000000 0.000000 -2.000000 0.000000 1.000000 "
    "0.000000 "
    "-4.999999 0.000000 0.000000 1.000000 -45.000000 0.000000 0.000000 0.000000 1.000000\",\n"
    "            \"procrustes_1\": \"" IDENTITY "\",\n"
    "            \"fixed\": \"yes\"\n"
    "        },\n"
    "        {\n"
    "            \"name\": \"second\",\n"
    "            \"shape_1\": \"ellipsoid_01.vtk\",\n"
    "            \"group_sex\": \"f\",\n"
    "            \"alignment_1\": \"1 0 0 0 1 0 0 0 1 -7 8.5 9\"\n"
    "        }\n"
    "    ],\n"
    "    \"groom\": {\n"
    "        \"1\": {\n"
    "            \"alignment_enabled\": \"true\",\n"
    "            \"spacing\": \"0 0 0\"\n"
    "        }\n"
    "    },\n"
    "    \"optimize\": {\n"
    "        \"number_of_particles\": \"64\",\n"
    "        \"use_normals\": \"0\"\n"
    "    },\n"
    "    \"studio\": null,\n"
    "    \"project\": {\n"
    "        \"version\": \"2\"\n"
    "    },\n"
    "    \"somebody_elses\": {\n"
    "        \"deep\": [\n"
    "            {\n"
    "                \"x\": 1\n"
    "            }\n"
    "        ]\n"
    "    },\n"
    "    \"landmarks\": [\n"
    "        {\n"
    "            \"domain\": \"1\",\n"
    "            \"name\": \"1\",\n"
    "            \"visible\": \"true\",\n"
    "            \"color\": \"#ffaf4e\",\n"
    "            \"comment\": \"\"\n"
    "        }\n"
    "    ]\n"
    "}\n";

static const char *put(void **state, const char *name, const char *text, char path[TEST_PATH])
{
    folder_put(state, name, text, strlen(text));
    return folder_path(state, name, path);
}

static apsm_project read_text(void **state, const char *text)
{
    char path[TEST_PATH];
    apsm_project p;
    if (apsm_project_read(ctx, put(state, "in.swproj", text, path), &p) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    return p;
}

static char *write_text(void **state, const apsm_project *p)
{
    char path[TEST_PATH], *data;
    size_t size;
    folder_path(state, "out.swproj", path);
    if (apsm_project_write(ctx, path, p) != APSM_OK) fail_msg("%s", apsm_error_text(ctx));
    assert_int_equal(apsm_read_file(ctx, path, 1 << 20, &data, &size), APSM_OK);
    return data;
}

static void a_project_of_shapeworks_is_understood(void **state)
{
    apsm_project p = read_text(state, shapeworks);
    assert_int_equal(p.n, 2);
    assert_string_equal(p.domain, "1");
    assert_string_equal(p.folder, *state);
    const apsm_subject *s = p.subjects;
    assert_string_equal(s[0].name, "ellipsoid_00");
    assert_string_equal(s[0].shape, "ellipsoid_00.vtk");
    assert_string_equal(s[0].groomed, "groomed/ellipsoid_00_groomed.vtk");
    assert_string_equal(s[0].local_particles, "p/ellipsoid_00_groomed_local.particles");
    assert_string_equal(s[0].world_particles, "p/ellipsoid_00_groomed_world.particles");
    assert_true(s[0].has_alignment && s[0].has_procrustes && !s[0].mirrored);
    assert_true(s[0].alignment[3] == -2 && s[0].alignment[7] == -4.999999);
    assert_true(s[0].alignment[11] == -45 && s[0].alignment[15] == 1 && s[0].alignment[0] == 1);
    assert_string_equal(apsm_subject_column(&s[0], "fixed"), "yes");
    assert_string_equal(apsm_subject_column(&s[1], "group_sex"), "f");
    assert_null(apsm_subject_column(&s[1], "fixed"));
    assert_string_equal(s[1].name, "second");
    assert_true(s[1].groomed == NULL && !s[1].has_procrustes);
    assert_true(s[1].has_alignment && s[1].alignment[3] == -7 && s[1].alignment[7] == 8.5);
    assert_true(s[1].alignment[11] == 9 && s[1].alignment[5] == 1 && s[1].alignment[12] == 0);
    assert_string_equal(apsm_project_get(&p, "optimize", "number_of_particles"), "64");
    assert_null(apsm_project_get(&p, "optimize", "none"));
    assert_null(apsm_project_get(&p, "studio", "none"));
    assert_int_equal(apsm_project_find(&p, "second"), 1);
    assert_int_equal(apsm_project_find(&p, "third"), 2);
    apsm_project_free(&p);
    apsm_project_free(&p);
}

/* The text must come back byte for byte, but for the empty name, which ShapeWorks fills as well. */
static void an_unchanged_project_is_written_as_it_was(void **state)
{
    apsm_project p = read_text(state, shapeworks);
    char *out = write_text(state, &p), expected[sizeof shapeworks + 32];
    const char *cut = strstr(shapeworks, "\"name\": \"\"") + 9;
    snprintf(expected, sizeof expected, "%.*sellipsoid_00%s", (int)(cut - shapeworks), shapeworks,
             cut);
    assert_string_equal(out, expected);
    free(out);
    apsm_project_free(&p);
}

static void changes_are_written_and_the_rest_is_kept(void **state)
{
    apsm_project p = read_text(state, shapeworks);
    apsm_subject *s = &p.subjects[1];
    assert_int_equal(apsm_text_set(&s->groomed, "groomed/second.ply"), APSM_OK);
    s->has_procrustes = s->mirrored = true;
    s->procrustes[0] = 1.0 / 3;
    assert_int_equal(apsm_text_set(&p.subjects[0].world_particles, NULL), APSM_OK);
    assert_int_equal(apsm_subject_set_column(s, "note", "a \"b\""), APSM_OK);
    assert_int_equal(apsm_subject_set_column(&p.subjects[0], "fixed", NULL), APSM_OK);
    assert_int_equal(apsm_project_set(&p, "apsm", "alpha", "5"), APSM_OK);
    assert_int_equal(apsm_project_set(&p, "apsm", "seed", "1"), APSM_OK);
    assert_int_equal(apsm_project_set(&p, "apsm", "alpha", "7"), APSM_OK);
    free(write_text(state, &p));
    apsm_project_free(&p);

    char path[TEST_PATH];
    const char *key, *value;
    assert_int_equal(apsm_project_read(ctx, folder_path(state, "out.swproj", path), &p), APSM_OK);
    s = &p.subjects[1];
    assert_string_equal(s->groomed, "groomed/second.ply");
    assert_true(s->mirrored && s->procrustes[0] == 1.0 / 3 && s->alignment[3] == -7);
    assert_null(p.subjects[0].world_particles);
    assert_null(apsm_subject_column(&p.subjects[0], "fixed"));
    assert_string_equal(apsm_subject_column(&p.subjects[0], "landmarks_file_1"),
                        "marks/ellipsoid_00.csv");
    assert_string_equal(apsm_subject_column(s, "note"), "a \"b\"");
    assert_int_equal(apsm_project_count(&p, "apsm"), 2);
    apsm_project_pair(&p, "apsm", 0, &key, &value);
    assert_string_equal(key, "alpha");
    assert_string_equal(value, "7");
    apsm_project_pair(&p, "apsm", 1, &key, &value);
    assert_string_equal(key, "seed");
    apsm_project_clear(&p, "apsm");
    assert_int_equal(apsm_project_count(&p, "apsm"), 0);
    apsm_project_free(&p);
}

/* ShapeWorks' reader throws at a value that is no string, and at null groups. */
static void check_strings(const json_t *object)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)object, key, value) if (!json_is_string(value))
        fail_msg("%s is no string", key);
}

static void a_new_project_has_shapeworks_layout(void **state)
{
    apsm_project p;
    apsm_subject *s;
    assert_int_equal(apsm_project_init(ctx, *state, &p), APSM_OK);
    for (int i = 0; i < 40; i++) {
        char name[16];
        snprintf(name, sizeof name, "n%d", i);
        assert_int_equal(apsm_project_add(&p, name, "../in.ply", &s), APSM_OK);
    }
    s->mirrored = s->has_alignment = true;
    assert_int_equal(apsm_text_set(&s->groomed, "groomed/n39.ply"), APSM_OK);
    assert_int_equal(apsm_subject_set_column(s, "group_side", "left"), APSM_OK);
    assert_int_equal(apsm_project_set(&p, "optimize", "number_of_particles", "128"), APSM_OK);
    apsm_project_remove(&p, 0);
    assert_int_equal(p.n, 39);
    assert_string_equal(p.subjects[0].name, "n1");
    char *out = write_text(state, &p);
    assert_non_null(strstr(out,
                           "            \"name\": \"n39\",\n"
                           "            \"shape_1\": \"../in.ply\",\n"
                           "            \"groomed_1\": \"groomed/n39.ply\",\n"
                           "            \"alignment_1\": \"1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\",\n"
                           "            \"group_side\": \"left\",\n"
                           "            \"mirrored\": \"yes\"\n"
                           "        }\n"));
    json_t *root = json_loads(out, 0, NULL);
    size_t i;
    json_t *row;
    json_array_foreach(json_object_get(root, "data"), i, row) check_strings(row);
    check_strings(json_object_get(root, "optimize"));
    check_strings(json_object_get(root, "project"));
    assert_string_equal(
        json_string_value(json_object_get(json_object_get(root, "project"), "version")), "2");
    json_decref(root);
    free(out);
    apsm_project_free(&p);
}

static void other_columns_and_hand_written_values_are_taken(void **state)
{
    apsm_project p = read_text(
        state, "{\"data\": [{\"segmentation_femur\": \"a\\\\b.nrrd\", \"age\": 41, \"w\": 0.1, "
               "\"mirrored\": true, \"groomed_femur\": null, \"alignment_femur\": \"\"}], "
               "\"apsm\": {\"particles\": 64, \"remesh\": false}}");
    const apsm_subject *s = &p.subjects[0];
    assert_string_equal(p.domain, "femur");
    assert_string_equal(s->shape, "a/b.nrrd");
    assert_string_equal(s->name, "b");
    assert_string_equal(apsm_subject_column(s, "age"), "41");
    assert_string_equal(apsm_subject_column(s, "w"), "0.1");
    assert_true(s->mirrored && !s->has_alignment && s->groomed == NULL);
    assert_string_equal(apsm_project_get(&p, "apsm", "particles"), "64");
    assert_string_equal(apsm_project_get(&p, "apsm", "remesh"), "false");
    char *out = write_text(state, &p);
    assert_non_null(strstr(out, "\"segmentation_femur\": \"a/b.nrrd\""));
    assert_null(strstr(out, "\"shape_"));
    assert_non_null(strstr(out, "\"age\": \"41\""));
    assert_non_null(strstr(out, "\"mirrored\": \"yes\""));
    free(out);
    p.subjects[0].mirrored = false;
    out = write_text(state, &p);
    assert_non_null(strstr(out, "\"mirrored\": \"no\""));
    free(out);
    apsm_project_free(&p);
    p = read_text(state, "{\"data\": [{\"local_particles_1\": \"x_local.particles\"}, "
                         "{\"mesh_1\": \"y.ply\"}]}");
    assert_string_equal(p.subjects[0].name, "x_local");
    assert_string_equal(p.subjects[1].shape, "y.ply");
    apsm_project_free(&p);
    p = read_text(state, "{\"data\": [], \"groom\": null}");
    assert_int_equal(p.n, 0);
    apsm_project_free(&p);
}

static void names_become_unique_and_safe(void **state)
{
    apsm_project p = read_text(
        state, "{\"data\": [{\"shape_1\": \"a/liver.nrrd\"}, {\"shape_1\": \"b/liver.nrrd\"}, "
               "{\"name\": \"liver_2\", \"shape_1\": \"c\"}, {\"name\": \"../x/y\", \"shape_1\": "
               "\"d\"}, {\"name\": \"liver\", \"shape_1\": \"e\"}, {}]}");
    const char *const expected[] = {
        "liver", "liver_2", "liver_2_2", "_._x_y", "liver_3", "shape_6"
    };
    assert_int_equal(p.n, 6);
    for (size_t i = 0; i < 6; i++) assert_string_equal(p.subjects[i].name, expected[i]);
    apsm_project_free(&p);
}

static void expect_refusal(void **state, const char *text, apsm_status status, const char *words)
{
    char path[TEST_PATH];
    apsm_project p;
    assert_int_equal(apsm_project_read(ctx, put(state, "bad.swproj", text, path), &p), status);
    if (!strstr(apsm_error_text(ctx), words) || !strstr(apsm_error_text(ctx), "bad.swproj"))
        fail_msg("'%s' does not say '%s'", apsm_error_text(ctx), words);
    assert_true(p.n == 0 && p.subjects == NULL && p.root == NULL && p.folder == NULL);
}

static void broken_projects_are_refused_with_the_place(void **state)
{
#define BAD(text, words) expect_refusal(state, text, APSM_ERR_FORMAT, words)
    BAD("{\"data\": [\n{\"name\": }]}", "bad.swproj:2:");
    BAD("{\"data\": [], \"data\": []}", "duplicate");
    BAD("[]", "no array \"data\"");
    BAD("3", "no array \"data\"");
    BAD("{\"groom\": {}}", "no array \"data\"");
    BAD("{\"data\": {}}", "no array \"data\"");
    BAD("{\"data\": [{}, 3]}", "data[1] is no object");
    BAD("{\"data\": [{\"shape_1\": [\"a\"]}]}", "data[0].shape_1 is an object or array");
    BAD("{\"data\": [{}, {\"alignment_1\": \"1 2 3\"}]}", "data[1].alignment_1: '1 2 3'");
    BAD("{\"data\": [{\"procrustes_1\": \"1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 x\"}]}",
        "data[0].procrustes_1");
    BAD("{\"data\": [{\"procrustes_1\": \"1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 nan\"}]}",
        "data[0].procrustes_1");
    BAD("{\"data\": [{\"procrustes_1\": \"1 0 0 0 0 1 0 0 0 0 1 0 1 2 3 1\"}]}", "0 0 0 1");
    BAD("{\"data\": [{\"alignment_1\": \"1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 0\"}]}", "16 numbers");
    BAD("{\"data\": [], \"apsm\": [1]}", "apsm must be an object");
    BAD("{\"data\": [], \"apsm\": {\"alpha\": [1]}}", "apsm.alpha must be a string");
    char path[TEST_PATH];
    apsm_project p;
    put(state, "bad.xlsx", "PK", path);
    assert_int_equal(apsm_project_read(ctx, path, &p), APSM_ERR_FORMAT);
    assert_non_null(strstr(apsm_error_text(ctx), "bad.xlsx: is no .xlsx"));
    assert_int_equal(apsm_project_read(ctx, folder_path(state, "none", path), &p), APSM_ERR_IO);
}

static void texts_that_are_not_utf8_are_not_written(void **state)
{
    char path[TEST_PATH];
    apsm_project p;
    assert_int_equal(apsm_project_init(ctx, *state, &p), APSM_OK);
    assert_int_equal(apsm_project_add(&p, "a", "b\xff.ply", NULL), APSM_OK);
    folder_path(state, "x.swproj", path);
    assert_int_equal(apsm_project_write(ctx, path, &p), APSM_ERR_ARG);
    assert_non_null(strstr(apsm_error_text(ctx), "UTF-8"));
    assert_int_equal(folder_count(*state), 0);
    apsm_project_free(&p);
}

static void a_moved_project_reaches_the_same_files(void **state)
{
    char folder[TEST_PATH];
    apsm_project p = read_text(state, shapeworks);
    assert_int_equal(apsm_make_folder(ctx, folder_path(state, "deep/model", folder)), APSM_OK);
    assert_int_equal(apsm_text_set(&p.subjects[1].shape, "/abs/x.ply"), APSM_OK);
    assert_int_equal(apsm_project_rebase(&p, folder), APSM_OK);
    assert_string_equal(p.subjects[0].shape, "../../ellipsoid_00.vtk");
    assert_string_equal(p.subjects[0].local_particles,
                        "../../p/ellipsoid_00_groomed_local.particles");
    assert_string_equal(apsm_subject_column(&p.subjects[0], "landmarks_file_1"),
                        "../../marks/ellipsoid_00.csv");
    assert_string_equal(apsm_subject_column(&p.subjects[0], "fixed"), "yes");
    assert_string_equal(p.subjects[1].shape, "/abs/x.ply");
    char *path = apsm_project_path(&p, p.subjects[0].shape), *back;
    back = apsm_path_relative(*state, path);
    assert_string_equal(back, "ellipsoid_00.vtk");
    free(path);
    free(back);
    apsm_project_free(&p);
}

static void note(void *user, const char *line)
{
    char *lines = user;
    strncat(lines, line, 4000 - strlen(lines));
    strncat(lines, "\n", 4000 - strlen(lines));
}

static void every_problem_of_a_project_is_one_line(void **state)
{
    char lines[4096] = "";
    apsm_project p = read_text(
        state,
        "{\"data\": ["
        "{\"name\": \"a\", \"shape_1\": \"a.ply\", \"local_particles_1\": \"a.particles\"},"
        "{\"name\": \"b\", \"shape_1\": \"none.ply\", \"local_particles_1\": \"b.particles\"},"
        "{\"name\": \"c\", \"shape_1\": \"a.ply\", \"local_particles_1\": \"c.particles\","
        " \"alignment_1\": \"1 1 0 0 0 1 0 0 0 0 1 0 0 0 0 1\"}, {\"name\": \"d\"}]}");
    folder_put(state, "a.ply", "", 0);
    folder_put(state, "a.particles", "1 2 3\n4 5 6\n", 12);
    folder_put(state, "b.particles", "1 2 3\n", 6);
    folder_put(state, "c.particles", "1 2\n", 4);
    assert_int_equal(apsm_project_check(ctx, &p, note, lines), 6);
    const char *const expected[] = { "b: shape_1: ",
                                     "none.ply does not exist",
                                     "b: has 1 local particles where a has 2",
                                     "c: local particles: ",
                                     "c.particles:1: fewer than three",
                                     "c: its alignment is no rigid motion",
                                     "d: names no file",
                                     "only 3 of 4 shapes have particles" };
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
        if (!strstr(lines, expected[i])) fail_msg("no '%s' in:\n%s", expected[i], lines);
    apsm_project_free(&p);

    p = read_text(state, "{\"data\": [{\"name\": \"a\", \"shape_1\": \"a.ply\", "
                         "\"alignment_1\": \"0 -2 0 5 2 0 0 0 0 0 2 0 0 0 0 1\", "
                         "\"local_particles_1\": \"a.particles\"}]}");
    assert_int_equal(apsm_project_check(ctx, &p, note, lines), 0);
    apsm_project_free(&p);
    p = read_text(state, "{\"data\": [{\"name\": \"a\", \"shape_1\": \"a.ply\", "
                         "\"world_particles_1\": \"a.ply.vtk\"}]}");
    lines[0] = '\0';
    assert_int_equal(apsm_project_check(ctx, &p, note, lines), 1);
    assert_non_null(strstr(lines, "a.ply.vtk does not exist"));
    apsm_project_free(&p);
    assert_int_equal(apsm_project_init(ctx, *state, &p), APSM_OK);
    assert_int_equal(apsm_project_check(ctx, &p, note, lines), 1);
    apsm_project_free(&p);
}

static void add_particles(apsm_project *p)
{
    assert_int_equal(apsm_text_set(&p->subjects[0].local_particles, "l"), APSM_OK);
    assert_int_equal(apsm_text_set(&p->subjects[0].world_particles, "w"), APSM_OK);
}

/* A run that was interrupted reads the project again before it adds columns. */
static void reading_between_two_steps_leaves_no_trace(void **state)
{
    apsm_project p;
    apsm_subject *s;
    assert_int_equal(apsm_project_init(ctx, *state, &p), APSM_OK);
    assert_int_equal(apsm_project_add(&p, "a", "in/a.ply", &s), APSM_OK);
    s->has_alignment = s->has_procrustes = s->mirrored = true;
    assert_int_equal(apsm_text_set(&s->groomed, "g"), APSM_OK);
    assert_int_equal(apsm_subject_set_column(s, "reflection", "r"), APSM_OK);
    char *between = write_text(state, &p);
    apsm_project q = read_text(state, between);
    add_particles(&p);
    add_particles(&q);
    char *whole = write_text(state, &p), *resumed = write_text(state, &q);
    assert_string_equal(whole, resumed);
    assert_true(strstr(whole, "\"groomed_1\"") < strstr(whole, "\"local_particles_1\""));
    assert_true(strstr(whole, "\"world_particles_1\"") < strstr(whole, "\"alignment_1\""));
    free(between);
    free(whole);
    free(resumed);
    apsm_project_free(&p);
    apsm_project_free(&q);
}

/* The bytes of the file at path; static. */
static const char *bytes_of(const char *path)
{
    static char text[8192];
    char *data;
    size_t size;
    assert_int_equal(apsm_read_file(ctx, path, sizeof text - 1, &data, &size), APSM_OK);
    memcpy(text, data, size);
    text[size] = '\0';
    free(data);
    return text;
}

static void excluded_shapes_are_set_aside_and_written_in_their_place(void **state)
{
    char path[TEST_PATH], again[TEST_PATH];
    apsm_project p;
    put(state, "p.swproj",
        "{\"data\": [{\"name\": \"a\", \"shape_1\": \"a.ply\", \"excluded\": \"Yes\", "
        "\"note\": \"n\"}, {\"name\": \"b\", \"shape_1\": \"b.ply\", \"excluded\": \"no\"}, "
        "{\"name\": \"c\", \"shape_1\": \"c.ply\", \"excluded\": true}, "
        "{\"name\": \"d\", \"shape_1\": \"d.ply\", \"excluded\": \"1\"}]}",
        path);
    assert_int_equal(apsm_project_read(ctx, path, &p), APSM_OK);
    assert_int_equal(p.n, 1);
    assert_string_equal(p.subjects[0].name, "b");
    assert_int_equal(apsm_project_write(ctx, folder_path(state, "q.swproj", again), &p), APSM_OK);
    const char *text = bytes_of(again), *at[4];
    static const char *const names[] = { "\"a\"", "\"b\"", "\"c\"", "\"d\"" };
    for (int k = 0; k < 4; k++) {
        at[k] = strstr(text, names[k]);
        assert_non_null(at[k]);
        assert_true(k == 0 || at[k] > at[k - 1]);
    }
    assert_non_null(strstr(text, "\"note\": \"n\""));
    char sub[TEST_PATH];
    assert_int_equal(apsm_project_rebase(&p, folder_path(state, "sub", sub)), APSM_OK);
    assert_int_equal(apsm_project_write(ctx, again, &p), APSM_OK);
    assert_non_null(strstr(bytes_of(again), "\"../c.ply\""));
    apsm_project_free(&p);
}

/* ShapeWorks grooms anew and keeps our columns: its mesh is no mirror image. */
static void a_mirrored_of_another_mesh_is_forgotten(void **state)
{
    char path[TEST_PATH], text[1024];
    static const char *const groomed[] = { "groomed/a.ply", "x/groomed/a.ply",
                                           "groomed/a_groomed.vtk", "groomed/ba.ply" };
    for (int k = 0; k < 4; k++) {
        apsm_project p;
        snprintf(text, sizeof text,
                 "{\"data\": [{\"name\": \"a\", \"shape_1\": \"a.ply\", \"groomed_1\": \"%s\", "
                 "\"mirrored\": \"yes\", \"reflection\": \"-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\"}]}",
                 groomed[k]);
        put(state, "p.swproj", text, path);
        assert_int_equal(apsm_project_read(ctx, path, &p), APSM_OK);
        assert_int_equal(p.subjects[0].mirrored, k < 2);
        assert_int_equal(apsm_subject_column(&p.subjects[0], "reflection") != NULL, k < 2);
        apsm_project_free(&p);
    }
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(a_project_of_shapeworks_is_understood),
        TEST(an_unchanged_project_is_written_as_it_was),
        TEST(changes_are_written_and_the_rest_is_kept),
        TEST(a_new_project_has_shapeworks_layout),
        TEST(other_columns_and_hand_written_values_are_taken),
        TEST(names_become_unique_and_safe),
        TEST(broken_projects_are_refused_with_the_place),
        TEST(texts_that_are_not_utf8_are_not_written),
        TEST(a_moved_project_reaches_the_same_files),
        TEST(every_problem_of_a_project_is_one_line),
        TEST(reading_between_two_steps_leaves_no_trace),
        TEST(excluded_shapes_are_set_aside_and_written_in_their_place),
        TEST(a_mirrored_of_another_mesh_is_forgotten),
    };
    ctx = apsm_context_new();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
