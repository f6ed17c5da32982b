/* From the table of options.  Operands have places (index), options flags; what has no default of
 * its own is text, which a host leaves out while it is empty. */
#include "xml.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#include "options/options.h"
#include "options_table.h"

static void put_text(FILE *out, const char *text)
{
    for (const char *c = text; *c; c++) {
        if (*c == '<')
            fputs("&lt;", out);
        else if (*c == '>')
            fputs("&gt;", out);
        else if (*c == '&')
            fputs("&amp;", out);
        else
            fputc(*c, out);
    }
}

static void put_element(FILE *out, const char *name, const char *text)
{
    fprintf(out, "<%s>", name);
    put_text(out, text);
    fprintf(out, "</%s>\n", name);
}

/* The name of a variable: letters, digits and _. */
static void put_name(FILE *out, const char *text)
{
    fputs("<name>", out);
    for (const char *c = text; *c; c++) fputc(isalnum((unsigned char)*c) ? *c : '_', out);
    fputs("</name>\n", out);
}

/* ---- options ---- */

/* The schema knows no hyphens in flags; the program takes _ for them. */
static void put_flags(FILE *out, const cli_option *o, cli_verb verb)
{
    put_name(out, o->name);
    if (o->letter) fprintf(out, "<flag>-%c</flag>\n", o->letter);
    fputs("<longflag>--", out);
    for (const char *c = o->name; *c; c++) fputc(*c == '-' ? '_' : *c, out);
    fputs("</longflag>\n", out);
    put_element(out, "description", cli_option_doc(o, verb));
    put_element(out, "label", o->name);
}

static void put_range(FILE *out, const apsm_option_info *m)
{
    char value[64];
    const apsm_options defaults = apsm_options_defaults();
    if (apsm_options_get(&defaults, m->name, value) != APSM_OK) return;
    fprintf(out,
            "<default>%s</default>\n<constraints><minimum>%.17g</minimum><maximum>%.17g</maximum>"
            "<step>%s</step></constraints>\n",
            value, m->least, m->most, m->kind == APSM_OPTION_INT ? "1" : "0.01");
}

static void put_words(FILE *out, const apsm_option_info *m)
{
    char value[64];
    const apsm_options defaults = apsm_options_defaults();
    if (apsm_options_get(&defaults, m->name, value) == APSM_OK) put_element(out, "default", value);
    for (const char *at = m->words; *at;) {
        const size_t length = strcspn(at, "|");
        fprintf(out, "<element>%.*s</element>\n", (int)length, at);
        at += length + (at[length] == '|');
    }
}

static bool is_path(const cli_option *o)
{
    return o->argument && (strcmp(o->argument, "DIR") == 0 || strcmp(o->argument, "FILE") == 0);
}

static const char *type_of(const cli_option *o)
{
    static const char *const of_method[] = { "integer", "double", "boolean", "string-enumeration" };
    if (o->method) return of_method[o->method->kind];
    if (!o->argument) return "boolean";
    if (!is_path(o)) return "string";
    return strcmp(o->argument, "DIR") == 0 ? "directory" : "file";
}

/* A switch that is on already is offered by its negation. */
static bool is_offered(const cli_option *o)
{
    static const cli_action hidden[] = { CLI_SET_PAIR,  CLI_PROGRESS,      CLI_FLAG_QUIET,
                                         CLI_FLAG_HELP, CLI_FLAG_HELP_ALL, CLI_FLAG_VERSION,
                                         CLI_FLAG_XML };
    for (size_t k = 0; k < sizeof hidden / sizeof *hidden; k++)
        if (o->action == hidden[k]) return false;
    if (!o->method || o->method->kind != APSM_OPTION_BOOL) return true;
    return strcmp(o->method->dflt, o->value) != 0;
}

static void put_option(FILE *out, const cli_option *o, cli_verb verb)
{
    const char *type = type_of(o);
    fprintf(out, "<%s>\n", type);
    put_flags(out, o, verb);
    if (strcmp(type, "boolean") == 0) fputs("<default>false</default>\n", out);
    if (strcmp(type, "integer") == 0 || strcmp(type, "double") == 0) put_range(out, o->method);
    if (strcmp(type, "string-enumeration") == 0) put_words(out, o->method);
    if (is_path(o))
        fprintf(out, "<channel>%s</channel>\n", o->action == CLI_OUT ? "output" : "input");
    fprintf(out, "</%s>\n", type);
}

static void put_group(FILE *out, const cli_verb_info *verb, cli_group group, const char *title)
{
    size_t n;
    bool any = false;
    cli_option *list = cli_options_list(&n);
    for (size_t i = 0; list && i < n; i++) {
        if (list[i].group != group || !(list[i].verbs & (unsigned)verb->verb) ||
            !is_offered(&list[i]))
            continue;
        if (!any) {
            fprintf(out, "<parameters%s>\n", group == CLI_GROUP_INPUT ? "" : " advanced=\"true\"");
            put_element(out, "label", title);
            put_element(out, "description", title);
        }
        any = true;
        put_option(out, &list[i], verb->verb);
    }
    if (any) fputs("</parameters>\n", out);
    free(list);
}

/* ---- operands ---- */

/* One word of the operands: "[MESHES...]" is an input like "MODEL_DIR|FILE". */
static void put_operand(FILE *out, const char *word, size_t length, int index)
{
    char text[96];
    size_t n = 0;
    for (size_t k = 0; k < length && n < sizeof text - 1; k++)
        if (!strchr("[]().", word[k])) text[n++] = word[k];
    text[n] = '\0';
    const bool folder = strstr(text, "DIR") || strstr(text, "INPUT") || strstr(text, "MODEL");
    const char *type = strcmp(text, "NAME") == 0 ? "string" : folder ? "directory" : "file";
    fprintf(out, "<%s>\n<name>operand%d</name>\n", type, index);
    fprintf(out, "<index>%d</index>\n", index);
    put_element(out, "description", text);
    put_element(out, "label", text);
    if (strcmp(type, "string") != 0) fputs("<channel>input</channel>\n", out);
    fprintf(out, "</%s>\n", type);
}

static void put_operands(FILE *out, const cli_verb_info *verb)
{
    int index = 0;
    fputs("<parameters>\n<label>What to work on</label>\n<description>What to work on"
          "</description>\n",
          out);
    for (const char *at = verb->operands; *at && *at != '-';) {
        const size_t length = strcspn(at, " ");
        put_operand(out, at, length, index++);
        at += length;
        at += strspn(at, " ");
    }
    fputs("</parameters>\n", out);
}

void cli_xml(FILE *out, const cli_verb_info *verb)
{
    fputs("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<executable>\n"
          "<category>Shape Models</category>\n",
          out);
    fprintf(out, "<title>apsm %s</title>\n", verb->name);
    put_element(out, "description", verb->text);
    fprintf(out, "<version>%s</version>\n<license>Apache-2.0</license>\n", APSM_VERSION);
    fputs("<contributor>The apsm developers</contributor>\n", out);
    put_operands(out, verb);
    put_group(out, verb, CLI_GROUP_INPUT, "Input and output");
    put_group(out, verb, CLI_GROUP_MODEL, "Model");
    put_group(out, verb, CLI_GROUP_RUN, "Run");
    put_group(out, verb, CLI_GROUP_METHOD, "Method");
    fputs("</executable>\n", out);
}

char **cli_argv_of_link(int *argc, char **argv)
{
    static const char prefix[] = "apsm-";
    const char *slash = *argc > 0 ? strrchr(argv[0], '/') : NULL;
    char *name = *argc > 0 ? argv[0] + (slash ? slash + 1 - argv[0] : 0) : NULL;
    if (!name || strncmp(name, prefix, sizeof prefix - 1) != 0 ||
        !cli_find_verb(name + sizeof prefix - 1))
        return NULL;
    char **more = calloc((size_t)*argc + 2, sizeof *more);
    if (!more) return NULL;
    more[0] = argv[0];
    more[1] = name + sizeof prefix - 1;
    for (int k = 1; k < *argc; k++) more[k + 1] = argv[k];
    ++*argc;
    return more;
}
