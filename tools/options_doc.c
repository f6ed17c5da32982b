/* Writes docs/options.md from the option table; scripts/make-options-doc builds and runs it. */
#include <stdio.h>
#include <string.h>

#include "apsm/options.h"

/* Bars separate the columns of a table. */
static void put_text(const char *text)
{
    for (; *text; text++) {
        if (*text == '|') putchar('\\');
        putchar(*text);
    }
}

static void put_words(const char *words)
{
    putchar('`');
    for (; *words; words++)
        if (*words == '|')
            fputs("`, `", stdout);
        else
            putchar(*words);
    putchar('`');
}

static void put_row(const apsm_option_info *o)
{
    const size_t first = o->words ? strcspn(o->words, "|") : 0;
    printf("| `%s` | %.*s | ", o->name, o->dflt ? (int)strlen(o->dflt) : (int)first,
           o->dflt ? o->dflt : o->words);
    switch (o->kind) {
    case APSM_OPTION_INT:
        printf("whole, %.10g to %.10g", o->least, o->most);
        break;
    case APSM_OPTION_REAL:
        printf("%.10g to %.10g", o->least, o->most);
        break;
    case APSM_OPTION_BOOL:
        fputs("`true`, `false`", stdout);
        break;
    case APSM_OPTION_ENUM:
        put_words(o->words);
        break;
    }
    fputs(" | ", stdout);
    put_text(o->doc);
    fputs(" |\n", stdout);
}

int main(void)
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    fputs(
        "# Options of the method\n\n"
        "Written by `scripts/make-options-doc` from the lists beside the steps; do not edit.\n\n"
        "Each can be given as `--name X` (with dashes for underscores; a switch as `--name` or\n"
        "`--no-name`), as `--set name=X`, or in a file for `--config`. Options of the program\n"
        "itself (inputs, folders, threads) are in `apsm run --help`. Numbers in brackets are\n"
        "equations of [method.md](method.md); h is the mean distance of neighbouring particles on\n"
        "the template. \"(paper)\" marks a reading of the paper that is not our default;\n"
        "`--preset paper-literal-femur` and its like select all of them.\n\n"
        "| name | default | values | meaning |\n|---|---|---|---|\n",
        stdout);
    for (size_t k = 0; k < n; k++) put_row(&table[k]);
    return fflush(stdout) != 0;
}
