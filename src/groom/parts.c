/* Runs that touch are joined by union and find; roots are the first runs of their parts, so that
 * parts are numbered in the order of their first voxels. */
#include "groom/parts.h"

#include <stdlib.h>

/* Runs of in == value in a row of nx voxels; run NULL: only counted. */
static size_t row_runs(size_t nx, const unsigned char *in, unsigned char value, part_run *run)
{
    size_t count = 0;
    for (size_t x = 0; x < nx;) {
        while (x < nx && in[x] != value) x++;
        if (x == nx) break;
        const size_t from = x;
        while (x < nx && in[x] == value) x++;
        if (run) run[count] = (part_run){ (uint32_t)from, (uint32_t)x, 0 };
        count++;
    }
    return count;
}

static uint32_t root_of(part_run *run, uint32_t i)
{
    while (run[i].part != i) {
        run[i].part = run[run[i].part].part;
        i = run[i].part;
    }
    return i;
}

static void join(part_run *run, uint32_t i, uint32_t k)
{
    const uint32_t a = root_of(run, i), b = root_of(run, k);
    if (a < b)
        run[b].part = a;
    else
        run[a].part = b;
}

/* Joins the runs of two rows that touch; corners: also if one ends where the other begins. */
static void join_rows(const parts *p, size_t row, size_t other, bool corners)
{
    const uint32_t slack = corners;
    size_t i = p->first[row], k = p->first[other];
    while (i < p->first[row + 1] && k < p->first[other + 1]) {
        const part_run *a = &p->run[i], *b = &p->run[k];
        if (a->from < b->to + slack && b->from < a->to + slack)
            join(p->run, (uint32_t)i, (uint32_t)k);
        if (a->to < b->to)
            i++;
        else
            k++;
    }
}

static void join_all(const size_t n[3], const parts *p, bool corners)
{
    for (size_t z = 0; z < n[2]; z++)
        for (size_t y = 0; y < n[1]; y++) {
            const size_t row = y + n[1] * z;
            if (y > 0) join_rows(p, row, row - 1, corners);
            if (z > 0) join_rows(p, row, row - n[1], corners);
            if (z > 0 && y > 0 && corners) join_rows(p, row, row - n[1] - 1, true);
            if (z > 0 && y + 1 < n[1] && corners) join_rows(p, row, row - n[1] + 1, true);
        }
}

/* Roots to numbers of parts.  Roots come before their runs. */
static apsm_status number(size_t runs, parts *p)
{
    for (size_t i = 0; i < runs; i++) p->n += p->run[i].part == i;
    p->size = calloc(p->n + 1, sizeof *p->size);
    if (!p->size) return APSM_ERR_MEMORY;
    size_t next = 0;
    for (size_t i = 0; i < runs; i++) {
        part_run *r = &p->run[i];
        r->part = r->part == i ? (uint32_t)next++ : p->run[r->part].part;
        p->size[r->part] += r->to - r->from;
    }
    return APSM_OK;
}

apsm_status parts_find(const size_t n[3], const unsigned char *in, unsigned char value,
                       bool corners, parts *p)
{
    const size_t rows = n[1] * n[2];
    size_t runs = 0;
    *p = (parts){ .first = malloc((rows + 1) * sizeof *p->first) };
    if (!p->first) return APSM_ERR_MEMORY;
    for (size_t r = 0; r < rows; r++) {
        p->first[r] = runs;
        runs += row_runs(n[0], in + n[0] * r, value, NULL);
    }
    p->first[rows] = runs;
    p->run = malloc((runs + 1) * sizeof *p->run);
    apsm_status status = p->run && runs < UINT32_MAX ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        for (size_t r = 0; r < rows; r++)
            (void)row_runs(n[0], in + n[0] * r, value, p->run + p->first[r]);
        for (size_t i = 0; i < runs; i++) p->run[i].part = (uint32_t)i;
        join_all(n, p, corners);
        for (size_t i = 0; i < runs; i++) p->run[i].part = root_of(p->run, (uint32_t)i);
        status = number(runs, p);
    }
    if (status != APSM_OK) parts_free(p);
    return status;
}

void parts_paint(const size_t n[3], const parts *p, size_t part, unsigned char to,
                 unsigned char *in)
{
    for (size_t row = 0; row < n[1] * n[2]; row++)
        for (size_t i = p->first[row]; i < p->first[row + 1]; i++)
            if (p->run[i].part == part)
                for (size_t x = p->run[i].from; x < p->run[i].to; x++) in[x + n[0] * row] = to;
}

void parts_free(parts *p)
{
    free(p->first);
    free(p->run);
    free(p->size);
    *p = (parts){ .first = NULL };
}
