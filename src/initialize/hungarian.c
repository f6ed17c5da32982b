/* Cheapest assignment by shortest augmenting paths (Kuhn 1955; Jonker & Volgenant 1987).
 *
 *   C (n x n)  costs;  u, v  prices of rows and columns;  reduced cost  C_ij - u_i - v_j >= 0   (1)
 * with equality on assigned pairs: then the assignment is optimal, since every assignment costs at
 * least sum u + sum v.  Three steps keep (1) throughout:
 *   reduce_columns  v_j = min_i C_ij; a row that gives the minimum of some column takes it;
 *   reduce_rows     a free row takes its cheapest column from whoever has it, and lowers that
 *                   column's price by what the second cheapest would cost more;
 *   augment         Dijkstra over reduced costs from a free row to a free column.
 * The first two assign most rows in O(n^2).  u is recovered at the end. */
#include "initialize/assignment.h"

#include <math.h>
#include <string.h>

#include "core/kernel.h"

typedef struct assigner {
    size_t n;
    const double *C;  /* n x n */
    double *v;        /* n: column prices */
    double *d;        /* n: distances of columns in augment */
    uint32_t *column; /* n: of a row, or APSM_NONE */
    uint32_t *row;    /* n: of a column, or APSM_NONE */
    uint32_t *from;   /* n: row before a column on its path */
    uint32_t *list;   /* n: columns, those scanned first */
    uint32_t *free;   /* n: rows without a column */
    size_t n_free;
} assigner;

size_t apsm_assign_work_size(size_t n)
{
    return n * (sizeof(double) + 4 * sizeof(uint32_t)) + sizeof(double);
}

/* d <- column minima, from <- the rows that have them (the first such). */
APSM_KERNEL static void column_minima(size_t n, const double *C, double *d, uint32_t *from)
{
    memcpy(d, C, n * sizeof *d);
    memset(from, 0, n * sizeof *from);
    for (size_t i = 1; i < n; i++)
        for (size_t j = 0; j < n; j++) {
            const bool less = C[i * n + j] < d[j];
            d[j] = less ? C[i * n + j] : d[j];
            from[j] = less ? (uint32_t)i : from[j];
        }
}

static void reduce_columns(assigner *a)
{
    const size_t n = a->n;
    column_minima(n, a->C, a->v, a->from);
    for (size_t i = 0; i < n; i++) a->column[i] = a->row[i] = APSM_NONE;
    for (size_t j = 0; j < n; j++) {
        const uint32_t i = a->from[j];
        if (a->column[i] != APSM_NONE) continue;
        a->column[i] = (uint32_t)j;
        a->row[j] = i;
    }
    a->n_free = 0;
    for (size_t i = 0; i < n; i++)
        if (a->column[i] == APSM_NONE) a->free[a->n_free++] = (uint32_t)i;
}

/* The two smallest of c - v and the column of the first; ties: lowest index. */
static uint32_t two_smallest(size_t n, const double *c, const double *v, double *first,
                             double *second, uint32_t *runner_up)
{
    uint32_t best = 0, next = APSM_NONE;
    double a = c[0] - v[0], b = INFINITY;
    for (size_t j = 1; j < n; j++) {
        const double x = c[j] - v[j];
        if (x >= b) continue;
        if (x < a) {
            b = a;
            next = best;
            a = x;
            best = (uint32_t)j;
        } else {
            b = x;
            next = (uint32_t)j;
        }
    }
    *first = a;
    *second = b;
    *runner_up = next;
    return best;
}

/* One round over the free rows.  A row that loses its column by a gain in price is treated next;
 * the count bounds chains that rounding might make endless. */
static void reduce_rows(assigner *a)
{
    const size_t n = a->n, rows = a->n_free;
    size_t k = 0, kept = 0, left = 8 * n;
    while (k < rows) {
        const uint32_t i = a->free[k++];
        double first, second;
        uint32_t other, j = two_smallest(n, a->C + i * n, a->v, &first, &second, &other);
        const bool gain = first < second && second < INFINITY;
        if (gain)
            a->v[j] -= second - first;
        else if (a->row[j] != APSM_NONE && other != APSM_NONE)
            j = other; /* a tie */
        const uint32_t loser = a->row[j];
        a->column[i] = j;
        a->row[j] = i;
        if (loser == APSM_NONE) continue;
        a->column[loser] = APSM_NONE;
        if (gain && left > 0) {
            left--;
            a->free[--k] = loser;
        } else {
            a->free[kept++] = loser;
        }
    }
    a->n_free = kept;
}

/* Lowers the distances of the columns list[scanned..n) by way of row i, and brings those at the
 * distance `least` of i's own column to the front of them.  Returns the new end of that front,
 * or sets *end to a free column at that distance. */
static size_t relax(assigner *a, uint32_t i, double least, size_t front, uint32_t *end)
{
    const size_t n = a->n;
    const double *c = a->C + i * n;
    const double shift = least - (c[a->column[i]] - a->v[a->column[i]]);
    for (size_t k = front; k < n; k++) {
        const uint32_t j = a->list[k];
        const double x = c[j] - a->v[j] + shift;
        if (!(x < a->d[j])) continue;
        a->d[j] = x;
        a->from[j] = i;
        if (x > least) continue;
        if (a->row[j] == APSM_NONE) {
            *end = j;
            return front;
        }
        a->list[k] = a->list[front];
        a->list[front++] = j;
    }
    return front;
}

/* Columns at the least distance among list[front..n) come first; returns their end. */
static size_t next_front(const assigner *a, size_t front, double *least)
{
    size_t end = front;
    *least = INFINITY;
    for (size_t k = front; k < a->n; k++) {
        const uint32_t j = a->list[k];
        if (a->d[j] > *least) continue;
        if (a->d[j] < *least) {
            *least = a->d[j];
            end = front;
        }
        a->list[k] = a->list[end];
        a->list[end++] = j;
    }
    return end;
}

/* Shortest path from a free row to a free column; prices of scanned columns are settled. */
static uint32_t shortest_path(assigner *a, uint32_t start)
{
    const size_t n = a->n;
    for (size_t j = 0; j < n; j++) {
        a->d[j] = a->C[start * n + j] - a->v[j];
        a->from[j] = start;
        a->list[j] = (uint32_t)j;
    }
    size_t scanned = 0, front = 0, settled = 0;
    uint32_t end = APSM_NONE;
    double least = 0.0;
    while (end == APSM_NONE) {
        if (scanned == front) {
            settled = front;
            front = next_front(a, front, &least);
            for (size_t k = scanned; k < front && end == APSM_NONE; k++)
                if (a->row[a->list[k]] == APSM_NONE) end = a->list[k];
        }
        while (end == APSM_NONE && scanned < front)
            front = relax(a, a->row[a->list[scanned++]], least, front, &end);
    }
    for (size_t k = 0; k < settled; k++) a->v[a->list[k]] += a->d[a->list[k]] - least;
    return end;
}

static void augment(assigner *a, uint32_t start)
{
    uint32_t j = shortest_path(a, start), i;
    do { /* hand columns on along the path */
        i = a->from[j];
        const uint32_t before = a->column[i];
        a->row[j] = i;
        a->column[i] = j;
        j = before;
    } while (i != start);
}

apsm_status apsm_assign(size_t n, const double *cost, uint32_t *column, double *row_price,
                        double *column_price, void *work)
{
    for (size_t k = 0; k < n * n; k++)
        if (!isfinite(cost[k])) return APSM_ERR_NONFINITE;
    if (n == 0) return APSM_OK;
    double *d = work;
    uint32_t *index = (uint32_t *)(d + n);
    assigner a = { .n = n,
                   .C = cost,
                   .v = column_price,
                   .d = d,
                   .column = column,
                   .row = index,
                   .from = index + n,
                   .list = index + 2 * n,
                   .free = index + 3 * n };
    reduce_columns(&a);
    reduce_rows(&a);
    reduce_rows(&a);
    for (size_t k = 0; k < a.n_free; k++) augment(&a, a.free[k]);
    for (size_t i = 0; i < n; i++) row_price[i] = cost[i * n + column[i]] - column_price[column[i]];
    return APSM_OK;
}

/* ---- matching samples ---- */

size_t apsm_match_samples_work_size(size_t J)
{
    return (J * J + 2 * J) * sizeof(double) + J * sizeof(uint32_t) + sizeof(double) +
           apsm_assign_work_size(J);
}

/* What is out of reach costs more than a whole assignment within reach. */
static void replace_infinite(size_t J, double *cost)
{
    double largest = 0.0;
    for (size_t k = 0; k < J * J; k++)
        if (cost[k] < INFINITY) largest = fmax(largest, cost[k]);
    const double beyond = largest > 0.0 ? largest * (double)(J + 1) : 1.0;
    for (size_t k = 0; k < J * J; k++)
        if (!(cost[k] < INFINITY)) cost[k] = beyond;
}

apsm_status apsm_match_samples(const apsm_geodesic *g, apsm_geodesic_work *w, size_t J,
                               const apsm_surface_point *reference,
                               const apsm_surface_point *samples, apsm_surface_point *matched,
                               void *work)
{
    double *cost = work, *row_price = cost + J * J, *column_price = row_price + J,
           *scratch = column_price + J;
    uint32_t *column = (uint32_t *)((char *)scratch + apsm_assign_work_size(J));
    for (size_t j = 0; j < J; j++) {
        APSM_TRY(apsm_geodesic_from(g, reference + j, INFINITY, w));
        for (size_t k = 0; k < J; k++) cost[j * J + k] = apsm_geodesic_distance(g, w, samples + k);
    }
    replace_infinite(J, cost);
    APSM_TRY(apsm_assign(J, cost, column, row_price, column_price, scratch));
    for (size_t j = 0; j < J; j++) matched[j] = samples[column[j]];
    return APSM_OK;
}
