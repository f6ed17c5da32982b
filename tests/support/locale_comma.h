/* locale_comma.h -- switches the process to a locale with a decimal comma, one that the system has
 * or one compiled for the test.  False if there is none: the test then says it was skipped. */
#ifndef APSM_TEST_LOCALE_COMMA_H
#define APSM_TEST_LOCALE_COMMA_H

#include <locale.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

static inline bool use_decimal_comma(const char *folder)
{
    static const char *const names[] = { "de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "de_DE" };
    char command[2048];
    for (int round = 0; round < 2; round++) {
        for (size_t i = 0; i < sizeof names / sizeof *names; i++)
            if (setlocale(LC_ALL, names[i]) && *localeconv()->decimal_point == ',') return true;
        snprintf(command, sizeof command,
                 "localedef -i de_DE -f UTF-8 '%s/de_DE.UTF-8' >/dev/null 2>&1", folder);
        if (round == 0 && (system(command) != 0 || setenv("LOCPATH", folder, 1) != 0)) break;
    }
    return false;
}

#endif
