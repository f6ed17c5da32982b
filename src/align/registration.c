/* Non-rigid registration by soft correspondence both ways, under a Gaussian process prior.  Numbers
 * are those of docs/method.md.
 *
 * Lengths are divided by the reference's radius.  y_m, n_m: M points of the reference with normals;
 * z_k, o_k: points of the shape.  The displacement u of the reference is a Gaussian process
 *   cov u(y) u(y') = a^2 (1 + y.y') + sum_s a_s^2 exp(-|y - y'|^2 / 2 b_s^2)              (14)
 * (affine maps, and smooth ones of three reaches), restricted to its largest modes by the points of
 * a subset C (Nystroem):
 *   u(y) = sum_k b_k phi_k(y),  phi = K(y, C) Q / sqrt(eigenvalue),  b_k ~ N(0, 1).
 * In turns, with x_m = y_m + u(y_m), n_m turned along, and sigma falling:
 *   S_mk = exp(-|x_m - z_k|^2 / 2 sigma^2 - kappa (1 - n_m.o_k))                          (15)
 *   A_mk = M w_m w_k S_mk / 2 (1 / (e + sum_m w_m S_mk) + 1 / (e + sum_k w_k S_mk))       (16)
 *   b    = argmin sum_mk A_mk |x_m - z_k|^2 / 2 sigma^2 + |b|^2 / 2                       (17)
 *
 * (15) and (17) are coherent point drift (Myronenko & Song 2010) with another prior, with normals,
 * so that the sides of a sheet stay apart, and annealed instead of estimated; the two terms of (16)
 * ask that every point of the shape is reached and that every point of the reference arrives: tips
 * go to tips.  e lets points without a partner go.
 *
 * (15) is nearly all of the work and nearly nothing between points that are far apart: points of
 * the reference come in blocks of LANES near ones, and a block is passed over where all of its
 * distances bring S below e^-20, a millionth of what e weighs. */
#include "align/registration.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/exp.h"
#include "core/kernel.h"
#include "geometry/vec3.h"
#include "linalg/linalg.h"

enum { CENTRES = 128, SCALES = 3, ROUNDS = 50 };

static const double reach[SCALES] = { 1.0, 0.5, 0.25 };     /* b_s */
static const double size_of[SCALES] = { 0.12, 0.05, 0.02 }; /* a_s */
static const double affine_size = 0.3;                      /* a */
static const double outlier = 0.01;                         /* e, in weights of a point */
static const double first_sigma = 0.2, last_sigma = 0.5;    /* the last in spacings of the points */
static const double first_kappa = 2.0, last_kappa = 5.0;
static const double negligible = 20;         /* S below e to the minus this is none */
static const double least_eigenvalue = 1e-5; /* relative to the largest */

struct apsm_registration {
    size_t M, C, p;
    double centre[3], radius, spacing;
    double *y, *n, *w; /* M x 3, M x 3, M */
    double *B;         /* C x p: from modes to weights of the kernel's centres, y[0..C) */
    double *Phi;       /* 4M x p: phi_k, then its derivatives along the axes, at every y_m */
    uint32_t *order;   /* M: which point is at that place of the blocks */
};

void apsm_registration_free(apsm_registration *r)
{
    if (!r) return;
    free(r->y);
    free(r->n);
    free(r->w);
    free(r->B);
    free(r->Phi);
    free(r->order);
    free(r);
}

/* ---- the prior (14) ---- */

/* k[0]: covariance of y and c; k[1..3]: its derivatives by y. */
static void covariance(const double y[3], const double c[3], double k[4])
{
    const double d2 = vec3_distance2(y, c), a2 = affine_size * affine_size;
    double slope = 0;
    k[0] = a2 * (1 + vec3_dot(y, c));
    for (int s = 0; s < SCALES; s++) {
        const double b2 = reach[s] * reach[s];
        const double g = size_of[s] * size_of[s] * apsm_exp(-0.5 * d2 / b2);
        k[0] += g;
        slope -= g / b2;
    }
    for (int a = 0; a < 3; a++) k[1 + a] = a2 * c[a] + slope * (y[a] - c[a]);
}

void apsm_registration_covariance(size_t n, const double *y, double *K)
{
    for (size_t a = 0; a < n; a++)
        for (size_t b = 0; b < n; b++) {
            double k[4];
            covariance(y + 3 * a, y + 3 * b, k);
            K[a * n + b] = k[0];
        }
}

/* K (4n x C): rows 4m to 4m + 3 belong to y_m. */
static void covariances(const apsm_registration *r, size_t n, const double *y, double *K)
{
    for (size_t m = 0; m < n; m++)
        for (size_t c = 0; c < r->C; c++) {
            double k[4];
            covariance(y + 3 * m, r->y + 3 * c, k);
            for (size_t a = 0; a < 4; a++) K[(4 * m + a) * r->C + c] = k[a];
        }
}

/* B from the eigenvectors of the centres' covariance. */
static apsm_status find_modes(apsm_registration *r, double *K, double *eigen)
{
    const size_t C = r->C;
    double *value = eigen, *Q = eigen + C;
    apsm_registration_covariance(C, r->y, K);
    APSM_TRY(apsm_symmetric_eigen(C, K, value, Q));
    r->p = 0;
    while (r->p < C && value[r->p] > least_eigenvalue * value[0]) r->p++;
    for (size_t c = 0; c < C; c++)
        for (size_t k = 0; k < r->p; k++) r->B[c * r->p + k] = Q[k * C + c] / sqrt(value[k]);
    return APSM_OK;
}

static apsm_status make_prior(apsm_registration *r)
{
    const size_t C = r->C, rows = 4 * r->M;
    double *K = malloc((rows + 1) * C * sizeof *K), *eigen = malloc((C + 1) * C * sizeof *eigen);
    r->B = malloc(C * C * sizeof *r->B);
    apsm_status status = K && eigen && r->B ? find_modes(r, K, eigen) : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        r->Phi = malloc(rows * r->p * sizeof *r->Phi);
        status = r->Phi ? APSM_OK : APSM_ERR_MEMORY;
    }
    if (status == APSM_OK) {
        covariances(r, r->M, r->y, K);
        apsm_gemm(0, 0, rows, r->p, C, 1, K, C, r->B, r->p, 0, r->Phi, r->p);
    }
    free(K);
    free(eigen);
    return status;
}

/* ---- blocks ---- */

enum { LANES = 8 };

static size_t blocks_of(size_t n)
{
    return (n + LANES - 1) / LANES;
}

typedef struct ranked {
    double key;
    uint32_t m;
} ranked;

static int by_key(const void *a, const void *b)
{
    const ranked *x = a, *y = b;
    if (x->key != y->key) return x->key < y->key ? -1 : 1;
    return (x->m > y->m) - (x->m < y->m);
}

static size_t longest_axis(size_t n, const ranked *list, const double *y)
{
    double most = -1;
    size_t longest = 0;
    for (size_t c = 0; c < 3; c++) {
        double lo = INFINITY, hi = -INFINITY;
        for (size_t i = 0; i < n; i++) {
            lo = fmin(lo, y[3 * list[i].m + c]);
            hi = fmax(hi, y[3 * list[i].m + c]);
        }
        if (hi - lo > most) most = hi - lo, longest = c;
    }
    return longest;
}

/* Halves the list across its longest axis, and its halves, down to blocks. */
static void halve(size_t n, ranked *list, const double *y)
{
    if (n <= LANES) return;
    const size_t c = longest_axis(n, list, y), left = (blocks_of(n) + 1) / 2 * LANES;
    for (size_t i = 0; i < n; i++) list[i].key = y[3 * list[i].m + c];
    qsort(list, n, sizeof *list, by_key);
    halve(left, list, y);
    halve(n - left, list + left, y);
}

static apsm_status order_points(apsm_registration *r)
{
    ranked *list = malloc(r->M * sizeof *list);
    r->order = malloc(r->M * sizeof *r->order);
    const bool enough = list && r->order;
    for (size_t k = 0; enough && k < r->M; k++) list[k].m = (uint32_t)k;
    if (enough) halve(r->M, list, r->y);
    for (size_t k = 0; enough && k < r->M; k++) r->order[k] = list[k].m;
    free(list);
    return enough ? APSM_OK : APSM_ERR_MEMORY;
}

/* ---- the reference ---- */

/* To lengths in radii about the reference's centre. */
static void normalise(const apsm_registration *r, size_t n, const double *x, double *y)
{
    for (size_t k = 0; k < 3 * n; k++) y[k] = (x[k] - r->centre[k % 3]) / r->radius;
}

apsm_status apsm_registration_new(const apsm_cloud *cloud, apsm_registration **registration)
{
    *registration = NULL;
    if (!(cloud->radius > 0)) return APSM_ERR_GEOMETRY;
    apsm_registration *r = calloc(1, sizeof *r);
    if (!r) return APSM_ERR_MEMORY;
    r->M = cloud->n;
    r->C = cloud->n < CENTRES ? cloud->n : CENTRES;
    r->radius = cloud->radius;
    memcpy(r->centre, cloud->centre, sizeof r->centre);
    r->y = malloc(3 * r->M * sizeof *r->y);
    r->n = malloc(3 * r->M * sizeof *r->n);
    r->w = malloc(r->M * sizeof *r->w);
    apsm_status status = r->y && r->n && r->w ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        normalise(r, r->M, cloud->x, r->y);
        memcpy(r->n, cloud->normal, 3 * r->M * sizeof *r->n);
        memcpy(r->w, cloud->w, r->M * sizeof *r->w);
        r->spacing = vec3_mean_spacing(r->M, r->y);
        status = order_points(r);
    }
    if (status == APSM_OK) status = make_prior(r);
    if (status != APSM_OK) {
        apsm_registration_free(r);
        return status;
    }
    *registration = r;
    return APSM_OK;
}

/* ---- moving points ---- */

/* x <- y + u and n <- the normal there, for u and its derivatives U (4 x 3). */
static void move_point(const double *U, const double y[3], const double n[3], double x[3],
                       double turned[3])
{
    double F[3][3], cross[3]; /* columns of the map's derivative: F[a] = d x / d y_a */
    double sum[3] = { 0 };
    for (int a = 0; a < 3; a++)
        for (int c = 0; c < 3; c++) F[a][c] = (a == c ? 1 : 0) + U[3 * (a + 1) + c];
    for (int a = 0; a < 3; a++) { /* areas change by the cofactors */
        vec3_cross(F[(a + 1) % 3], F[(a + 2) % 3], cross);
        vec3_add_scaled(sum, n[a], cross);
    }
    vec3_normalise(sum);
    for (int c = 0; c < 3; c++) {
        x[c] = y[c] + U[c];
        turned[c] = sum[c];
    }
}

/* Points of the reference where they are; those beyond its M have no weight.  Weights of (16) are
 * in single precision: they say which points attract which, to 1e-6. */
typedef struct block {
    float x[3][LANES], n[3][LANES];
    float w[LANES], per_w[LANES]; /* and one over it */
} block;

/* Balls around the blocks' points; points of the shape beyond reach2 of a centre pass a block over.
 */
typedef struct balls {
    float *centre[3], *reach2; /* blocks */
} balls;

/* Sums of (16), and over k of A_mk and A_mk z_k. */
typedef struct block_sums {
    float arrived[LANES], D[LANES], z[3][LANES];
} block_sums;

/* Everything a registration works on.  x, n: where the reference's points are, M of them. */
typedef struct job {
    const apsm_registration *r;
    const apsm_cloud *shape;
    size_t M, K;   /* points of the reference and of the shape */
    size_t blocks; /* of the reference */
    double sigma, kappa;
    double *z;                /* K x 3 */
    double *x, *n, *u;        /* M x 3, M x 3, 4M x 3 */
    double *target;           /* M x 3 */
    double *A, *b, *weighted; /* p x p, p x 3, M x p */
    double *D;                /* M */
    block *block;             /* blocks */
    balls balls;
    block_sums *sums; /* blocks */
    float *S;         /* K x blocks x LANES: of the blocks that are near, one after the other */
    float *reached;   /* K: a sum of (16) */
    float *d2;        /* blocks: of a point from the centres of the balls */
    uint32_t *near;   /* K x blocks: those that are, */
    size_t *nears;    /* K: so many */
} job;

static size_t doubles_of(size_t bytes)
{
    return (bytes + sizeof(double) - 1) / sizeof(double);
}

size_t apsm_registration_work_size(const apsm_registration *r, size_t n)
{
    const size_t blocks = blocks_of(r->M), p = r->p;
    return 3 * n + 22 * r->M + p * p + 3 * p + r->M * p + doubles_of(blocks * sizeof(block)) +
           doubles_of(blocks * sizeof(block_sums)) +
           doubles_of(n * blocks * LANES * sizeof(float)) + doubles_of(n * sizeof(float)) +
           5 * doubles_of(blocks * sizeof(float)) + doubles_of(n * blocks * sizeof(uint32_t)) +
           doubles_of(n * sizeof(size_t));
}

static void *take(double **work, size_t bytes)
{
    void *here = *work;
    *work += doubles_of(bytes);
    return here;
}

static job job_in(const apsm_registration *r, const apsm_cloud *shape, double *work)
{
    const size_t K = shape->n, M = r->M, p = r->p, blocks = blocks_of(M);
    job j = { .r = r, .shape = shape, .M = M, .K = K, .blocks = blocks };
    double **const array[] = { &j.z, &j.x, &j.n, &j.u, &j.target, &j.A, &j.b, &j.weighted, &j.D };
    const size_t size[] = { 3 * K, 3 * M, 3 * M, 12 * M, 3 * M, p * p, 3 * p, M * p, M };
    for (size_t k = 0; k < sizeof size / sizeof *size; k++) {
        *array[k] = work;
        work += size[k];
    }
    j.block = take(&work, blocks * sizeof *j.block);
    j.sums = take(&work, blocks * sizeof *j.sums);
    j.S = take(&work, K * blocks * LANES * sizeof *j.S);
    j.reached = take(&work, K * sizeof *j.reached);
    for (size_t c = 0; c < 3; c++) j.balls.centre[c] = take(&work, blocks * sizeof(float));
    j.balls.reach2 = take(&work, blocks * sizeof(float));
    j.d2 = take(&work, blocks * sizeof *j.d2);
    j.near = take(&work, K * blocks * sizeof *j.near);
    j.nears = take(&work, K * sizeof *j.nears);
    memset(j.block, 0, blocks * sizeof *j.block);
    for (size_t k = 0; k < M; k++) {
        block *b = &j.block[k / LANES];
        b->w[k % LANES] = (float)r->w[r->order[k]];
        b->per_w[k % LANES] = 1.0f / (float)r->w[r->order[k]];
    }
    return j;
}

/* The ball around block i's points, with the distance beyond which S is negligible. */
static void enclose(const block *b, size_t n, float beyond, size_t i, balls *to)
{
    float r2 = 0, centre[3];
    for (size_t c = 0; c < 3; c++) {
        float lo = b->x[c][0], hi = lo;
        for (size_t l = 1; l < n; l++) {
            lo = b->x[c][l] < lo ? b->x[c][l] : lo;
            hi = b->x[c][l] > hi ? b->x[c][l] : hi;
        }
        to->centre[c][i] = centre[c] = 0.5f * (lo + hi);
    }
    for (size_t l = 0; l < n; l++) {
        float d2 = 0;
        for (size_t c = 0; c < 3; c++) d2 += (b->x[c][l] - centre[c]) * (b->x[c][l] - centre[c]);
        r2 = d2 > r2 ? d2 : r2;
    }
    to->reach2[i] = (beyond + sqrtf(r2)) * (beyond + sqrtf(r2));
}

static void move_reference(job *j)
{
    const apsm_registration *r = j->r;
    const float beyond = (float)(j->sigma * sqrt(2 * negligible));
    apsm_gemm(0, 0, 4 * j->M, 3, r->p, 1, r->Phi, r->p, j->b, 3, 0, j->u, 3);
    for (size_t m = 0; m < j->M; m++)
        move_point(j->u + 12 * m, r->y + 3 * m, r->n + 3 * m, j->x + 3 * m, j->n + 3 * m);
    for (size_t k = 0; k < j->M; k++) {
        block *b = &j->block[k / LANES];
        for (size_t c = 0; c < 3; c++) {
            b->x[c][k % LANES] = (float)j->x[3 * r->order[k] + c];
            b->n[c][k % LANES] = (float)j->n[3 * r->order[k] + c];
        }
    }
    for (size_t k = 0; k < j->blocks; k++)
        enclose(&j->block[k], k + 1 < j->blocks ? LANES : j->M - LANES * k, beyond, k, &j->balls);
}

/* ---- the two halves of a round ---- */

/* One point of the shape, as the kernels see it. */
typedef struct shape_point {
    float z[3], normal[3], weight;
} shape_point;

static shape_point point_of(const job *j, size_t k)
{
    shape_point p = { .weight = (float)j->shape->w[k] };
    for (size_t c = 0; c < 3; c++) {
        p.z[c] = (float)j->z[3 * k + c];
        p.normal[c] = (float)j->shape->normal[3 * k + c];
    }
    return p;
}

/* d2 (n) <- squared distances of z from the centres. */
APSM_KERNEL static void distances(size_t n, const float *restrict x, const float *restrict y,
                                  const float *restrict z, const float p[3], float *restrict d2)
{
#pragma omp simd
    for (size_t k = 0; k < n; k++) {
        const float a = x[k] - p[0], b = y[k] - p[1], c = z[k] - p[2];
        d2[k] = a * a + b * b + c * c;
    }
}

/* near <- the blocks that are near enough to z; returns how many. */
static size_t find_near(const job *j, const float z[3], uint32_t *near)
{
    const balls *of = &j->balls;
    size_t n = 0;
    distances(j->blocks, of->centre[0], of->centre[1], of->centre[2], z, j->d2);
    for (size_t k = 0; k < j->blocks; k++) {
        near[n] = (uint32_t)k;
        n += j->d2[k] <= of->reach2[k];
    }
    return n;
}

/* S <- w_m w_k S_mk for the n near blocks, arrived += w_k S_mk; returns sum_m w_m S_mk.  steep and
 * kappa in powers of 2. */
APSM_KERNEL static float soft_row(size_t n, const uint32_t *restrict near,
                                  const block *restrict blocks, const shape_point *p, float steep,
                                  float kappa, float *restrict S, block_sums *restrict sums)
{
    float lane[LANES] = { 0 }, sum = 0;
    for (size_t k = 0; k < n; k++) {
        const block *restrict b = blocks + near[k];
        float *restrict s = S + LANES * k, *restrict arrived = sums[near[k]].arrived;
#pragma omp simd
        for (size_t l = 0; l < LANES; l++) {
            const float x = b->x[0][l] - p->z[0], y = b->x[1][l] - p->z[1],
                        z = b->x[2][l] - p->z[2];
            const float cosine =
                b->n[0][l] * p->normal[0] + b->n[1][l] * p->normal[1] + b->n[2][l] * p->normal[2];
            const float v =
                b->w[l] * apsm_exp2f(-steep * (x * x + y * y + z * z) - kappa * (1.0f - cosine));
            lane[l] += v;
            s[l] = p->weight * v;
            arrived[l] += s[l] * b->per_w[l];
        }
    }
    for (size_t l = 0; l < LANES; l++) sum += lane[l];
    return sum;
}

/* (15) and the sums in (16); S_mk w_m w_k in S. */
static void match_softly(job *j)
{
    const double log2_e = 1.4426950408889634;
    const float steep = (float)(0.5 * log2_e / (j->sigma * j->sigma)),
                kappa = (float)(log2_e * j->kappa);
    const float e = (float)(outlier / (double)j->M);
    memset(j->sums, 0, j->blocks * sizeof *j->sums);
    for (size_t k = 0; k < j->blocks; k++)
        for (size_t l = 0; l < LANES; l++) j->sums[k].arrived[l] = e;
    for (size_t k = 0; k < j->K; k++) {
        const shape_point p = point_of(j, k);
        uint32_t *near = j->near + k * j->blocks;
        j->nears[k] = find_near(j, p.z, near);
        j->reached[k] = e + soft_row(j->nears[k], near, j->block, &p, steep, kappa,
                                     j->S + k * j->blocks * LANES, j->sums);
    }
}

/* D (M) += A_mk, z += A_mk z_k for one k and the n near blocks; what arrived has been inverted. */
APSM_KERNEL static void add_row(size_t n, const uint32_t *restrict near, const float *restrict S,
                                float per_reached, float half, const float z[3],
                                block_sums *restrict sums)
{
    for (size_t k = 0; k < n; k++) {
        block_sums *restrict to = sums + near[k];
        const float *restrict s = S + LANES * k;
#pragma omp simd
        for (size_t l = 0; l < LANES; l++) {
            const float A = half * s[l] * (per_reached + to->arrived[l]);
            to->D[l] += A;
            to->z[0][l] += A * z[0];
            to->z[1][l] += A * z[1];
            to->z[2][l] += A * z[2];
        }
    }
}

/* D_m = sum_k A_mk, target_m = sum_k A_mk (z_k - y_m). */
static void find_targets(job *j)
{
    const apsm_registration *r = j->r;
    const float half = 0.5f * (float)j->M;
    for (size_t k = 0; k < j->blocks; k++)
        for (size_t l = 0; l < LANES; l++) j->sums[k].arrived[l] = 1.0f / j->sums[k].arrived[l];
    for (size_t k = 0; k < j->K; k++) {
        const shape_point p = point_of(j, k);
        add_row(j->nears[k], j->near + k * j->blocks, j->S + k * j->blocks * LANES,
                1.0f / j->reached[k], half, p.z, j->sums);
    }
    for (size_t k = 0; k < j->M; k++) {
        const block_sums *of = &j->sums[k / LANES];
        const size_t m = r->order[k];
        j->D[m] = (double)of->D[k % LANES];
        for (size_t c = 0; c < 3; c++)
            j->target[3 * m + c] = (double)of->z[c][k % LANES] - j->D[m] * r->y[3 * m + c];
    }
}

/* (17): (sigma^2 I + Phi' D Phi) b = Phi' target. */
static apsm_status fit(job *j)
{
    const apsm_registration *r = j->r;
    const size_t p = r->p;
    for (size_t m = 0; m < j->M; m++) {
        const double root = sqrt(j->D[m]);
        for (size_t k = 0; k < p; k++) j->weighted[m * p + k] = root * r->Phi[4 * m * p + k];
    }
    apsm_syrk(p, j->M, j->weighted, 0, j->A);
    for (size_t k = 0; k < p; k++) j->A[k * p + k] += j->sigma * j->sigma;
    apsm_gemm(1, 0, p, 3, j->M, 1, r->Phi, 4 * p, j->target, 3, 0, j->b, 3);
    APSM_TRY(apsm_cholesky(p, j->A));
    apsm_cholesky_solve(p, j->A, 3, j->b);
    return APSM_OK;
}

/* J points of the reference follow the modes b. */
static void move_points(const job *j, size_t J, double *X, double *N)
{
    const apsm_registration *r = j->r;
    double *W = j->weighted; /* C x 3 */
    apsm_gemm(0, 0, r->C, 3, r->p, 1, r->B, r->p, j->b, 3, 0, W, 3);
    for (size_t i = 0; i < J; i++) {
        double y[3], n[3], x[3], U[12] = { 0 };
        normalise(r, 1, X + 3 * i, y);
        memcpy(n, N + 3 * i, sizeof n);
        for (size_t c = 0; c < r->C; c++) {
            double k[4];
            covariance(y, r->y + 3 * c, k);
            for (size_t a = 0; a < 4; a++) vec3_add_scaled(U + 3 * a, k[a], W + 3 * c);
        }
        move_point(U, y, n, x, N + 3 * i);
        for (size_t c = 0; c < 3; c++) X[3 * i + c] = r->centre[c] + r->radius * x[c];
    }
}

apsm_status apsm_registration_move(const apsm_registration *r, const apsm_cloud *shape, size_t J,
                                   double *X, double *N, double *work)
{
    job j = job_in(r, shape, work);
    const double end = last_sigma * r->spacing;
    normalise(r, shape->n, shape->x, j.z);
    memset(j.b, 0, 3 * r->p * sizeof *j.b);
    for (int round = 0; round < ROUNDS; round++) {
        const double t = (double)round / (ROUNDS - 1);
        j.sigma = first_sigma * pow(end / first_sigma, t);
        j.kappa = first_kappa + t * (last_kappa - first_kappa);
        move_reference(&j);
        match_softly(&j);
        find_targets(&j);
        APSM_TRY(fit(&j));
    }
    move_points(&j, J, X, N);
    return APSM_OK;
}
