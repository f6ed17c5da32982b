/* H of (12) where particles are many: never formed, but kept as what it is made of,
 *
 *   H = R'R + mu T'QT + D - prior U'U
 *
 * with rows R that have few entries (surfaces, order of neighbours, landmarks, features, contacts),
 * Q the smoothness of displacements, T the tangents, D a diagonal and U the prior's modes. Unknowns
 * are in the order of the particles' places along the template, in single precision: H shapes the
 * step, whose worth the value decides. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/kernel.h"
#include "optimize/fidelity_shape.h"

/* ---- memory ---- */

apsm_status fidelity_system_alloc(size_t J, size_t rows, size_t entries, fidelity_system *s)
{
    *s = (fidelity_system){ 0 };
    s->start = malloc((rows + 1) * sizeof *s->start);
    s->place = malloc((entries + 1) * sizeof *s->place);
    s->x = malloc((2 * entries + 1) * sizeof *s->x);
    s->diagonal = malloc(2 * J * sizeof *s->diagonal);
    s->tangent = malloc(6 * J * sizeof *s->tangent);
    s->work = malloc(8 * J * sizeof *s->work);
    return s->start && s->place && s->x && s->diagonal && s->tangent && s->work ? APSM_OK
                                                                                : APSM_ERR_MEMORY;
}

void fidelity_system_free(fidelity_system *s)
{
    free(s->start);
    free(s->place);
    free(s->x);
    free(s->diagonal);
    free(s->tangent);
    free(s->work);
    *s = (fidelity_system){ 0 };
}

/* ---- what it is made of ---- */

void fidelity_system_begin(const apsm_fidelity *f, const double *tangent, fidelity_system *s)
{
    const size_t n = 2 * f->J;
    s->n = 0;
    s->start[0] = 0;
    s->smooth = 0;
    memset(s->diagonal, 0, n * sizeof *s->diagonal);
    for (size_t x = 0; x < n; x++) {
        const size_t at = 2 * (size_t)f->place[x / 2] + x % 2;
        for (size_t c = 0; c < 3; c++) s->tangent[c * n + at] = (float)tangent[3 * x + c];
    }
}

void fidelity_system_put(const apsm_fidelity *f, size_t count, const uint32_t *particle,
                         const double *x, fidelity_system *s)
{
    const size_t first = s->start[s->n];
    for (size_t k = 0; k < count; k++) { /* in order: most of them are */
        const uint32_t place = f->place[particle[k]];
        size_t at = first + k;
        for (; at > first && s->place[at - 1] > place; at--) {
            s->place[at] = s->place[at - 1];
            memcpy(s->x + 2 * at, s->x + 2 * (at - 1), 2 * sizeof *s->x);
        }
        s->place[at] = place;
        s->x[2 * at] = (float)x[2 * k];
        s->x[2 * at + 1] = (float)x[2 * k + 1];
    }
    s->start[++s->n] = first + count;
}

void fidelity_system_put_diagonal(const apsm_fidelity *f, size_t unknown, double weight,
                                  fidelity_system *s)
{
    s->diagonal[2 * (size_t)f->place[unknown / 2] + unknown % 2] += (float)weight;
}

/* ---- its product ---- */

/* y (3 x J) += four rows of Q by c. */
KERNEL_INLINE void add_four(size_t J, const float *const q[4], const float c[4][3], float *y)
{
    float *y0 = y, *y1 = y + J, *y2 = y + 2 * J;
    for (size_t k = 0; k < J; k++) {
        const float a = q[0][k], b = q[1][k], d = q[2][k], e = q[3][k];
        y0[k] += (c[0][0] * a + c[1][0] * b) + (c[2][0] * d + c[3][0] * e);
        y1[k] += (c[0][1] * a + c[1][1] * b) + (c[2][1] * d + c[3][1] * e);
        y2[k] += (c[0][2] * a + c[1][2] * b) + (c[2][2] * d + c[3][2] * e);
    }
}

/* y (2J) += smooth T'QT x; Qx: 3J. */
APSM_KERNEL static void multiply_smooth(size_t J, float smooth, const float *Q, const float *u,
                                        const float *x, float *Qx, float *y)
{
    const size_t n = 2 * J;
    memset(Qx, 0, 3 * J * sizeof *Qx);
    for (size_t j = 0; j < J; j += 4) {
        const float *q[4];
        float c[4][3] = { { 0 } };
        for (size_t r = 0; r < 4; r++) {
            q[r] = Q + (j + r < J ? j + r : j) * J;
            for (size_t k = 0; k < 3 && j + r < J; k++) {
                const float *t = u + k * n + 2 * (j + r), *at = x + 2 * (j + r);
                c[r][k] = smooth * (t[0] * at[0] + t[1] * at[1]);
            }
        }
        add_four(J, q, (const float(*)[3])c, Qx);
    }
    for (size_t k = 0; k < n; k++)
        y[k] += u[k] * Qx[k / 2] + u[n + k] * Qx[J + k / 2] + u[2 * n + k] * Qx[2 * J + k / 2];
}

void fidelity_system_multiply(const apsm_fidelity *f, const fidelity_system *s, const float *x,
                              float *y)
{
    for (size_t k = 0; k < 2 * f->J; k++) y[k] = s->diagonal[k] * x[k];
    for (size_t r = 0; r < s->n; r++) {
        float sum = 0;
        for (size_t e = s->start[r]; e < s->start[r + 1]; e++) {
            const float *at = x + 2 * (size_t)s->place[e];
            sum += s->x[2 * e] * at[0] + s->x[2 * e + 1] * at[1];
        }
        for (size_t e = s->start[r]; e < s->start[r + 1]; e++) {
            float *at = y + 2 * (size_t)s->place[e];
            at[0] += sum * s->x[2 * e];
            at[1] += sum * s->x[2 * e + 1];
        }
    }
    multiply_smooth(f->J, (float)s->smooth, f->Q32, s->tangent, x, s->work, y);
}

/* ---- its band ---- */

enum { LANES = 8 };

/* Sum of sizes of q_k t'u_k. */
KERNEL_INLINE float sum_of_sizes(size_t n, size_t stride, const float *q, const float t[3],
                                 const float *u)
{
    float lane[LANES] = { 0 }, sum = 0;
    const size_t whole = n - n % LANES;
    for (size_t k = 0; k < whole; k += LANES)
        for (size_t l = 0; l < LANES; l++) {
            const float *v = u + k + l;
            lane[l] += fabsf(q[k + l] * (t[0] * v[0] + t[1] * v[stride] + t[2] * v[2 * stride]));
        }
    for (size_t k = whole; k < n; k++)
        sum += fabsf(q[k] * (t[0] * u[k] + t[1] * u[stride + k] + t[2] * u[2 * stride + k]));
    for (size_t l = 0; l < LANES; l++) sum += lane[l];
    return sum;
}

/* The band of smooth T'QT, and share of what that loses of a row on its diagonal; q: 2J. */
APSM_KERNEL static void make_smooth_band(size_t J, size_t width, float smooth, float share,
                                         const float *Q, const float *u, float *q, float *band)
{
    const size_t n = 2 * J, reach = width / 2;
    for (size_t x = 0; x < n; x++) {
        const size_t j = x / 2, first = j > reach ? 2 * (j - reach) : 0;
        const size_t end = j + reach + 1 < J ? 2 * (j + reach + 1) : n;
        const float t[3] = { smooth * u[x], smooth * u[n + x], smooth * u[2 * n + x] };
        float *h = band + x * (width + 1);
        for (size_t k = 0; k < J && x % 2 == 0; k++) q[2 * k] = q[2 * k + 1] = Q[j * J + k];
        for (size_t y = x; y < end; y++)
            h[y - x] = q[y] * (t[0] * u[y] + t[1] * u[n + y] + t[2] * u[2 * n + y]);
        for (size_t y = end > x ? end - x : 0; y <= width; y++) h[y] = 0;
        h[0] += share *
                (sum_of_sizes(first, n, q, t, u) + sum_of_sizes(n - end, n, q + end, t, u + end));
    }
}

/* What entry a of a row makes with the entries from a to end - 1, all of them within the band. */
static void put_blocks(size_t width, const fidelity_system *s, size_t a, size_t end, float *band)
{
    const size_t low = s->place[a];
    const float p = s->x[2 * a], q = s->x[2 * a + 1];
    float *first = band + 2 * low * width, *second = first + width; /* by the other's unknown */
    first[2 * low] += p * p;
    first[2 * low + 1] += p * q;
    second[2 * low + 1] += q * q;
    for (size_t b = a + 1; b < end; b++) {
        const size_t y = 2 * (size_t)s->place[b];
        const float u = s->x[2 * b], v = s->x[2 * b + 1];
        first[y] += p * u;
        first[y + 1] += p * v;
        second[y] += q * u;
        second[y + 1] += q * v;
    }
}

/* What of a row's square is beyond the band goes in part to its diagonal. */
static void put_beyond(size_t width, float share, const float *a, const float *b, size_t low,
                       size_t high, float *band)
{
    const float A = fabsf(a[0]) + fabsf(a[1]), B = fabsf(b[0]) + fabsf(b[1]);
    for (size_t e = 0; e < 2; e++) {
        band[(2 * low + e) * (width + 1)] += share * fabsf(a[e]) * B;
        band[(2 * high + e) * (width + 1)] += share * fabsf(b[e]) * A;
    }
}

void fidelity_system_band(const apsm_fidelity *f, const fidelity_system *s, float *band)
{
    static const float share = 0.15F;
    const size_t width = f->band, reach = width / 2;
    make_smooth_band(f->J, width, (float)s->smooth, share, f->Q32, s->tangent, s->work, band);
    for (size_t r = 0; r < s->n; r++)
        for (size_t a = s->start[r]; a < s->start[r + 1]; a++) {
            const size_t low = s->place[a];
            size_t end = s->start[r + 1];
            while (s->place[end - 1] - low > reach) end--;
            put_blocks(width, s, a, end, band);
            for (size_t b = end; b < s->start[r + 1]; b++)
                put_beyond(width, share, s->x + 2 * a, s->x + 2 * b, low, s->place[b], band);
        }
    for (size_t x = 0; x < 2 * f->J; x++) band[x * (width + 1)] += s->diagonal[x];
}

/* ---- as a whole ---- */

void fidelity_system_form(const apsm_fidelity *f, const fidelity_system *s, double *H)
{
    const size_t J = f->J, n = 2 * J;
    const float *u = s->tangent;
    for (size_t x = 0; x < n; x++)
        for (size_t y = 0; y <= x; y++) {
            const double t = (double)u[x] * (double)u[y] + (double)u[n + x] * (double)u[n + y] +
                             (double)u[2 * n + x] * (double)u[2 * n + y];
            H[x * n + y] = s->smooth * (double)f->Q32[x / 2 * J + y / 2] * t;
        }
    for (size_t r = 0; r < s->n; r++)
        for (size_t a = 2 * s->start[r]; a < 2 * s->start[r + 1]; a++)
            for (size_t b = 2 * s->start[r]; b <= a; b++) {
                const size_t x = 2 * (size_t)s->place[a / 2] + a % 2;
                H[x * n + 2 * (size_t)s->place[b / 2] + b % 2] += (double)(s->x[a] * s->x[b]);
            }
    for (size_t x = 0; x < n; x++) H[x * n + x] += (double)s->diagonal[x];
}
