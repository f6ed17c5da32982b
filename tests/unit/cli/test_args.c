/* The command line: what is understood, what is refused, and with which words. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdio.h>
#include <string.h>

#include "args.h"
#include "folder.h"
#include "help.h"
#include "options/options.h"

static apsm_context *ctx;

/* Parses a line of words separated by single spaces. */
static apsm_status parse(const char *line, cli_args *args)
{
    static char text[2048], *words[64];
    int n = 0;
    snprintf(text, sizeof text, "apsm %s", line);
    for (char *word = strtok(text, " "); word; word = strtok(NULL, " ")) words[n++] = word;
    words[n] = NULL;
    return cli_args_parse(ctx, n, words, args);
}

static cli_args understood(const char *line)
{
    cli_args args;
    if (parse(line, &args) != APSM_OK) fail_msg("%s: %s", line, apsm_error_text(ctx));
    return args;
}

static void expect_pair(const cli_args *args, const char *key, const char *value)
{
    const char *found = cli_args_get(args, key);
    if (!found || strcmp(found, value) != 0)
        fail_msg("%s is %s, not %s", key, found ? found : "not set", value);
}

static void a_whole_command_is_understood(void **state)
{
    (void)state;
    cli_args a =
        understood("run a.ply dir -o model -J 64 --adaptivity 0.25 --stage1-epochs=7 "
                   "--no-remesh --set align=similarity --set decay1-at=0.5 --label 1,2 "
                   "--reflect-match _L_ --exclude ^x --template t --seed 18446744073709551615 "
                   "--threads 3 --memory 1.5G --progress json --resume b.ply");
    assert_int_equal(a.verb->verb, CLI_RUN);
    assert_int_equal(a.n_inputs, 3);
    assert_string_equal(a.inputs[0], "a.ply");
    assert_string_equal(a.inputs[2], "b.ply");
    assert_string_equal(a.out_dir, "model");
    assert_int_equal(a.threads, 3);
    assert_int_equal(a.memory, (size_t)3 << 29);
    assert_int_equal(a.progress, CLI_PROGRESS_JSON);
    assert_true(a.resume && !a.overwrite && !a.dry_run && !a.quiet);
    assert_int_equal(a.n_set, 11);
    expect_pair(&a, "particles", "64");
    expect_pair(&a, "adaptivity", "0.25");
    expect_pair(&a, "stage1_epochs", "7");
    expect_pair(&a, "remesh", "false");
    expect_pair(&a, "align", "similarity");
    expect_pair(&a, "decay1_at", "0.5");
    expect_pair(&a, "labels", "1,2");
    expect_pair(&a, "reflect_match", "_L_");
    expect_pair(&a, "exclude", "^x");
    expect_pair(&a, "template", "t");
    expect_pair(&a, "seed", "18446744073709551615");
    cli_args_free(&a);
}

/* --method sets other options: those that are given as well stay, whatever the order. */
static void the_method_comes_first(void **state)
{
    (void)state;
    cli_args a = understood("run x -o m --gamma 0.3 --stage1-epochs 9 --method xu2023");
    apsm_options o = apsm_options_defaults();
    for (size_t i = 0; i < a.n_set; i++)
        assert_int_equal(apsm_options_set(ctx, &o, a.set[i].key, a.set[i].value), APSM_OK);
    assert_int_equal(o.optimize.method, APSM_METHOD_XU2023);
    assert_int_equal(o.optimize.schedule.stage1_epochs, 9);
    assert_int_equal(o.optimize.schedule.stage2_epochs, 50);
    assert_true(o.optimize.schedule.gamma > 0.29 && o.optimize.schedule.gamma < 0.31);
    cli_args_free(&a);
}

static void short_and_long_forms_are_the_same(void **state)
{
    (void)state;
    const char *const lines[] = { "groom x -om -J64 -q", "groom x --out m --particles 64 --quiet",
                                  "groom -q --out=m --particles=64 x", "groom -o m -q -J 64 -- x" };
    for (size_t i = 0; i < 4; i++) {
        cli_args a = understood(lines[i]);
        assert_string_equal(a.out_dir, "m");
        assert_true(a.quiet && a.n_inputs == 1 && a.n_set == 1);
        assert_string_equal(a.inputs[0], "x");
        expect_pair(&a, "particles", "64");
        cli_args_free(&a);
    }
}

static void steps_take_their_folder_either_way(void **state)
{
    (void)state;
    const char *const lines[] = { "optimize m", "optimize -o m", "optimize m -o m",
                                  "evaluate m --definition paper", "initialize -o m" };
    for (size_t i = 0; i < 5; i++) {
        cli_args a = understood(lines[i]);
        assert_string_equal(a.out_dir, "m");
        assert_int_equal(a.n_inputs, 0);
        cli_args_free(&a);
    }
}

static void help_and_version_need_nothing_else(void **state)
{
    (void)state;
    const char *const lines[] = {
        "--help", "-h", "help", "run --help", "help run", "run -h", "run -J 64 --help-all"
    };
    for (size_t i = 0; i < 7; i++) {
        cli_args a = understood(lines[i]);
        assert_true(a.help);
        assert_true((i >= 3) == (a.verb != NULL));
        assert_true(a.help_all == (i == 6));
        cli_args_free(&a);
    }
    cli_args a = understood("--version");
    assert_true(a.version && !a.help);
    cli_args_free(&a);
}

static void mistakes_are_named_with_the_remedy(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        { "", "apsm --help" },
        { "optimise m", "the nearest is 'optimize'" },
        { "-o m run", "the verb comes first" },
        { "run", "apsm run INPUT... -o MODEL_DIR" },
        { "run x", "needs a model folder" },
        { "run -o /nonexistent/m", "no inputs" },
        { "groom -o /nonexistent/m", "no inputs" },
        { "optimize", "needs a model folder" },
        { "optimize a b", "one model folder" },
        { "optimize a -o b", "given twice" },
        { "check", "needs something to look at" },
        { "info", "needs something to look at" },
        { "info a b", "info takes 1 operand, not 2" },
        { "run x -o m --partcles 3", "unknown option --partcles; the nearest is --particles" },
        { "run x -o m --particle 3", "the nearest is --particles" },
        { "run x -o m --adapt 1", "the nearest is --adaptivity" },
        { "run x -o m -Z", "unknown option -Z" },
        { "run x -o m -J", "--particles needs an argument" },
        { "run x -o m --seed", "--seed needs an argument" },
        { "run x -o --seed 3", "--out needs an argument, but --seed follows" },
        { "run x -o m --resume=yes", "--resume takes no argument" },
        { "run x -o m --out=", "--out is empty" },
        { "run x -o m -o n", "--out is given twice, as m and as n" },
        { "run x -o m -J 2", "particles = 2" },
        { "run x -o m -J 64x", "particles = 64x" },
        { "run x -o m --adaptivity 1,5", "adaptivity = 1,5" },
        { "run x -o m --align none-at-all", "rigid|similarity|none" },
        { "run x -o m --set", "--set needs an argument" },
        { "run x -o m --set alpha", "give KEY=VALUE" },
        { "run x -o m --set =3", "give KEY=VALUE" },
        { "run x -o m --set alhpa=3", "unknown option 'alhpa'; the nearest is 'alpha'" },
        { "run x -o m --set alpha=3 --alpha 4", "alpha is given twice, as 3 and as 4" },
        { "run x -o m --remesh --no-remesh", "remesh is given twice" },
        { "run x -o m --exclude a --exclude b", "exclude is given twice" },
        { "run x -o m --exclude [a", "exclude = [a" },
        { "run x -o m --reflect-match (", "regular expression" },
        { "run x -o m --seed -1", "seed = -1" },
        { "run x -o m --seed 18446744073709551616", "seed = " },
        { "run x -o m --label 1;2", "1;2" },
        { "run x -o m --threads 0", "--threads 0" },
        { "run x -o m --memory 2", "--memory 2: give a number with a unit" },
        { "run x -o m --memory 2X", "--memory 2X" },
        { "run x -o m --memory 2GX", "--memory 2GX" },
        { "run x -o m --memory G", "--memory G" },
        { "run x -o m --memory -2G", "--memory -2G" },
        { "run x -o m --memory nanG", "--memory nanG" },
        { "run x -o m --memory 63M", "64M at least" },
        { "check x --memory 2G", "--memory does not belong to 'check'" },
        { "run x -o m --threads many", "--threads many" },
        { "run x -o m --progress bar", "auto, plain or json" },
        { "run x -o m --preset none", "unknown preset" },
        { "run x -o m --resume --overwrite", "contradict" },
        { "run x -o m --quiet --progress plain", "contradict" },
        { "optimize m --label 1", "--label does not belong to 'optimize'" },
        { "check x -o m", "--out does not belong to 'check'" },
        { "info m -J 3", "--particles does not belong to 'info'" },
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        cli_args a;
        const apsm_status status = parse(cases[i][0], &a);
        if (status != APSM_ERR_ARG) fail_msg("'%s' gave status %d", cases[i][0], (int)status);
        if (!strstr(apsm_error_text(ctx), cases[i][1]))
            fail_msg("'%s' gave '%s'", cases[i][0], apsm_error_text(ctx));
        cli_args_free(&a);
    }
}

static void the_same_value_twice_is_no_contradiction(void **state)
{
    (void)state;
    cli_args a = understood("run x -o m -o m --alpha 3 --set alpha=3 --resume --resume");
    assert_int_equal(a.n_set, 1);
    cli_args_free(&a);
}

static void put(void **state, const char *text, char line[1500], const char *rest)
{
    char path[TEST_PATH];
    folder_put(state, "c.json", text, strlen(text));
    snprintf(line, 1500, "run x -o m --config %s %s", folder_path(state, "c.json", path), rest);
}

/* Preset first, then the file, then the command line: what comes later wins. */
static void priorities_are_preset_file_options(void **state)
{
    char line[1500];
    put(state, "{\"particles\": 99, \"alpha\": 0.1, \"remesh\": false, \"align\": \"none\"}", line,
        "--alpha 4 --preset paper-literal-hip");
    cli_args a = understood(line);
    assert_int_equal(a.n_set, 5);
    assert_string_equal(a.set[0].key, "preset");
    expect_pair(&a, "particles", "99");
    expect_pair(&a, "alpha", "4");
    expect_pair(&a, "remesh", "false");
    cli_args_free(&a);
    put(state, "{\"alpha\": 0.1, \"preset\": \"default\"}", line, "");
    a = understood(line);
    assert_string_equal(a.set[0].key, "preset");
    expect_pair(&a, "alpha", "0.1");
    cli_args_free(&a);
    put(state,
        "{\"format\": \"apsm-manifest\", \"version\": 1, \"options\": {\"version\": "
        "\"0.1.0\", \"template_used\": \"x\", \"seed\": \"5\", \"particles\": \"70\"}}",
        line, "");
    a = understood(line);
    assert_int_equal(a.n_set, 2);
    expect_pair(&a, "seed", "5");
    cli_args_free(&a);
}

static void mistakes_in_a_configuration_name_the_file(void **state)
{
    static const char *const cases[][2] = {
        { "{\"particles\": 1}", "c.json: option particles = 1" },
        { "{\"partciles\": 100}",
          "c.json: unknown option 'partciles'; the nearest is 'particles'" },
        { "{\"alpha\": [1]}", "c.json: alpha must be" },
        { "{\"alpha\": null}", "c.json: alpha must be" },
        { "[1]", "c.json: holds no options" },
        { "{\"alpha\": 1,}", "c.json:1:" },
        { "{\"exclude\": \"(\"}", "c.json: exclude = (" },
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char line[1500];
        cli_args a;
        put(state, cases[i][0], line, "");
        assert_int_not_equal(parse(line, &a), APSM_OK);
        if (!strstr(apsm_error_text(ctx), cases[i][1]))
            fail_msg("'%s' gave '%s'", cases[i][0], apsm_error_text(ctx));
        cli_args_free(&a);
    }
    cli_args a;
    assert_int_equal(parse("run x -o m --config /nonexistent.json", &a), APSM_ERR_IO);
    cli_args_free(&a);
}

/* Every line of every help fits in 80 columns, and every option is explained once. */
static void help_fits_80_columns(void **state)
{
    char path[TEST_PATH], line[1000];
    size_t n;
    const cli_verb_info *verbs = cli_verbs(&n);
    for (size_t i = 0; i <= n; i++)
        for (int all = 0; all < 2; all++) {
            FILE *file = fopen(folder_path(state, "help", path), "w+");
            int lines = 0;
            cli_help(file, i < n ? &verbs[i] : NULL, all);
            rewind(file);
            for (; fgets(line, sizeof line, file); lines++)
                if (strlen(line) > 80) fail_msg("%zu characters: %s", strlen(line), line);
            assert_true(lines > 10);
            fclose(file);
        }
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_whole_command_is_understood),
        cmocka_unit_test(the_method_comes_first),
        cmocka_unit_test(short_and_long_forms_are_the_same),
        cmocka_unit_test(steps_take_their_folder_either_way),
        cmocka_unit_test(help_and_version_need_nothing_else),
        cmocka_unit_test(mistakes_are_named_with_the_remedy),
        cmocka_unit_test(the_same_value_twice_is_no_contradiction),
        TEST(priorities_are_preset_file_options),
        TEST(mistakes_in_a_configuration_name_the_file),
        TEST(help_fits_80_columns),
    };
    ctx = apsm_context_new();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    apsm_context_free(ctx);
    return failed;
}
