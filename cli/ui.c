/* Three ways to show progress: a bar that is redrawn in place, plain lines now and then, a JSON
 * object for every report.  The time left is that of the stage at its mean rate so far. */
#define _DEFAULT_SOURCE /* TIOCGWINSZ */
#include "ui.h"
#include "plain.h"

#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

typedef enum style { STYLE_BAR, STYLE_PLAIN, STYLE_JSON } style;

static const double redraw_seconds = 0.1, line_seconds = 5;

enum { MOST_SAID = 64 };

struct cli_ui {
    FILE *out, *err;
    style style;
    bool quiet;
    cli_clock_fn clock;
    const char *stage; /* that is under way, or NULL */
    apsm_progress last;
    double mismatched;   /* last known of the stage, or NAN */
    double began, shown; /* times of the stage's first report and of the last one shown */
    size_t done_at_start;
    bool drawn;            /* a bar stands on the last line */
    char *said[MOST_SAID]; /* the first warnings, n_said */
    size_t n_said;
};

double cli_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static style choose_style(cli_progress_mode mode, FILE *err)
{
    const char *terminal = getenv("TERM");
    if (mode == CLI_PROGRESS_JSON) return STYLE_JSON;
    if (mode == CLI_PROGRESS_PLAIN || !isatty(fileno(err))) return STYLE_PLAIN;
    return terminal && strcmp(terminal, "dumb") != 0 ? STYLE_BAR : STYLE_PLAIN;
}

cli_ui *cli_ui_new(cli_progress_mode mode, bool quiet, FILE *out, FILE *err, cli_clock_fn clock)
{
    cli_ui *ui = calloc(1, sizeof *ui);
    if (!ui) return NULL;
    ui->out = out;
    ui->err = err;
    ui->style = choose_style(mode, err);
    ui->quiet = quiet;
    ui->clock = clock;
    return ui;
}

void cli_ui_attach(cli_ui *ui, apsm_context *ctx)
{
    apsm_context_set_log(ctx, cli_ui_log, ui);
    apsm_context_set_progress(ctx, cli_ui_progress, ui);
}

/* ---- Text of a report ---- */

typedef struct buffer {
    char at[512];
    size_t used;
} buffer;

static void add(buffer *t, const char *format, ...) APSM_PRINTF(2, 3);
static void add(buffer *t, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    const int n = vsnprintf(t->at + t->used, sizeof t->at - t->used, format, args);
    va_end(args);
    if (n > 0)
        t->used += (size_t)n < sizeof t->at - t->used ? (size_t)n : sizeof t->at - t->used - 1;
}

static void add_time(buffer *t, double seconds)
{
    const long s = lround(seconds);
    if (s < 60)
        add(t, "%ld s", s);
    else if (s < 3600)
        add(t, "%ld:%02ld min", s / 60, s % 60);
    else
        add(t, "%ld:%02ld h", s / 3600, s / 60 % 60);
}

static void add_losses(const cli_ui *ui, buffer *t)
{
    static const char *const names[] = { "sampl.", "corres.", "eigen" };
    if (isfinite(ui->mismatched)) add(t, "  mismatched %.1f %%", 100 * ui->mismatched);
    for (int k = 0; k < 3; k++)
        if (isfinite(ui->last.loss[k])) add(t, "  %s %.3g", names[k], ui->last.loss[k]);
}

/* Seconds left, or NAN before there is a rate. */
static double time_left(const cli_ui *ui)
{
    const apsm_progress *p = &ui->last;
    const double elapsed = ui->clock() - ui->began;
    if (p->done <= ui->done_at_start || p->done >= p->total) return NAN;
    return elapsed * (double)(p->total - p->done) / (double)(p->done - ui->done_at_start);
}

static void add_times(const cli_ui *ui, buffer *t)
{
    const double left = time_left(ui);
    if (isfinite(left)) {
        add(t, "  ");
        add_time(t, left);
        add(t, " left");
    } else if (ui->last.done >= ui->last.total) {
        add(t, "  in ");
        add_time(t, ui->clock() - ui->began);
    }
}

/* ---- Bar ---- */

static int terminal_width(FILE *err)
{
    struct winsize size;
    return ioctl(fileno(err), TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

static void wipe_bar(cli_ui *ui)
{
    if (ui->drawn) fputs("\r\033[K", ui->err);
    ui->drawn = false;
}

static void draw_bar(cli_ui *ui)
{
    enum { NARROW = 8, WIDE = 20 };
    const apsm_progress *p = &ui->last;
    const int width = terminal_width(ui->err) - 1;
    const size_t cells = width < 100 ? NARROW : WIDE;
    const size_t full = p->total ? cells * p->done / p->total : 0;
    buffer t = { .used = 0 };
    add(&t, "%-9s [", p->stage);
    for (size_t i = 0; i < cells; i++) add(&t, "%c", i < full ? '#' : '.');
    add(&t, "] %zu/%zu", p->done, p->total);
    add_times(ui, &t);
    add_losses(ui, &t);
    wipe_bar(ui);
    fprintf(ui->err, "%.*s", width, t.at); /* the losses stand last: they may be cut off */
    fflush(ui->err);
    ui->drawn = true;
}

/* ---- Plain and JSON ---- */

static void print_line(const cli_ui *ui)
{
    const apsm_progress *p = &ui->last;
    buffer t = { .used = 0 };
    add(&t, "%s: %zu/%zu", p->stage, p->done, p->total);
    add_times(ui, &t);
    add_losses(ui, &t);
    fprintf(ui->err, "%s\n", t.at);
    fflush(ui->err);
}

/* One object a line; takes the reference. */
static void put_json(const cli_ui *ui, json_t *object)
{
    json_dumpf(object, ui->out, JSON_COMPACT | JSON_REAL_PRECISION(9));
    fputc('\n', ui->out);
    fflush(ui->out);
    json_decref(object);
}

static json_t *number_or_null(double x)
{
    return isfinite(x) ? json_real(x) : json_null();
}

/* File names need not be UTF-8, JSON must be: then '?' stands for what is not ASCII. */
static json_t *json_text(const char *line)
{
    json_t *text = json_string(line);
    if (text) return text;
    char copy[4096];
    snprintf(copy, sizeof copy, "%s", line);
    for (char *c = copy; *c; c++)
        if ((unsigned char)*c > 126) *c = '?';
    return json_string(copy);
}

static void print_json(const cli_ui *ui)
{
    const apsm_progress *p = &ui->last;
    put_json(ui, json_pack("{s:s, s:s, s:I, s:I, s:o, s:o, s:o, s:o, s:o, s:o}", "event",
                           "progress", "stage", p->stage, "done", (json_int_t)p->done, "total",
                           (json_int_t)p->total, "sampling", number_or_null(p->loss[0]),
                           "correspondence", number_or_null(p->loss[1]), "eigenshape",
                           number_or_null(p->loss[2]), "mismatched", number_or_null(p->mismatched),
                           "seconds", number_or_null(ui->clock() - ui->began), "seconds_left",
                           number_or_null(time_left(ui))));
}

/* ---- Sinks ---- */

/* Stages of less than a second are not worth a line. */
static bool was_short(const cli_ui *ui)
{
    return ui->clock() - ui->began < 1;
}

/* The bar of a stage stays on the screen when the next one begins. */
static void end_stage(cli_ui *ui)
{
    if (was_short(ui)) wipe_bar(ui);
    if (ui->drawn) fputc('\n', ui->err);
    ui->drawn = false;
    ui->stage = NULL;
}

static bool is_due(const cli_ui *ui, bool begins)
{
    const double since = ui->clock() - ui->shown;
    if (ui->style == STYLE_JSON) return true;
    if (ui->last.done >= ui->last.total) return ui->style != STYLE_PLAIN || !was_short(ui);
    if (ui->style == STYLE_PLAIN) return since >= line_seconds; /* short stages only at their end */
    return begins || since >= redraw_seconds;
}

void cli_ui_progress(void *user, const apsm_progress *p)
{
    cli_ui *ui = user;
    if (ui->quiet) return;
    const bool begins = !ui->stage || strcmp(ui->stage, p->stage) != 0 || p->done < ui->last.done;
    if (begins) {
        if (ui->stage) end_stage(ui);
        ui->stage = p->stage;
        ui->began = ui->shown = ui->clock();
        ui->done_at_start = p->done;
        ui->mismatched = NAN;
    }
    ui->last = *p;
    if (isfinite(p->mismatched)) ui->mismatched = p->mismatched;
    if (!is_due(ui, begins)) return;
    ui->shown = ui->clock();
    if (ui->style == STYLE_JSON)
        print_json(ui);
    else if (ui->style == STYLE_BAR)
        draw_bar(ui);
    else
        print_line(ui);
    if (p->done >= p->total) end_stage(ui);
}

/* Files that are read more than once are not warned of more than once. */
static bool is_said_again(cli_ui *ui, const char *warning)
{
    for (size_t k = 0; k < ui->n_said; k++)
        if (strcmp(ui->said[k], warning) == 0) return true;
    char *const copy = ui->n_said < MOST_SAID ? strdup(warning) : NULL;
    if (copy) ui->said[ui->n_said++] = copy; /* else it may be said again */
    return false;
}

void cli_ui_log(void *user, apsm_log_level level, const char *line)
{
    cli_ui *ui = user;
    const bool warning = level == APSM_LOG_WARNING, drawn = ui->drawn;
    if (warning ? is_said_again(ui, line) : ui->quiet) return;
    if (ui->style == STYLE_JSON) {
        put_json(ui, json_pack("{s:s, s:o}", "event", warning ? "warning" : "message", "text",
                               json_text(line)));
        return;
    }
    wipe_bar(ui);
    fflush(ui->err);
    cli_put_plain(warning ? ui->err : ui->out, warning ? "warning: " : "", line);
    fflush(warning ? ui->err : ui->out);
    if (drawn) draw_bar(ui);
}

void cli_say(cli_ui *ui, const char *format, ...)
{
    char line[4096];
    va_list args;
    va_start(args, format);
    vsnprintf(line, sizeof line, format, args);
    va_end(args);
    if (ui->style == STYLE_JSON) {
        put_json(ui, json_pack("{s:s, s:o}", "event", "result", "text", json_text(line)));
        return;
    }
    wipe_bar(ui);
    cli_put_plain(ui->out, "", line);
}

void cli_error(cli_ui *ui, apsm_status status, const char *line)
{
    end_stage(ui);
    if (ui->style == STYLE_JSON)
        put_json(ui, json_pack("{s:s, s:s, s:o}", "event", "error", "kind",
                               apsm_status_text(status), "text", json_text(line)));
    fflush(ui->out);
    cli_put_plain(ui->err, "apsm: ", line);
}

void cli_ui_free(cli_ui *ui)
{
    if (!ui) return;
    end_stage(ui);
    for (size_t k = 0; k < ui->n_said; k++) free(ui->said[k]);
    free(ui);
}
