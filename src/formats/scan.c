#include "formats/scan.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <strings.h>

#include "core/number.h"
#include "files/io.h"

/* The file's first two lines tell: one CR alone may have strayed into a comment. */
static bool ends_in_cr(const char *bytes, size_t size)
{
    enum { LONGEST_LINE = 1 << 16 };
    size_t k = 0;
    for (int line = 0; line < 2; line++, k++) {
        const size_t most = size - k < LONGEST_LINE ? size : k + LONGEST_LINE;
        while (k < most && bytes[k] != '\n' && bytes[k] != '\r') k++;
        if (k == size) return line > 0;
        if (k == most || bytes[k] == '\n') return false;
        if (k + 1 < size && bytes[k + 1] == '\n') return false;
        if (k + 1 == size) return true;
    }
    return true;
}

static char line_end(const scan *s)
{
    return s->bare_cr ? '\r' : '\n';
}

scan scan_begin(apsm_context *ctx, const char *path, const char *bytes, size_t size)
{
    const bool mark = size >= 3 && memcmp(bytes, "\xef\xbb\xbf", 3) == 0;
    return (scan){
        .ctx = ctx,
        .path = path,
        .bytes = bytes,
        .size = size,
        .at = mark ? 3 : 0,
        .line = 1,
        .bare_cr = ends_in_cr(bytes, size),
    };
}

/* ---- failures ---- */

void scan_fail(scan *s, const char *format, ...)
{
    char text[512];
    va_list args;
    if (!scan_ok(s)) return;
    va_start(args, format);
    apsm_vprint(text, sizeof text, format, args);
    va_end(args);
    s->status = apsm_fail(s->ctx, APSM_ERR_FORMAT, "%s: %s %zu: %s", s->path,
                          s->binary ? "byte" : "line", s->binary ? s->at : s->line, text);
}

void scan_refuse(scan *s, apsm_status status, const char *format, ...)
{
    char text[512];
    va_list args;
    if (!scan_ok(s)) return;
    va_start(args, format);
    apsm_vprint(text, sizeof text, format, args);
    va_end(args);
    s->status = apsm_fail(s->ctx, status, "%s: %s", s->path, text);
}

void scan_no_memory(scan *s)
{
    scan_refuse(s, APSM_ERR_MEMORY, "out of memory; close other programs");
}

const char *word_show(word w, char shown[WORD_SHOWN])
{
    size_t n = 0;
    for (; n < w.length && n + 1 < WORD_SHOWN; n++)
        shown[n] = w.text[n] >= ' ' && w.text[n] <= '~' ? w.text[n] : '?';
    shown[n] = '\0';
    return shown;
}

void scan_expected(scan *s, const char *what, word found)
{
    char shown[WORD_SHOWN];
    if (found.length)
        scan_fail(s, "expected %s, found '%s'; export it again", what, word_show(found, shown));
    else
        scan_fail(s, "expected %s, but the %s ends; it is cut short: copy or export it again", what,
                  scan_left(s) ? "line" : "file");
}

/* ---- words ---- */

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\v' || c == '\f';
}

bool scan_skip_blanks(scan *s, bool over_lines)
{
    while (s->at < s->size && is_blank(s->bytes[s->at])) {
        if (s->bytes[s->at] == line_end(s)) {
            if (!over_lines) return false;
            s->line++;
        }
        s->at++;
    }
    return scan_ok(s) && s->at < s->size;
}

static word next_word(scan *s, bool over_lines)
{
    if (!scan_skip_blanks(s, over_lines)) return (word){ "", 0 };
    const size_t first = s->at;
    while (s->at < s->size && !is_blank(s->bytes[s->at])) s->at++;
    return (word){ s->bytes + first, s->at - first };
}

word scan_word(scan *s)
{
    return next_word(s, true);
}

word scan_word_in_line(scan *s)
{
    return next_word(s, false);
}

word scan_rest_of_line(scan *s)
{
    if (!scan_ok(s) || s->at == s->size) return (word){ "", 0 };
    const char *const first = s->bytes + s->at;
    const char *const end = memchr(first, line_end(s), s->size - s->at);
    size_t length = end ? (size_t)(end - first) : s->size - s->at;
    s->at += length + (end != NULL);
    s->line += end != NULL;
    if (length && first[length - 1] == '\r') length--;
    return (word){ first, length };
}

bool word_is(word w, const char *text)
{
    return strlen(text) == w.length && memcmp(w.text, text, w.length) == 0;
}

bool word_is_any_case(word w, const char *text)
{
    return strlen(text) == w.length && strncasecmp(w.text, text, w.length) == 0;
}

void scan_expect(scan *s, const char *wanted)
{
    char quoted[WORD_SHOWN];
    const word found = scan_word(s);
    if (word_is_any_case(found, wanted)) return;
    snprintf(quoted, sizeof quoted, "'%s'", wanted);
    scan_expected(s, quoted, found);
}

/* ---- numbers ---- */

/* A decimal number taken apart: value = mantissa 10^exponent, exactly if whole. */
typedef struct decimal {
    uint64_t mantissa;
    int exponent;
    bool negative, whole;
} decimal;

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

/* Digits from text[*at] on; scale: how many powers of ten each digit that is kept takes away. */
static size_t take_digits(word w, size_t *at, decimal *d, int scale)
{
    size_t n = 0;
    for (; *at < w.length && is_digit(w.text[*at]); (*at)++, n++) {
        const unsigned digit = (unsigned)(w.text[*at] - '0');
        if (d->mantissa < (UINT64_MAX - 9) / 10) {
            d->mantissa = 10 * d->mantissa + digit;
            d->exponent -= scale;
        } else { /* more digits than the mantissa holds */
            d->exponent += 1 - scale;
            d->whole = d->whole && digit == 0;
        }
    }
    return n;
}

static bool take_exponent(word w, size_t *at, decimal *d)
{
    enum { MOST = 100000 };
    if (*at == w.length) return true;
    if (w.text[*at] != 'e' && w.text[*at] != 'E') return false;
    (*at)++;
    const bool negative = *at < w.length && w.text[*at] == '-';
    if (*at < w.length && (w.text[*at] == '-' || w.text[*at] == '+')) (*at)++;
    int e = 0;
    const size_t first = *at;
    for (; *at < w.length && is_digit(w.text[*at]); (*at)++)
        if (e < MOST) e = 10 * e + (w.text[*at] - '0');
    d->exponent += negative ? -e : e;
    return *at > first && *at == w.length;
}

static bool take_decimal(word w, decimal *d)
{
    size_t at = 0;
    *d = (decimal){ .whole = true };
    if (w.length && (w.text[0] == '+' || w.text[0] == '-')) d->negative = w.text[at++] == '-';
    size_t digits = take_digits(w, &at, d, 0);
    if (at < w.length && w.text[at] == '.') {
        at++;
        digits += take_digits(w, &at, d, 1);
    }
    return digits > 0 && take_exponent(w, &at, d);
}

/* strtod under the locale "C". */
static bool number_by_library(word w, double *value)
{
    enum { LONGEST = 1000 };
    char copy[LONGEST + 1];
    if (w.length > LONGEST) return false;
    memcpy(copy, w.text, w.length);
    copy[w.length] = '\0';
    const locale_t before = apsm_numbers_begin();
    *value = strtod(copy, NULL);
    apsm_numbers_end(before);
    return true;
}

/* Below 2^53 and with at most 22 powers of ten both factors are exact, so that the one rounding of
 * the product or quotient is the right one. */
bool word_number(word w, double *value)
{
    static const double power[] = { 1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                    1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                    1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22 };
    const word bare =
        w.length && (w.text[0] == '-' || w.text[0] == '+') ? (word){ w.text + 1, w.length - 1 } : w;
    decimal d;
    if (word_is_any_case(bare, "nan") || word_is_any_case(bare, "inf") ||
        word_is_any_case(bare, "infinity")) {
        *value = HUGE_VAL;
        return true;
    }
    if (!take_decimal(w, &d)) return false;
    if (!d.whole || d.mantissa > (UINT64_C(1) << 53) || d.exponent < -22 || d.exponent > 22)
        return number_by_library(w, value);
    const double m = (double)d.mantissa;
    const double x = d.exponent < 0 ? m / power[-d.exponent] : m * power[d.exponent];
    *value = d.negative ? -x : x;
    return true;
}

bool word_integer(word w, int64_t *value)
{
    decimal d = { .whole = true };
    size_t at = 0;
    if (w.length && (w.text[0] == '+' || w.text[0] == '-')) d.negative = w.text[at++] == '-';
    if (!take_digits(w, &at, &d, 0) || at != w.length || d.exponent || d.mantissa > INT64_MAX)
        return false;
    *value = d.negative ? -(int64_t)d.mantissa : (int64_t)d.mantissa;
    return true;
}

double scan_number(scan *s, const char *what)
{
    const word w = scan_word(s);
    double value = 0.0;
    if (!scan_ok(s)) return 0.0;
    if (!word_number(w, &value))
        scan_expected(s, what, w);
    else if (!isfinite(value))
        scan_fail(s, "%s is not finite; export it again", what);
    return scan_ok(s) ? value : 0.0;
}

int64_t scan_integer(scan *s, const char *what)
{
    const word w = scan_word(s);
    int64_t value = 0;
    if (scan_ok(s) && !word_integer(w, &value)) scan_expected(s, what, w);
    return scan_ok(s) ? value : 0;
}

size_t scan_check_count(scan *s, int64_t n, const char *what, size_t bytes)
{
    if (!scan_ok(s)) return 0;
    if (n >= 0 && (uint64_t)n <= (scan_left(s) + 1) / bytes) return (size_t)n;
    scan_fail(s,
              "%s %lld is more than the file can hold; it is cut short or damaged: copy or export "
              "it again",
              what, (long long)n);
    return 0;
}

size_t scan_count(scan *s, const char *what, size_t bytes)
{
    return scan_check_count(s, scan_integer(s, what), what, bytes);
}

/* ---- binary ---- */

const unsigned char *scan_bytes(scan *s, size_t n)
{
    if (!scan_ok(s)) return NULL;
    if (scan_left(s) < n) {
        scan_fail(s, "the file ends here; it is cut short: copy or export it again");
        return NULL;
    }
    const unsigned char *const p = (const unsigned char *)s->bytes + s->at;
    s->at += n;
    return p;
}

double scan_real(scan *s, scalar type, bool big_endian)
{
    const unsigned char *const p = scan_bytes(s, scalar_size(type));
    return p ? scalar_real(type, p, big_endian) : 0.0;
}

int64_t scan_whole(scan *s, scalar type, bool big_endian)
{
    const unsigned char *const p = scan_bytes(s, scalar_size(type));
    return p ? scalar_integer(type, p, big_endian) : 0;
}
