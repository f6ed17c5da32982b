/* option_words.h -- pairs NAME VALUE on the command line of a generator. */
#ifndef APSM_TEST_OPTION_WORDS_H
#define APSM_TEST_OPTION_WORDS_H

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

static inline bool option_words(int n, char **words, size_t options, const char *const names[],
                                double value[])
{
    if (n % 2) return false;
    for (int k = 0; k < n; k += 2) {
        size_t o = 0;
        char *end;
        while (o < options && strcmp(words[k], names[o]) != 0) o++;
        if (o == options) return false;
        value[o] = strtod(words[k + 1], &end);
        if (*end) return false;
    }
    return true;
}

#endif
