/* Iterative closest points in both directions, trimmed.
 *
 *   p_k = M x_k, y_k its closest point on the fixed surface     (moving points)
 *   y_l, p_l = M x_l with x_l its closest point on the moving surface   (fixed points)
 *   E(M) = sum_k w_k |p_k - y_k|^2                               (Besl & McKay 1992; trimming:
 *                                                                 Chetverikov et al. 2005)
 * One step moves all p by Delta(p) = omega x q + tau + sigma q, q = p - c, and minimises
 *
 *   sum_k w_k r^T (n n^T + lambda (I - n n^T)) r,   r = p_k + Delta(p_k) - y_k,
 *
 * n being the surface normal at the closest point.  lambda = 1 is point-to-point: it never
 * increases E but creeps along smooth surfaces; lambda = 0 is point-to-plane (Chen & Medioni
 * 1992): nearly Newton's method, but it may fail.  lambda is adapted as by Levenberg and
 * Marquardt: smaller after a step that lowers E, larger after one that does not.  At lambda = 1
 * the step is the exact rigid or similarity fit.  Lengths are taken in units of the fixed cloud's
 * radius, so that the equations have no dimension.
 *
 * Where a shape has been cut off (cuts.c), neither the cut face nor what the other shape has beyond
 * its plane is matched, and E is divided by the cube of the share that is (Chetverikov's measure),
 * lest shapes part to agree.
 *
 * Where a rotation is to be expected, E is multiplied by 1 + kappa |theta|^2, theta the turn from
 * it as a vector: what a normal prior of 12 degrees says against about 25 independent distances
 * whose variance is not known.  The surfaces of most shapes say far more; those of a cup or of a
 * thin shaft do not.
 *
 * The coarse variant knows the surfaces by their clouds alone: closest cloud points instead of
 * closest points, all n^2 distances at once, which is far cheaper for a hundred points. */
#include "align/icp.h"

#include <math.h>
#include <string.h>

#include "core/kernel.h"
#include "core/robust.h"
#include "geometry/affine.h"
#include "geometry/bvh_guess.h"
#include "geometry/vec3.h"
#include "linalg/linalg.h"

static const double lambda_least = 0.01, lambda_down = 0.1, lambda_up = 10.0;
static const double in_plane = 0.02;     /* radii: so near to a cut plane is in it */
static const double least_shared = 0.25; /* of the points */
static const double kappa = 1.0;         /* rad^-2 */
static const double largest_turn = 0.7;  /* rad: linearisation is no use beyond */

static const double shrinks_least = 0.15; /* a step to the one before */
static const double roughly = 10.0;       /* tolerances: what the first clouds may leave */

/* The pairs of one pose; m = n + n_fixed pairs, those of moving points first. */
typedef struct pairs {
    double *p, *y, *normal; /* m x 3 */
    double *at;             /* m x 3: the closest point in the frame of its own surface */
    double *w;              /* m: 0 for a trimmed pair; sum 1 */
    double *d2;             /* m */
    double E, residual;
    double theta[3]; /* the turn from the usual rotation, 0 if there is none */
} pairs;

typedef struct icp_job {
    const apsm_surface *moving, *fixed;
    const apsm_icp_options *opt;
    bool coarse;
    bool along;        /* normals of pairs lead from point to point */
    size_t n, n_fixed; /* points of the clouds in use; coarse: as many of both */
    double *work;      /* 6 times the larger number */
} icp_job;

enum { DOUBLES_PER_PAIR = 14, DEPTH = 6 };

size_t apsm_icp_work_size(size_t n)
{
    return 2 * DOUBLES_PER_PAIR * 2 * n + 6 * n;
}

static pairs pairs_in(double *work, size_t m)
{
    return (pairs){ .p = work,
                    .y = work + 3 * m,
                    .normal = work + 6 * m,
                    .at = work + 9 * m,
                    .w = work + 12 * m,
                    .d2 = work + 13 * m };
}

static void map(const double M[16], const double x[3], double y[3])
{
    for (size_t a = 0; a < 3; a++)
        y[a] = M[4 * a] * x[0] + M[4 * a + 1] * x[1] + M[4 * a + 2] * x[2] + M[4 * a + 3];
}

/* Of a similarity, proper or not: L^-1 = L^T / scale^2. */
void apsm_similarity_invert(const double M[16], double inverse[16])
{
    const double scale2 = M[0] * M[0] + M[1] * M[1] + M[2] * M[2];
    apsm_affine_identity(inverse);
    for (size_t a = 0; a < 3; a++) {
        double t = 0.0;
        for (size_t b = 0; b < 3; b++) {
            inverse[4 * a + b] = M[4 * b + a] / scale2;
            t -= inverse[4 * a + b] * M[4 * b + 3];
        }
        inverse[4 * a + 3] = t;
    }
}

static void rotate(const double M[16], const double x[3], double y[3])
{
    for (size_t a = 0; a < 3; a++) y[a] = vec3_dot(M + 4 * a, x);
}

/* The closest point to x.  `before`, if not NULL, is a point of the surface: nothing farther need
 * be looked at. */
static void look_up(const apsm_bvh *bvh, const double x[3], const double *before, apsm_closest *c)
{
    const double slack = 1.0 + 1e-9; /* so that `before` itself is not lost by rounding */
    const double bound = before ? vec3_distance2(x, before) * slack : INFINITY;
    apsm_bvh_closest(bvh, x, bound, c);
    if (before && !(c->distance2 < INFINITY)) apsm_bvh_closest(bvh, x, INFINITY, c);
}

/* Takes the way from point to point as the normal of pair k, where that has a direction: unlike
 * normals of faces it does not jump when a closest point crosses an edge, and so the step has no
 * jumps and vanishes where the sum of squares is least. */
static bool look_along(const icp_job *job, size_t k, pairs *q)
{
    const double least = 1e-9 * job->fixed->cloud->radius;
    double r[3];
    if (!job->along) return false;
    vec3_sub(q->y + 3 * k, q->p + 3 * k, r);
    if (!(vec3_normalise(r) > least)) return false;
    memcpy(q->normal + 3 * k, r, sizeof r);
    return true;
}

/* Pairs of the moving points.  before: the pairs of an earlier pose, or NULL. */
static void match_moving(const icp_job *job, const double M[16], const pairs *before, pairs *q)
{
    const apsm_bvh *bvh = job->fixed->bvh;
    for (size_t k = 0; k < job->n; k++) {
        apsm_closest c;
        map(M, job->moving->cloud->x + 3 * k, q->p + 3 * k);
        look_up(bvh, q->p + 3 * k, before ? before->at + 3 * k : NULL, &c);
        memcpy(q->y + 3 * k, c.x, sizeof c.x);
        memcpy(q->at + 3 * k, c.x, sizeof c.x);
        q->d2[k] = c.distance2;
        if (look_along(job, k, q)) continue;
        memcpy(q->normal + 3 * k, bvh_face_normal(bvh, c.on.face), 3 * sizeof *q->normal);
    }
}

/* Pairs of the fixed points, whose closest points are found in the moving shape's frame. */
static void match_fixed(const icp_job *job, const double M[16], const pairs *before, pairs *q)
{
    const apsm_bvh *bvh = job->moving->bvh;
    const double scale2 = vec3_dot(M, M);
    double back[16];
    apsm_similarity_invert(M, back);
    for (size_t k = job->n; k < job->n + job->n_fixed; k++) {
        apsm_closest c;
        double x[3];
        memcpy(q->y + 3 * k, job->fixed->cloud->x + 3 * (k - job->n), 3 * sizeof *q->y);
        map(back, q->y + 3 * k, x);
        look_up(bvh, x, before ? before->at + 3 * k : NULL, &c);
        memcpy(q->at + 3 * k, c.x, sizeof c.x);
        map(M, c.x, q->p + 3 * k);
        q->d2[k] = c.distance2 * scale2;
        if (look_along(job, k, q)) continue;
        rotate(M, bvh_face_normal(bvh, c.on.face), q->normal + 3 * k);
        vec3_normalise(q->normal + 3 * k);
    }
}

/* d2[l] <- squared distance of p to point l of Y (3 x n, a row a coordinate); where that is
 * smaller than least[l], it and the point's number k are noted.  Returns the least of d2. */
APSM_KERNEL static double distances(size_t n, const double *restrict Y, const double p[restrict 3],
                                    double k, double *restrict d2, double *restrict least,
                                    double *restrict who)
{
    double smallest = INFINITY;
#pragma omp simd reduction(min : smallest)
    for (size_t l = 0; l < n; l++) {
        const double x = Y[l] - p[0], y = Y[n + l] - p[1], z = Y[2 * n + l] - p[2];
        const double d = x * x + y * y + z * z;
        who[l] = d < least[l] ? k : who[l];
        least[l] = d < least[l] ? d : least[l];
        d2[l] = d;
        smallest = d < smallest ? d : smallest;
    }
    return smallest;
}

/* The first of row (n) that is `value`, or the last. */
APSM_KERNEL static size_t find(size_t n, const double *restrict row, double value)
{
    const int count = (int)n;
    double at = count - 1;
#pragma omp simd reduction(min : at)
    for (int l = 0; l < count; l++) {
        const double here = row[l] == value ? (double)l : (double)(count - 1);
        at = here < at ? here : at;
    }
    return (size_t)at;
}

/* Both directions at once, by the table of distances between the clouds. */
static void match_clouds(const icp_job *job, const double M[16], pairs *q)
{
    const apsm_cloud *moving = job->moving->cloud, *fixed = job->fixed->cloud;
    const size_t n = job->n;
    double *Y = job->work, *row = Y + 3 * n, *who = row + n, *least = q->d2 + n;
    for (size_t l = 0; l < n; l++) {
        least[l] = INFINITY;
        who[l] = 0.0;
        for (size_t a = 0; a < 3; a++) Y[a * n + l] = fixed->x[3 * l + a];
    }
    for (size_t k = 0; k < n; k++) {
        map(M, moving->x + 3 * k, q->p + 3 * k);
        q->d2[k] = distances(n, Y, q->p + 3 * k, (double)k, row, least, who);
        const size_t l = find(n, row, q->d2[k]);
        memcpy(q->y + 3 * k, fixed->x + 3 * l, 3 * sizeof *q->y);
        memcpy(q->normal + 3 * k, fixed->normal + 3 * l, 3 * sizeof *q->normal);
    }
    for (size_t l = 0; l < n; l++) {
        const size_t k = (size_t)who[l];
        memcpy(q->p + 3 * (n + l), q->p + 3 * k, 3 * sizeof *q->p);
        memcpy(q->y + 3 * (n + l), fixed->x + 3 * l, 3 * sizeof *q->y);
        rotate(M, moving->normal + 3 * k, q->normal + 3 * (n + l));
        vec3_normalise(q->normal + 3 * (n + l));
    }
}

/* Whether a point of one shape can have a partner on the other: it does not lie in a plane that its
 * own shape was cut in, nor, at `there` in the other's frame, beyond one of the other's. */
static bool is_shared(const apsm_cloud *own, const double x[3], const apsm_cloud *other,
                      const double there[3])
{
    for (size_t c = 0; c < own->cuts; c++)
        if (vec3_dot(own->cut[c], x) > own->cut[c][3] - in_plane * own->radius) return false;
    for (size_t c = 0; c < other->cuts; c++)
        if (vec3_dot(other->cut[c], there) > other->cut[c][3]) return false;
    return true;
}

/* The share of a direction's pairs that are shared, or 1 and all of them if they are few: then that
 * is no pose. */
static double shared_of(size_t n, double *shared)
{
    size_t few = 0;
    for (size_t k = 0; k < n; k++) few += shared[k] > 0.0;
    if ((double)few >= least_shared * (double)n) return (double)few / (double)n;
    for (size_t k = 0; k < n; k++) shared[k] = 1.0;
    return 1.0;
}

/* w <- 1 for pairs of what both shapes have, 0 for others; returns their share. */
static double mark_shared(const icp_job *job, const double M[16], pairs *q)
{
    const apsm_cloud *moving = job->moving->cloud, *fixed = job->fixed->cloud;
    double back[16];
    for (size_t k = 0; k < job->n + job->n_fixed; k++) q->w[k] = 1.0;
    if (moving->cuts + fixed->cuts == 0) return 1.0;
    apsm_similarity_invert(M, back);
    for (size_t k = 0; k < job->n; k++)
        q->w[k] = is_shared(moving, moving->x + 3 * k, fixed, q->p + 3 * k);
    for (size_t l = 0; l < job->n_fixed; l++) {
        double x[3];
        map(back, fixed->x + 3 * l, x);
        q->w[job->n + l] = is_shared(fixed, fixed->x + 3 * l, moving, x);
    }
    return 0.5 * (shared_of(job->n, q->w) + shared_of(job->n_fixed, q->w + job->n));
}

/* Weights of the pairs of one direction: those of the cloud (1 for the beginning of a cloud),
 * 0 for the farthest ones and where w was 0, 1/2 in all. */
static void weigh(const icp_job *job, const apsm_cloud *cloud, size_t n, const double *d2,
                  double *w)
{
    const size_t keep = n - (size_t)(job->opt->trim * (double)n);
    double farthest = INFINITY, sum = 0.0;
    if (keep < n) {
        memcpy(job->work, d2, n * sizeof *d2);
        farthest = robust_select(n, job->work, keep - 1);
    }
    for (size_t k = 0; k < n; k++) {
        w[k] *= d2[k] <= farthest ? (n < cloud->n ? 1.0 : cloud->w[k]) : 0.0;
        sum += w[k];
    }
    for (size_t k = 0; k < n; k++) w[k] *= 0.5 / sum;
}

/* theta <- the rotation vector of M's rotation after the inverse of the usual one. */
static void turn_from_usual(const icp_job *job, const double M[16], double theta[3])
{
    const double *U = job->opt->usual;
    const double scale = vec3_norm(M);
    double T[9], axis[3];
    theta[0] = theta[1] = theta[2] = 0.0;
    if (!U) return;
    vec3_cross(U, U + 3, axis);
    if (apsm_affine_det(M) * vec3_dot(axis, U + 6) < 0.0) return;
    for (size_t a = 0; a < 3; a++)
        for (size_t b = 0; b < 3; b++) T[3 * a + b] = vec3_dot(M + 4 * a, U + 3 * b) / scale;
    for (size_t a = 0; a < 3; a++) {
        const size_t b = (a + 1) % 3, c = (a + 2) % 3;
        axis[a] = 0.5 * (T[3 * c + b] - T[3 * b + c]);
    }
    const double sine = vec3_norm(axis), cosine = 0.5 * (T[0] + T[4] + T[8] - 1.0);
    const double factor = sine > 1e-9 ? atan2(sine, cosine) / sine : 1.0;
    for (size_t a = 0; a < 3; a++) theta[a] = factor * axis[a];
}

static void match(const icp_job *job, const double M[16], const pairs *before, pairs *q)
{
    if (job->coarse) {
        match_clouds(job, M, q);
    } else {
        match_moving(job, M, before, q);
        match_fixed(job, M, before, q);
    }
    const double share = mark_shared(job, M, q);
    weigh(job, job->moving->cloud, job->n, q->d2, q->w);
    weigh(job, job->fixed->cloud, job->n_fixed, q->d2 + job->n, q->w + job->n);
    q->E = q->residual = 0.0;
    for (size_t k = 0; k < job->n + job->n_fixed; k++) {
        q->E += q->w[k] * q->d2[k];
        q->residual += q->w[k] * sqrt(q->d2[k]);
    }
    if (share < 1.0) {
        q->E /= share * share * share;
        q->residual /= share * sqrt(share);
    }
    turn_from_usual(job, M, q->theta);
    q->E *= 1.0 + kappa * vec3_dot(q->theta, q->theta);
}

/* Adds the pair's share J' W J to H (7 x 7, lower triangle) and J' W r to g, W = w (lambda +
 * (1 - lambda) n n').  The columns of the Jacobian J of Delta(p) by (omega, tau, sigma) are e_a x
 * q, e_a and q. */
static void add_pair(const double q[3], const double r[3], const double n[3], double w,
                     double lambda, double H[49], double g[7])
{
    double W[3][3], WJ[7][3], Wr[3]; /* WJ[a]: W times column a */
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            W[a][b] = w * ((1.0 - lambda) * n[a] * n[b] + (a == b ? lambda : 0.0));
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3, c = (a + 2) % 3; /* e_a x q = q_b e_c - q_c e_b */
        Wr[a] = vec3_dot(W[a], r);
        WJ[6][a] = vec3_dot(W[a], q);
        for (int k = 0; k < 3; k++) {
            WJ[a][k] = q[b] * W[c][k] - q[c] * W[b][k];
            WJ[3 + a][k] = W[a][k];
        }
    }
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        for (int k = 0; k <= a; k++) H[7 * a + k] += q[b] * WJ[k][c] - q[c] * WJ[k][b];
        for (int k = 0; k < 4 + a; k++) H[7 * (3 + a) + k] += WJ[k][a];
        g[a] += q[b] * Wr[c] - q[c] * Wr[b];
        g[3 + a] += Wr[a];
    }
    for (int k = 0; k < 7; k++) H[42 + k] += vec3_dot(q, WJ[k]);
    g[6] += vec3_dot(q, Wr);
}

/* The map of the step z = (omega, tau, sigma) about c: turn by |omega|, scale by e^sigma. */
static void step_map(const double z[7], const double c[3], double radius, double D[16])
{
    const double angle = vec3_norm(z);
    const double s = angle > 0.0 ? sin(angle) / angle : 1.0, half = sin(0.5 * angle);
    const double v = angle > 0.0 ? 2.0 * half * half / (angle * angle) : 0.0; /* (1-cos)/angle^2 */
    const double K[9] = { 0, -z[2], z[1], z[2], 0, -z[0], -z[1], z[0], 0 }, scale = exp(z[6]);
    apsm_affine_identity(D);
    for (size_t a = 0; a < 3; a++) {
        double t = c[a] + radius * z[3 + a];
        for (size_t b = 0; b < 3; b++) {
            const double K2 = z[a] * z[b] - (a == b ? angle * angle : 0.0);
            D[4 * a + b] = scale * ((a == b ? 1.0 : 0.0) + s * K[3 * a + b] + v * K2);
            t -= D[4 * a + b] * c[b];
        }
        D[4 * a + 3] = t;
    }
}

/* Gauss and Newton's terms of kappa |theta|^2, as shares of those of the distances. */
static void add_usual(const icp_job *job, const pairs *q, double H[49], double z[7])
{
    const double radius = job->fixed->cloud->radius,
                 t2 = 1.0 + kappa * vec3_dot(q->theta, q->theta);
    double E = 0.0;
    if (!job->opt->usual) return;
    for (size_t k = 0; k < job->n + job->n_fixed; k++) E += q->w[k] * q->d2[k];
    const double weight = kappa * E / (radius * radius * t2);
    for (size_t a = 0; a < 3; a++) {
        H[8 * a] += weight;
        z[a] -= weight * q->theta[a];
    }
}

/* The step z for 0 < lambda < 1; false if there is none to be trusted. */
static bool newton_step(const icp_job *job, const pairs *q, double lambda, double z[7])
{
    const double *c = job->fixed->cloud->centre, radius = job->fixed->cloud->radius;
    const size_t unknowns = job->opt->scale ? 7 : 6;
    double H[49] = { 0 }, A[49];
    for (size_t a = 0; a < 7; a++) z[a] = 0.0;
    for (size_t k = 0; k < job->n + job->n_fixed; k++) {
        double lever[3], r[3];
        if (!(q->w[k] > 0.0)) continue;
        for (size_t a = 0; a < 3; a++) {
            lever[a] = (q->p[3 * k + a] - c[a]) / radius;
            r[a] = (q->y[3 * k + a] - q->p[3 * k + a]) / radius;
        }
        add_pair(lever, r, q->normal + 3 * k, q->w[k], lambda, H, z);
    }
    add_usual(job, q, H, z);
    for (size_t a = 0; a < unknowns; a++)
        for (size_t b = 0; b < unknowns; b++) A[unknowns * a + b] = H[7 * a + b];
    if (!job->opt->scale) z[6] = 0.0;
    if (apsm_cholesky(unknowns, A) != APSM_OK) return false;
    apsm_cholesky_solve(unknowns, A, 1, z);
    return vec3_norm(z) <= largest_turn && fabs(z[6]) <= largest_turn;
}

/* The map of a step about the centre of the fixed cloud. */
static void map_of_step(const icp_job *job, const double z[7], double D[16])
{
    step_map(z, job->fixed->cloud->centre, job->fixed->cloud->radius, D);
}

/* The step's move of the points, root mean square, relative to the radius. */
static double step_length(const icp_job *job, const pairs *q, const double D[16])
{
    double sum = 0.0;
    for (size_t k = 0; k < job->n + job->n_fixed; k++) {
        double x[3];
        map(D, q->p + 3 * k, x);
        sum += q->w[k] * vec3_distance2(x, q->p + 3 * k);
    }
    return sqrt(sum) / job->fixed->cloud->radius;
}

/* The next map to try, at the safe end if lambda says so or Newton's step cannot be trusted. */
static void propose(const icp_job *job, const pairs *q, double *lambda, double D[16])
{
    double z[7];
    if (*lambda < 1.0 && newton_step(job, q, *lambda, z)) {
        map_of_step(job, z, D);
        return;
    }
    *lambda = 1.0;
    apsm_affine_fit(job->n + job->n_fixed, q->p, q->y, q->w, job->opt->scale, D);
}

static void swap_pairs(pairs *a, pairs *b)
{
    const pairs t = *a;
    *a = *b;
    *b = t;
}

static size_t smaller(size_t a, size_t b)
{
    return a < b ? a : b;
}

/* Says how many points are in use and divides the scratch. */
static void open_job(icp_job *job, double *work, pairs *a, pairs *b)
{
    const size_t most = job->opt->points > 0 ? job->opt->points : SIZE_MAX;
    job->n = smaller(job->moving->cloud->n, most);
    job->n_fixed = smaller(job->fixed->cloud->n, most);
    if (job->coarse) job->n = job->n_fixed = smaller(job->n, job->n_fixed);
    const size_t m = job->n + job->n_fixed;
    *a = pairs_in(work, m);
    *b = pairs_in(work + DOUBLES_PER_PAIR * m, m);
    job->work = work + 2 * DOUBLES_PER_PAIR * m;
}

static double icp_run(icp_job *job, double M[16], double *work)
{
    const apsm_icp_options *opt = job->opt;
    pairs now, next;
    open_job(job, work, &now, &next);
    double lambda = opt->near ? lambda_least : 1.0;
    match(job, M, NULL, &now);
    for (int i = 0; i < opt->max_iterations; i++) {
        double D[16], trial[16];
        propose(job, &now, &lambda, D);
        if (step_length(job, &now, D) < opt->tolerance) break;
        apsm_affine_multiply(D, M, trial);
        match(job, trial, &now, &next);
        if (next.E < now.E) {
            const bool enough = lambda < 1.0 && next.E > (1.0 - opt->enough) * now.E;
            swap_pairs(&now, &next);
            memcpy(M, trial, sizeof trial);
            if (enough) break;
            lambda = fmax(lambda * lambda_down, lambda_least);
        } else if (lambda < 1.0) {
            lambda = fmin(lambda * lambda_up, 1.0);
        } else {
            break; /* even the safe step does not help: as good as it gets */
        }
    }
    return now.residual;
}

/* ---- To rest: (13) of docs/method.md ---- */

/* Where the sum of steps is, the step that is proposed there, and how both have changed from one
 * pose to the next; change k of all is at k % DEPTH. */
typedef struct trail {
    size_t n;       /* changes */
    double shrinks; /* the last step relative to the one before */
    double at[7], z[7], dx[DEPTH][7], dz[DEPTH][7];
} trail;

static double dot7(const double a[7], const double b[7])
{
    double sum = 0.0;
    for (size_t k = 0; k < 7; k++) sum += a[k] * b[k];
    return sum;
}

/* Anderson's extrapolation (J. ACM 12, 1965): of the affine combinations of the poses on the trail
 * the one whose steps cancel best, and one step on from there.  Newton's step with normals alone
 * creeps where the surfaces curve away from each other; six poses tell it how.  next: the sum of
 * steps to go to. */
static void extrapolate(const trail *t, double next[7])
{
    const size_t n = t->n < DEPTH ? t->n : DEPTH;
    double A[DEPTH * DEPTH], b[DEPTH], most = 0.0;
    for (size_t a = 0; a < 7; a++) next[a] = t->at[a] + t->z[a];
    for (size_t k = 0; k < n; k++) {
        b[k] = dot7(t->dz[k], t->z);
        for (size_t l = 0; l < n; l++) A[n * k + l] = dot7(t->dz[k], t->dz[l]);
        most = fmax(most, A[n * k + k]);
    }
    for (size_t k = 0; k < n; k++) A[n * k + k] += 1e-10 * most;
    if (n == 0 || apsm_cholesky(n, A) != APSM_OK) return;
    apsm_cholesky_solve(n, A, 1, b);
    for (size_t k = 0; k < n; k++)
        for (size_t a = 0; a < 7; a++) next[a] -= b[k] * (t->dx[k][a] + t->dz[k][a]);
}

/* The best pose so far. */
typedef struct best_pose {
    double M[16], E, residual;
} best_pose;

static void note(const pairs *q, const double M[16], best_pose *best)
{
    if (q->E >= best->E) return;
    best->E = q->E;
    best->residual = q->residual;
    memcpy(best->M, M, sizeof best->M);
}

/* Notes the change of the steps since the last pose, and goes on to the next, by a step of the
 * length that is returned. */
static double go_on(const icp_job *job, const pairs *now, bool first, const double z[7], trail *t,
                    double M[16])
{
    double next[7], D[16], moved[16], *dz = t->dz[t->n % DEPTH];
    if (!first) {
        for (size_t a = 0; a < 7; a++) dz[a] = z[a] - t->z[a];
        t->n++;
    }
    memcpy(t->z, z, sizeof t->z);
    extrapolate(t, next);
    double *step = t->dx[t->n % DEPTH];
    for (size_t a = 0; a < 7; a++) step[a] = next[a] - t->at[a];
    memcpy(t->at, next, sizeof t->at);
    map_of_step(job, step, D);
    apsm_affine_multiply(D, M, moved);
    memcpy(M, moved, sizeof moved);
    return step_length(job, now, D);
}

/* From M on, to where less than `enough` is left if steps go on to shrink as they did; the last is
 * taken, but not looked at.  True if that comes to rest. */
static bool rest(const icp_job *job, double enough, pairs *now, pairs *before, double M[16],
                 best_pose *best)
{
    trail t = { .shrinks = 1.0 };
    double last = 0.0;
    match(job, M, NULL, now);
    note(now, M, best);
    for (int i = 0; i < job->opt->max_iterations; i++) {
        double z[7], D[16];
        if (!newton_step(job, now, lambda_least, z)) return false;
        map_of_step(job, z, D);
        const double length = step_length(job, now, D);
        if (i > 0) t.shrinks = fmin(fmax(length / last, shrinks_least), 1.0);
        const double taken = go_on(job, now, i == 0, z, &t, M);
        if (t.shrinks * fmax(length, taken) < enough) return true;
        last = length;
        swap_pairs(now, before);
        match(job, M, before, now);
        note(now, M, best);
    }
    return false;
}

void apsm_icp_to_rest(size_t levels, const apsm_surface *moving, const apsm_surface *fixed,
                      const apsm_icp_options *opt, double M[16], double *residual, double *work)
{
    for (size_t k = 0; k < levels; k++) {
        icp_job job = { .moving = &moving[k], .fixed = &fixed[k], .opt = opt, .along = true };
        const double enough = k + 1 < levels ? roughly * opt->tolerance : opt->tolerance;
        best_pose best = { .E = INFINITY };
        pairs now, before;
        open_job(&job, work, &now, &before);
        const bool rests =
            rest(&job, enough, &now, &before, M, &best) && now.E <= best.E * (1.0 + 1e-9);
        if (!rests) memcpy(M, best.M, sizeof best.M);
        *residual = rests ? now.residual : best.residual;
    }
}

void apsm_icp(const apsm_surface *moving, const apsm_surface *fixed, const apsm_icp_options *opt,
              double M[16], double *residual, double *work)
{
    icp_job job = { .moving = moving, .fixed = fixed, .opt = opt };
    *residual = icp_run(&job, M, work);
}

void apsm_icp_coarse(const apsm_surface *moving, const apsm_surface *fixed,
                     const apsm_icp_options *opt, double M[16], double *residual, double *work)
{
    icp_job job = { .moving = moving, .fixed = fixed, .opt = opt, .coarse = true };
    *residual = icp_run(&job, M, work);
}

apsm_icp_options apsm_icp_defaults(void)
{
    return (apsm_icp_options){ .max_iterations = 60, .tolerance = 1e-4 };
}
