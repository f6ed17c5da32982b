/* First particles of a cohort.  docs/method.md, "Initialisation": farthest points on the template,
 * spread evenly, then projected onto the aligned shapes (7c), or matched to samples of every shape
 * (7b, the paper). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "align/registration.h"
#include "core/deal.h"
#include "initialize/anchors.h"
#include "initialize/assignment.h"
#include "initialize/farthest_point.h"
#include "initialize/features.h"
#include "initialize/projection.h"
#include "optimize/correspondence_loss.h"
#include "optimize/optimizer.h"
#include "optimize/rim_seats.h"

enum { SPREAD_EPOCHS = 60, ADAPTIVE_EPOCHS = 6 };
static const double anchor_reach = 3; /* of the pull of a landmark, in h */

/* The vertex farthest from the surface's centroid: the same whatever the order of the vertices,
 * but for ties. */
static uint32_t outermost_vertex(const apsm_mesh *mesh)
{
    double c[3], best = -1;
    uint32_t vertex = 0;
    apsm_mesh_centroid(mesh, c);
    for (size_t v = 0; v < mesh->nv; v++) {
        const double *x = mesh->V + 3 * v;
        const double d2 = (x[0] - c[0]) * (x[0] - c[0]) + (x[1] - c[1]) * (x[1] - c[1]) +
                          (x[2] - c[2]) * (x[2] - c[2]);
        if (d2 > best) best = d2, vertex = (uint32_t)v;
    }
    return vertex;
}

/* J farthest points of a shape, as surface points. */
static apsm_status sample_shape(apsm_context *ctx, const apsm_shape *shape, size_t J,
                                apsm_surface_point *S)
{
    apsm_geodesic_work *w = NULL;
    uint32_t *order = malloc(J * sizeof *order);
    double *nearest = malloc(shape->mesh.nv * sizeof *nearest);
    apsm_status status = order && nearest ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_geodesic_work_new(shape->geodesic, &w);
    if (status == APSM_OK)
        status = apsm_farthest_vertices(shape->geodesic, w, outermost_vertex(&shape->mesh), J,
                                        order, NULL, nearest);
    if (status == APSM_ERR_GEOMETRY)
        status =
            apsm_fail(ctx, status, "%s: %zu vertices are too few for %zu particles; raise faces",
                      shape->name, shape->mesh.nv, J);
    for (size_t j = 0; j < J && status == APSM_OK; j++)
        status = apsm_surface_vertex(&shape->topology, order[j], &S[j]);
    apsm_geodesic_work_free(w);
    free(order);
    free(nearest);
    return status;
}

/* What the tasks share: the template's particles and normals. */
typedef struct carry {
    const apsm_cohort *cohort;
    const apsm_optimize_options *options;
    size_t d, J; /* which part, of how many particles */
    double h;
    const double *T, *TN;            /* J x 3 */
    bool *on_rim;                    /* J: particles on the template's rim */
    double *P;                       /* I x J x 3, out */
    apsm_registration *registration; /* NULL if not asked for */
} carry;

static void positions(const apsm_shape *shape, size_t J, const apsm_surface_point *S, double *P)
{
    for (size_t j = 0; j < J; j++) apsm_surface_position(&shape->mesh, &S[j], P + 3 * j);
}

static void project(const carry *c, const apsm_shape *shape, const double *X, const double *N,
                    apsm_surface_point *S, double *P)
{
    apsm_projection_options po = c->options->first;
    po.h = c->h;
    apsm_project_particles(shape->bvh, c->J, X, N, &po, S, P, NULL);
}

/* The paper's way: the shape's own samples get the names of the projected reference particles. */
static apsm_status match(apsm_context *ctx, const carry *c, const apsm_shape *shape,
                         apsm_surface_point *S, double *P)
{
    apsm_geodesic_work *w = NULL;
    apsm_surface_point *samples = malloc(2 * c->J * sizeof *samples);
    void *work = malloc(apsm_match_samples_work_size(c->J));
    apsm_status status = samples && work ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        project(c, shape, c->T, c->TN, S, P);
        status = sample_shape(ctx, shape, c->J, samples);
    }
    if (status == APSM_OK) status = apsm_geodesic_work_new(shape->geodesic, &w);
    if (status == APSM_OK)
        status = apsm_match_samples(shape->geodesic, w, c->J, S, samples, samples + c->J, work);
    if (status == APSM_OK) positions(shape, c->J, samples + c->J, P);
    apsm_geodesic_work_free(w);
    free(samples);
    free(work);
    return status;
}

static apsm_status carry_to(apsm_context *ctx, const carry *c, const apsm_shape *shape, double *P)
{
    if (c->registration)
        return apsm_register_particles(c->registration, &shape->mesh, shape->bvh, c->J, c->T, c->TN,
                                       c->h, P);
    apsm_surface_point *S = malloc(c->J * sizeof *S);
    if (!S) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    if (c->options->first.initialize == APSM_INIT_PROJECTION)
        project(c, shape, c->T, c->TN, S, P);
    else
        status = match(ctx, c, shape, S, P);
    free(S);
    return status;
}

/* The registration takes the template's landmarks along; what it misses by, the particles follow.
 */
static apsm_status pull_to_anchors(const carry *c, size_t i, double *P)
{
    const size_t L = c->cohort->anchors.L, t = c->cohort->template_index;
    const apsm_shape *shape = &c->cohort->shape[i], *from = &c->cohort->shape[t];
    double *X = malloc((6 * L + 3 * c->J) * sizeof *X), *LN = X + 3 * L, *N = X + 6 * L;
    apsm_surface_point *S = malloc((L > c->J ? L : c->J) * sizeof *S);
    apsm_status status = X && S ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        apsm_shape_look_up(from, L, anchor_at(c->cohort, t, 0), S, X, LN);
        if (c->registration)
            status = apsm_register_particles(c->registration, &shape->mesh, shape->bvh, L, X, LN,
                                             c->h, X);
    }
    if (status == APSM_OK) {
        apsm_shape_look_up(shape, c->J, P, S, NULL, N);
        status = apsm_anchors_pull(c->cohort, i, c->J, X, N, anchor_reach * c->h, P);
    }
    free(S);
    free(X);
    return status;
}

static apsm_status carry_to_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const carry *c = user;
    const size_t bytes = c->J * 3 * sizeof *c->P, piece = c->d * c->cohort->I + i;
    double *P = c->P + i * c->J * 3;
    if (!cohort_moves(c->cohort, i)) return APSM_OK;
    if (i == c->cohort->template_index) {
        memcpy(P, c->T, bytes);
        return APSM_OK;
    }
    if (apsm_recall(ctx, "first", piece, bytes, P)) return APSM_OK;
    APSM_TRY(carry_to(ctx, c, &c->cohort->shape[i], P));
    if (c->cohort->features.F > 0) APSM_TRY(apsm_features_pull(c->cohort, i, c->J, c->T, c->h, P));
    if (c->cohort->anchors.L > 0) APSM_TRY(pull_to_anchors(c, i, P));
    apsm_shape_keep_on_rim(&c->cohort->shape[i], c->J, c->on_rim, P, NULL);
    return apsm_keep(ctx, "first", piece, bytes, P);
}

/* Particles T (J x 3) spread over the template, where the surface error wants them unless stage 2
 * is to see to that; S (J) is scratch. */
static apsm_status seed_template(apsm_context *ctx, const apsm_cohort *cohort,
                                 const apsm_optimize_options *options, size_t J,
                                 apsm_surface_point *S, double *T)
{
    const size_t t = cohort->template_index;
    const apsm_shape *shape = &cohort->shape[t];
    APSM_TRY(sample_shape(ctx, shape, J, S));
    positions(shape, J, S, T);
    apsm_anchors_hold(cohort, t, T);
    APSM_TRY(apsm_spread(ctx, cohort, t, options, J, SPREAD_EPOCHS, 0, T));
    if (shape->rim.n > 0) {
        APSM_TRY(apsm_seat_rim(shape, J, T));
        apsm_anchors_hold(cohort, t, T);
        APSM_TRY(apsm_spread(ctx, cohort, t, options, J, SPREAD_EPOCHS, 0, T));
    }
    const double c = options->schedule.adaptivity;
    const apsm_optimizer_state first = { .stage = APSM_STAGE_1 };
    if (!(c > 0) || apsm_draws_points(options, &first)) return APSM_OK;
    return apsm_spread(ctx, cohort, t, options, J, ADAPTIVE_EPOCHS, c, T);
}

/* The template's particles c->T, which are c->P's where it is fixed, with normals TN and spacing.
 */
static apsm_status begin_with_template(apsm_context *ctx, carry *c, double *T, double *TN)
{
    const size_t t = c->cohort->template_index, J = c->J;
    const apsm_shape *shape = &c->cohort->shape[t];
    apsm_surface_point *S = malloc(J * sizeof *S);
    uint32_t *N6 = malloc(J * APSM_NEIGHBOURS * sizeof *N6);
    apsm_status status = S && N6 ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK && cohort_moves(c->cohort, t))
        status = seed_template(ctx, c->cohort, c->options, J, S, T);
    else if (status == APSM_OK)
        memcpy(T, c->P + t * J * 3, J * 3 * sizeof *T);
    if (status == APSM_OK) {
        apsm_shape_look_up(shape, J, T, S, NULL, TN);
        status = apsm_neighbours6(J, T, N6);
    }
    if (status == APSM_OK) c->h = apsm_spacing(J, T, N6, NULL);
    free(S);
    free(N6);
    return status;
}

static apsm_status prepare_registration(carry *c)
{
    const size_t t = c->cohort->template_index;
    apsm_cloud cloud;
    APSM_TRY(apsm_cloud_spread(&c->cohort->shape[t].mesh, APSM_REGISTRATION_POINTS, &cloud));
    const apsm_status status = apsm_registration_new(&cloud, &c->registration);
    apsm_cloud_free(&cloud);
    return status;
}

/* Those of part d, whose cohort this is; P is I x J x 3. */
static apsm_status first_of_part(apsm_context *ctx, const apsm_cohort *cohort, size_t d,
                                 const apsm_optimize_options *options, size_t J, double *P)
{
    double *T = malloc(6 * J * sizeof *T);
    if (!T) return APSM_ERR_MEMORY;
    carry c = { cohort, options, d, J, .T = T, .TN = T + 3 * J, .P = P };
    apsm_status status = begin_with_template(ctx, &c, T, T + 3 * J);
    c.on_rim = malloc(J * sizeof *c.on_rim);
    if (status == APSM_OK && !c.on_rim) status = APSM_ERR_MEMORY;
    if (status == APSM_OK)
        apsm_shape_find_on_rim(&cohort->shape[cohort->template_index], J, T, c.on_rim);
    if (status == APSM_OK && options->first.initialize == APSM_INIT_REGISTRATION)
        status = prepare_registration(&c);
    if (status == APSM_OK)
        status = apsm_dealt_for(ctx, cohort->I, carry_to_shape, &c, "initialize");
    apsm_registration_free(c.registration);
    free(c.on_rim);
    free(T);
    return status;
}

apsm_status apsm_first_particles(apsm_context *ctx, const apsm_cohort *cohort,
                                 const apsm_optimize_options *options, size_t J, double *P)
{
    if (!cohort->part) return first_of_part(ctx, cohort, 0, options, J, P);
    double *part = malloc(cohort->I * J * 3 * sizeof *part);
    apsm_status status = part ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t d = 0; d < cohort->parts && status == APSM_OK; d++) {
        const size_t own = cohort->first[d + 1] - cohort->first[d];
        cohort_take_part(cohort, d, J, P, part);
        status = first_of_part(ctx, &cohort->part[d], d, options, own, part);
        cohort_put_part(cohort, d, J, part, P);
    }
    free(part);
    return status;
}
