#include "groom/handles.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { LEAST_SHAPES = 4, MANY = 3 };
const double handles_sinus_closing = 0.1;
static const double most_shapes = 2.0 / 3.0;

static int by_size(const void *a, const void *b)
{
    const long x = *(const long *)a, y = *(const long *)b;
    return (x > y) - (x < y);
}

/* The value that is there most often in n sorted ones, the least of equals; *times, how often. */
static long most_common(size_t n, const long *sorted, size_t *times)
{
    long best = sorted[0];
    *times = 0;
    for (size_t first = 0, k = 1; k <= n; k++) {
        if (k < n && sorted[k] == sorted[first]) continue;
        if (k - first > *times) {
            *times = k - first;
            best = sorted[first];
        }
        first = k;
    }
    return best;
}

handles_kind handles_judge(size_t n, const long *before, const long *after, long *common,
                           long *scratch)
{
    long *const had = scratch, *const has = scratch + n;
    size_t times;
    *common = 0;
    if (n < LEAST_SHAPES) return HANDLES_DEBRIS;
    memcpy(had, before, n * sizeof *had);
    memcpy(has, after, n * sizeof *has);
    qsort(had, n, sizeof *had, by_size);
    qsort(has, n, sizeof *has, by_size);
    *common = most_common(n, had, &times);
    if (*common > 0 && (double)times >= most_shapes * (double)n) return HANDLES_ANATOMY;
    const bool many = had[(n - 1) / 2] >= MANY, differ = had[n - 1] - had[0] >= MANY;
    return many && differ && has[(n - 1) / 2] == 0 ? HANDLES_SINUS : HANDLES_DEBRIS;
}
