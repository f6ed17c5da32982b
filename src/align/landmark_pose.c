/* Generalised Procrustes analysis (Gower 1975) of landmarks of which some may be missing: in turns
 * the mean place of every landmark over the shapes that have it, and the best map of every shape to
 * these places.  The template's map stays, so that the world does.  With surfaces, the pairs of
 * both sides' closest points come to the landmarks, either half of the weight. */
#include "align/landmark_pose.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "geometry/affine.h"
#include "geometry/bvh.h"
#include "geometry/vec3.h"

enum { TURNS = 20, SURFACE_TURNS = 30, POINTS = 400 };
static const double thin = 1e-3; /* second spread of a line, relative to the first */

typedef struct posing {
    const landmark_table *t;
    const apsm_mesh *const *meshes;
    landmark_pose_options o;
    bool *can;     /* I */
    double *mean;  /* L x 3: places in the world */
    double *x, *y; /* L x 3 */
    double *M;
    /* with surfaces: the template's, in the world */
    apsm_mesh fixed;
    apsm_bvh *bvh;
    apsm_cloud cloud;
} posing;

/* Landmarks of shape i that have a mean place: x in its frame, y the place. */
static size_t pairs_of(const posing *p, size_t i, double *x, double *y)
{
    size_t n = 0;
    for (size_t l = 0; l < p->t->L; l++) {
        if (!landmark_is_there(p->t, i, l) || isnan(p->mean[3 * l])) continue;
        memcpy(x + 3 * n, landmark_at(p->t, i, l), 3 * sizeof *x);
        memcpy(y + 3 * n++, p->mean + 3 * l, 3 * sizeof *y);
    }
    return n;
}

static bool spans_a_plane(size_t n, const double *x)
{
    double c[3] = { 0 }, A[9] = { 0 }, U[9], s[3], V[9];
    for (size_t k = 0; k < 3 * n; k++) c[k % 3] += x[k] / (double)n;
    for (size_t k = 0; k < n; k++)
        for (size_t a = 0; a < 9; a++)
            A[a] += (x[3 * k + a / 3] - c[a / 3]) * (x[3 * k + a % 3] - c[a % 3]);
    apsm_svd3(A, U, s, V);
    return n >= 3 && s[1] > thin * thin * s[0];
}

static void find_means(posing *p)
{
    for (size_t l = 0; l < p->t->L; l++) {
        double sum[3] = { 0 }, y[3];
        size_t n = 0;
        for (size_t i = 0; i < p->t->I; i++) {
            if (!landmark_is_there(p->t, i, l) || !p->can[i]) continue;
            apsm_affine_apply(p->M + 16 * i, 1, landmark_at(p->t, i, l), y);
            vec3_add_scaled(sum, 1, y);
            n++;
        }
        for (size_t c = 0; c < 3; c++) p->mean[3 * l + c] = n > 0 ? sum[c] / (double)n : NAN;
    }
}

/* The world is where the template is: all follow what it would take to bring it back. */
static apsm_status keep_template(const posing *p, const double was[16])
{
    double back[16], *const own = p->M + 16 * p->o.template_index;
    APSM_TRY(apsm_affine_invert(own, back));
    apsm_affine_multiply(was, back, back);
    for (size_t i = 0; i < p->t->I; i++)
        if (p->can[i]) apsm_affine_multiply(back, p->M + 16 * i, p->M + 16 * i);
    memcpy(own, was, 16 * sizeof *own);
    return APSM_OK;
}

static apsm_status turn(posing *p)
{
    const size_t t = p->o.template_index;
    double was[16];
    memcpy(was, p->M + 16 * t, sizeof was);
    find_means(p);
    for (size_t i = 0; i < p->t->I; i++) {
        const size_t n = pairs_of(p, i, p->x, p->y);
        if (p->can[i] && n >= 3) apsm_affine_fit(n, p->x, p->y, NULL, p->o.scale, p->M + 16 * i);
    }
    return p->can[t] ? keep_template(p, was) : APSM_OK;
}

/* ---- with surfaces ---- */

/* Pairs x (frame of the shape), y (world) of one shape with their weights. */
typedef struct pair_list {
    size_t n;
    double *x, *y, *w;
} pair_list;

static void add_pair(pair_list *q, const double x[3], const double y[3], double w)
{
    memcpy(q->x + 3 * q->n, x, 3 * sizeof *x);
    memcpy(q->y + 3 * q->n, y, 3 * sizeof *y);
    q->w[q->n++] = w;
}

static apsm_status surface_turn(const posing *p, const apsm_cloud *cloud, const apsm_bvh *own,
                                size_t landmarks, pair_list *q, double M[16])
{
    double inverse[16], at[3];
    apsm_closest c;
    q->n = landmarks;
    APSM_TRY(apsm_affine_invert(M, inverse));
    for (size_t k = 0; k < cloud->n; k++) {
        apsm_affine_apply(M, 1, cloud->x + 3 * k, at);
        apsm_bvh_closest(p->bvh, at, INFINITY, &c);
        add_pair(q, cloud->x + 3 * k, c.x, 0.5 * cloud->w[k]);
    }
    for (size_t k = 0; k < p->cloud.n; k++) {
        apsm_affine_apply(inverse, 1, p->cloud.x + 3 * k, at);
        apsm_bvh_closest(own, at, INFINITY, &c);
        add_pair(q, c.x, p->cloud.x + 3 * k, 0.5 * p->cloud.w[k]);
    }
    apsm_affine_fit(q->n, q->x, q->y, q->w, p->o.scale, M);
    return APSM_OK;
}

static apsm_status place_with_surface(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    const posing *p = user;
    if (i == p->o.template_index || !p->can[i]) return APSM_OK;
    apsm_cloud cloud = { 0 };
    apsm_bvh *own = NULL;
    const size_t room = p->t->L + 2 * POINTS;
    pair_list q = { 0, malloc(3 * room * sizeof(double)), malloc(3 * room * sizeof(double)),
                    malloc(room * sizeof(double)) };
    apsm_status status = q.x && q.y && q.w ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_cloud_spread(p->meshes[i], POINTS, &cloud);
    if (status == APSM_OK) status = apsm_bvh_build_unsigned(p->meshes[i], &own);
    if (status == APSM_OK) {
        const size_t n = pairs_of(p, i, q.x, q.y);
        for (size_t k = 0; k < n; k++) q.w[k] = 1 / (double)n;
        for (int k = 0; k < SURFACE_TURNS && status == APSM_OK; k++)
            status = surface_turn(p, &cloud, own, n, &q, p->M + 16 * i);
    }
    apsm_bvh_free(own);
    apsm_cloud_free(&cloud);
    free(q.x);
    free(q.y);
    free(q.w);
    return status;
}

static apsm_status place_with_surfaces(apsm_context *ctx, posing *p)
{
    const size_t t = p->o.template_index;
    find_means(p);
    APSM_TRY(apsm_mesh_copy(p->meshes[t], &p->fixed));
    apsm_mesh_transform(&p->fixed, p->M + 16 * t);
    apsm_status status = apsm_bvh_build_unsigned(&p->fixed, &p->bvh);
    if (status == APSM_OK) status = apsm_cloud_spread(&p->fixed, POINTS, &p->cloud);
    if (status == APSM_OK) status = apsm_parallel_for(ctx, p->t->I, place_with_surface, p, "align");
    apsm_cloud_free(&p->cloud);
    apsm_bvh_free(p->bvh);
    apsm_mesh_free(&p->fixed);
    return status;
}

/* ---- all ---- */

/* Who has landmarks enough. */
static size_t choose(posing *p)
{
    size_t without = 0;
    for (size_t i = 0; i < p->t->I; i++) p->can[i] = true;
    find_means(p);
    for (size_t i = 0; i < p->t->I; i++) {
        p->can[i] = spans_a_plane(pairs_of(p, i, p->x, p->y), p->x);
        without += !p->can[i];
    }
    return without;
}

static apsm_status place(apsm_context *ctx, posing *p, size_t *kept)
{
    for (size_t i = 0; i < p->t->I; i++)
        if (apsm_affine_det(p->M + 16 * i) <= 0) return APSM_ERR_ARG;
    *kept = choose(p);
    for (int k = 0; k < TURNS; k++) APSM_TRY(turn(p));
    return p->o.surfaces ? place_with_surfaces(ctx, p) : APSM_OK;
}

apsm_status landmark_pose(apsm_context *ctx, const landmark_table *t,
                          const apsm_mesh *const *meshes, const landmark_pose_options *o, double *M,
                          size_t *kept)
{
    posing p = { .t = t, .meshes = meshes, .o = *o, .M = M };
    p.can = calloc(t->I + 1, sizeof *p.can);
    p.mean = malloc((9 * t->L + 1) * sizeof *p.mean);
    apsm_status status = p.can && p.mean ? APSM_OK : APSM_ERR_MEMORY;
    *kept = 0;
    if (status == APSM_OK) {
        p.x = p.mean + 3 * t->L;
        p.y = p.x + 3 * t->L;
        status = place(ctx, &p, kept);
    }
    free(p.can);
    free(p.mean);
    return status;
}
