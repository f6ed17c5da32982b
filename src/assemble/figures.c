#include <stdlib.h>
#include <string.h>

#include "assemble/job.h"

static apsm_status allocate(const joint_cohort *c, joint_figures *f)
{
    *f = (joint_figures){ .pairs = c->n * (c->n - 1) / 2 };
    f->like = calloc(c->n, sizeof *f->like);
    f->warp = calloc(c->n, sizeof *f->warp);
    f->mesh = calloc(c->n, sizeof *f->mesh);
    f->surface = calloc(c->I * c->n, sizeof *f->surface);
    f->contact = calloc(c->I * f->pairs, sizeof *f->contact);
    f->mean = calloc(f->pairs, sizeof *f->mean);
    return f->like && f->warp && f->mesh && f->surface && f->contact && f->mean ? APSM_OK
                                                                                : APSM_ERR_MEMORY;
}

/* ---- one model of all particles ---- */

static apsm_status make_model(joint_job *job, const joint_cohort *c, joint_figures *f)
{
    const apsm_parts parts = joint_parts(c);
    const char *word = joint_setting(job, "definition");
    apsm_options options = apsm_options_defaults();
    if (word) APSM_TRY(apsm_options_set(job->ctx, &options, "definition", word));
    const apsm_evaluate_input input = { .I = c->I,
                                        .J = c->J,
                                        .P = c->Q,
                                        .model = &f->model,
                                        .definition = (apsm_definition)options.definition };
    APSM_TRY(apsm_shape_model_fit(job->ctx, c->I, c->J, c->Q, &f->model));
    APSM_TRY(apsm_evaluate(job->ctx, &input, &f->evaluation));
    return apsm_pose_shape_separate(job->ctx, c->I, &parts, c->Q, &f->poses);
}

/* ---- surfaces ---- */

/* Every part has the template of its own model, if that subject is in the joint; else the first. */
static apsm_status make_warp(apsm_context *ctx, const joint_cohort *c, size_t d, joint_figures *f)
{
    for (size_t i = 0; i < c->I; i++)
        if (c->row[i * c->n + d] == c->folder[d].template_index) f->like[d] = i;
    const size_t t = f->like[d];
    APSM_TRY(joint_mesh(ctx, c, t, d, &f->mesh[d]));
    return apsm_warp_build(ctx, APSM_PHI_R, f->mesh[d].nv, f->mesh[d].V,
                           c->first[d + 1] - c->first[d], c->Q + 3 * (t * c->J + c->first[d]),
                           &f->warp[d]);
}

/* The meshes of all parts and their trees. */
typedef struct surfaces {
    size_t n;
    apsm_mesh *mesh;
    apsm_bvh **tree;
} surfaces;

static void surfaces_free(surfaces *s)
{
    for (size_t d = 0; d < s->n; d++) {
        if (s->tree) apsm_bvh_free(s->tree[d]);
        if (s->mesh) apsm_mesh_free(&s->mesh[d]);
    }
    free(s->tree);
    free(s->mesh);
    *s = (surfaces){ 0 };
}

static apsm_status surfaces_new(size_t n, surfaces *s)
{
    *s = (surfaces){ n, calloc(n, sizeof *s->mesh), calloc(n, sizeof *s->tree) };
    return s->mesh && s->tree ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status plant(surfaces *s)
{
    for (size_t d = 0; d < s->n; d++) APSM_TRY(apsm_bvh_build(&s->mesh[d], &s->tree[d]));
    return APSM_OK;
}

static apsm_status own_surfaces(apsm_context *ctx, const joint_cohort *c, size_t i, surfaces *s)
{
    APSM_TRY(surfaces_new(c->n, s));
    for (size_t d = 0; d < c->n; d++) APSM_TRY(joint_mesh(ctx, c, i, d, &s->mesh[d]));
    return plant(s);
}

/* The parts' templates warped to particles x (J x 3, world). */
static apsm_status warped_surfaces(const joint_cohort *c, const joint_figures *f, const double *x,
                                   surfaces *s)
{
    APSM_TRY(surfaces_new(c->n, s));
    for (size_t d = 0; d < c->n; d++) {
        APSM_TRY(apsm_mesh_copy(&f->mesh[d], &s->mesh[d]));
        apsm_warp_apply(&f->warp[d], x + 3 * c->first[d], s->mesh[d].V);
    }
    return plant(s);
}

/* contact[pair * stride] <- of all pairs of parts. */
static void measure_contacts(const surfaces *s, size_t stride, apsm_contact *contact)
{
    for (size_t a = 0; a < s->n; a++)
        for (size_t b = a + 1; b < s->n; b++, contact += stride)
            apsm_contact_measure(s->tree[a], s->tree[b], contact);
}

typedef struct measuring {
    const joint_cohort *c;
    joint_figures *f;
} measuring;

static apsm_status compare(apsm_context *ctx, const measuring *m, size_t i, const surfaces *own,
                           const surfaces *warped)
{
    enum { STRIDE = sizeof(joint_contact) / sizeof(apsm_contact) };
    joint_contact *contact = m->f->contact + i * m->f->pairs;
    measure_contacts(own, STRIDE, &contact->own);
    measure_contacts(warped, STRIDE, &contact->rebuilt);
    for (size_t d = 0; d < m->c->n; d++)
        APSM_TRY(apsm_surface_distance_between(ctx, &own->mesh[d], own->tree[d], &warped->mesh[d],
                                               NULL, &m->f->surface[i * m->c->n + d]));
    return APSM_OK;
}

static apsm_status measure_subject(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const measuring *m = user;
    surfaces own = { 0 }, warped = { 0 };
    apsm_status status = own_surfaces(ctx, m->c, i, &own);
    if (status == APSM_OK) status = warped_surfaces(m->c, m->f, m->c->Q + 3 * i * m->c->J, &warped);
    if (status == APSM_OK) status = compare(ctx, m, i, &own, &warped);
    surfaces_free(&own);
    surfaces_free(&warped);
    return status;
}

static apsm_status measure_mean(const joint_cohort *c, joint_figures *f)
{
    surfaces mean = { 0 };
    const apsm_status status = warped_surfaces(c, f, f->model.mean, &mean);
    if (status == APSM_OK) measure_contacts(&mean, 1, f->mean);
    surfaces_free(&mean);
    return status;
}

apsm_status joint_measure(joint_job *job, const joint_cohort *cohort, joint_figures *figures)
{
    APSM_TRY(allocate(cohort, figures));
    APSM_TRY(make_model(job, cohort, figures));
    for (size_t d = 0; d < cohort->n; d++) APSM_TRY(make_warp(job->ctx, cohort, d, figures));
    measuring m = { cohort, figures };
    APSM_TRY(apsm_parallel_for(job->ctx, cohort->I, measure_subject, &m, "contacts"));
    return measure_mean(cohort, figures);
}

void joint_figures_free(joint_figures *f, size_t n)
{
    for (size_t d = 0; d < n; d++) {
        if (f->warp) apsm_warp_free(&f->warp[d]);
        if (f->mesh) apsm_mesh_free(&f->mesh[d]);
    }
    free(f->like);
    free(f->warp);
    free(f->mesh);
    free(f->surface);
    free(f->contact);
    free(f->mean);
    apsm_evaluation_free(&f->evaluation);
    apsm_shape_model_free(&f->model);
    apsm_pose_shape_free(&f->poses);
    *f = (joint_figures){ 0 };
}
