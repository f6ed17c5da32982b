/* What the program says, with a clock that the test turns. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ui.h"

static double now;
static double test_clock(void)
{
    return now;
}

/* A ui that writes to memory. */
typedef struct stage {
    char *out, *err;
    size_t out_size, err_size;
    FILE *out_file, *err_file;
    cli_ui *ui;
} stage;

static void begin(stage *s, cli_progress_mode mode, bool quiet)
{
    now = 100;
    s->out_file = open_memstream(&s->out, &s->out_size);
    s->err_file = open_memstream(&s->err, &s->err_size);
    s->ui = cli_ui_new(mode, quiet, s->out_file, s->err_file, test_clock);
}

static void end(stage *s)
{
    cli_ui_free(s->ui);
    fclose(s->out_file);
    fclose(s->err_file);
}

static void release(stage *s)
{
    free(s->out);
    free(s->err);
}

static void report(stage *s, size_t done, double loss, double mismatched)
{
    const apsm_progress p = { "stage 1", done, 100, { loss, NAN, NAN }, mismatched };
    cli_ui_progress(s->ui, &p);
}

/* A memory stream is no terminal: a line every five seconds, and one at the end. */
static void plain_lines_come_now_and_then(void **state)
{
    (void)state;
    stage s;
    begin(&s, CLI_PROGRESS_AUTO, false);
    for (size_t k = 0; k <= 100; k++, now += 0.125) report(&s, k, 0.25, k == 30 ? 0.125 : NAN);
    cli_ui_log(s.ui, APSM_LOG_INFO, "a message");
    cli_ui_log(s.ui, APSM_LOG_WARNING, "careful");
    end(&s);
    assert_string_equal(s.err, "stage 1: 40/100  8 s left  mismatched 12.5 %  sampl. 0.25\n"
                               "stage 1: 80/100  3 s left  mismatched 12.5 %  sampl. 0.25\n"
                               "stage 1: 100/100  in 13 s  mismatched 12.5 %  sampl. 0.25\n"
                               "warning: careful\n");
    assert_string_equal(s.out, "a message\n");
    release(&s);
}

static void short_stages_leave_no_line(void **state)
{
    (void)state;
    stage s;
    begin(&s, CLI_PROGRESS_PLAIN, false);
    for (size_t k = 0; k <= 100; k++, now += 0.0078125) report(&s, k, NAN, NAN);
    end(&s);
    assert_string_equal(s.err, "");
    release(&s);
}

static void long_times_are_readable(void **state)
{
    (void)state;
    stage s;
    begin(&s, CLI_PROGRESS_PLAIN, false);
    report(&s, 10, NAN, NAN);
    now += 60;
    report(&s, 20, NAN, NAN);
    now += 6000;
    report(&s, 30, NAN, NAN);
    end(&s);
    assert_string_equal(s.err, "stage 1: 20/100  8:00 min left\n"
                               "stage 1: 30/100  5:53 h left\n");
    release(&s);
}

static void every_json_line_is_an_object(void **state)
{
    (void)state;
    stage s;
    begin(&s, CLI_PROGRESS_JSON, false);
    report(&s, 0, NAN, NAN);
    now += 1;
    report(&s, 1, 0.5, 0.25);
    cli_ui_log(s.ui, APSM_LOG_WARNING, "say \"ah\"\nand \xff");
    cli_ui_log(s.ui, APSM_LOG_INFO, "done");
    cli_say(s.ui, "n = %d", 3);
    cli_error(s.ui, APSM_ERR_IO, "no disk");
    end(&s);
    json_t *line[8];
    size_t n = 0;
    for (char *at = strtok(s.out, "\n"); at; at = strtok(NULL, "\n"))
        if (!(line[n++] = json_loads(at, 0, NULL))) fail_msg("no JSON: %s", at);
    assert_int_equal(n, 6);
    static const char *const events[] = { "progress", "progress", "warning",
                                          "message",  "result",   "error" };
    for (size_t i = 0; i < n; i++)
        assert_string_equal(json_string_value(json_object_get(line[i], "event")), events[i]);
    assert_true(json_is_null(json_object_get(line[0], "sampling")));
    assert_true(json_real_value(json_object_get(line[1], "sampling")) == 0.5);
    assert_true(json_real_value(json_object_get(line[1], "seconds_left")) == 99);
    assert_int_equal(json_integer_value(json_object_get(line[1], "total")), 100);
    assert_string_equal(json_string_value(json_object_get(line[5], "text")), "no disk");
    for (size_t i = 0; i < n; i++) json_decref(line[i]);
    assert_string_equal(s.err, "apsm: no disk\n");
    release(&s);
}

static void quiet_keeps_warnings_errors_and_answers(void **state)
{
    (void)state;
    stage s;
    begin(&s, CLI_PROGRESS_AUTO, true);
    report(&s, 1, 0.5, NAN);
    cli_ui_log(s.ui, APSM_LOG_INFO, "hidden");
    cli_ui_log(s.ui, APSM_LOG_WARNING, "seen");
    cli_say(s.ui, "answer");
    cli_error(s.ui, APSM_ERR_IO, "no disk");
    end(&s);
    assert_string_equal(s.out, "answer\n");
    assert_string_equal(s.err, "warning: seen\napsm: no disk\n");
    release(&s);
}

static void warnings_are_said_once_and_hidden_by_no_message(void **state)
{
    (void)state;
    stage s;
    begin(&s, CLI_PROGRESS_AUTO, false);
    cli_ui_log(s.ui, APSM_LOG_INFO, "a");
    for (int k = 0; k < 2; k++) {
        cli_ui_log(s.ui, APSM_LOG_WARNING, "a");
        cli_ui_log(s.ui, APSM_LOG_WARNING, "b");
    }
    char text[32];
    for (int k = 0; k < 200; k++) {
        snprintf(text, sizeof text, "%d", k);
        cli_ui_log(s.ui, APSM_LOG_WARNING, text);
    }
    end(&s);
    assert_string_equal(s.out, "a\n");
    assert_memory_equal(s.err, "warning: a\nwarning: b\nwarning: 0\n", 33);
    assert_non_null(strstr(s.err, "warning: 199\n"));
    release(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plain_lines_come_now_and_then),
        cmocka_unit_test(short_stages_leave_no_line),
        cmocka_unit_test(long_times_are_readable),
        cmocka_unit_test(every_json_line_is_an_object),
        cmocka_unit_test(quiet_keeps_warnings_errors_and_answers),
        cmocka_unit_test(warnings_are_said_once_and_hidden_by_no_message),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
