/* The choice among poses.  Points x_b of the provisional template with normals; in pose M shape i
 * has there the heights (J1) of its own cloud's point
 *
 *   k(b) = argmin_k |x_k - M^-1 x_b|^2 + 2 h^2 (1 - n_k . M^-1 n_b),
 *
 * u_i(M)_b.  With m_i the median of the others', in the poses chosen so far,
 *
 *   evidence(M) = mean over scales of artanh corr_b(u_i(M), m_i) - log residual(M)      (J4)
 *
 * and every shape takes the pose of most evidence, a few times over.  A pose that is upside down
 * has the surface about where it should be, but not its form. */
#include "align/pose_choice.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/registration.h"
#include "core/robust.h"
#include "geometry/affine.h"
#include "geometry/form.h"
#include "geometry/vec3.h"

enum { ROUNDS = 4, LEAST_SHAPES = 4, MANY_SHAPES = 8 };
/* Particles of a model that is usual: their spacing makes the radii of form. */
static const double usual_particles = 128.0;
/* Poses that fit worse by this factor are not looked at. */
static const double open_ratio = 1.5;

static double spacing_of(double area)
{
    return sqrt(2.0 * area / (sqrt(3.0) * usual_particles));
}

void pose_heights(const apsm_mesh *mesh, const apsm_cloud *cloud, double *faces, double *heights)
{
    apsm_form_faces(mesh, faces);
    apsm_form_heights(mesh->nf, faces, cloud->n, cloud->x, cloud->normal,
                      spacing_of(apsm_mesh_area(mesh)), heights);
}

typedef struct election {
    size_t n, base, points, dim; /* dim = points x scales */
    const apsm_cloud *cloud;
    double *const *heights;
    const pose_ballot *ballot;
    bool hands;
    apsm_registration *registration; /* of the provisional template's cloud */
    double *seen;                    /* n x 2 x POSE_OPTIONS x dim: u_i(M) */
    double *taken;                   /* n x dim: of the pose chosen so far */
    double *usual;                   /* n x dim */
    pose_choice *choice;
} election;

static double *seen_in(const election *e, size_t i, size_t hand, size_t option)
{
    return e->seen + ((i * 2 + hand) * POSE_OPTIONS + option) * e->dim;
}

/* The cloud's point nearest to y with normal n. */
static size_t nearest(const apsm_cloud *cloud, const double y[3], const double n[3], double h2)
{
    size_t best = 0;
    double least = INFINITY;
    for (size_t k = 0; k < cloud->n; k++) {
        const double cost = vec3_distance2(cloud->x + 3 * k, y) +
                            2.0 * h2 * (1.0 - vec3_dot(cloud->normal + 3 * k, n));
        if (cost < least) least = cost, best = k;
    }
    return best;
}

/* Whether that option can be chosen: it fits about as well as the best, or is the best of the shape
 * as it is. */
static bool is_open(const pose_ballot *b, size_t hand, size_t option)
{
    const double least = fmin(b->residual[0][0], b->residual[1][0]);
    const double residual = b->residual[hand][option];
    return isfinite(residual) && ((hand == 0 && option == 0) || residual <= open_ratio * least);
}

/* The base's points, moved to shape i as it lies by M; what the shape looks like where they arrive.
 */
static apsm_status look(const election *e, size_t i, const double M[16], double *seen)
{
    const apsm_cloud *base = &e->cloud[e->base], *own = &e->cloud[i];
    /* the area of a sphere of this radius: only weighs normals against distances */
    const double h = spacing_of(4.0 * M_PI * base->radius * base->radius);
    const size_t n = own->n, p = e->points;
    apsm_cloud laid = *own;
    double *work =
        malloc((6 * (n + p) + apsm_registration_work_size(e->registration, n)) * sizeof *work);
    if (!work) return APSM_ERR_MEMORY;
    double *X = work + 6 * n, *N = X + 3 * p, *scratch = N + 3 * p;
    laid.x = work;
    laid.normal = work + 3 * n;
    apsm_affine_apply(M, n, own->x, laid.x);
    apsm_affine_apply_normals(M, n, own->normal, laid.normal);
    memcpy(X, base->x, 3 * p * sizeof *X);
    memcpy(N, base->normal, 3 * p * sizeof *N);
    const apsm_status status = apsm_registration_move(e->registration, &laid, p, X, N, scratch);
    for (size_t b = 0; b < p && status == APSM_OK; b++) {
        const size_t k = nearest(&laid, X + 3 * b, N + 3 * b, h * h);
        memcpy(seen + APSM_FORM_SCALES * b, e->heights[i] + APSM_FORM_SCALES * k,
               APSM_FORM_SCALES * sizeof *seen);
    }
    free(work);
    return status;
}

static apsm_status look_task(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    const election *e = user;
    if (i == e->base) {
        memcpy(e->taken + i * e->dim, e->heights[i], e->dim * sizeof *e->taken);
        return APSM_OK;
    }
    for (size_t hand = 0; hand < 2; hand++)
        for (size_t k = 0; k < POSE_OPTIONS; k++)
            if (is_open(&e->ballot[i], hand, k))
                APSM_TRY(look(e, i, e->ballot[i].M[hand][k], seen_in(e, i, hand, k)));
    memcpy(e->taken + i * e->dim, seen_in(e, i, 0, 0), e->dim * sizeof *e->taken);
    return APSM_OK;
}

static double evidence_for(const election *e, size_t i, size_t hand, size_t option)
{
    const double least = 1e-9 * e->cloud[i].radius; /* of shapes that are all alike */
    const double fit = -log(fmax(e->ballot[i].residual[hand][option], least));
    if (!e->usual) return fit;
    return fit +
           apsm_form_agreement(e->points, seen_in(e, i, hand, option), e->usual + i * e->dim, NULL);
}

static void choose_of_hand(const election *e, size_t i, size_t hand)
{
    pose_choice *c = &e->choice[i];
    c->option[hand] = 0;
    c->evidence[hand] = c->second[hand] = -INFINITY;
    for (size_t k = 0; k < POSE_OPTIONS; k++) {
        if (!is_open(&e->ballot[i], hand, k)) continue;
        const double evidence = evidence_for(e, i, hand, k);
        if (evidence > c->evidence[hand]) {
            c->second[hand] = c->evidence[hand];
            c->evidence[hand] = evidence;
            c->option[hand] = k;
        } else if (evidence > c->second[hand]) {
            c->second[hand] = evidence;
        }
    }
}

bool pose_hands_differ(size_t n, size_t base, const pose_choice *choice, double *scratch)
{
    size_t others = 0;
    if (n < MANY_SHAPES) return true;
    for (size_t i = 0; i < n; i++) {
        const double more = choice[i].evidence[1] - choice[i].evidence[0];
        if (i != base) scratch[others++] = isfinite(more) ? fabs(more) : INFINITY;
    }
    return robust_median(others, scratch) > HAND_CLEARLY;
}

int pose_hand(const pose_choice *c, const pose_ballot *b, bool hands_differ)
{
    const double more = c->evidence[1] - c->evidence[0];
    const double mirrored = b->residual[1][c->option[1]], own = b->residual[0][c->option[0]];
    const bool nearer = hands_differ && mirrored < APSM_MIRROR_RATIO * own;
    const bool farther = hands_differ && own < APSM_MIRROR_RATIO * mirrored;
    if (more > HAND_CLEARLY || (more > 0.0 && nearer)) return 1;
    return more < -HAND_CLEARLY || (more < 0.0 && farther) ? -1 : 0;
}

static void choose(const election *e, size_t i, bool hands_differ)
{
    pose_choice *c = &e->choice[i];
    if (i == e->base) return;
    for (size_t hand = 0; hand < 2; hand++) choose_of_hand(e, i, hand);
    c->mirrored = e->hands && pose_hand(c, &e->ballot[i], hands_differ) > 0;
}

/* One round; returns whether a choice has changed. */
static bool vote(const election *e, double *column)
{
    bool changed = false;
    const bool hands_differ = pose_hands_differ(e->n, e->base, e->choice, column);
    robust_left_out_medians(e->n, e->dim, e->taken, e->usual, column);
    for (size_t i = 0; i < e->n; i++) {
        const pose_choice *c = &e->choice[i];
        choose(e, i, hands_differ);
        if (i == e->base) continue;
        double *taken = e->taken + i * e->dim;
        const double *now = seen_in(e, i, c->mirrored, c->option[c->mirrored]);
        changed |= memcmp(taken, now, e->dim * sizeof *taken) != 0;
        memcpy(taken, now, e->dim * sizeof *taken);
    }
    return changed;
}

bool pose_is_contested(size_t n, size_t base, const pose_ballot *ballots)
{
    for (size_t i = 0; i < n; i++) {
        size_t open = 0;
        for (size_t k = 0; k < 2 * POSE_OPTIONS && i != base; k++)
            open += is_open(&ballots[i], k / POSE_OPTIONS, k % POSE_OPTIONS);
        if (open > 1) return true;
    }
    return false;
}

apsm_status pose_choose(apsm_context *ctx, size_t n, size_t base, const apsm_cloud *clouds,
                        double *const *heights, const pose_ballot *ballots, bool hands,
                        pose_choice *choice)
{
    election e = { .n = n,
                   .base = base,
                   .points = clouds[base].n < POSE_POINTS ? clouds[base].n : POSE_POINTS,
                   .cloud = clouds,
                   .heights = heights,
                   .ballot = ballots,
                   .hands = hands,
                   .choice = choice };
    e.dim = e.points * APSM_FORM_SCALES;
    for (size_t i = 0; i < n; i++)
        choice[i] =
            (pose_choice){ .evidence = { 0.0, -INFINITY }, .second = { -INFINITY, -INFINITY } };
    if (n < LEAST_SHAPES || !pose_is_contested(n, base, ballots)) { /* form decides nothing */
        for (size_t i = 0; i < n; i++) choose(&e, i, true);
        return APSM_OK;
    }
    e.seen = malloc(n * 2 * POSE_OPTIONS * e.dim * sizeof *e.seen);
    e.taken = malloc((2 * n * e.dim + n) * sizeof *e.taken);
    apsm_status status = e.seen && e.taken ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_registration_new(&clouds[base], &e.registration);
    if (status == APSM_OK) {
        e.usual = e.taken + n * e.dim;
        status = apsm_parallel_for(ctx, n, look_task, &e, NULL);
    }
    for (int round = 0; status == APSM_OK && round < ROUNDS; round++)
        if (!vote(&e, e.usual + n * e.dim)) break;
    apsm_registration_free(e.registration);
    free(e.seen);
    free(e.taken);
    return status;
}
