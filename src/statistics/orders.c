/* Order number k of a multiset is found without the ones before (Knuth, TAOCP 4A, 7.2.1.2, by
 * counting): at each place the classes are tried in turn, and each holds as many orders as its
 * remaining places can be filled.  Blocks are the digits of a number with mixed radix. */
#include "statistics/orders.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"

static const double most_counted = 1e15; /* integers up to here are exact in a double */

void apsm_orders_free(apsm_orders *orders)
{
    free(orders->row);
    free(orders->first);
    free(orders->class_of);
    *orders = (apsm_orders){ 0 };
}

/* Rows sorted by block, in their order within each. */
static void sort_blocks(const size_t *block, apsm_orders *o)
{
    size_t n = 0;
    for (size_t b = 0; n < o->N; b++) {
        o->first[b] = n;
        for (size_t i = 0; i < o->N; i++)
            if ((block ? block[i] : 0) == b) o->row[n++] = i;
        o->blocks = b + 1;
    }
    o->first[o->blocks] = n;
}

static bool same_columns(const apsm_design *d, size_t a, size_t b, size_t columns)
{
    return memcmp(d->X + a * d->q, d->X + b * d->q, columns * sizeof *d->X) == 0;
}

/* Whether the reduced model says the same of all rows of every block. */
static bool is_plain(const apsm_design *d, const apsm_orders *o)
{
    for (size_t b = 0; b < o->blocks; b++)
        for (size_t k = o->first[b] + 1; k < o->first[b + 1]; k++)
            if (!same_columns(d, o->row[o->first[b]], o->row[k], d->r)) return false;
    return true;
}

/* Classes are numbered by their first row's place in the block. */
static void classify(const apsm_design *d, apsm_orders *o)
{
    const bool plain = is_plain(d, o);
    for (size_t b = 0; b < o->blocks; b++)
        for (size_t k = o->first[b]; k < o->first[b + 1]; k++) {
            size_t like = k;
            for (size_t m = o->first[b]; plain && m < k && like == k; m++)
                if (same_columns(d, o->row[m], o->row[k], d->q)) like = m;
            o->class_of[k] = like;
        }
}

/* Orders of left[c] things of each of the classes from..to: (sum left)! / prod left!. */
static double multinomial(size_t from, size_t to, const size_t *left)
{
    double orders = 1;
    size_t n = 0;
    for (size_t c = from; c < to; c++)
        for (size_t k = 1; k <= left[c]; k++) {
            orders = orders * (double)++n / (double)k; /* a binomial product: whole at each step */
            if (!(orders <= most_counted)) return INFINITY;
        }
    return round(orders);
}

static void count_classes(const apsm_orders *o, size_t b, size_t *left)
{
    for (size_t k = o->first[b]; k < o->first[b + 1]; k++) left[k] = 0;
    for (size_t k = o->first[b]; k < o->first[b + 1]; k++) left[o->class_of[k]]++;
}

static double count_orders(const apsm_orders *o, size_t *left)
{
    double all = 1;
    for (size_t b = 0; b < o->blocks; b++) {
        count_classes(o, b, left);
        all *= multinomial(o->first[b], o->first[b + 1], left);
        if (!(all <= most_counted)) return INFINITY;
    }
    return all;
}

apsm_status apsm_orders_make(apsm_context *ctx, const apsm_design *design, const size_t *block,
                             size_t most, apsm_orders *orders)
{
    const size_t N = design->N;
    *orders = (apsm_orders){ .N = N,
                             .row = malloc(N * sizeof(size_t)),
                             .first = malloc((N + 1) * sizeof(size_t)),
                             .class_of = malloc(N * sizeof(size_t)) };
    size_t *left = malloc(N * sizeof *left);
    if (!orders->row || !orders->first || !orders->class_of || !left) {
        free(left);
        apsm_orders_free(orders);
        return APSM_ERR_MEMORY;
    }
    for (size_t i = 0; block && i < N; i++)
        if (block[i] >= N) {
            free(left);
            apsm_orders_free(orders);
            return apsm_fail(ctx, APSM_ERR_ARG, "blocks are numbered from 0, without gaps");
        }
    sort_blocks(block, orders);
    classify(design, orders);
    orders->all = count_orders(orders, left);
    orders->exact = orders->all <= (double)most;
    orders->count = orders->exact ? (size_t)orders->all : most;
    free(left);
    return APSM_OK;
}

/* The next row of class c of a block that has not been given out: counted up in taken[c]. */
static size_t next_of_class(const apsm_orders *o, size_t b, size_t c, size_t *taken)
{
    size_t seen = 0;
    for (size_t k = o->first[b];; k++)
        if (o->class_of[k] == c && seen++ == taken[c]) {
            taken[c]++;
            return o->row[k];
        }
}

/* Order number k of block b, k below its number of orders. */
static void order_of_block(const apsm_orders *o, size_t b, double k, size_t *sigma, size_t *work)
{
    const size_t from = o->first[b], to = o->first[b + 1];
    size_t *left = work, *taken = work + o->N;
    count_classes(o, b, left);
    memset(taken + from, 0, (to - from) * sizeof *taken);
    for (size_t at = from; at < to; at++)
        for (size_t c = from; c < to; c++) {
            if (left[c] == 0) continue;
            left[c]--;
            const double below = multinomial(from, to, left);
            if (k < below) {
                sigma[o->row[at]] = next_of_class(o, b, c, taken);
                break;
            }
            k -= below;
            left[c]++;
        }
}

/* Number 0 is the first in the order of classes, not the given one: the two change places. */
static double number_of_given(const apsm_orders *o, size_t b, size_t *left)
{
    const size_t from = o->first[b], to = o->first[b + 1];
    double k = 0;
    count_classes(o, b, left);
    for (size_t at = from; at < to; at++) {
        for (size_t c = from; c < o->class_of[at]; c++) {
            if (left[c] == 0) continue;
            left[c]--;
            k += multinomial(from, to, left);
            left[c]++;
        }
        left[o->class_of[at]]--;
    }
    return k;
}

static void get_exact(const apsm_orders *o, double k, size_t *sigma, size_t *work)
{
    for (size_t b = 0; b < o->blocks; b++) {
        count_classes(o, b, work);
        const double n = multinomial(o->first[b], o->first[b + 1], work);
        double digit = fmod(k, n);
        k = floor(k / n);
        const double given = number_of_given(o, b, work);
        digit = digit == 0 ? given : digit == given ? 0 : digit;
        order_of_block(o, b, digit, sigma, work);
    }
}

static void get_random(const apsm_orders *o, uint64_t seed, size_t k, size_t *sigma)
{
    apsm_random rng = apsm_random_stream(seed, APSM_STREAM_PERMUTATION, k, 0);
    for (size_t i = 0; i < o->N; i++) sigma[i] = i;
    for (size_t b = 0; b < o->blocks; b++)
        for (size_t m = o->first[b + 1]; m-- > o->first[b] + 1;) {
            const size_t with = o->first[b] + apsm_random_below(&rng, m - o->first[b] + 1);
            const size_t x = sigma[o->row[m]];
            sigma[o->row[m]] = sigma[o->row[with]];
            sigma[o->row[with]] = x;
        }
}

void apsm_orders_get(const apsm_orders *orders, uint64_t seed, size_t k, size_t *sigma,
                     size_t *work)
{
    if (orders->exact)
        get_exact(orders, (double)k, sigma, work);
    else
        get_random(orders, seed, k, sigma);
}

void apsm_orders_signs(size_t N, uint64_t seed, size_t k, double *sign)
{
    apsm_random rng = apsm_random_stream(seed, APSM_STREAM_PERMUTATION, k, 1);
    for (size_t i = 0; i < N; i++) sign[i] = apsm_random_below(&rng, 2) ? 1 : -1;
}
