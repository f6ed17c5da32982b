/* number.h -- numbers as text, the same under every locale of the process. */
#ifndef APSM_CORE_NUMBER_H
#define APSM_CORE_NUMBER_H

#include <locale.h>
#include <stddef.h>

#include "apsm/number.h"

/* Between the two, this thread's numbers have a decimal point whatever the user's locale. */
locale_t apsm_numbers_begin(void);
void apsm_numbers_end(locale_t before);

#endif
