/* Other poses.  For each turn S of a cube (and a reflection before it) about the usual particles'
 * principal axes, iterated closest particles:
 *
 *   k(j) = argmin_k |M p_j - x_k|^2 + 2 h^2 (1 - M n_j . nx_k),  M = argmin sum_j |M p_j -
 * x_k(j)|^2
 *
 * A shape that lies the wrong way has particles where the usual shape's form is another one: its
 * heights (J1) then agree with the usual ones at k(j) better than at j.  At most 128 particles,
 * evenly by number, are moved. */
#include "judge/turns.h"

#include <math.h>
#include <string.h>

#include "core/kernel.h"
#include "geometry/affine.h"
#include "geometry/form.h"
#include "geometry/vec3.h"

enum { TURNS = 24, ROUNDS = 8, MOST = 128, LANES = 8 };
static const double near = 0.7; /* of particles that lie between others, in h */
static const double wrong_share = 0.1, wrong_distance = 2.0; /* h */
static const double least_spread = 0.01;                     /* of heights */

/* LANES usual particles side by side, from their centre and over h; those beyond the last are
 * infinitely far away. */
typedef struct usual_block {
    float x[3][LANES], n[3][LANES];
} usual_block;

static size_t blocks_of(size_t J)
{
    return (J + LANES - 1) / LANES;
}

size_t apsm_turns_work_size(size_t J)
{
    return (size_t)MOST * (6 + 6 + 3 + 2 * APSM_FORM_SCALES) +
           blocks_of(J) * ((sizeof(usual_block) + LANES * sizeof(float)) / sizeof(double) + 1);
}

/* Turn number k of a cube: the permutations of the axes, with the signs that make det = +1. */
static void cube_turn(size_t k, double S[9])
{
    static const size_t axes[6][3] = { { 0, 1, 2 }, { 1, 2, 0 }, { 2, 0, 1 },
                                       { 0, 2, 1 }, { 1, 0, 2 }, { 2, 1, 0 } };
    const size_t *p = axes[k / 4];
    const double odd = k / 4 < 3 ? 1.0 : -1.0;
    const double a = k & 1 ? -1.0 : 1.0, b = k & 2 ? -1.0 : 1.0;
    memset(S, 0, 9 * sizeof *S);
    S[p[0]] = a;
    S[3 + p[1]] = b;
    S[6 + p[2]] = a * b * odd;
}

/* Centre c and principal axes A (rows) of n points. */
static void frame(size_t n, const double *x, double c[3], double A[9])
{
    double V[9];
    apsm_principal_axes(n, x, c, V);
    for (size_t a = 0; a < 9; a++) A[a] = V[3 * (a % 3) + a / 3];
}

/* M: about c, A^T S A. */
static void start(const double c[3], const double A[9], const double S[9], double M[16])
{
    double SA[9];
    for (size_t a = 0; a < 9; a++)
        SA[a] = S[a - a % 3] * A[a % 3] + S[a - a % 3 + 1] * A[3 + a % 3] +
                S[a - a % 3 + 2] * A[6 + a % 3];
    apsm_affine_identity(M);
    for (size_t r = 0; r < 3; r++)
        for (size_t k = 0; k < 3; k++)
            M[4 * r + k] = A[r] * SA[k] + A[3 + r] * SA[3 + k] + A[6 + r] * SA[6 + k];
    for (size_t r = 0; r < 3; r++) M[4 * r + 3] = c[r] - vec3_dot(M + 4 * r, c);
}

/* The usual particles as a search goes through them; arrays in the scratch. */
typedef struct usual_set {
    const apsm_turns_input *in;
    size_t blocks;
    usual_block *block; /* blocks */
    float *cost;        /* blocks x LANES */
    uint32_t *near;     /* blocks: those in which the least may be */
    double c[3];        /* centre */
    float reach;        /* largest coordinate of x */
} usual_set;

/* The moved part of a shape; arrays in the scratch. */
typedef struct moved {
    size_t n, stride;
    double *p, *normal; /* n x 3: as they are, or reflected in the usual frame */
    double *q, *qn;     /* n x 3: moved */
    double *target;     /* n x 3 */
    const usual_set *usual;
} moved;

static usual_set arrange_usual(const apsm_turns_input *in, const double c[3], double *work)
{
    usual_set u = { .in = in, .blocks = blocks_of(in->J), .block = (usual_block *)(void *)work };
    u.cost = (float *)(void *)(u.block + u.blocks);
    u.near = (uint32_t *)(void *)(u.cost + LANES * u.blocks);
    memcpy(u.c, c, sizeof u.c);
    for (size_t k = 0; k < u.blocks * LANES; k++)
        for (size_t a = 0; a < 3; a++) {
            const bool there = k < in->J;
            const float x = there ? (float)((in->X[3 * k + a] - c[a]) / in->h) : INFINITY;
            u.block[k / LANES].x[a][k % LANES] = x;
            u.block[k / LANES].n[a][k % LANES] = there ? (float)in->XN[3 * k + a] : 0.0f;
            if (there) u.reach = fmaxf(u.reach, fabsf(x));
        }
    return u;
}

/* Costs over h^2 for one at q with normal n, in single precision; returns the least. */
APSM_KERNEL static float estimate(const usual_set *u, const float q[3], const float n[3])
{
    float least[LANES], all = INFINITY;
    for (size_t l = 0; l < LANES; l++) least[l] = INFINITY;
    for (size_t k = 0; k < u->blocks; k++) {
        const usual_block *restrict b = u->block + k;
        float *restrict cost = u->cost + LANES * k;
#pragma omp simd
        for (size_t l = 0; l < LANES; l++) {
            const float x = q[0] - b->x[0][l], y = q[1] - b->x[1][l], z = q[2] - b->x[2][l];
            const float cosine = n[0] * b->n[0][l] + n[1] * b->n[1][l] + n[2] * b->n[2][l];
            cost[l] = x * x + y * y + z * z + 2.0f * (1.0f - cosine);
            least[l] = cost[l] < least[l] ? cost[l] : least[l];
        }
    }
    for (size_t l = 0; l < LANES; l++) all = least[l] < all ? least[l] : all;
    return all;
}

/* u->near <- the blocks with a cost up to the limit; returns their number. */
APSM_KERNEL static size_t list_near(const usual_set *u, float limit)
{
    size_t count = 0;
    for (size_t k = 0; k < u->blocks; k++) {
        const float *restrict cost = u->cost + LANES * k;
        int near_by = 0;
#pragma omp simd reduction(| : near_by)
        for (size_t l = 0; l < LANES; l++) near_by |= cost[l] <= limit;
        u->near[count] = (uint32_t)k;
        count += near_by != 0;
    }
    return count;
}

/* Where the search is. */
typedef struct choice {
    double cost, distance2;
    uint32_t at;
} choice;

/* Usual particle k instead, if it costs less. */
static void try_particle(const apsm_turns_input *in, const double q[3], const double n[3], size_t k,
                         choice *best)
{
    const double *X = in->X + 3 * k, *XN = in->XN + 3 * k, weigh = 2.0 * in->h * in->h;
    const double x = q[0] - X[0], y = q[1] - X[1], z = q[2] - X[2];
    const double d2 = x * x + y * y + z * z;
    const double cost = d2 + weigh * (1.0 - (n[0] * XN[0] + n[1] * XN[1] + n[2] * XN[2]));
    if (cost < best->cost) *best = (choice){ cost, d2, (uint32_t)k };
}

/* at <- the usual particle of least cost for one at q with normal n, of equal ones the first;
 * returns its squared distance.  Single precision tells which it can be, double decides: with
 * coordinates up to r and unit normals an estimate errs by less than 2^-17 r^2 + 2^-19. */
static double nearest(const usual_set *u, const double q[3], const double n[3], uint32_t *at)
{
    float f[3], fn[3], r = u->reach;
    choice best = { .cost = INFINITY };
    for (size_t a = 0; a < 3; a++) {
        f[a] = (float)((q[a] - u->c[a]) / u->in->h);
        fn[a] = (float)n[a];
        r = fabsf(f[a]) > r ? fabsf(f[a]) : r;
    }
    const float limit = estimate(u, f, fn) + 0x1p-16f * r * r + 0x1p-18f;
    const size_t count = list_near(u, limit);
    for (size_t b = 0; b < count; b++)
        for (size_t k = LANES * u->near[b]; k < LANES * (u->near[b] + 1); k++)
            if (k < u->in->J && u->cost[k] <= limit) try_particle(u->in, q, n, k, &best);
    *at = best.at;
    return best.distance2;
}

/* at (n) <- the usual particles on which M lays those of m; returns the mean squared distance. */
static double lay(const double M[16], moved *m, uint32_t *at)
{
    double sum = 0.0;
    apsm_affine_apply(M, m->n, m->p, m->q);
    apsm_affine_apply_normals(M, m->n, m->normal, m->qn);
    for (size_t k = 0; k < m->n; k++) sum += nearest(m->usual, m->q + 3 * k, m->qn + 3 * k, at + k);
    return sum / (double)m->n;
}

static double settle(const apsm_turns_input *in, double M[16], moved *m, uint32_t *at)
{
    for (int round = 0; round < ROUNDS; round++) {
        lay(M, m, at);
        for (size_t k = 0; k < m->n; k++)
            memcpy(m->target + 3 * k, in->X + 3 * at[k], 3 * sizeof *m->target);
        apsm_affine_fit(m->n, m->p, m->target, NULL, 0, M);
    }
    return sqrt(lay(M, m, at)) / in->h;
}

/* Whether particles would be elsewhere, and not only a little. */
static bool is_other(const apsm_turns_input *in, const moved *m, const uint32_t *at)
{
    const double far2 = wrong_distance * wrong_distance * in->h * in->h;
    size_t far = 0;
    for (size_t k = 0; k < m->n; k++)
        far += vec3_distance2(in->X + 3 * at[k], in->X + 3 * m->stride * k) > far2;
    return (double)far > wrong_share * (double)m->n;
}

static void take_particles(const apsm_turns_input *in, const double *reflection, double *work,
                           moved *m)
{
    m->stride = (in->J + MOST - 1) / MOST;
    m->n = (in->J + m->stride - 1) / m->stride;
    m->p = work;
    m->normal = m->p + 3 * m->n;
    m->q = m->normal + 3 * m->n;
    m->qn = m->q + 3 * m->n;
    m->target = m->qn + 3 * m->n;
    for (size_t k = 0; k < m->n; k++) {
        memcpy(m->p + 3 * k, in->P + 3 * m->stride * k, 3 * sizeof *m->p);
        memcpy(m->normal + 3 * k, in->N + 3 * m->stride * k, 3 * sizeof *m->normal);
    }
    if (!reflection) return;
    apsm_affine_apply(reflection, m->n, m->p, m->p);
    apsm_affine_apply_normals(reflection, m->n, m->normal, m->normal);
}

/* Own heights of the moved particles against usual ones at others. */
static double agreement(const apsm_turns_input *in, const moved *m, const uint32_t *at, double *own)
{
    double *usual = own + m->n * APSM_FORM_SCALES;
    for (size_t k = 0; k < m->n; k++) {
        const size_t from = APSM_FORM_SCALES * m->stride * k, to = APSM_FORM_SCALES * (size_t)at[k];
        memcpy(own + APSM_FORM_SCALES * k, in->own + from, APSM_FORM_SCALES * sizeof *own);
        memcpy(usual + APSM_FORM_SCALES * k, in->usual + to, APSM_FORM_SCALES * sizeof *own);
    }
    return apsm_form_agreement(m->n, own, usual, NULL);
}

/* How much more likely the heights are as they lie: (J2a), the mean over particles and scales of
 *
 *   ((own - u_there)^2 - (own - u_here)^2) / 2 v,
 *
 * v the mean of both variances: positive where they are as usual here, negative where as usual
 * there, and next to nothing where usual heights hardly differ. */
static double evidence(const apsm_turns_input *in, const moved *m, const uint32_t *at)
{
    double sum = 0.0;
    for (size_t k = 0; k < m->n; k++)
        for (size_t s = 0; s < APSM_FORM_SCALES; s++) {
            const size_t here = APSM_FORM_SCALES * m->stride * k + s;
            const size_t there = APSM_FORM_SCALES * (size_t)at[k] + s;
            const double a = in->usual[here], b = in->usual[there];
            const double va = in->spread[here], vb = in->spread[there];
            const double v = fmax(0.5 * (va * va + vb * vb), least_spread * least_spread);
            sum += (b - a) * (0.5 * (a + b) - in->own[here]) / v;
        }
    return sum / (double)(m->n * APSM_FORM_SCALES);
}

static double fit_as_it_is(const apsm_turns_input *in, const usual_set *usual)
{
    double sum = 0.0;
    for (size_t j = 0; j < in->J; j++) {
        uint32_t at = 0;
        sum += nearest(usual, in->P + 3 * j, in->N + 3 * j, &at);
    }
    return sqrt(sum / (double)in->J) / in->h;
}

void apsm_turns_search(const apsm_turns_input *in, bool mirrored, apsm_turn *best, double *own_fit,
                       double *work, uint32_t *at)
{
    static const double flip[9] = { 1, 0, 0, 0, 1, 0, 0, 0, -1 };
    double c[3], A[9], S[9], reflection[16];
    moved m;
    *best = (apsm_turn){
        .agreement = -INFINITY, .mirrored = mirrored, .evidence = INFINITY, .staying = INFINITY
    };
    apsm_affine_identity(best->M);
    frame(in->J, in->X, c, A);
    start(c, A, flip, reflection);
    const usual_set usual = arrange_usual(in, c, work);
    m.usual = &usual;
    work += apsm_turns_work_size(in->J) - apsm_turns_work_size(0);
    take_particles(in, mirrored ? reflection : NULL, work, &m);
    for (size_t k = 0; k < TURNS; k++) {
        double M[16];
        cube_turn(k, S);
        start(c, A, S, M);
        const double fit = settle(in, M, &m, at);
        if (!is_other(in, &m, at)) {
            if (mirrored && fit < near) best->staying = fmin(best->staying, evidence(in, &m, at));
            continue;
        }
        const double a = agreement(in, &m, at, m.target + 3 * m.n);
        best->evidence = fmin(best->evidence, evidence(in, &m, at));
        if (!(a > best->agreement)) continue;
        best->agreement = a;
        best->fit = fit;
        memcpy(best->M, M, sizeof M);
        if (mirrored) apsm_affine_multiply(M, reflection, best->M);
    }
    if (own_fit) *own_fit = fit_as_it_is(in, &usual);
}
