#include "judge/twins.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "core/robust.h"

/* Of the usual distance, of the logarithms of sizes, and how many times as far as the twin whoever
 * is none has to be: where shapes vary in one way only, many are near. */
static const double near = 0.25, alike = 0.01, apart = 3.0;
enum { BLOCK = 24 }; /* coordinates between two looks at the sum */

typedef struct sized {
    double size;
    uint32_t i;
} sized;

typedef struct seeking {
    size_t I, n;     /* shapes, coordinates of each */
    const double *Q; /* I x n */
    double most;     /* squared distance of twins */
    const sized *by_size;
    uint32_t *twin;
} seeking;

/* Or more than `most`. */
static double distance2(size_t n, const double *x, const double *y, double most)
{
    double sum = 0.0;
    for (size_t k = 0; k < n && sum <= most;)
        for (const size_t end = n - k > BLOCK ? k + BLOCK : n; k < end; k++)
            sum += (x[k] - y[k]) * (x[k] - y[k]);
    return sum;
}

static double between(const seeking *s, size_t i, size_t k, double most)
{
    return distance2(s->n, s->Q + s->n * i, s->Q + s->n * k, most);
}

/* The first of the shapes that are near to the p-th by size and of its size, or itself; *nearest <-
 * the least of their squared distances. */
static size_t find_near(const seeking *s, size_t p, double *nearest)
{
    const sized *own = s->by_size + p;
    size_t first = own->i, q = p;
    bool found = false;
    *nearest = INFINITY;
    while (q > 0 && fabs(own->size - s->by_size[q - 1].size) <= alike) q--;
    for (; q < s->I && (q <= p || fabs(own->size - s->by_size[q].size) <= alike); q++) {
        const size_t k = s->by_size[q].i;
        const double d2 = q == p ? INFINITY : between(s, own->i, k, s->most);
        if (!(d2 <= s->most)) continue;
        *nearest = fmin(*nearest, d2);
        if (!found || k < first) first = k;
        found = true;
    }
    return first;
}

/* Whether another shape, that is none of the near ones, is hardly farther than the nearest. */
static bool has_others(const seeking *s, size_t i, double nearest)
{
    const double enough = apart * apart * nearest;
    for (size_t k = 0; k < s->I && enough > s->most; k++) {
        const double d2 = k == i ? 0.0 : between(s, i, k, enough);
        if (d2 > s->most && d2 <= enough) return true;
    }
    return false;
}

static apsm_status seek_twin(apsm_context *ctx, size_t p, int worker, void *user)
{
    (void)ctx, (void)worker;
    const seeking *s = user;
    const size_t i = s->by_size[p].i;
    double nearest;
    const size_t first = find_near(s, p, &nearest);
    s->twin[i] = (uint32_t)(first < i && !has_others(s, i, nearest) ? first : i);
    return APSM_OK;
}

static int by_size(const void *a, const void *b)
{
    const sized *x = a, *y = b;
    if (x->size != y->size) return x->size < y->size ? -1 : 1;
    return (x->i > y->i) - (x->i < y->i);
}

apsm_status apsm_twins_find(apsm_context *ctx, size_t I, size_t J, const double *Q, const double *X,
                            const double *size, uint32_t *twin, double *work)
{
    const size_t n = 3 * J;
    sized *order = malloc(I * sizeof *order);
    if (!order) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < I; i++) {
        work[i] = distance2(n, Q + n * i, X + n * i, INFINITY);
        order[i] = (sized){ size[i], (uint32_t)i };
    }
    qsort(order, I, sizeof *order, by_size);
    seeking s = { I, n, Q, near * near * robust_median(I, work), order, twin };
    const apsm_status status = apsm_parallel_for(ctx, I, seek_twin, &s, NULL);
    free(order);
    return status;
}
