/* Global pose search: ICP from many starts, on few points first, dropping most of the starts on
 * the way (successive halving).
 *
 * Starts bring centre to centre and turn one principal frame onto the other by G S: S one of the
 * four half turns about the axes (the sign ambiguity of principal axes) and G the identity or one
 * of a grid of rotations, the super-Fibonacci spiral of Alexa (CVPR 2022).  Because starts are
 * relative to the shapes' own frames, the poses in which the shapes come do not matter, except by
 * rounding; shapes that were cut off are put end to end instead.  Because the grid covers all
 * rotations, shapes without clear axes are served, too.  A mirrored search reflects the moving
 * shape in its principal frame. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "align/icp.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"

enum { GRID = 48, STARTS = 4 * (GRID + 1), ROUNDS = 3 };

/* What a round does to the candidates it is given, and how many different ones it passes on. */
typedef struct search_round {
    bool coarse; /* clouds only */
    size_t points;
    int iterations;
    size_t keep;
} search_round;
static const search_round rounds[ROUNDS] = { { true, 64, 2, 32 },
                                             { true, 128, 4, 6 },
                                             { false, 64, 4, 3 } };
static const double rough = 1e-3;   /* tolerance until the best is known */
static const double hopeless = 2.0; /* times the least residual */
/* Poses that differ by less than this root mean square distance, relative to the radius, count as
 * one. */
static const double same_pose = 0.15;

typedef struct candidate {
    double M[16], residual;
} candidate;

/* G S F, F the reflection: columns of G with their signs. */
static void start_rotation(size_t k, bool mirrored, double R[9])
{
    const double sign[4][3] = { { 1, 1, 1 }, { 1, -1, -1 }, { -1, 1, -1 }, { -1, -1, 1 } };
    const double identity[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
    memcpy(R, identity, sizeof identity);
    if (k >= 4) apsm_rotation_of_spiral(k / 4 - 1, GRID, R);
    for (size_t a = 0; a < 3; a++)
        for (size_t b = 0; b < 3; b++)
            R[3 * a + b] *= mirrored && b == 2 ? -sign[k % 4][b] : sign[k % 4][b];
}

/* M = T(centre of fixed) scale B^T R A T(-centre of moving); A, B: principal frames. */
static void start_pose(const apsm_cloud *moving, const apsm_cloud *fixed, size_t k, bool mirrored,
                       bool scale, double M[16])
{
    double R[9], RA[9];
    const double size = scale ? fixed->radius / moving->radius : 1.0;
    start_rotation(k, mirrored, R);
    for (size_t a = 0; a < 3; a++)
        for (size_t b = 0; b < 3; b++) {
            RA[3 * a + b] = 0.0;
            for (size_t c = 0; c < 3; c++) RA[3 * a + b] += R[3 * a + c] * moving->axes[3 * c + b];
        }
    apsm_affine_identity(M);
    for (size_t a = 0; a < 3; a++) {
        M[4 * a + 3] = fixed->centre[a];
        for (size_t b = 0; b < 3; b++) {
            M[4 * a + b] = 0.0;
            for (size_t c = 0; c < 3; c++) M[4 * a + b] += fixed->axes[3 * c + a] * RA[3 * c + b];
            M[4 * a + b] *= size;
            M[4 * a + 3] -= M[4 * a + b] * moving->centre[b];
        }
    }
}

/* Least a.M x over the cloud; M NULL: the identity. */
static double lowest(const apsm_cloud *cloud, const double M[16], const double a[3])
{
    double least = INFINITY;
    for (size_t k = 0; k < cloud->n; k++) {
        double x[3] = { cloud->x[3 * k], cloud->x[3 * k + 1], cloud->x[3 * k + 2] };
        if (M) apsm_affine_apply(M, 1, x, x);
        least = fmin(least, vec3_dot(a, x));
    }
    return least;
}

/* Shifts M along a so that the ends opposite to a cut with normal a meet. */
static void match_ends(const apsm_cloud *moving, const apsm_cloud *fixed, const double a[3],
                       double M[16])
{
    const double shift = lowest(fixed, NULL, a) - lowest(moving, M, a);
    for (size_t r = 0; r < 3; r++) M[4 * r + 3] += shift * a[r];
}

/* The centre of a shape that was cut off is somewhere else: its whole end is not. */
static void match_whole_ends(const apsm_cloud *moving, const apsm_cloud *fixed, double M[16])
{
    for (size_t c = 0; c < moving->cuts; c++) {
        double a[3];
        apsm_affine_apply_normals(M, 1, moving->cut[c], a);
        match_ends(moving, fixed, a, M);
    }
    for (size_t c = 0; c < fixed->cuts; c++) match_ends(moving, fixed, fixed->cut[c], M);
}

/* Root mean square distance between A x and B x over the beginning of the cloud. */
static double pose_distance(const apsm_cloud *cloud, const double A[16], const double B[16])
{
    const size_t n = cloud->n < 16 ? cloud->n : 16;
    double sum = 0.0;
    for (size_t k = 0; k < n; k++) {
        double a[3], b[3];
        apsm_affine_apply(A, 1, cloud->x + 3 * k, a);
        apsm_affine_apply(B, 1, cloud->x + 3 * k, b);
        sum += vec3_distance2(a, b);
    }
    return sqrt(sum / (double)n);
}

/* By residual; stable, so that ties stay in the order of the starts. */
static void sort_candidates(size_t n, candidate *c)
{
    for (size_t i = 1; i < n; i++) {
        const candidate t = c[i];
        size_t j = i;
        for (; j > 0 && t.residual < c[j - 1].residual; j--) c[j] = c[j - 1];
        c[j] = t;
    }
}

/* Sorts and keeps the best of each pose, at most `keep`; returns how many. */
static size_t keep_distinct(const apsm_surface *moving, double near, size_t keep, size_t n,
                            candidate *c)
{
    size_t kept = 0;
    sort_candidates(n, c);
    for (size_t i = 0; i < n && kept < keep; i++) {
        bool fresh = true;
        for (size_t j = 0; j < kept && fresh; j++)
            fresh = pose_distance(moving->cloud, c[i].M, c[j].M) > near;
        if (fresh) c[kept++] = c[i];
    }
    return kept;
}

/* Registers every candidate as the round says. */
static void run_round(const apsm_surface *moving, const apsm_surface *fixed,
                      const apsm_icp_options *opt, bool coarse, size_t n, candidate *c,
                      double *work)
{
    for (size_t k = 0; k < n; k++)
        if (coarse)
            apsm_icp_coarse(moving, fixed, opt, c[k].M, &c[k].residual, work);
        else
            apsm_icp(moving, fixed, opt, c[k].M, &c[k].residual, work);
}

/* How many of the sorted candidates fit about as well as the best or the rival; the best does. */
static size_t count_hopeful(const candidate *c, size_t n, double rival)
{
    const double least = rival > 0.0 ? fmin(rival, c[0].residual) : c[0].residual;
    size_t hopeful = 1;
    while (hopeful < n && c[hopeful].residual <= hopeless * least) hopeful++;
    return hopeful;
}

void apsm_pose_search(const apsm_surface *moving, const apsm_surface *fixed, bool mirrored,
                      const apsm_icp_options *opt, apsm_pose *pose, double *work)
{
    candidate c[STARTS];
    size_t n = STARTS;
    const double near = same_pose * fixed->cloud->radius;
    apsm_icp_options quick = *opt;
    quick.tolerance = fmax(opt->tolerance, rough);
    quick.near = false;
    for (size_t k = 0; k < n; k++) {
        start_pose(moving->cloud, fixed->cloud, k, mirrored, opt->scale, c[k].M);
        match_whole_ends(moving->cloud, fixed->cloud, c[k].M);
    }
    for (size_t r = 0; r < ROUNDS; r++) {
        quick.points = rounds[r].points;
        quick.max_iterations = rounds[r].iterations;
        run_round(moving, fixed, &quick, rounds[r].coarse, n, c, work);
        n = keep_distinct(moving, near, rounds[r].keep, n, c);
    }
    quick.points = opt->points;
    quick.near = opt->near;
    quick.max_iterations = opt->max_iterations;
    run_round(moving, fixed, &quick, false, count_hopeful(c, n, opt->rival), c, work);
    n = keep_distinct(moving, near, APSM_POSE_OPTIONS, n, c);
    pose->runner_up = n > 1 ? c[1].residual : INFINITY;
    if (opt->tolerance < rough) run_round(moving, fixed, opt, false, 1, c, work);
    memcpy(pose->M, c[0].M, sizeof pose->M);
    pose->residual = c[0].residual;
    for (size_t k = 0; k < APSM_POSE_OPTIONS; k++) {
        memcpy(pose->option_M[k], c[k].M, sizeof pose->option_M[k]);
        pose->option_residual[k] = k < n ? c[k].residual : INFINITY;
    }
}

void apsm_pose_from(const apsm_surface *moving, const apsm_surface *fixed, const double R[9],
                    const apsm_icp_options *opt, apsm_pose *pose, double *work)
{
    const double size = opt->scale ? fixed->cloud->radius / moving->cloud->radius : 1.0;
    apsm_affine_identity(pose->M);
    for (size_t a = 0; a < 3; a++) {
        for (size_t b = 0; b < 3; b++) pose->M[4 * a + b] = size * R[3 * a + b];
        pose->M[4 * a + 3] =
            fixed->cloud->centre[a] - vec3_dot(pose->M + 4 * a, moving->cloud->centre);
    }
    match_whole_ends(moving->cloud, fixed->cloud, pose->M);
    apsm_icp(moving, fixed, opt, pose->M, &pose->residual, work);
    pose->runner_up = INFINITY;
}
