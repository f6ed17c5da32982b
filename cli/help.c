#include "help.h"

#include <stdlib.h>
#include <string.h>

#include "options/options.h"
#include "options_table.h"

enum { WIDTH = 79, INDENT = 27 };

/* Writes words from column *column on, breaking lines before WIDTH and starting them at indent. */
static void put_words(FILE *out, const char *text, int indent, int *column)
{
    bool first = true;
    for (const char *at = text; *at;) {
        const int length = (int)strcspn(at, " ");
        if (!first && *column + 1 + length > WIDTH) {
            fprintf(out, "\n%*s", indent, "");
            *column = indent;
        } else if (!first) {
            fputc(' ', out);
            ++*column;
        }
        fprintf(out, "%.*s", length, at);
        *column += length;
        at += length;
        at += strspn(at, " ");
        first = false;
    }
}

static void put_paragraph(FILE *out, const char *text)
{
    int column = 0;
    put_words(out, text, 0, &column);
    fputc('\n', out);
}

/* "  LEFT   text", the text wrapped in its own column. */
static void put_entry(FILE *out, const char *left, const char *text)
{
    int column = fprintf(out, "  %s", left);
    if (column > INDENT - 2) {
        fputc('\n', out);
        column = 0;
    }
    fprintf(out, "%*s", INDENT - column, "");
    column = INDENT;
    put_words(out, text, INDENT, &column);
    fputc('\n', out);
}

/* "word1, word2 or word3" from "word1|word2|word3". */
static void list_words(const char *words, char *text, size_t size)
{
    size_t used = 0;
    for (const char *at = words; *at;) {
        const size_t length = strcspn(at, "|");
        const bool last = at[length] == '\0', last_but_one = !last && !strchr(at + length + 1, '|');
        const int n = snprintf(text + used, size - used, "%.*s%s", (int)length, at,
                               last           ? ""
                               : last_but_one ? " or "
                                              : ", ");
        used += n > 0 && (size_t)n < size - used ? (size_t)n : 0;
        at += length + !last;
    }
}

/* Appends "(default 128)", of a choice "(rigid, similarity or none; default rigid)". */
static void add_default(const apsm_option_info *m, char *text, size_t size)
{
    char value[64] = "", words[256] = "";
    const apsm_options defaults = apsm_options_defaults();
    const size_t used = strlen(text);
    if (apsm_options_get(&defaults, m->name, value) != APSM_OK) return;
    if (m->kind == APSM_OPTION_REAL) snprintf(value, sizeof value, "%s", m->dflt);
    if (m->kind == APSM_OPTION_ENUM) list_words(m->words, words, sizeof words);
    snprintf(text + used, size - used, " (%s%sdefault %s)", words, *words ? "; " : "", value);
}

static void put_option(FILE *out, const cli_option *o, cli_verb verb)
{
    char left[96], text[512];
    const apsm_option_info *m = o->method;
    const bool negated = m && m->kind == APSM_OPTION_BOOL && strcmp(o->value, "false") == 0;
    if (negated) return; /* shown with its positive */
    snprintf(left, sizeof left, "%c%c%s--%s%s%s%s", o->letter ? '-' : ' ',
             o->letter ? o->letter : ' ', o->letter ? ", " : "  ",
             m && m->kind == APSM_OPTION_BOOL ? "[no-]" : "", o->name, o->argument ? " " : "",
             o->argument ? o->argument : "");
    snprintf(text, sizeof text, "%s", cli_option_doc(o, verb));
    if (m) add_default(m, text, sizeof text);
    put_entry(out, left, text);
}

static void put_group(FILE *out, const cli_verb_info *verb, cli_group group, const char *title)
{
    size_t n;
    bool any = false;
    cli_option *list = cli_options_list(&n);
    for (size_t i = 0; list && i < n; i++) {
        if (list[i].group != group || !(list[i].verbs & (unsigned)verb->verb)) continue;
        if (!any) fprintf(out, "\n%s\n", title);
        any = true;
        put_option(out, &list[i], verb->verb);
    }
    free(list);
}

static void put_verb_help(FILE *out, const cli_verb_info *verb, bool all)
{
    fprintf(out, "Usage: apsm %s %s [OPTION...]\n\n", verb->name, verb->operands);
    put_paragraph(out, verb->text);
    if (verb->examples) fprintf(out, "\nExamples\n%s", verb->examples);
    put_group(out, verb, CLI_GROUP_INPUT, "Input and output");
    put_group(out, verb, CLI_GROUP_MODEL, "Model");
    put_group(out, verb, CLI_GROUP_RUN, "Run");
    if (all) put_group(out, verb, CLI_GROUP_METHOD, "Method (also --set KEY=VALUE)");
    fputc('\n', out);
    if (verb->verb == CLI_RUN)
        put_paragraph(out, "Ctrl-C stops after the running epoch and saves a checkpoint; a second "
                           "Ctrl-C stops at once.");
    put_paragraph(out, "Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted.");
}

static void put_overview(FILE *out)
{
    size_t n;
    const cli_verb_info *verbs = cli_verbs(&n);
    fputs("apsm makes statistical shape models: particles that correspond across shapes\n"
          "and follow each shape's detail.\n\n"
          "Usage: apsm VERB [ARGUMENT...] [OPTION...]\n\nVerbs, in the order of the work\n",
          out);
    for (size_t i = 0; i < n; i++) put_entry(out, verbs[i].name, verbs[i].summary);
    fputs("\nFirst steps\n"
          "  apsm check SHAPES_DIR\n"
          "  apsm run SHAPES_DIR -o MODEL_DIR -J 128\n"
          "  apsm info MODEL_DIR\n\n"
          "apsm VERB --help tells more, apsm VERB --help-all everything.\n",
          out);
}

void cli_help(FILE *out, const cli_verb_info *verb, bool all)
{
    if (verb)
        put_verb_help(out, verb, all);
    else
        put_overview(out);
}

void cli_version(FILE *out)
{
    fprintf(out, "apsm %s\n", APSM_VERSION);
}
