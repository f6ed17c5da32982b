/* The choice of the template.  What a template's mesh lacks or has too much of, every warp of it
 * inherits; a typical pose and size (the medoid) says nothing about that.  So candidates are tried
 * for what they are for, with the correspondence that is at hand before there is any: points of
 * the typical shape, carried to the others by non-rigid registration. */
#include "model/template_choice.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "align/registration.h"
#include "geometry/bvh.h"
#include "geometry/vec3.h"
#include "initialize/projection.h"
#include "model/warp.h"

enum { CANDIDATES = 10, OTHERS = 6, MOST = CANDIDATES + OTHERS };
enum { POINTS = 128, VERTICES = 500 };
static const double worth = 0.98;

/* A shape in the common frame. */
typedef struct entrant {
    size_t shape;
    apsm_mesh mesh;
    apsm_bvh *bvh;
    double P[3 * POINTS];
} entrant;

/* Scratch of a thread for the candidate at hand. */
typedef struct warped {
    apsm_mesh mesh; /* the candidate's faces, vertices of its own */
    apsm_bvh *bvh;
} warped;

typedef struct contest {
    const apsm_mesh *const *meshes;
    const double *M;
    size_t n, candidates;
    entrant *e; /* n: candidates, the first of them the typical shape, and others to judge by */
    apsm_registration *registration;
    double X[3 * POINTS], N[3 * POINTS]; /* points and normals of the typical shape */
    size_t points;                       /* 128 if the surface has as many vertices */
    double h;                            /* their spacing */
    /* of the candidate at hand */
    const entrant *candidate;
    apsm_warp warp;
    warped *scratch;    /* threads */
    double *error;      /* n */
    bool avoid_typical; /* the one that all were aligned to serves only for that */
} contest;

/* ---- who takes part ---- */

typedef struct ranked {
    double residual;
    size_t shape;
} ranked;

static int by_residual(const void *a, const void *b)
{
    const ranked *x = a, *y = b;
    if (x->residual != y->residual) return x->residual < y->residual ? -1 : 1;
    return x->shape < y->shape ? -1 : x->shape > y->shape;
}

static apsm_status choose_entrants(size_t n, const double *residual, const bool *skip,
                                   size_t typical, contest *c)
{
    ranked *list = malloc(n * sizeof *list);
    size_t eligible = 0;
    if (!list) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < n; i++)
        if (i == typical || !skip || !skip[i])
            list[eligible++] = (ranked){ i == typical ? -1 : residual[i], i };
    qsort(list, eligible, sizeof *list, by_residual);
    c->candidates = eligible < CANDIDATES ? eligible : CANDIDATES;
    const size_t rest = eligible - c->candidates, others = rest < OTHERS ? rest : OTHERS;
    for (size_t k = 0; k < c->candidates; k++) c->e[c->n++].shape = list[k].shape;
    for (size_t k = 0; k < others; k++)
        c->e[c->n++].shape = list[c->candidates + (2 * k + 1) * rest / (2 * others)].shape;
    free(list);
    return APSM_OK;
}

/* ---- points on all of them ---- */

static apsm_status open_entrant(const contest *c, entrant *e)
{
    APSM_TRY(apsm_mesh_copy(c->meshes[e->shape], &e->mesh));
    apsm_mesh_transform(&e->mesh, c->M + 16 * e->shape);
    return apsm_bvh_build_unsigned(&e->mesh, &e->bvh);
}

static apsm_status prepare_entrant(apsm_context *ctx, size_t k, int worker, void *user)
{
    (void)ctx, (void)worker;
    const contest *c = user;
    entrant *e = &c->e[k];
    if (k == 0) return APSM_OK; /* the typical shape */
    APSM_TRY(open_entrant(c, e));
    return apsm_register_particles(c->registration, &e->mesh, e->bvh, c->points, c->X, c->N, c->h,
                                   e->P);
}

static apsm_status prepare_typical(contest *c)
{
    entrant *e = &c->e[0];
    apsm_cloud cloud;
    APSM_TRY(open_entrant(c, e));
    APSM_TRY(apsm_cloud_spread(&e->mesh, APSM_REGISTRATION_POINTS, &cloud));
    /* points of a cloud are each the farthest from those before, so the first are spread as well */
    c->points = cloud.n < POINTS ? cloud.n : POINTS;
    memcpy(c->X, cloud.x, 3 * c->points * sizeof *c->X);
    memcpy(c->N, cloud.normal, 3 * c->points * sizeof *c->N);
    c->h = vec3_mean_spacing(c->points, c->X);
    memcpy(e->P, c->X, sizeof c->X);
    const apsm_status status = apsm_registration_new(&cloud, &c->registration);
    apsm_cloud_free(&cloud);
    return status;
}

/* ---- the warps ---- */

/* Sum of the distances of some vertices of a mesh from a surface; *count grows by their number. */
static double distances(const apsm_mesh *mesh, const apsm_bvh *surface, size_t *count)
{
    const size_t step = 1 + (mesh->nv - 1) / VERTICES;
    double sum = 0;
    for (size_t v = 0; v < mesh->nv; v += step, ++*count) {
        apsm_closest closest;
        apsm_bvh_closest(surface, mesh->V + 3 * v, INFINITY, &closest);
        sum += sqrt(closest.distance2);
    }
    return sum;
}

static apsm_status judge(apsm_context *ctx, size_t k, int worker, void *user)
{
    (void)ctx;
    const contest *c = user;
    const entrant *e = &c->e[k];
    warped *w = &c->scratch[worker];
    size_t count = 0;
    c->error[k] = 0;
    if (e == c->candidate) return APSM_OK;
    apsm_warp_apply(&c->warp, e->P, w->mesh.V);
    apsm_bvh_refit(w->bvh);
    const double sum = distances(&w->mesh, e->bvh, &count) + distances(&e->mesh, w->bvh, &count);
    c->error[k] = sum / (double)count;
    return APSM_OK;
}

static void free_scratch(contest *c, size_t threads)
{
    for (size_t k = 0; k < threads; k++) {
        apsm_bvh_free(c->scratch[k].bvh);
        apsm_mesh_free(&c->scratch[k].mesh);
        c->scratch[k] = (warped){ 0 };
    }
    apsm_warp_free(&c->warp);
}

/* *mean (out): of the candidate's distances from all the others. */
static apsm_status try_candidate(apsm_context *ctx, contest *c, const entrant *e, double *mean)
{
    const size_t threads = (size_t)apsm_context_threads(ctx);
    c->candidate = e;
    apsm_status status =
        apsm_warp_build(ctx, APSM_PHI_R, e->mesh.nv, e->mesh.V, c->points, e->P, &c->warp);
    for (size_t k = 0; status == APSM_OK && k < threads; k++) {
        status = apsm_mesh_copy(&e->mesh, &c->scratch[k].mesh);
        if (status == APSM_OK)
            status = apsm_bvh_build_unsigned(&c->scratch[k].mesh, &c->scratch[k].bvh);
    }
    if (status == APSM_OK) status = apsm_parallel_for(ctx, c->n, judge, c, NULL);
    free_scratch(c, threads);
    *mean = 0;
    for (size_t k = 0; status == APSM_OK && k < c->n; k++)
        *mean += c->error[k] / (double)(c->n - 1);
    return status;
}

static apsm_status hold(apsm_context *ctx, contest *c, size_t *chosen)
{
    double least = INFINITY;
    APSM_TRY(prepare_typical(c));
    APSM_TRY(apsm_parallel_for(ctx, c->n, prepare_entrant, c, NULL));
    for (size_t k = 0; k < c->candidates; k++) {
        double mean;
        APSM_TRY(try_candidate(ctx, c, &c->e[k], &mean));
        if (k == 0) mean *= c->avoid_typical ? INFINITY : worth;
        if (mean < least) least = mean, *chosen = c->e[k].shape;
    }
    return APSM_OK;
}

apsm_status apsm_choose_template(apsm_context *ctx, size_t n, const apsm_mesh *const *meshes,
                                 const double *M, const double *residual, const bool *skip,
                                 size_t typical, size_t *chosen)
{
    *chosen = typical;
    if (n < 4) return APSM_OK;
    contest c = { .meshes = meshes, .M = M, .avoid_typical = skip && skip[typical] };
    c.e = calloc(MOST, sizeof *c.e);
    c.error = calloc(MOST, sizeof *c.error);
    c.scratch = calloc((size_t)apsm_context_threads(ctx), sizeof *c.scratch);
    apsm_status status = c.e && c.error && c.scratch ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = choose_entrants(n, residual, skip, typical, &c);
    if (status == APSM_OK && c.n >= 4) status = hold(ctx, &c, chosen);
    for (size_t k = 0; c.e && k < c.n; k++) {
        apsm_bvh_free(c.e[k].bvh);
        apsm_mesh_free(&c.e[k].mesh);
    }
    apsm_registration_free(c.registration);
    free(c.e);
    free(c.error);
    free(c.scratch);
    return status;
}
