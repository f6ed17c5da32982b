/* Numbers as text, the same under every locale. */
#include "core/number.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* "C" always exists; should newlocale fail for want of memory, the thread keeps its locale. */
locale_t apsm_numbers_begin(void)
{
    const locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    return c ? uselocale(c) : (locale_t)0;
}

void apsm_numbers_end(locale_t before)
{
    if (!before) return;
    const locale_t c = uselocale(before);
    freelocale(c);
}

int apsm_vprint(char *text, size_t size, const char *format, va_list args)
{
    const locale_t before = apsm_numbers_begin();
    const int length = vsnprintf(text, size, format, args);
    apsm_numbers_end(before);
    return length;
}

int apsm_print(char *text, size_t size, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    const int length = apsm_vprint(text, size, format, args);
    va_end(args);
    return length;
}

void apsm_format_number(double x, char text[APSM_NUMBER_LENGTH])
{
    const locale_t before = apsm_numbers_begin();
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(text, APSM_NUMBER_LENGTH, "%.*g", digits, x);
        if (isfinite(x) && strtod(text, NULL) == x) break;
    }
    apsm_numbers_end(before);
}

/* strtod alone would also take " 1", "0x1p3", "inf" and "nan(...)". */
static bool is_decimal(const char *text, size_t length)
{
    for (size_t i = 0; i < length; i++)
        if (!text[i] || !strchr("0123456789+-.eE", text[i])) return false;
    return length > 0;
}

bool apsm_parse_number(const char *text, size_t length, double *x)
{
    enum { LONGEST = 512 }; /* more digits than any writer makes */
    char copy[LONGEST + 1], *end;
    if (length > LONGEST || !is_decimal(text, length)) return false;
    memcpy(copy, text, length);
    copy[length] = '\0';
    const locale_t before = apsm_numbers_begin();
    const double value = strtod(copy, &end);
    apsm_numbers_end(before);
    if (end != copy + length || !isfinite(value)) return false;
    *x = value;
    return true;
}
