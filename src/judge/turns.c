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

/* LANES usual particles side by side; those beyond the last are infinitely far away. */
typedef struct usual_block {
    double x[3][LANES], n[3][LANES];
} usual_block;

static size_t blocks_of(size_t J)
{
    return (J + LANES - 1) / LANES;
}

size_t apsm_turns_work_size(size_t J)
{
    return (size_t)MOST * (6 + 6 + 3 + 2 * APSM_FORM_SCALES) +
           blocks_of(J) * (sizeof(usual_block) / sizeof(double));
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

/* The moved part of a shape; arrays in the scratch. */
typedef struct moved {
    size_t n, stride;
    double *p, *normal; /* n x 3: as they are, or reflected in the usual frame */
    double *q, *qn;     /* n x 3: moved */
    double *target;     /* n x 3 */
    const usual_block *usual;
} moved;

static void arrange_usual(const apsm_turns_input *in, usual_block *block)
{
    for (size_t k = 0; k < blocks_of(in->J) * LANES; k++)
        for (size_t c = 0; c < 3; c++) {
            block[k / LANES].x[c][k % LANES] = k < in->J ? in->X[3 * k + c] : INFINITY;
            block[k / LANES].n[c][k % LANES] = k < in->J ? in->XN[3 * k + c] : 0.0;
        }
}

/* at <- the usual particle of least cost for one at q with normal n, of equal ones the first;
 * returns its squared distance.  weigh: 2 h^2. */
APSM_KERNEL static double nearest(size_t blocks, const usual_block *restrict usual, double weigh,
                                  const double q[3], const double n[3], uint32_t *at)
{
    double least[LANES], block[LANES] = { 0 }, distance2[LANES] = { 0 };
    size_t best = 0;
    for (size_t l = 0; l < LANES; l++) least[l] = INFINITY;
    for (size_t k = 0; k < blocks; k++) {
        const usual_block *restrict b = usual + k;
#pragma omp simd
        for (size_t l = 0; l < LANES; l++) {
            const double x = q[0] - b->x[0][l], y = q[1] - b->x[1][l], z = q[2] - b->x[2][l];
            const double d2 = x * x + y * y + z * z;
            const double cosine = n[0] * b->n[0][l] + n[1] * b->n[1][l] + n[2] * b->n[2][l];
            const double cost = d2 + weigh * (1.0 - cosine);
            block[l] = cost < least[l] ? (double)k : block[l];
            distance2[l] = cost < least[l] ? d2 : distance2[l];
            least[l] = cost < least[l] ? cost : least[l];
        }
    }
    for (size_t l = 1; l < LANES; l++)
        if (least[l] < least[best] || (least[l] == least[best] && block[l] < block[best])) best = l;
    *at = (uint32_t)(LANES * (size_t)block[best] + best);
    return distance2[best];
}

/* at (n) <- the usual particles on which M lays those of m; returns the mean squared distance. */
static double lay(const apsm_turns_input *in, const double M[16], moved *m, uint32_t *at)
{
    double sum = 0.0;
    apsm_affine_apply(M, m->n, m->p, m->q);
    apsm_affine_apply_normals(M, m->n, m->normal, m->qn);
    for (size_t k = 0; k < m->n; k++)
        sum += nearest(blocks_of(in->J), m->usual, 2.0 * in->h * in->h, m->q + 3 * k, m->qn + 3 * k,
                       at + k);
    return sum / (double)m->n;
}

static double settle(const apsm_turns_input *in, double M[16], moved *m, uint32_t *at)
{
    for (int round = 0; round < ROUNDS; round++) {
        lay(in, M, m, at);
        for (size_t k = 0; k < m->n; k++)
            memcpy(m->target + 3 * k, in->X + 3 * at[k], 3 * sizeof *m->target);
        apsm_affine_fit(m->n, m->p, m->target, NULL, 0, M);
    }
    return sqrt(lay(in, M, m, at)) / in->h;
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

static double fit_as_it_is(const apsm_turns_input *in, const usual_block *usual)
{
    double sum = 0.0;
    for (size_t j = 0; j < in->J; j++) {
        uint32_t at = 0;
        sum += nearest(blocks_of(in->J), usual, 2.0 * in->h * in->h, in->P + 3 * j, in->N + 3 * j,
                       &at);
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
    usual_block *usual = (usual_block *)(void *)work;
    arrange_usual(in, usual);
    m.usual = usual;
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
    if (own_fit) *own_fit = fit_as_it_is(in, usual);
}
