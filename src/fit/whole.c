/* A whole surface: the template's particles are registered to it as those of the cohort were
 * ((14)-(17)), and then fit by rounds of (12), whose prior is the model.  The kernels are the
 * cohort's own; what differs is that the prior stays. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "correspond/certificate.h"
#include "fit/parts.h"
#include "geometry/vec3.h"
#include "initialize/projection.h"
#include "optimize/fidelity_shape.h"

/* Template and shape as a cohort of two, and a view of the model's stage on it. */
typedef struct pair {
    apsm_shape shape[2];
    apsm_cohort cohort;
    apsm_fidelity stage;
} pair;

static void open_pair(const fit_job *job, pair *p)
{
    p->shape[0] = job->m->cohort.shape[0];
    p->shape[1] = job->shape;
    p->cohort = (apsm_cohort){ .I = 2, .shape = p->shape, .template_index = 0 };
    p->stage = *job->m->fidelity;
    p->stage.cohort = &p->cohort;
}

/* The prior stays, so few rounds suffice: of 4, 6, 8 and 12 on 26 tali all end at the same
 * distance.
 */
enum { ROUNDS = 4 };

/* P0 and P: 2 x D.  with_end: a round more, after which particles with faults return. */
static apsm_status run_rounds(const fit_job *job, long first, long last, bool with_end,
                              const double *P0, double *P)
{
    pair p;
    fidelity_work w;
    open_pair(job, &p);
    p.stage.o.fidelity_rounds = with_end ? last : last + 1;
    apsm_status status = fidelity_work_alloc(&p.stage, job->m->prior.modes, &w);
    for (long r = first; status == APSM_OK && r < last; r++)
        status = fidelity_round_of(&p.stage, &job->m->prior, 1, r, P0, P, &w);
    fidelity_work_free(&w);
    return status;
}

/* Rounds, and where the certificate then finds a fault the end of the cohort's stage. */
static apsm_status fit_rounds(fit_job *job, const double *P0, double *P)
{
    const size_t D = 3 * job->m->model.J, bytes = D * sizeof *P;
    APSM_TRY(run_rounds(job, 0, ROUNDS, false, P0, P));
    memcpy(job->out->world, P + D, bytes);
    APSM_TRY(fit_certify(job));
    if (job->out->certified && job->out->folds + job->out->swaps == 0) return APSM_OK;
    APSM_TRY(run_rounds(job, ROUNDS, ROUNDS + 1, true, P0, P));
    memcpy(job->out->world, P + D, bytes);
    return fit_certify(job);
}

apsm_status fit_whole_particles(apsm_context *ctx, fit_job *job)
{
    (void)ctx;
    const apsm_fit_model *m = job->m;
    const size_t J = m->model.J, D = 3 * J;
    double *P0 = malloc(4 * D * sizeof *P0);
    if (!P0) return APSM_ERR_MEMORY;
    double *P = P0 + 2 * D;
    memcpy(P0, m->T, D * sizeof *P0);
    apsm_status status = apsm_register_particles(m->registration, &job->shape.mesh, job->shape.bvh,
                                                 J, m->T, m->TN, m->h, P0 + D);
    if (status == APSM_OK) {
        apsm_shape_keep_on_rim(&job->shape, J, m->fidelity->on_rim, P0 + D, NULL);
        memcpy(P, P0, 2 * D * sizeof *P);
        status = fit_rounds(job, P0, P);
    }
    free(P0);
    return status;
}

apsm_status fit_whole_deviations(fit_job *job)
{
    const apsm_fit_model *m = job->m;
    const posterior_model *q = &m->posterior;
    const size_t J = m->model.J, M = q->M;
    double *error =
        malloc((J + M + M * M + 9 * J + posterior_particles_work_size(q)) * sizeof *error);
    if (!error) return APSM_ERR_MEMORY;
    double *b = error + J, *B = b + M, *block = B + M * M, *work = block + 9 * J;
    posterior_scores s = { .b = b, .B = B };
    for (size_t j = 0; j < J; j++) error[j] = q->noise;
    const apsm_status status =
        posterior_of_particles(q, job->out->world, error, &s, NULL, block, work);
    for (size_t j = 0; j < J && status == APSM_OK; j++) {
        fit_set_deviation(job->out, j, block + 9 * j, m->TN + 3 * j, 1);
        job->out->observed[j] = true;
    }
    free(error);
    job->out->observed_share = job->out->counted_share = 1;
    return status;
}

/* ---- certificate ---- */

/* What apsm_certify needs of the shape. */
typedef struct looked_up {
    apsm_surface_point *S;
    double *N, *distance; /* J x 3, J */
    apsm_neighbourhoods rows;
} looked_up;

/* Rows to factor times the closest, or, for 0, as far as the certificate needs them. */
static apsm_status measure_rows(const fit_job *job, double factor, looked_up *l)
{
    return apsm_certificate_measure(job->shape.geodesic, job->m->model.J, l->S, job->out->world,
                                    &job->m->fidelity->reference, factor, &l->rows);
}

static apsm_status look_up(const fit_job *job, looked_up *l)
{
    const size_t J = job->m->model.J;
    const double *P = job->out->world;
    l->S = malloc(J * sizeof *l->S);
    l->N = malloc(6 * J * sizeof *l->N);
    l->distance = malloc(J * sizeof *l->distance);
    if (!l->S || !l->N || !l->distance) return APSM_ERR_MEMORY;
    double *X = l->N + 3 * J;
    apsm_shape_look_up(&job->shape, J, P, l->S, X, l->N);
    for (size_t j = 0; j < J; j++) l->distance[j] = sqrt(vec3_distance2(X + 3 * j, P + 3 * j));
    return measure_rows(job, 0, l);
}

static apsm_status judge(const fit_job *job, looked_up *l, apsm_certificate *c)
{
    const struct apsm_fidelity *f = job->m->fidelity;
    const apsm_certificate_options o = apsm_certificate_defaults();
    const apsm_certificate_input in = { f->J, f->h,  &f->reference,   &l->rows, f->N6,
                                        f->T, f->TN, job->out->world, l->N,     l->distance };
    APSM_TRY(apsm_certify(&in, &o, c));
    if (!(c->reasons & (1u << APSM_REVIEW_MISMATCHED))) return APSM_OK;
    APSM_TRY(measure_rows(job, 4, l)); /* how far those beyond 2 are */
    return apsm_certify(&in, &o, c);
}

apsm_status fit_certify(fit_job *job)
{
    looked_up l = { 0 };
    apsm_certificate c = { 0 };
    apsm_fit *out = job->out;
    apsm_status status = look_up(job, &l);
    if (status == APSM_OK) status = judge(job, &l, &c);
    if (status == APSM_OK) {
        out->has_certificate = true;
        out->certified = c.certified;
        out->lost = c.lost;
        out->swaps = c.swaps;
        out->folds = c.folds;
        out->off_surface = c.off_surface_max;
        job->faults = c.reasons;
    }
    apsm_certificate_free(&c);
    apsm_neighbourhoods_free(&l.rows);
    free(l.S);
    free(l.N);
    free(l.distance);
    return status;
}
