/* Anti-aliasing of a mask by constrained smoothing.
 *
 *   M    mask, 1 inside, 0 outside, known at its own nodes
 *   u    smooth function on the fine grid; the surface is the set u = l
 *   G    small binomial filter, equally wide along all axes in space
 *
 * u minimises  |(I - G) u|^2 + mu sum over mask nodes of (u - M)^2                           (A1)
 * subject to   u >= l + m at inner, u <= l - m at outer firm mask nodes                      (A2)
 *
 * The first term is close to the squared Laplacian (a thin plate), so that planes and, nearly,
 * spheres pass unchanged where a blur would shrink them.  The constraint holds for voxels behind
 * the surface and for all of thin parts (thin.c), so that sheets and tips of one voxel survive
 * while raggedness of a voxel on thick parts goes.  Between nodes far apart (fine nodes without
 * data) the first term alone interpolates; where these are slices M is their signed distances'
 * (between.c), and what is between them the start.  The level l makes the volume that of the mask;
 * it is found anew after every round of iterations, as the constraint refers to it.  Constraints on
 * a level set: Whitaker, "Reducing aliasing artifacts in iso-surfaces of binary volumes", 2000;
 * there the curvature flow shrinks.  Solved by projected accelerated gradients (Beck & Teboulle
 * 2009) on the nodes near the surface; elsewhere u = M. */
#include "groom/antialias.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "core/kernel.h"
#include "groom/between.h"
#include "groom/thin.h"

static const double fidelity = 0.02;     /* mu for smoothing = 1 */
static const float voxel_margin = 0.03f; /* m */
static const float slice_margin = 0.06f; /* m between slices, over between_slope */
enum { REACH = 4, ROUNDS = 3, ITERATIONS = 8, BINS = 4096 };
enum { IN_A_RUN = 255 }; /* of thin_mark's marks: the node has a kind */
/* Kinds of fine nodes: between the mask's; mask nodes bound by (A2); mask nodes that are not; of
 * those, what sticks out by a voxel. */
enum { FREE, INNER, OUTER, INNER_LOOSE, OUTER_LOOSE, INNER_RAGGED, OUTER_RAGGED };
/* M in (A1); of ragged nodes the mask is hardly believed. */
static const float expected[] = { 0.0f, 1.0f, 0.0f, 1.0f, 0.0f, 0.65f, 0.35f };

/* Fine nodes [from, to) of row `row` (= y + ny z) that may change. */
typedef struct run {
    size_t row;
    uint32_t from, to;
    size_t first; /* of its nodes among those of all runs */
} run;

typedef struct work {
    const antialias_input *in;
    size_t n[3];         /* of the fine grid */
    float w[3];          /* G along an axis: w, 1 - 2w, w */
    float *y;            /* fine; that of the iterations, and u when they end */
    float *u;            /* nodes */
    float *r[3];         /* (I - G) y in plane z of the fine grid is r[z % 3]; 0 where no run is */
    run *runs;           /* by rows */
    size_t *plane;       /* plane z has the runs plane[z] .. plane[z + 1] - 1; n[2] + 1 */
    size_t count, nodes; /* of runs, and of all nodes in them */
    unsigned char *kind; /* nodes */
    float *target;       /* nodes: M of slices far apart; or NULL */
    float *line;         /* 2 n[0] + 4 */
    float mu, level, margin;
    float elsewhere; /* least of y at firm inner nodes outside of the runs, or INFINITY */
} work;

static size_t reach_of(const antialias_input *in, int axis)
{
    const double nodes = ceil(REACH * fmax(in->smoothing, 1.0) / in->refine[axis]);
    return (size_t)nodes + (in->refine[axis] > 1);
}

void antialias_rim(const antialias_input *in, size_t rim[3])
{
    for (int c = 0; c < 3; c++) rim[c] = reach_of(in, c) + 2;
}

void antialias_fine(const antialias_input *in, size_t fine[3])
{
    for (int c = 0; c < 3; c++) fine[c] = (in->n[c] - 1) * (size_t)in->refine[c] + 1;
}

/* --- which nodes take part ---------------------------------------------------------------- */

/* near (mask grid, out): 1 at the two ends of every edge the surface crosses. */
static void mark_surface(const antialias_input *in, unsigned char *near)
{
    const size_t nx = in->n[0], ny = in->n[1], nz = in->n[2];
    const size_t step[3] = { 1, nx, nx * ny };
    memset(near, 0, nx * ny * nz);
    for (size_t z = 0; z < nz; z++)
        for (size_t y = 0; y < ny; y++)
            for (size_t x = 0; x < nx; x++) {
                const size_t i = x + nx * (y + ny * z), at[3] = { x, y, z };
                for (int c = 0; c < 3; c++)
                    if (at[c] + 1 < in->n[c] && in->mask[i] != in->mask[i + step[c]])
                        near[i] = near[i + step[c]] = 1;
            }
}

/* near <- nodes within `reach` of a marked one along one line of n nodes, `step` apart. */
static void dilate_line(unsigned char *near, size_t n, size_t step, size_t reach)
{
    size_t left = 0; /* steps the last mark still reaches, plus one */
    for (size_t i = 0; i < n; i++) {
        if (near[i * step] == 1) left = reach + 1;
        if (left) {
            left--;
            if (near[i * step] == 0) near[i * step] = 2;
        }
    }
    left = 0;
    for (size_t i = n; i-- > 0;) {
        if (near[i * step] == 1) left = reach + 1;
        if (left) {
            left--;
            if (near[i * step] == 0) near[i * step] = 2;
        }
    }
    for (size_t i = 0; i < n; i++) near[i * step] = near[i * step] != 0;
}

static void dilate(const antialias_input *in, unsigned char *near)
{
    const size_t *n = in->n, step[3] = { 1, n[0], n[0] * n[1] };
    for (int c = 0; c < 3; c++) {
        const int a = (c + 1) % 3, b = (c + 2) % 3;
        for (size_t i = 0; i < n[a]; i++)
            for (size_t k = 0; k < n[b]; k++)
                dilate_line(near + i * step[a] + k * step[b], n[c], step[c], reach_of(in, c));
    }
}

/* Whether the mask node below or above fine row (y, z), at mask x, is near. */
static bool row_near(const antialias_input *in, const unsigned char *near, size_t x, size_t y,
                     size_t z)
{
    const size_t ry = (size_t)in->refine[1], rz = (size_t)in->refine[2];
    const size_t y0 = y / ry, y1 = (y + ry - 1) / ry, z0 = z / rz, z1 = (z + rz - 1) / rz;
    const size_t nx = in->n[0], ny = in->n[1];
    return near[x + nx * (y0 + ny * z0)] || near[x + nx * (y1 + ny * z0)] ||
           near[x + nx * (y0 + ny * z1)] || near[x + nx * (y1 + ny * z1)];
}

/* Runs of row (y, z), which is not on the border of the grid; runs NULL: only counted. */
static size_t row_runs(const work *w, const unsigned char *near, size_t y, size_t z, run *runs)
{
    const size_t rx = (size_t)w->in->refine[0];
    size_t count = 0;
    for (size_t x = 0; x < w->in->n[0];) {
        if (!row_near(w->in, near, x, y, z)) {
            x++;
            continue;
        }
        size_t end = x + 1;
        while (end < w->in->n[0] && row_near(w->in, near, end, y, z)) end++;
        size_t from = x * rx, to = (end - 1) * rx + 1;
        if (from == 0) from = 1;
        if (to > w->n[0] - 1) to = w->n[0] - 1;
        if (runs) runs[count] = (run){ y + w->n[1] * z, (uint32_t)from, (uint32_t)to, 0 };
        count++;
        x = end;
    }
    return count;
}

static size_t all_runs(const work *w, const unsigned char *near, run *runs)
{
    size_t count = 0;
    for (size_t z = 1; z + 1 < w->n[2]; z++)
        for (size_t y = 1; y + 1 < w->n[1]; y++)
            count += row_runs(w, near, y, z, runs ? runs + count : NULL);
    return count;
}

/* Where the nodes of each run begin, and the runs of each plane. */
static void number_runs(work *w)
{
    size_t k = 0;
    for (size_t z = 0; z < w->n[2]; z++) {
        w->plane[z] = k;
        for (; k < w->count && w->runs[k].row < w->n[1] * (z + 1); k++) {
            w->runs[k].first = w->nodes;
            w->nodes += w->runs[k].to - w->runs[k].from;
        }
    }
    w->plane[w->n[2]] = k;
}

static apsm_status find_runs(work *w)
{
    unsigned char *near = malloc(w->in->n[0] * w->in->n[1] * w->in->n[2]);
    if (!near) return APSM_ERR_MEMORY;
    mark_surface(w->in, near);
    dilate(w->in, near);
    w->count = all_runs(w, near, NULL);
    w->runs = malloc((w->count + 1) * sizeof *w->runs);
    w->plane = malloc((w->n[2] + 1) * sizeof *w->plane);
    if (w->runs) (void)all_runs(w, near, w->runs);
    if (w->runs && w->plane) number_runs(w);
    free(near);
    w->kind = malloc(w->nodes + 1);
    w->u = malloc((w->nodes + 1) * sizeof *w->u);
    return w->runs && w->plane && w->kind && w->u ? APSM_OK : APSM_ERR_MEMORY;
}

/* --- the start: M, linear between its nodes ------------------------------------------------ */

static float mask_between(const antialias_input *in, size_t x, size_t y, size_t z)
{
    const size_t at[3] = { x, y, z };
    size_t i[3], step[3] = { 1, in->n[0], in->n[0] * in->n[1] };
    float t[3], sum = 0.0f;
    for (int c = 0; c < 3; c++) {
        const size_t r = (size_t)in->refine[c];
        i[c] = at[c] / r;
        t[c] = (float)(at[c] % r) / (float)r;
    }
    const size_t base = i[0] + step[1] * i[1] + step[2] * i[2];
    for (int k = 0; k < 8; k++) {
        float weight = 1.0f;
        size_t node = base;
        for (int c = 0; c < 3; c++) {
            weight *= k >> c & 1 ? t[c] : 1.0f - t[c];
            node += (k >> c & 1) && t[c] > 0.0f ? step[c] : 0;
        }
        sum += weight * (float)in->mask[node];
    }
    return sum;
}

/* In cubes a ragged voxel is rather noise; a slice thicker than its voxels are wide is ragged where
 * a smooth surface leaves it. */
static unsigned char node_kind(const antialias_input *in, unsigned char inside, unsigned char firm)
{
    const bool cubes = in->refine[0] == 1 && in->refine[1] == 1 && in->refine[2] == 1;
    if (firm == THIN_FIRM) return inside ? INNER : OUTER;
    if (firm == THIN_RAGGED && cubes) return inside ? INNER_RAGGED : OUTER_RAGGED;
    return inside ? INNER_LOOSE : OUTER_LOOSE;
}

/* The kinds of a run's nodes, of which firm does not speak then. */
static void mark_run(const work *w, const run *p, unsigned char *firm)
{
    const antialias_input *in = w->in;
    const size_t rx = (size_t)in->refine[0], ry = (size_t)in->refine[1], rz = (size_t)in->refine[2];
    const size_t y = p->row % w->n[1], z = p->row / w->n[1];
    unsigned char *kind = w->kind + p->first;
    for (size_t x = p->from; x < p->to; x++) {
        const bool node = x % rx == 0 && y % ry == 0 && z % rz == 0;
        const size_t at = x / rx + in->n[0] * (y / ry + in->n[1] * (z / rz));
        *kind++ = node ? node_kind(in, in->mask[at], firm[at]) : FREE;
        if (node) firm[at] = IN_A_RUN;
    }
}

/* Of firm inner nodes outside of the runs. */
static float least_elsewhere(const work *w, const unsigned char *firm)
{
    const antialias_input *in = w->in;
    const size_t rx = (size_t)in->refine[0], ry = (size_t)in->refine[1], rz = (size_t)in->refine[2];
    float least = INFINITY;
    size_t i = 0;
    for (size_t z = 0; z < in->n[2]; z++)
        for (size_t y = 0; y < in->n[1]; y++)
            for (size_t x = 0; x < in->n[0]; x++, i++)
                if (in->mask[i] && firm[i] == THIN_FIRM)
                    least = fminf(least, w->y[x * rx + w->n[0] * (y * ry + w->n[1] * z * rz)]);
    return least;
}

/* y <- M. */
static void start_values(work *w)
{
    const antialias_input *in = w->in;
    const bool same = w->n[0] == in->n[0] && w->n[1] == in->n[1] && w->n[2] == in->n[2];
    const size_t count = w->n[0] * w->n[1] * w->n[2];
    size_t i = 0;
    if (same)
        for (; i < count; i++) w->y[i] = (float)in->mask[i];
    for (size_t z = 0; z < w->n[2] && !same; z++)
        for (size_t y = 0; y < w->n[1]; y++)
            for (size_t x = 0; x < w->n[0]; x++) w->y[i++] = mask_between(in, x, y, z);
}

/* y in the runs. */
static void copy_runs(const work *w, float *nodes)
{
    for (size_t k = 0; k < w->count; k++) {
        const run *p = &w->runs[k];
        memcpy(nodes + p->first, w->y + p->row * w->n[0] + p->from,
               (p->to - p->from) * sizeof *nodes);
    }
}

/* y, and what stands for M in the runs, where slices are far apart. */
static apsm_status start_between(work *w, int axis)
{
    w->margin = slice_margin * between_slope(w->in, axis);
    w->target = malloc((w->nodes + 1) * sizeof *w->target);
    if (!w->target) return APSM_ERR_MEMORY;
    APSM_TRY(between_slices(w->in, axis, w->y));
    copy_runs(w, w->target);
    return APSM_OK;
}

static apsm_status start(work *w, unsigned char *firm)
{
    const int axis = between_axis(w->in);
    for (size_t k = 0; k < w->count; k++) mark_run(w, &w->runs[k], firm);
    w->margin = voxel_margin;
    if (axis < 0)
        start_values(w);
    else
        APSM_TRY(start_between(w, axis));
    copy_runs(w, w->u);
    w->elsewhere = least_elsewhere(w, firm);
    return APSM_OK;
}

/* --- iterations ----------------------------------------------------------------------------- */

/* out[0..n) <- (I - G) f on a run; f, lo and hi point at its first node, in its plane and those
 * below and above.  line: n + 2 scratch. */
APSM_KERNEL
static void minus_filtered(const float *restrict f, const float *below, const float *above,
                           ptrdiff_t row, size_t n, const float w[3], float *restrict line,
                           float *restrict out)
{
    const float cy = 1.0f - 2.0f * w[1], cz = 1.0f - 2.0f * w[2], cx = 1.0f - 2.0f * w[0];
    const float a = cy * cz, b = w[1] * cz, c = cy * w[2], d = w[1] * w[2];
    const float *m = f - 1, *lo = below - 1, *hi = above - 1;
    for (ptrdiff_t i = 0; i < (ptrdiff_t)n + 2; i++)
        line[i] = a * m[i] + b * (m[i - row] + m[i + row]) + c * (lo[i] + hi[i]) +
                  d * ((lo[i - row] + lo[i + row]) + (hi[i - row] + hi[i + row]));
    for (size_t i = 0; i < n; i++)
        out[i] = f[i] - (cx * line[i + 1] + w[0] * (line[i] + line[i + 2]));
}

/* z within (A2). */
static inline float project(unsigned char kind, float level, float margin, float z)
{
    z = kind == INNER && z < level + margin ? level + margin : z;
    return kind == OUTER && z > level - margin ? level - margin : z;
}

/* One node row: gradient step from y, projection to (A2), extrapolation by beta. */
APSM_KERNEL
static void step_row(const work *w, const run *p, const float *restrict gradient, float beta)
{
    const size_t at = p->row * w->n[0] + p->from, n = p->to - p->from;
    const unsigned char *const kind = w->kind + p->first;
    const float mu = w->mu, scale = 1.0f / (1.0f + mu), level = w->level, margin = w->margin;
    float *restrict u = w->u + p->first, *restrict y = w->y + at;
    for (size_t i = 0; i < n; i++) {
        const float pull = kind[i] == FREE ? 0.0f : mu * (y[i] - expected[kind[i]]);
        const float z = project(kind[i], level, margin, y[i] - scale * (gradient[i] + pull));
        y[i] = z + beta * (z - u[i]);
        u[i] = z;
    }
}

/* The same for slices far apart. */
APSM_KERNEL
static void step_row_between(const work *w, const run *p, const float *restrict gradient,
                             float beta)
{
    const size_t at = p->row * w->n[0] + p->from, n = p->to - p->from;
    const unsigned char *const kind = w->kind + p->first;
    const float *const target = w->target + p->first;
    const float mu = w->mu, scale = 1.0f / (1.0f + mu), level = w->level, margin = w->margin;
    float *restrict u = w->u + p->first, *restrict y = w->y + at;
    for (size_t i = 0; i < n; i++) {
        const float pull = kind[i] == FREE ? 0.0f : mu * (y[i] - target[i]);
        const float z = project(kind[i], level, margin, y[i] - scale * (gradient[i] + pull));
        y[i] = z + beta * (z - u[i]);
        u[i] = z;
    }
}

/* r of plane z <- 0 in the runs of plane `of`, which held its memory before. */
static void clear_plane(const work *w, size_t z, size_t of)
{
    for (size_t k = w->plane[of]; k < w->plane[of + 1]; k++) {
        const run *const p = &w->runs[k];
        const size_t at = (p->row - of * w->n[1]) * w->n[0] + p->from;
        memset(w->r[z % 3] + at, 0, (p->to - p->from) * sizeof *w->r[0]);
    }
}

/* r <- (I - G) y in plane z. */
static void filter_plane(const work *w, size_t z)
{
    const ptrdiff_t row = (ptrdiff_t)w->n[0], plane = row * (ptrdiff_t)w->n[1];
    for (size_t k = w->plane[z]; k < w->plane[z + 1]; k++) {
        const run *const p = &w->runs[k];
        const float *const y = w->y + p->row * w->n[0] + p->from;
        const size_t at = (p->row - z * w->n[1]) * w->n[0] + p->from;
        minus_filtered(y, y - plane, y + plane, row, p->to - p->from, w->w, w->line,
                       w->r[z % 3] + at);
    }
}

/* y, u <- a step along -(I - G) r - mu (y - M) in plane z. */
static void step_plane(const work *w, size_t z, float beta)
{
    float *const gradient = w->line + w->n[0] + 2;
    for (size_t k = w->plane[z]; k < w->plane[z + 1]; k++) {
        const run *const p = &w->runs[k];
        const size_t at = (p->row - z * w->n[1]) * w->n[0] + p->from;
        minus_filtered(w->r[z % 3] + at, w->r[(z + 2) % 3] + at, w->r[(z + 1) % 3] + at,
                       (ptrdiff_t)w->n[0], p->to - p->from, w->w, w->line, gradient);
        if (w->target)
            step_row_between(w, p, gradient, beta);
        else
            step_row(w, p, gradient, beta);
    }
}

/* One iteration, plane after plane: r of a plane and of those beside it, then its step.  No run is
 * in the first and last planes. */
static void iterate(work *w, float beta)
{
    for (size_t z = 1; z < w->n[2]; z++) {
        if (z >= 3) clear_plane(w, z, z - 3);
        filter_plane(w, z);
        step_plane(w, z - 1, beta);
    }
    for (size_t z = w->n[2] < 3 ? 0 : w->n[2] - 3; z < w->n[2]; z++) clear_plane(w, z, z);
}

/* --- volume ---------------------------------------------------------------------------------- */

/* Adds the 8 points at the quarters of a cell with corner values c to the histogram of u. */
static void add_cell(const float c[8], uint32_t *bins)
{
    static const float q[2] = { 0.25f, 0.75f };
    for (int k = 0; k < 8; k++) {
        const float x = q[k & 1], y = q[k >> 1 & 1], z = q[k >> 2];
        const float a = c[0] + x * (c[1] - c[0]), b = c[2] + x * (c[3] - c[2]);
        const float d = c[4] + x * (c[5] - c[4]), e = c[6] + x * (c[7] - c[6]);
        const float f = a + y * (b - a), g = d + y * (e - d);
        const float v = f + z * (g - f);
        bins[v <= 0.0f ? 0 : v >= 1.0f ? BINS - 1 : (int)(v * (float)(BINS - 1))]++;
    }
}

/* Eighths of cells by the value of u, which y is now. */
static void histogram(const work *w, uint32_t *bins)
{
    const size_t nx = w->n[0], plane = nx * w->n[1];
    memset(bins, 0, BINS * sizeof *bins);
    for (size_t z = 0; z + 1 < w->n[2]; z++)
        for (size_t y = 0; y + 1 < w->n[1]; y++) {
            const float *p = w->y + nx * (y + w->n[1] * z), *s = p + plane;
            for (size_t x = 0; x + 1 < nx; x++) {
                const float c[8] = { p[x], p[x + 1], p[nx + x], p[nx + x + 1],
                                     s[x], s[x + 1], s[nx + x], s[nx + x + 1] };
                const bool outside = c[0] <= 0.0f && c[1] <= 0.0f && c[2] <= 0.0f && c[3] <= 0.0f &&
                                     c[4] <= 0.0f && c[5] <= 0.0f && c[6] <= 0.0f && c[7] <= 0.0f;
                if (!outside) add_cell(c, bins);
            }
        }
}

/* The level above which u has the volume `wanted` (eighths of cells). */
static double level_of(const uint32_t *bins, double wanted)
{
    double above = 0.0;
    for (int k = BINS - 1; k > 0; k--) {
        const double next = above + bins[k];
        if (next >= wanted) {
            const double part = bins[k] ? (wanted - above) / bins[k] : 0.0;
            return ((double)k + 1.0 - part) / (BINS - 1);
        }
        above = next;
    }
    return 1.0 / (BINS - 1);
}

/* Mask's volume in eighths of fine cells. */
static double mask_volume(const antialias_input *in)
{
    double count = 0.0;
    for (size_t i = 0; i < in->n[0] * in->n[1] * in->n[2]; i++) count += in->mask[i];
    return 8.0 * count * in->refine[0] * in->refine[1] * in->refine[2];
}

/* --- the whole ------------------------------------------------------------------------------- */

static void smooth(work *w, uint32_t *bins)
{
    const double wanted = mask_volume(w->in);
    int most = 1;
    for (int c = 0; c < 3; c++) most = w->in->refine[c] > most ? w->in->refine[c] : most;
    const int iterations = (int)(ITERATIONS * 0.5 * (1.0 + most) * fmax(w->in->smoothing, 1.0));
    for (int round = 0; round < ROUNDS; round++) {
        double t = 1.0;
        for (int i = 0; i < iterations; i++) {
            const double next = 0.5 * (1.0 + sqrt(1.0 + 4.0 * t * t));
            iterate(w, i + 1 < iterations ? (float)((t - 1.0) / next) : 0.0f);
            t = next;
        }
        histogram(w, bins);
        const float level = (float)level_of(bins, wanted);
        /* In the end no inner node may get out, whatever the volume. */
        w->level = round + 1 < ROUNDS ? level : fminf(level, w->level + 0.9f * w->margin);
    }
}

static void set_filter(work *w)
{
    double h[3], least = INFINITY;
    for (int c = 0; c < 3; c++) {
        h[c] = w->in->spacing[c] / w->in->refine[c];
        least = fmin(least, h[c]);
    }
    for (int c = 0; c < 3; c++) w->w[c] = (float)(0.25 * (least / h[c]) * (least / h[c]));
}

/* The value of the firm inner node that is least inside; INFINITY: there is none. */
static float least_inside(const work *w)
{
    float least = w->elsewhere;
    for (size_t k = 0; k < w->count; k++) {
        const run *const p = &w->runs[k];
        const float *const y = w->y + p->row * w->n[0] + p->from;
        for (uint32_t i = 0; i < p->to - p->from; i++)
            if (w->kind[p->first + i] == INNER) least = fminf(least, y[i]);
    }
    return least;
}

static apsm_status make_scratch(work *w)
{
    const size_t plane = w->n[0] * w->n[1];
    w->line = malloc((2 * w->n[0] + 4) * sizeof *w->line);
    float *const r = calloc(3 * plane, sizeof *r);
    for (size_t k = 0; k < 3 && r; k++) w->r[k] = r + k * plane;
    return w->line && r ? APSM_OK : APSM_ERR_MEMORY;
}

static void free_scratch(work *w)
{
    free(w->u);
    free(w->r[0]);
    free(w->runs);
    free(w->plane);
    free(w->kind);
    free(w->target);
    free(w->line);
}

apsm_status antialias(const antialias_input *in, float *values, double *inward)
{
    work w = { .in = in, .y = values, .level = 0.5f };
    const double s = in->smoothing;
    antialias_fine(in, w.n);
    w.mu = s > 0.0 ? (float)(fidelity / (s * s * s * s)) : 0.0f;
    set_filter(&w);
    uint32_t *bins = malloc(BINS * sizeof *bins);
    unsigned char *firm = malloc(in->n[0] * in->n[1] * in->n[2]);
    apsm_status status = bins && firm ? find_runs(&w) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = make_scratch(&w);
    if (status == APSM_OK) status = thin_mark(in->n, in->mask, firm);
    if (status == APSM_OK) status = start(&w, firm);
    free(firm);
    if (status == APSM_OK) {
        if (s > 0.0) smooth(&w, bins);
        *inward = 0.9 * fminf(1.0f, least_inside(&w) - w.level);
        const size_t count = w.n[0] * w.n[1] * w.n[2];
        for (size_t i = 0; i < count; i++) values[i] = w.level - values[i];
    }
    free_scratch(&w);
    free(bins);
    return status;
}
