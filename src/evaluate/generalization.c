/* Generalization by leave-one-out without refitting.  In the coordinates of the full model's modes
 * (rows of V, r x 3J; scores t_i), the scatter of all shapes but i about their own mean is
 *   S_i = diag(s^2) - rho t_i t_i^T,    rho = I / (I - 1),    p_i - mean_i = rho V^T t_i,
 * so the residual of p_i after m modes of the others is rho V^T c_m, with all c_m (m = 1..I-2) from
 * a rank-one downdate in O(I^2) (downdate.c).  What remains are the particles' lengths of V^T c_m:
 * one product r x r x 3J a shape, done block by block of particles. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/deal.h"
#include "evaluate/blocks.h"
#include "evaluate/downdate.h"
#include "evaluate/metrics.h"
#include "linalg/linalg.h"

enum { SLAB = 4 }; /* blocks of particles in one product */

typedef struct scratch {
    apsm_downdate *downdate;
    double *C; /* M x r: residuals in mode coordinates */
    double *E; /* M x SLAB blocks: the same for some particles */
} scratch;

typedef struct leave_one_out {
    const apsm_shape_model *model;
    size_t M;      /* sizes m of models that can differ: the others have at most r modes */
    size_t shapes; /* that are left out */
    size_t row, blocks;
    double *d;        /* modes: s^2 */
    double *mode;     /* modes x row: in blocks */
    double *distance; /* shapes x M: mean particle distance of one to m modes of the others */
    scratch *worker;  /* threads */
    int threads;
} leave_one_out;

/* distance (M) += lengths of the particles' residuals over all particles. */
static void add_lengths(const leave_one_out *l, const scratch *w, size_t rows, double *distance)
{
    const size_t r = l->model->modes;
    for (size_t b = 0; b < l->blocks; b += SLAB) {
        const size_t n = l->blocks - b < SLAB ? l->blocks - b : SLAB, width = n * 3 * APSM_BLOCK;
        apsm_gemm(0, 0, rows, width, r, 1.0, w->C, r, l->mode + b * 3 * APSM_BLOCK, l->row, 0.0,
                  w->E, width);
        for (size_t m = 0; m < rows; m++) distance[m] += apsm_blocks_norm(n, w->E + m * width);
    }
}

size_t apsm_generalization_shapes(size_t I)
{
    enum { MOST = 1000 };
    return I < MOST ? I : MOST;
}

static apsm_status leave_out(apsm_context *ctx, size_t k, int worker, void *user)
{
    (void)ctx;
    leave_one_out *l = user;
    scratch *w = &l->worker[worker];
    const size_t r = l->model->modes, I = l->model->I;
    const double rho = (double)I / (double)(I - 1), scale = rho / (double)l->model->J;
    const size_t i = k * I / l->shapes; /* evenly among all */
    double *distance = l->distance + k * l->M;
    const size_t rows = apsm_downdate_residuals(w->downdate, l->d, l->model->score + i * r, rho,
                                                APSM_ZERO_VARIANCE, l->M, w->C);
    memset(distance, 0, l->M * sizeof *distance);
    if (rows > 0) {
        add_lengths(l, w, rows, distance);
    } else { /* the others have no modes: the distance to their mean */
        memcpy(w->C, l->model->score + i * r, r * sizeof *w->C);
        add_lengths(l, w, 1, distance);
    }
    for (size_t m = 0; m < l->M; m++)
        distance[m] = m < rows || m == 0 ? distance[m] * scale : distance[m - 1];
    return APSM_OK;
}

static void scratch_free(leave_one_out *l)
{
    for (int k = 0; l->worker && k < l->threads; k++) {
        apsm_downdate_free(l->worker[k].downdate);
        free(l->worker[k].C);
        free(l->worker[k].E);
    }
    free(l->worker);
    free(l->d);
    free(l->mode);
    free(l->distance);
}

static apsm_status scratch_alloc(leave_one_out *l)
{
    const size_t r = l->model->modes;
    l->d = malloc(r * sizeof *l->d);
    l->mode = malloc(r * l->row * sizeof *l->mode);
    l->distance = malloc(l->shapes * l->M * sizeof *l->distance);
    l->worker = calloc((size_t)l->threads, sizeof *l->worker);
    if (!l->d || !l->mode || !l->distance || !l->worker) return APSM_ERR_MEMORY;
    for (int k = 0; k < l->threads; k++) {
        scratch *w = &l->worker[k];
        APSM_TRY(apsm_downdate_new(r, &w->downdate));
        w->C = malloc(l->M * r * sizeof *w->C);
        w->E = malloc(l->M * SLAB * 3 * APSM_BLOCK * sizeof *w->E);
        if (!w->C || !w->E) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

/* Mean and standard error over the shapes, in their order; beyond M nothing changes. */
static void average(const leave_one_out *l, double *mean, double *error)
{
    const double n = (double)l->shapes;
    for (size_t m = 0; m < l->M; m++) {
        double sum = 0.0, sum2 = 0.0;
        for (size_t k = 0; k < l->shapes; k++) sum += l->distance[k * l->M + m];
        mean[m] = sum / n;
        for (size_t k = 0; k < l->shapes; k++) {
            const double x = l->distance[k * l->M + m] - mean[m];
            sum2 += x * x;
        }
        if (error) error[m] = sqrt(sum2 / (n * (n - 1.0)));
    }
    for (size_t m = l->M; m < l->model->I - 2; m++) {
        mean[m] = mean[l->M - 1];
        if (error) error[m] = error[l->M - 1];
    }
}

apsm_status apsm_generalization(apsm_context *ctx, const apsm_shape_model *model,
                                double *generalization, double *error)
{
    const size_t I = model->I, r = model->modes;
    if (I < 3) return APSM_OK;
    leave_one_out l = { .model = model,
                        .M = r < I - 2 ? r : I - 2,
                        .shapes = apsm_generalization_shapes(I),
                        .row = apsm_blocks_row(model->J),
                        .threads = apsm_context_threads(ctx) };
    l.blocks = l.row / (3 * APSM_BLOCK);
    if (r == 0) {
        memset(generalization, 0, (I - 2) * sizeof *generalization);
        if (error) memset(error, 0, (I - 2) * sizeof *error);
        return APSM_OK;
    }
    apsm_status status = scratch_alloc(&l);
    if (status == APSM_OK) {
        for (size_t k = 0; k < r; k++) {
            l.d[k] = model->variance[k] * (double)(I - 1);
            apsm_blocks_pack(model->J, model->mode + k * 3 * model->J, l.mode + k * l.row);
        }
        const apsm_shared_loop loop = { .kind = "generalization",
                                        .n = l.shapes,
                                        .fn = leave_out,
                                        .user = &l,
                                        .stage = "generalization",
                                        .made = { { l.distance, l.M * sizeof *l.distance } } };
        status = apsm_shared_for(ctx, &loop);
    } else {
        apsm_fail(ctx, status, "out of memory for the generalization of %zu shapes", I);
    }
    if (status == APSM_OK) average(&l, generalization, error);
    scratch_free(&l);
    return status;
}
