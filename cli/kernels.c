#define _DEFAULT_SOURCE /* setenv */
#include "kernels.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#if defined __x86_64__ && defined __linux__
static const char name[] = "OPENBLAS_CORETYPE";

/* What computes nothing starts in half the time without. */
static bool computes(const char *word)
{
    static const char *const others[] = { "info", "check", "convert", "verify" };
    if (!word || *word == '-') return false;
    for (size_t k = 0; k < sizeof others / sizeof *others; k++)
        if (strcmp(word, others[k]) == 0) return false;
    return true;
}

void cli_pin_kernels(char **argv)
{
    if (!argv[0] || !computes(argv[1]) || getenv(name) || !__builtin_cpu_supports("avx2") ||
        !__builtin_cpu_supports("fma"))
        return;
    if (setenv(name, "Haswell", 1) != 0) return;
    execv("/proc/self/exe", argv);
    unsetenv(name); /* there is no /proc: go on as we are */
}
#else
void cli_pin_kernels(char **argv)
{
    (void)argv;
}
#endif
