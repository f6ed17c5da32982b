/* Columns of a table that look like numbers to who wrote them and are none: with decimal commas,
 * percent signs, remarks or units, or dates.  As groups they would answer another question. */
#include <math.h>
#include <string.h>

#include "apsm/options.h"
#include "statistics/table.h"

typedef enum text_kind { WORD, NUMBER, COMMA, PERCENT, DATE, WITH_WORD, KINDS } text_kind;

static bool is_number(const char *text, size_t n)
{
    double value;
    return apsm_parse_number(text, n, &value);
}

static bool is_number_with_comma(const char *text, size_t n)
{
    char copy[64];
    if (n >= sizeof copy || !memchr(text, ',', n)) return false;
    for (size_t k = 0; k < n; k++) copy[k] = text[k] == ',' ? '.' : text[k];
    return is_number(copy, n);
}

static bool is_percent(const char *text)
{
    size_t n = strlen(text);
    if (n < 2 || text[n - 1] != '%') return false;
    for (n--; n > 0 && text[n - 1] == ' ';) n--;
    return is_number(text, n) || is_number_with_comma(text, n);
}

/* 2019-03-01, 1.3.2019, 03/01/19, with or without a time behind it; 1-2-3 is a code. */
static bool is_date(const char *text)
{
    const char *const first = text + strspn(text, "0123456789");
    size_t digits = (size_t)(first - text), years = digits == 4;
    bool long_enough = digits > 1;
    if (!*first || !strchr("-./", *first)) return false;
    for (int part = 0; part < 2; part++) {
        if (!(digits == 1 || digits == 2 || digits == 4) || *text == '\0') return false;
        text += digits;
        if (*text++ != *first) return false;
        digits = strspn(text, "0123456789");
        years += digits == 4;
        long_enough = long_enough || digits > 1;
    }
    const char after = text[digits];
    return (digits == 1 || digits == 2 || digits == 4) && years <= 1 && long_enough &&
           (after == '\0' || after == ' ' || after == 'T');
}

static text_kind kind_of(const char *text)
{
    const size_t n = strlen(text);
    if (is_number(text, n)) return NUMBER;
    if (is_number_with_comma(text, n)) return COMMA;
    if (is_percent(text)) return PERCENT;
    if (is_date(text)) return DATE;
    return *text >= '0' && *text <= '9' ? WITH_WORD : WORD;
}

/* Where most have a number, what is odd: by preference what is common and has its own remedy. */
const char *apsm_column_spoilt_by(const apsm_column *c)
{
    size_t all = 0, shapes[KINDS] = { 0 };
    const char *last[KINDS] = { NULL };
    for (size_t k = 0; k < c->levels; k++) {
        const text_kind kind = kind_of(c->level[k]);
        all += c->shapes[k];
        shapes[kind] += c->shapes[k];
        last[kind] = c->level[k];
    }
    size_t numbers = shapes[NUMBER] + shapes[COMMA] + shapes[PERCENT] + shapes[DATE];
    if (2 * c->levels > all) numbers += shapes[WITH_WORD]; /* as groups they have no two shapes */
    if (2 * numbers < all || shapes[NUMBER] == all) return NULL;
    for (text_kind kind = COMMA; kind < KINDS; kind++)
        if (last[kind]) return last[kind];
    return last[WORD];
}

static const char *remedy_of(text_kind kind)
{
    switch (kind) {
    case COMMA:
        return "is written with a comma; write numbers with a point, thousands without a mark";
    case PERCENT:
        return "has a percent sign; write the number alone";
    case DATE:
        return "is a date, neither a number nor a group; write years or days since a day as "
               "numbers, or the names of groups";
    case WITH_WORD:
        return "is no number, though it begins like one; write the number alone (for groups, let "
               "all names begin with a letter)";
    default:
        return "is no number, though most of the column are; mend it or leave it empty (for "
               "groups, let all names begin with a letter)";
    }
}

/* Of numbers whose squares no double holds. */
static bool is_beyond_reckoning(double value)
{
    const double size = fabs(value);
    return size > 1e100 || (size > 0 && size < 1e-100);
}

apsm_status apsm_column_check(apsm_context *ctx, size_t I, const apsm_column *c)
{
    const char *const odd = apsm_column_spoilt_by(c);
    if (odd)
        return apsm_fail(ctx, APSM_ERR_ARG, "column '%s': '%s' %s", c->name, odd,
                         remedy_of(kind_of(odd)));
    for (size_t i = 0; i < I && !c->category; i++)
        if (is_beyond_reckoning(c->value[i]))
            return apsm_fail(ctx, APSM_ERR_ARG,
                             "column '%s': %g is beyond what can be reckoned with; write it in "
                             "another unit",
                             c->name, c->value[i]);
    return APSM_OK;
}
