/* Landmarks: points between the particles, which the warp makes linear in them, so that (41) holds
 * with A its rows; the pose is six modes more, about where it is, and a few rounds settle it. */
#include "fit/landmarks.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/rigid.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "linalg/linalg.h"
#include "optimize/fidelity_shape.h"

enum { ROUNDS = 5 };

typedef struct landmark_work {
    size_t n, D;
    double *A;      /* 3n x D */
    double *R;      /* 3n x 3n */
    double *offset; /* n x 3: of the points from the mean's surface */
    double *y;      /* n x 3: points in the world */
    double *P;      /* D */
    double *b, *B;  /* K, K x K */
    double *C;      /* D x D */
    double *store, *work;
} landmark_work;

static bool work_alloc(const apsm_fit_model *m, size_t n, landmark_work *w)
{
    const size_t D = m->posterior.D, K = m->posterior.M + FIT_RIGID;
    const posterior_model most = { .D = D, .M = K };
    *w = (landmark_work){ .n = n, .D = D };
    w->A = calloc(3 * n * D, sizeof *w->A);
    w->R = calloc(9 * n * n, sizeof *w->R);
    w->offset = malloc(3 * n * sizeof *w->offset);
    w->y = malloc(3 * n * sizeof *w->y);
    w->P = malloc(D * sizeof *w->P);
    w->b = malloc(K * sizeof *w->b);
    w->B = malloc(K * K * sizeof *w->B);
    w->C = malloc(D * D * sizeof *w->C);
    w->store = malloc(fit_rigid_size(&most) * sizeof *w->store);
    w->work = malloc(posterior_work_size(&most, 3 * n) * sizeof *w->work);
    return w->A && w->R && w->offset && w->y && w->P && w->b && w->B && w->C && w->store && w->work;
}

static void work_free(landmark_work *w)
{
    free(w->A);
    free(w->R);
    free(w->offset);
    free(w->y);
    free(w->P);
    free(w->b);
    free(w->B);
    free(w->C);
    free(w->store);
    free(w->work);
}

/* Rows of the warp at the points of the mean's surface that are closest to `at`. */
static apsm_status make_rows(fit_job *job, const double *at, landmark_work *w)
{
    const apsm_fit_model *m = job->m;
    const apsm_warp *warp = &m->fidelity->warp;
    apsm_mesh mean;
    apsm_bvh *bvh = NULL;
    APSM_TRY(apsm_mesh_copy(&m->cohort.shape[0].mesh, &mean));
    apsm_warp_apply(warp, m->model.mean, mean.V);
    const apsm_status status = apsm_bvh_build_unsigned(&mean, &bvh);
    for (size_t k = 0; k < w->n && status == APSM_OK; k++) {
        apsm_closest c;
        apsm_bvh_closest(bvh, at + 3 * k, INFINITY, &c);
        vec3_sub(at + 3 * k, c.x, w->offset + 3 * k);
        if (sqrt(c.distance2) > job->landmark.off_mean) {
            job->landmark.farthest = k;
            job->landmark.off_mean = sqrt(c.distance2);
        }
        const uint32_t *corner = mean.F + 3 * (size_t)c.on.face;
        for (size_t j = 0; j < warp->J; j++) {
            double part = 0;
            for (size_t v = 0; v < 3; v++)
                part += c.on.weight[v] * warp->W[corner[v] * warp->J + j];
            for (size_t a = 0; a < 3; a++) w->A[(3 * k + a) * w->D + 3 * j + a] = part;
        }
        for (size_t a = 0; a < 3; a++)
            w->R[(3 * k + a) * 3 * w->n + 3 * k + a] = fit_placing * fit_placing * m->h * m->h;
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mean);
    return status;
}

/* Points brought to their places on the mean; the mean squared distance that remains. */
static double place(size_t n, const double *x, const double *at, bool mirrored, double M[16])
{
    double F[16], sum = 0;
    apsm_affine_identity(F);
    if (mirrored) F[0] = -1;
    double y[3], *turned = malloc(3 * n * sizeof *turned);
    if (!turned) return NAN;
    apsm_affine_apply(F, n, x, turned);
    apsm_affine_fit(n, turned, at, NULL, 0, M);
    apsm_affine_multiply(M, F, M);
    for (size_t k = 0; k < n; k++) {
        apsm_affine_apply(M, 1, x + 3 * k, y);
        sum += vec3_distance2(y, at + 3 * k) / (double)n;
    }
    free(turned);
    return sum;
}

static apsm_status find_pose(fit_job *job, size_t n, const double *at, const double *x)
{
    double other[16];
    const apsm_fit_options *o = job->options;
    fit_pose *p = &job->pose;
    *p = (fit_pose){ .runner_up = INFINITY, .mirror_ratio = INFINITY };
    apsm_affine_identity(p->M);
    if (o->aligned) return APSM_OK;
    const double same = place(n, x, at, false, p->M), mirror = place(n, x, at, true, other);
    if (isnan(same) || isnan(mirror)) return APSM_ERR_MEMORY;
    p->mirrored = o->hand == APSM_HAND_OTHER || (o->hand == APSM_HAND_AUTO && n > 3 &&
                                                 sqrt(mirror) < APSM_MIRROR_RATIO * sqrt(same));
    if (p->mirrored) memcpy(p->M, other, sizeof other);
    p->residual = sqrt(p->mirrored ? mirror : same) / job->m->radius;
    if (o->hand == APSM_HAND_AUTO && n > 3)
        p->mirror_ratio = sqrt(p->mirrored ? same / mirror : mirror / same);
    return APSM_OK;
}

/* One linear step from P; the rigid part goes to the pose. */
static apsm_status step(fit_job *job, const double *x, bool last, landmark_work *w)
{
    const apsm_fit_model *m = job->m;
    double R[16], back[16], centre[3];
    apsm_affine_apply(job->pose.M, w->n, x, w->y);
    for (size_t k = 0; k < 3 * w->n; k++) w->y[k] -= w->offset[k];
    const posterior_model q = fit_rigid_add(&m->posterior, w->P, m->radius, w->store);
    const posterior_seen seen = { 3 * w->n, w->A, w->R, w->y };
    posterior_scores s = { .b = w->b, .B = w->B };
    APSM_TRY(posterior_of(&q, &seen, &s, job->out->world, last ? w->C : NULL, w->work));
    fit_centre(w->D, w->P, centre);
    fit_rigid_motion(centre, m->radius, w->b, R);
    APSM_TRY(apsm_affine_invert(R, back));
    apsm_affine_apply(back, w->D / 3, job->out->world, job->out->world);
    apsm_affine_multiply(back, job->pose.M, job->pose.M);
    memcpy(w->P, job->out->world, w->D * sizeof *w->P);
    return APSM_OK;
}

/* Landmarks are judged in groups, which spread over all of them: a hundred others say enough, and
 * the work grows with their cube. */
enum { GROUP = 100 };

/* Rows of every groups-th landmark from first on, one after the other; returns how many
 * coordinates.  R is that of all, whose blocks are alike. */
static size_t take_group(const landmark_work *w, size_t first, size_t groups, double *A, double *R,
                         double *y)
{
    const size_t row = 3 * w->D;
    size_t n = 0;
    for (size_t k = first; k < w->n; k += groups, n += 3) {
        memcpy(A + n * w->D, w->A + k * row, row * sizeof *A);
        memcpy(y + n, w->y + 3 * k, 3 * sizeof *y);
    }
    memset(R, 0, n * n * sizeof *R);
    for (size_t a = 0; a < n; a++) R[a * n + a] = w->R[0];
    return n;
}

/* Of the group that begins with first, the landmark that lies least where the others say. */
static apsm_status judge_group(fit_job *job, const posterior_model *q, size_t first, size_t groups,
                               landmark_work *w)
{
    const size_t most = 3 * ((w->n + groups - 1) / groups);
    double *A = malloc((most * (w->D + most + 3) + posterior_left_out_size(q, most)) * sizeof *A);
    if (!A) return APSM_ERR_MEMORY;
    double *R = A + most * w->D, *y = R + most * most, *miss = y + most, *z2 = miss + most;
    const posterior_seen seen = { take_group(w, first, groups, A, R, y), A, R, y };
    const apsm_status status = posterior_left_out(q, &seen, miss, z2, z2 + most);
    for (size_t k = 0; status == APSM_OK && k < seen.n / 3; k++) {
        if (!(sqrt(z2[k]) > job->landmark.deviations)) continue;
        job->landmark.which = first + k * groups;
        job->landmark.deviations = sqrt(z2[k]);
        job->landmark.off = vec3_norm(miss + 3 * k) / job->m->h;
    }
    free(A);
    return status;
}

/* The landmark that lies least where the others say. */
static apsm_status find_worst(fit_job *job, const double *x, landmark_work *w)
{
    const apsm_fit_model *m = job->m;
    const size_t groups = (w->n + GROUP - 1) / GROUP;
    apsm_affine_apply(job->pose.M, w->n, x, w->y);
    for (size_t k = 0; k < 3 * w->n; k++) w->y[k] -= w->offset[k];
    const posterior_model q = fit_rigid_add(&m->posterior, w->P, m->radius, w->store);
    for (size_t g = 0; g < groups; g++) APSM_TRY(judge_group(job, &q, g, groups, w));
    return APSM_OK;
}

static void set_deviations(const fit_job *job, const landmark_work *w)
{
    const double band = fit_band_slip * job->m->calibration.band[FIT_BANDS - 1];
    for (size_t j = 0; j < w->D / 3; j++) {
        double block[9];
        for (size_t a = 0; a < 9; a++) block[a] = w->C[(3 * j + a / 3) * w->D + 3 * j + a % 3];
        fit_set_deviation(job->out, j, block, job->m->TN + 3 * j, band);
        job->out->observed[j] = false;
    }
}

/* How far the given points are from the fit's. */
static void measure(const fit_job *job, const double *x, landmark_work *w)
{
    apsm_distance_summary *d = &job->out->distance.two_way;
    apsm_affine_apply(job->pose.M, w->n, x, w->y);
    size_t counted = 0;
    for (size_t k = 0; k < w->n; k++) {
        double y[3] = { 0 };
        for (size_t a = 0; a < 3; a++) {
            for (size_t e = 0; e < w->D; e++)
                y[a] += w->A[(3 * k + a) * w->D + e] * job->out->world[e];
            y[a] += w->offset[3 * k + a];
        }
        const double distance = sqrt(vec3_distance2(y, w->y + 3 * k));
        d->mean += distance / (double)w->n;
        d->max = fmax(d->max, distance);
        counted += distance < job->m->h;
    }
    d->p95 = d->max;
    job->out->has_distance = true;
    job->out->counted_share = (double)counted / (double)w->n;
}

static apsm_status solve(fit_job *job, const double *at, const double *x, landmark_work *w)
{
    APSM_TRY(make_rows(job, at, w));
    APSM_TRY(find_pose(job, w->n, at, x));
    memcpy(w->P, job->m->model.mean, w->D * sizeof *w->P);
    for (int r = 0; r < ROUNDS; r++) APSM_TRY(step(job, x, r + 1 == ROUNDS, w));
    set_deviations(job, w);
    measure(job, x, w);
    return find_worst(job, x, w);
}

apsm_status fit_landmark_particles(apsm_context *ctx, fit_job *job, size_t n, const double *at,
                                   const double *x)
{
    landmark_work w;
    (void)ctx;
    const apsm_status status = work_alloc(job->m, n, &w) ? solve(job, at, x, &w) : APSM_ERR_MEMORY;
    work_free(&w);
    return status;
}
