#include "formats/header_line.h"

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\n';
}

word word_trim(word w)
{
    while (w.length && is_blank(w.text[0])) w.text++, w.length--;
    while (w.length && is_blank(w.text[w.length - 1])) w.length--;
    return w;
}

bool header_split(word line, const char *signs, header_line *parts)
{
    size_t at = 0;
    while (at < line.length && !strchr(signs, line.text[at])) at++;
    if (at == line.length) return false;
    parts->key = word_trim((word){ line.text, at });
    parts->value = word_trim((word){ line.text + at + 1, line.length - at - 1 });
    return true;
}

static bool is_separator(char c)
{
    return is_blank(c) || c == ',' || c == '(' || c == ')';
}

word word_next(word *rest)
{
    while (rest->length && is_separator(rest->text[0])) rest->text++, rest->length--;
    word w = { rest->text, 0 };
    while (w.length < rest->length && !is_separator(w.text[w.length])) w.length++;
    rest->text += w.length;
    rest->length -= w.length;
    return w;
}

bool word_numbers(word value, size_t n, double *x)
{
    for (size_t k = 0; k < n; k++)
        if (!word_number(word_next(&value), &x[k])) return false;
    return word_next(&value).length == 0;
}
