/* Particles and projects go around: from every format to every other and on, what comes out is what
 * went in.  Only the text files of ShapeWorks round, to nine digits, and only once. */
#include "cmocka_all.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "apsm/particles.h"
#include "core/random.h"
#include "files/files.h"
#include "files/project.h"
#include "folder.h"

static const char *const extensions[] = { ".particles", ".lpts",     ".wpts", ".csv",
                                          ".npy",       ".mrk.json", ".vtk",  ".vtp" };
enum { FORMATS = sizeof extensions / sizeof *extensions, TEXTS = 3, SETS = 3 };

static void ok(apsm_context *ctx, apsm_status status)
{
    if (status != APSM_OK) fail_msg("%s: %s", apsm_status_text(status), apsm_error_text(ctx));
}

/* Shapes near the origin and far from it, tiny and huge, with whole numbers among them. */
static double *random_particles(apsm_random *random, size_t n)
{
    double *P = malloc(3 * n * sizeof *P);
    const double size = pow(10, 12 * apsm_random_uniform(random) - 6);
    const double away = apsm_random_uniform(random) < 0.5 ? 0 : 1e4 * size;
    for (size_t k = 0; k < 3 * n; k++) {
        P[k] = away + size * apsm_random_normal(random);
        if (apsm_random_uniform(random) < 0.1) P[k] = rint(P[k]);
    }
    return P;
}

static double *pass(apsm_context *ctx, void **state, const char *extension, size_t n,
                    const double *P)
{
    char path[TEST_PATH], name[32];
    size_t found;
    double *Q;
    snprintf(name, sizeof name, "p%s", extension);
    ok(ctx, apsm_points_write(ctx, folder_path(state, name, path), n, P));
    ok(ctx, apsm_points_read(ctx, path, &found, &Q));
    assert_int_equal(found, n);
    return Q;
}

static void every_pair_of_formats(void **state)
{
    apsm_context *ctx = apsm_context_new();
    apsm_random random = apsm_random_stream(11, APSM_STREAM_TEST, 0, 0);
    for (size_t a = 0; a < FORMATS; a++)
        for (size_t b = 0; b < FORMATS; b++)
            for (int set = 0; set < SETS; set++) {
                const size_t n = 1 + (size_t)apsm_random_below(&random, 90);
                double *P = random_particles(&random, n);
                double *Q = pass(ctx, state, extensions[a], n, P);
                double *R = pass(ctx, state, extensions[b], n, Q);
                double *S = pass(ctx, state, extensions[a], n, R);
                const bool rounds = a < TEXTS || b < TEXTS;
                for (size_t k = 0; k < 3 * n; k++)
                    if (!(fabs(R[k] - P[k]) <= (rounds ? 5e-9 * fabs(P[k]) : 0)))
                        fail_msg("%s to %s: %.17g became %.17g", extensions[a], extensions[b], P[k],
                                 R[k]);
                assert_memory_equal(a < TEXTS ? Q : R, S, 3 * n * sizeof *S); /* rounded once */
                free(P);
                free(Q);
                free(R);
                free(S);
            }
    apsm_context_free(ctx);
}

/* Six digits, as C++ writes them, and nine, as we do: both are read to the digit. */
static void six_and_nine_digits(void **state)
{
    apsm_context *ctx = apsm_context_new();
    apsm_random random = apsm_random_stream(12, APSM_STREAM_TEST, 0, 0);
    char path[TEST_PATH];
    for (int digits = 6; digits <= 9; digits += 3)
        for (int set = 0; set < 20; set++) {
            const size_t n = 2 + (size_t)apsm_random_below(&random, 60);
            double *P = random_particles(&random, n), *Q;
            size_t found;
            FILE *out = fopen(folder_path(state, "p.particles", path), "w");
            for (size_t k = 0; k < 3 * n; k++)
                fprintf(out, k % 3 == 2 ? "%.*g \n" : "%.*g ", digits, P[k]);
            fclose(out);
            ok(ctx, apsm_points_read(ctx, path, &found, &Q));
            assert_int_equal(found, n);
            for (size_t k = 0; k < 3 * n; k++) {
                char text[32];
                snprintf(text, sizeof text, "%.*g", digits, P[k]);
                assert_true(Q[k] == strtod(text, NULL));
            }
            free(P);
            free(Q);
        }
    apsm_context_free(ctx);
}

/* ---- Projects ---- */

static void set_random(apsm_random *random, double M[16], bool *has)
{
    *has = apsm_random_uniform(random) < 0.7;
    for (size_t k = 0; k < 12 && *has; k++) M[k] = 10 * apsm_random_normal(random);
}

static void fill_project(apsm_context *ctx, apsm_random *random, const char *folder,
                         apsm_project *project)
{
    char text[64];
    ok(ctx, apsm_project_init(ctx, folder, project));
    const size_t n = 1 + (size_t)apsm_random_below(random, 12);
    for (size_t i = 0; i < n; i++) {
        apsm_subject *s;
        snprintf(text, sizeof text, "s %zu \xc3\xa9&\"<", i);
        ok(ctx, apsm_project_add(project, text, i % 3 ? "in/a b.ply" : "../c.nrrd", &s));
        snprintf(text, sizeof text, "particles/%zu_world.particles", i);
        ok(ctx, apsm_text_set(&s->world_particles, text));
        if (i % 2) ok(ctx, apsm_text_set(&s->groomed, "groomed/g.ply"));
        set_random(random, s->alignment, &s->has_alignment);
        set_random(random, s->procrustes, &s->has_procrustes);
        s->mirrored = apsm_random_uniform(random) < 0.3;
        snprintf(text, sizeof text, "%.17g", apsm_random_normal(random));
        ok(ctx, apsm_subject_set_column(s, i % 2 ? "group_age" : "unknown column", text));
    }
    ok(ctx, apsm_project_set(project, "optimize", "number_of_particles", "64"));
    ok(ctx, apsm_project_set(project, "apsm", "alpha", "0.1"));
    ok(ctx, apsm_project_set(project, "yours", "key", "kept, also = signs"));
}

static bool same_text(const char *a, const char *b)
{
    return (!a && !b) || (a && b && strcmp(a, b) == 0);
}

static void compare(const apsm_project *a, const apsm_project *b)
{
    static const char *const groups[][2] = { { "optimize", "number_of_particles" },
                                             { "apsm", "alpha" },
                                             { "yours", "key" },
                                             { "project", "version" } };
    static const char *const columns[] = { "group_age", "unknown column" };
    assert_int_equal(a->n, b->n);
    for (size_t i = 0; i < a->n; i++) {
        const apsm_subject *s = &a->subjects[i], *t = &b->subjects[i];
        assert_true(same_text(s->name, t->name) && same_text(s->shape, t->shape));
        assert_true(same_text(s->groomed, t->groomed));
        assert_true(same_text(s->world_particles, t->world_particles));
        assert_true(s->mirrored == t->mirrored && s->has_alignment == t->has_alignment);
        assert_memory_equal(s->alignment, t->alignment, sizeof s->alignment);
        assert_memory_equal(s->procrustes, t->procrustes, sizeof s->procrustes);
        for (size_t k = 0; k < 2; k++)
            assert_true(
                same_text(apsm_subject_column(s, columns[k]), apsm_subject_column(t, columns[k])));
    }
    for (size_t k = 0; k < 4; k++)
        assert_true(same_text(apsm_project_get(a, groups[k][0], groups[k][1]),
                              apsm_project_get(b, groups[k][0], groups[k][1])));
}

/* Every value of a .swproj is a string, and the file ends with a newline. */
static void check_text(apsm_context *ctx, const char *path)
{
    char *data;
    size_t size;
    ok(ctx, apsm_read_file(ctx, path, 1 << 24, &data, &size));
    assert_true(data[size - 1] == '\n');
    for (size_t k = 0; k + 2 < size; k++)
        if (data[k] == '"' && data[k + 1] == ':') assert_true(strchr("\"{[", data[k + 3]));
    free(data);
}

static void projects_go_around(void **state)
{
    static const char *const names[] = { "a.swproj", "b.xlsx", "c.swproj", "D.XLSX" };
    apsm_context *ctx = apsm_context_new();
    apsm_random random = apsm_random_stream(13, APSM_STREAM_TEST, 0, 0);
    for (int trial = 0; trial < 20; trial++) {
        apsm_project first, now, next;
        char path[TEST_PATH];
        fill_project(ctx, &random, *state, &first);
        for (size_t k = 0; k < 4; k++) {
            ok(ctx, apsm_project_write(ctx, folder_path(state, names[k], path), k ? &now : &first));
            if (k % 2 == 0) check_text(ctx, path);
            ok(ctx, apsm_project_read(ctx, path, &next));
            compare(&first, &next);
            if (k) apsm_project_free(&now);
            now = next;
        }
        apsm_project_free(&now);
        apsm_project_free(&first);
    }
    apsm_context_free(ctx);
}

int main(void)
{
#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        IN_FOLDER(every_pair_of_formats),
        IN_FOLDER(six_and_nine_digits),
        IN_FOLDER(projects_go_around),
    };
    return cmocka_run_group_tests_name("formats", tests, NULL, NULL);
}
