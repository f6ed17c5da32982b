/* Squared distances by lower envelopes of parabolas (Felzenszwalb & Huttenlocher, "Distance
 * transforms of sampled functions", 2012): exact, whatever the spacing. */
#include "groom/envelope.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void envelope_free(envelope *e)
{
    free(e->f);
    free(e->z);
    free(e->v);
    *e = (envelope){ 0 };
}

apsm_status envelope_new(size_t n, envelope *e)
{
    e->f = malloc(n * sizeof *e->f);
    e->z = malloc((2 * n + 1) * sizeof *e->z);
    e->v = malloc(n * sizeof *e->v);
    if (e->f && e->z && e->v) return APSM_OK;
    envelope_free(e);
    return APSM_ERR_MEMORY;
}

/* The nodes of the lower envelope in v, where they begin in z (n + 1). */
void envelope_line(size_t n, double h, const envelope *e)
{
    double *f = e->f, *z = e->z;
    const double h2 = h * h;
    size_t k = 0, *v = e->v, first = 0;
    while (first < n && isinf(f[first])) first++;
    if (first == n) return;
    v[0] = first;
    z[0] = -INFINITY;
    for (size_t q = first + 1; q < n; q++) {
        if (isinf(f[q])) continue;
        double s;
        for (;;) {
            const double a = (double)q, b = (double)v[k];
            s = ((f[q] - f[v[k]]) / h2 + a * a - b * b) / (2.0 * (a - b));
            if (s > z[k] || k == 0) break;
            k--;
        }
        if (s > z[k]) k++;
        v[k] = q;
        z[k] = k == 0 ? -INFINITY : s;
    }
    const size_t last = k;
    double *const out = z + n + 1;
    k = 0;
    for (size_t p = 0; p < n; p++) {
        while (k < last && z[k + 1] < (double)p) k++;
        const double d = h * ((double)p - (double)v[k]);
        out[p] = d * d + f[v[k]];
    }
    memcpy(f, out, n * sizeof *f);
}
