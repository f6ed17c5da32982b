/* What the steps came to, as arrays. */
#include <stdlib.h>
#include <string.h>

#include "apsm/affine.h"
#include "run/session.h"

void run_forget_results(apsm_run *run)
{
    run_results *r = &run->results;
    free(r->P);
    free(r->surface);
    apsm_shape_model_free(&r->model);
    apsm_evaluation_free(&r->evaluation);
    certify_free(&r->certificate);
    *r = (run_results){ 0 };
}

size_t apsm_run_shapes(const apsm_run *run)
{
    return run->project.n;
}

const char *apsm_run_shape_name(const apsm_run *run, size_t i)
{
    return i < run->project.n ? run->project.subjects[i].name : NULL;
}

size_t apsm_run_template(const apsm_run *run)
{
    return run_template_index(run);
}

void apsm_run_to_world(const apsm_run *run, size_t i, double M[16])
{
    apsm_affine_identity(M);
    if (i >= run->project.n) return;
    const apsm_subject *s = &run->project.subjects[i];
    apsm_affine_multiply(s->procrustes, s->alignment, M);
}

const apsm_mesh *apsm_run_mesh(const apsm_run *run, size_t i)
{
    return run->mesh && i < run->mesh_count ? &run->mesh[i] : NULL;
}

const double *apsm_run_particles(const apsm_run *run, size_t *J)
{
    *J = run->results.J;
    return run->results.P;
}

const apsm_shape_model *apsm_run_model(const apsm_run *run)
{
    return run->results.evaluated ? &run->results.model : NULL;
}

/* ---- figures ---- */

typedef struct figure {
    const char *name;
    size_t n;
    const double *x;
} figure;

const double *apsm_run_figure(const apsm_run *run, const char *name, size_t *n)
{
    const run_results *r = &run->results;
    const apsm_evaluation *e = &r->evaluation;
    const size_t I = r->surface ? r->I : 0;
    const figure list[] = {
        { "variances", e->modes, e->variance },
        { "compactness", e->n_compactness, e->compactness },
        { "generalization", e->n_generalization, e->generalization },
        { "generalization_standard_error", e->n_generalization, e->generalization_error },
        { "specificity", e->n_specificity, e->specificity },
        { "specificity_standard_error", e->n_specificity, e->specificity_error },
        { "surface_mean", I, r->surface },
        { "surface_p95", I, I ? r->surface + I : NULL },
        { "surface_max", I, I ? r->surface + 2 * I : NULL },
    };
    *n = 0;
    for (size_t k = 0; k < sizeof list / sizeof *list && name; k++)
        if (strcmp(list[k].name, name) == 0) return *n = list[k].n, list[k].x;
    return NULL;
}

/* Three rows of I: mean, p95, max of the two-way distance. */
apsm_status run_gather_surface(run_results *r)
{
    if (!r->evaluation.surface) return APSM_OK;
    r->surface = malloc(3 * r->I * sizeof *r->surface);
    if (!r->surface) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < r->I; i++) {
        const apsm_distance_summary *d = &r->evaluation.surface[i].two_way;
        r->surface[i] = d->mean;
        r->surface[r->I + i] = d->p95;
        r->surface[2 * r->I + i] = d->max;
    }
    return APSM_OK;
}

/* ---- certificate ---- */

bool apsm_run_is_certified(const apsm_run *run, size_t i)
{
    const run_results *r = &run->results;
    return r->evaluated && i < r->certificate.I && r->certificate.shape[i].certified;
}

const char *apsm_run_review(const apsm_run *run, size_t i, size_t k)
{
    const run_results *r = &run->results;
    if (!r->evaluated || i >= r->certificate.I) return NULL;
    for (unsigned reason = 0; reason < APSM_REVIEW_COUNT; reason++)
        if (r->certificate.shape[i].reasons & (1u << reason) && k-- == 0)
            return apsm_review_text((apsm_review)reason);
    return NULL;
}
