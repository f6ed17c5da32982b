/* number.h -- numbers as text, the same under every locale of the process. */
#ifndef APSM_CORE_NUMBER_H
#define APSM_CORE_NUMBER_H

#include <locale.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>

#include "apsm/status.h"

enum { APSM_NUMBER_LENGTH = 32 };
/* The shortest of 15, 16 or 17 significant digits that reads back as the same double; not finite:
 * "nan", "inf", "-inf". */
void apsm_format_number(double x, char text[APSM_NUMBER_LENGTH]);
/* Reads one decimal number that fills text[0..length).  False if it is anything else: empty,
 * hexadecimal, "nan", "inf", with a decimal comma, beyond the range of double. */
bool apsm_parse_number(const char *text, size_t length, double *x);

/* snprintf and vsnprintf with a decimal point under every locale: for all text that is shown or
 * kept. */
int apsm_print(char *text, size_t size, const char *format, ...) APSM_PRINTF(3, 4);
int apsm_vprint(char *text, size_t size, const char *format, va_list args);

/* Between the two, this thread's numbers have a decimal point whatever the user's locale. */
locale_t apsm_numbers_begin(void);
void apsm_numbers_end(locale_t before);

#endif
