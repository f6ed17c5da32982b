#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "assemble/job.h"
#include "core/number.h"
#include "options/options.h"

enum { MODES_MOST = 5, APART_MOST = 3, KINDS = 3 };
static const double deviations = 2;
static const struct {
    const char *name;
    size_t most;
} kinds[KINDS] = { { "mode", MODES_MOST },
                   { "pose mode", APART_MOST },
                   { "shape mode", APART_MOST } };

static apsm_status allocate(const joint_cohort *c, joint_figures *f)
{
    *f = (joint_figures){ .pairs = c->n * (c->n - 1) / 2 };
    f->like = calloc(c->n, sizeof *f->like);
    f->warp = calloc(c->n, sizeof *f->warp);
    f->mesh = calloc(c->n, sizeof *f->mesh);
    f->surface = calloc(c->I * c->n, sizeof *f->surface);
    f->contact = calloc(c->I * f->pairs, sizeof *f->contact);
    f->spaces = calloc((1 + 2 * MODES_MOST + 4 * APART_MOST) * f->pairs, sizeof *f->spaces);
    return f->like && f->warp && f->mesh && f->surface && f->contact && f->spaces ? APSM_OK
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
                                        .options.definition = options.evaluate.definition };
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

/* ---- joints that the model makes ---- */

static const apsm_shape_model *model_of(const joint_figures *f, joint_modes of)
{
    return of == JOINT_MODES        ? &f->model
           : of == JOINT_POSE_MODES ? &f->poses.poses
                                    : &f->poses.shapes;
}

static size_t modes_of(const joint_figures *f, joint_modes of)
{
    const size_t n = model_of(f, of)->modes;
    return n < kinds[of].most ? n : kinds[of].most;
}

/* Mode and sign of the model's joint `made` > 0. */
static joint_modes find_made(const joint_figures *f, size_t made, size_t *k, double *sd)
{
    joint_modes of = JOINT_MODES;
    for (made--; made >= 2 * modes_of(f, of) && of + 1 < KINDS; of++) made -= 2 * modes_of(f, of);
    *k = made / 2;
    *sd = made % 2 ? deviations : -deviations;
    return of;
}

void joint_made_name(const joint_figures *f, size_t made, char name[JOINT_MADE_LENGTH])
{
    size_t k;
    double sd;
    snprintf(name, JOINT_MADE_LENGTH, "mean of the cohort");
    if (made == 0) return;
    const joint_modes of = find_made(f, made, &k, &sd);
    apsm_print(name, JOINT_MADE_LENGTH, "%s %zu %+gsd", kinds[of].name, k + 1, sd);
}

/* Poses and shapes apart, one of them at b along row `mode` of its model. */
static apsm_status compose(const joint_cohort *c, const joint_figures *f, bool of_poses, double b,
                           const double *mode, double *x)
{
    const apsm_pose_shape *ps = &f->poses;
    const apsm_parts parts = joint_parts(c);
    double *s = malloc(ps->J * 3 * sizeof *s), *xi = calloc(6 * ps->n, sizeof *xi);
    apsm_status status = s && xi ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        memcpy(s, ps->shapes.mean, ps->J * 3 * sizeof *s);
        if (of_poses) status = apsm_pose_shape_pose(ps, &parts, b, mode, xi);
        for (size_t a = 0; a < 3 * ps->J && !of_poses; a++) s[a] += b * mode[a];
    }
    if (status == APSM_OK) apsm_pose_shape_compose(ps, &parts, xi, s, x);
    free(s);
    free(xi);
    return status;
}

apsm_status joint_of_mode(const joint_cohort *c, const joint_figures *f, joint_modes of, size_t k,
                          double sd, double *x)
{
    const apsm_shape_model *m = model_of(f, of);
    const double b = sd * sqrt(m->variance[k]), *mode = m->mode + k * m->J * 3;
    if (of != JOINT_MODES) return compose(c, f, of == JOINT_POSE_MODES, b, mode, x);
    for (size_t e = 0; e < 3 * m->J; e++) x[e] = m->mean[e] + b * mode[e];
    return APSM_OK;
}

bool joint_made_closes(const joint_cohort *c, const joint_figures *f, size_t made, size_t pair)
{
    double usual = f->spaces[pair].depth;
    const double depth = f->spaces[made * f->pairs + pair].depth;
    for (size_t i = 0; i < c->I; i++)
        usual = fmax(usual, f->contact[i * f->pairs + pair].own.depth);
    return made > 0 && depth > 2 * usual && depth > 0;
}

bool joint_made_is_apart(const joint_figures *f, size_t made)
{
    size_t k;
    double sd;
    return made > 0 && find_made(f, made, &k, &sd) != JOINT_MODES;
}

/* The joint of particles x, as row `row` of f->spaces. */
static apsm_status measure_made(const joint_cohort *c, const double *x, size_t row,
                                joint_figures *f)
{
    surfaces made = { 0 };
    const apsm_status status = warped_surfaces(c, f, x, &made);
    if (status == APSM_OK) measure_contacts(&made, 1, f->spaces + row * f->pairs);
    surfaces_free(&made);
    return status;
}

/* The mean and the first modes: a model should not close a joint. */
static apsm_status measure_model(const joint_cohort *c, joint_figures *f)
{
    double *x = malloc((3 * f->model.J + 1) * sizeof *x);
    if (!x) return APSM_ERR_MEMORY;
    f->made = 1;
    for (int of = 0; of < KINDS; of++) f->made += 2 * modes_of(f, (joint_modes)of);
    apsm_status status = measure_made(c, f->model.mean, 0, f);
    for (size_t k = 1; k < f->made && status == APSM_OK; k++) {
        size_t mode;
        double sd;
        const joint_modes of = find_made(f, k, &mode, &sd);
        status = joint_of_mode(c, f, of, mode, sd, x);
        if (status == APSM_OK) status = measure_made(c, x, k, f);
    }
    free(x);
    return status;
}

apsm_status joint_measure(joint_job *job, const joint_cohort *cohort, joint_figures *figures)
{
    APSM_TRY(allocate(cohort, figures));
    APSM_TRY(make_model(job, cohort, figures));
    for (size_t d = 0; d < cohort->n; d++) APSM_TRY(make_warp(job->ctx, cohort, d, figures));
    measuring m = { cohort, figures };
    APSM_TRY(apsm_parallel_for(job->ctx, cohort->I, measure_subject, &m, "contacts"));
    APSM_TRY(measure_model(cohort, figures));
    return APSM_OK;
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
    free(f->spaces);
    apsm_evaluation_free(&f->evaluation);
    apsm_shape_model_free(&f->model);
    apsm_pose_shape_free(&f->poses);
    *f = (joint_figures){ 0 };
}
