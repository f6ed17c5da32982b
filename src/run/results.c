/* What the steps came to, as arrays. */
#include "run/results.h"

#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"
#include "run/shapes.h"
#include "session/session.h"

void run_forget_results(apsm_run *run)
{
    run_results *r = &run->results;
    free(r->P);
    apsm_shape_model_free(&r->model);
    figures_clear(&r->figures);
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

const apsm_figures *apsm_run_figures(const apsm_run *run)
{
    return run->results.evaluated ? &run->results.figures : NULL;
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
