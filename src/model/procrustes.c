/* Generalised Procrustes analysis (Gower, Psychometrika 40, 1975), with size treated apart from
 * pose: every shape is scaled to the cohort's root mean square centroid size, which cannot
 * collapse as a least-squares scale can.  A shape is worked on as C_i = scale_i (p_i - centroid_i);
 *   R_i = argmin |R C_i - mean|,   mean = average of R_i C_i,   until the mean rests.
 * Rotations of the mean itself are free: at the end all are turned so that the mean (or the
 * reference shape) is as it was at the start. */
#include "model/procrustes.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"

apsm_procrustes_options apsm_procrustes_defaults(void)
{
    return (apsm_procrustes_options){
        .pose = true, .scale = false, .reference = SIZE_MAX, .iterations = 100, .tolerance = 1e-10
    };
}

/* What the steps share. */
typedef struct gpa {
    size_t I, J;
    const apsm_procrustes_options *opt;
    double *centroid; /* I x 3 */
    double *scale;    /* I */
    double *C;        /* I x J x 3 */
    double *R;        /* I x 16: linear maps as 4 x 4 */
    double *mean;     /* J x 3 */
    double *start;    /* J x 3: what the frame is taken from */
    double *turned;   /* J x 3: scratch */
} gpa;

static void gpa_free(gpa *g)
{
    free(g->centroid);
    free(g->scale);
    free(g->C);
    free(g->R);
    free(g->mean);
    free(g->start);
    free(g->turned);
}

static apsm_status gpa_alloc(gpa *g)
{
    const size_t n = 3 * g->J;
    g->centroid = malloc(g->I * 3 * sizeof *g->centroid);
    g->scale = malloc(g->I * sizeof *g->scale);
    g->C = malloc(g->I * n * sizeof *g->C);
    g->R = malloc(g->I * 16 * sizeof *g->R);
    g->mean = malloc(n * sizeof *g->mean);
    g->start = malloc(n * sizeof *g->start);
    g->turned = malloc(n * sizeof *g->turned);
    return g->centroid && g->scale && g->C && g->R && g->mean && g->start && g->turned
               ? APSM_OK
               : APSM_ERR_MEMORY;
}

/* Moves p to its centroid c; returns the centroid size. */
static double centre(size_t J, const double *p, double c[3], double *C)
{
    double size2 = 0.0;
    for (size_t a = 0; a < 3; a++) {
        double sum = 0.0;
        for (size_t j = 0; j < J; j++) sum += p[3 * j + a] - p[a];
        c[a] = p[a] + sum / (double)J;
    }
    for (size_t k = 0; k < 3 * J; k++) {
        C[k] = p[k] - c[k % 3];
        size2 += C[k] * C[k];
    }
    return sqrt(size2);
}

static apsm_status centre_and_scale(apsm_context *ctx, gpa *g, const double *P)
{
    const size_t n = 3 * g->J;
    double size2 = 0.0;
    for (size_t i = 0; i < g->I; i++) {
        g->scale[i] = centre(g->J, P + i * n, g->centroid + 3 * i, g->C + i * n);
        size2 += g->scale[i] * g->scale[i];
        if (g->opt->scale && !(g->scale[i] > 0.0))
            return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                             "shape %zu: all particles coincide, so it has no size to align by", i);
    }
    const double size = sqrt(size2 / (double)g->I);
    for (size_t i = 0; i < g->I; i++) {
        g->scale[i] = g->opt->scale ? size / g->scale[i] : 1.0;
        for (size_t k = 0; k < n; k++) g->C[i * n + k] *= g->scale[i];
    }
    return APSM_OK;
}

/* x <- the average of R_i C_i; with R = identity at the start. */
static void average(gpa *g, double *x)
{
    const size_t n = 3 * g->J;
    memset(x, 0, n * sizeof *x);
    for (size_t i = 0; i < g->I; i++) {
        apsm_affine_apply(g->R + 16 * i, g->J, g->C + i * n, g->turned);
        for (size_t k = 0; k < n; k++) x[k] += g->turned[k];
    }
    for (size_t k = 0; k < n; k++) x[k] /= (double)g->I;
}

/* One round; returns how far the mean moved relative to its size. */
static double round_of_rotations(gpa *g, double *old)
{
    const size_t n = 3 * g->J;
    double moved = 0.0, size = 0.0;
    memcpy(old, g->mean, n * sizeof *old);
    for (size_t i = 0; i < g->I; i++)
        apsm_affine_fit(g->J, g->C + i * n, g->mean, NULL, 0, g->R + 16 * i);
    average(g, g->mean);
    for (size_t k = 0; k < n; k++) {
        moved += (g->mean[k] - old[k]) * (g->mean[k] - old[k]);
        size += g->mean[k] * g->mean[k];
    }
    return size > 0.0 ? sqrt(moved / size) : 0.0;
}

static apsm_status rotate(gpa *g)
{
    const size_t n = 3 * g->J;
    const bool by_shape = g->opt->reference < g->I;
    if (by_shape)
        memcpy(g->start, g->C + g->opt->reference * n, n * sizeof *g->start);
    else
        average(g, g->start);
    double *old = malloc(n * sizeof *old);
    if (!old) return APSM_ERR_MEMORY;
    memcpy(g->mean, g->start, n * sizeof *g->mean);
    for (size_t it = 0; it < g->opt->iterations; it++)
        if (round_of_rotations(g, old) <= g->opt->tolerance) break;
    free(old);
    double back[16];
    if (by_shape) {
        apsm_affine_apply(g->R + 16 * g->opt->reference, g->J, g->start, g->turned);
        apsm_affine_fit(g->J, g->turned, g->start, NULL, 0, back);
    } else {
        apsm_affine_fit(g->J, g->mean, g->start, NULL, 0, back);
    }
    for (size_t i = 0; i < g->I; i++) apsm_affine_multiply(back, g->R + 16 * i, g->R + 16 * i);
    return APSM_OK;
}

/* M_i x = scale_i R_i (x - centroid_i) + place; without pose the shape stays at its centroid. */
static void make_map(const gpa *g, size_t i, const double place[3], double M[16])
{
    const double *R = g->R + 16 * i, *c = g->centroid + 3 * i;
    const double *to = g->opt->pose ? place : c;
    apsm_affine_identity(M);
    for (size_t a = 0; a < 3; a++) {
        double moved = 0.0;
        for (size_t b = 0; b < 3; b++) {
            M[4 * a + b] = g->scale[i] * R[4 * a + b];
            moved += M[4 * a + b] * c[b];
        }
        M[4 * a + 3] = to[a] - moved;
    }
}

static void common_place(const gpa *g, double place[3])
{
    const bool by_shape = g->opt->reference < g->I;
    for (size_t a = 0; a < 3; a++) {
        place[a] = by_shape ? g->centroid[3 * g->opt->reference + a] : 0.0;
        for (size_t i = 0; i < g->I && !by_shape; i++)
            place[a] += g->centroid[3 * i + a] / (double)g->I;
    }
}

static apsm_status align(apsm_context *ctx, gpa *g, const double *P, double *M, double *Q)
{
    const size_t n = 3 * g->J;
    double place[3];
    APSM_TRY(centre_and_scale(ctx, g, P));
    for (size_t i = 0; i < g->I; i++) apsm_affine_identity(g->R + 16 * i);
    if (g->opt->pose) APSM_TRY(rotate(g));
    common_place(g, place);
    for (size_t i = 0; i < g->I; i++) {
        make_map(g, i, place, M + 16 * i);
        if (Q) apsm_affine_apply(M + 16 * i, g->J, P + i * n, Q + i * n);
    }
    return APSM_OK;
}

apsm_status apsm_procrustes(apsm_context *ctx, size_t I, size_t J, const double *P,
                            const apsm_procrustes_options *options, double *M, double *Q)
{
    if (I == 0 || J == 0 || !P || !options || !M || (options->pose && J < 3))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "Procrustes alignment needs a shape and at least 3 particles");
    gpa g = { .I = I, .J = J, .opt = options };
    apsm_status status = gpa_alloc(&g);
    if (status == APSM_OK) status = align(ctx, &g, P, M, Q);
    gpa_free(&g);
    return status;
}
