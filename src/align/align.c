/* Alignment of a cohort (docs/method.md, "Pose").
 *
 *   1. every shape is sampled;
 *   2. pose search of every shape, as it is and mirrored, against a provisional template:
 *      P_i maps shape i to the provisional template;
 *      If most poses hardly turn, the shapes come in one orientation, as images do, and where
 *      other poses fit about as well, those that hardly turn are taken;
 *   3. the medoid, by registrations of pairs (i, j) that start from P_j^-1 P_i;
 *   4. every shape is registered to the medoid t, from P_t^-1 P_i.
 *
 * Steps are parallel over shapes or pairs; each writes only its own entries. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "align/icp.h"
#include "align/medoid.h"
#include "align/pose_choice.h"
#include "core/deal.h"
#include "core/robust.h"
#include "geometry/affine.h"
#include "geometry/form.h"
#include "geometry/vec3.h"

enum { LEAST_POINTS = 64, ROUGH_POINTS = 150, HELD_TREES = 96, RESTING = 12, FEW_VERTICES = 128 };
/* What the last registration may leave, relative to the radius. */
static const double at_rest = 3e-5;
/* Share of the sum of squares that no step of a pair of the medoid's need lower. */
static const double enough_for_pairs = 1e-2;
/* 1 + 2 cos of 10 degrees: poses that are turned by less are one. */
static const double same_rotation = 2.97;

typedef struct aligner {
    size_t n;
    const apsm_mesh *const *mesh;
    const char *const *names;
    const apsm_align_options *opt;
    apsm_alignment *out;
    size_t base;         /* the provisional template */
    bool other_base;     /* it took the place of one that was turned against all others */
    apsm_cloud *cloud;   /* n */
    apsm_bvh **bvh;      /* n: NULL where no tree is held */
    double *area;        /* n */
    double **heights;    /* n: see pose_choice.h */
    pose_ballot *ballot; /* n */
    pose_choice *choice; /* n */
    double *P;           /* n x 16: shape to base */
    double *mirror;      /* n x 16: its mirror image to base */
    size_t *list;        /* n: scratch */
    double *work;        /* threads x work_size */
    size_t work_size;
    double common[9];       /* rotation from the orientation in which most shapes come to base */
    bool oriented;          /* nearly all do */
    double *given_residual; /* n */
    double *given; /* n x 16: poses near that in which shapes come, where they were tried */
    bool any_cut;  /* some shape was cut off */
    bool again;    /* for meshes that have been cropped */
    bool *fits;    /* n: whether that one fits about as well as the best, or the best is such */
    bool *turned;  /* n: whether the best turns more, and fits little better */
    apsm_medoid_plan *plan; /* while the medoid is looked for, and what goes with it: */
    size_t part;            /* of the plan's shapes, or all of them */
    double *R;              /* plan's candidates x shapes */
    apsm_cloud resting[2];  /* of the template: some vertices, and all */
} aligner;

apsm_align_options apsm_align_defaults(void)
{
    return (apsm_align_options){ .template_index = APSM_TEMPLATE_AUTO,
                                 APSM_OPTION_DEFAULTS(APSM_ALIGN_OPTIONS) };
}

static apsm_status fail(apsm_context *ctx, const aligner *a, size_t i, apsm_status status,
                        const char *what)
{
    if (a->names) return apsm_fail(ctx, status, "%s: %s", a->names[i], what);
    return apsm_fail(ctx, status, "shape %zu: %s", i, what);
}

static apsm_status sample_task(apsm_context *ctx, size_t i, int worker, void *user)
{
    aligner *a = user;
    (void)worker;
    a->area[i] = apsm_mesh_area(a->mesh[i]);
    const apsm_status status =
        apsm_cloud_sample(a->mesh[i], a->opt->points, apsm_context_seed(ctx), i, &a->cloud[i]);
    if (status == APSM_ERR_GEOMETRY)
        return fail(ctx, a, i, status, "surface without area, or not finite; check the mesh");
    if (status != APSM_OK) return fail(ctx, a, i, status, apsm_status_text(status));
    apsm_cloud_find_cuts(a->mesh[i], &a->cloud[i]);
    if (a->opt->borders) apsm_cloud_keep_cuts(&a->opt->borders[i], &a->cloud[i]);
    return APSM_OK;
}

/* Trees of the shapes in list are built and held. */
static apsm_status tree_task(apsm_context *ctx, size_t k, int worker, void *user)
{
    aligner *a = user;
    const size_t i = a->list[k];
    (void)worker;
    const apsm_status status = apsm_bvh_build_unsigned(a->mesh[i], &a->bvh[i]);
    return status == APSM_OK ? status : fail(ctx, a, i, status, apsm_status_text(status));
}

static apsm_status hold_trees(apsm_context *ctx, aligner *a, size_t n, const size_t *shapes)
{
    size_t missing = 0;
    for (size_t k = 0; k < n; k++)
        if (!a->bvh[shapes[k]]) a->list[missing++] = shapes[k];
    return apsm_parallel_for(ctx, missing, tree_task, a, NULL);
}

/* The surface of shape i, with a tree of its own if none is held: free *own afterwards. */
static apsm_status open_surface(apsm_context *ctx, const aligner *a, size_t i, apsm_bvh **own,
                                apsm_surface *surface)
{
    *own = NULL;
    if (!a->bvh[i]) {
        const apsm_status status = apsm_bvh_build_unsigned(a->mesh[i], own);
        if (status != APSM_OK) return fail(ctx, a, i, status, apsm_status_text(status));
    }
    *surface = (apsm_surface){ .bvh = *own ? *own : a->bvh[i], .cloud = &a->cloud[i] };
    return APSM_OK;
}

/* The index of the median area, of all shapes but `except` (a->n: of all); of equal areas the
 * first. */
static size_t median_area(const aligner *a, size_t except)
{
    const size_t middle = (a->n - (except < a->n) - 1) / 2;
    for (size_t i = 0; i < a->n; i++) {
        size_t less = 0, equal = 0;
        for (size_t j = 0; j < a->n && i != except; j++) {
            if (j == except) continue;
            less += a->area[j] < a->area[i];
            equal += a->area[j] == a->area[i];
        }
        if (less <= middle && middle < less + equal) return i;
    }
    return 0; /* not reached: areas are finite */
}

static double *scratch(const aligner *a, int worker)
{
    return a->work + (size_t)worker * a->work_size;
}

static apsm_icp_options icp_options(const aligner *a)
{
    apsm_icp_options icp = apsm_icp_defaults();
    icp.scale = a->opt->align == APSM_ALIGN_SIMILARITY;
    icp.trim = a->opt->trim;
    if (a->opt->align == APSM_ALIGN_NONE) icp.max_iterations = 0;
    return icp;
}

/* Enough to compare residuals, which this changes by less than 1 %. */
static void roughly(apsm_icp_options *icp)
{
    icp->points = ROUGH_POINTS;
    icp->near = true;
    icp->tolerance = 1e-3;
    icp->enough = 2e-3;
}

static double ratio(double a, double b)
{
    return b > 0.0 ? a / b : INFINITY;
}

/* Of the search: size does not count, unless it means little. */
static apsm_icp_options search_options(const aligner *a, const apsm_surface *moving,
                                       const apsm_surface *fixed)
{
    apsm_icp_options icp = icp_options(a);
    icp.scale |= !(a->opt->trim > 0.0 || moving->cloud->cuts + fixed->cloud->cuts > 0);
    roughly(&icp);
    return icp;
}

static void enter(const apsm_pose *pose, size_t hand, pose_ballot *ballot)
{
    memcpy(ballot->M[hand], pose->option_M, sizeof ballot->M[hand]);
    memcpy(ballot->residual[hand], pose->option_residual, sizeof ballot->residual[hand]);
}

static void search(const aligner *a, const apsm_surface *moving, double *work, pose_ballot *ballot)
{
    const apsm_surface fixed = { a->bvh[a->base], &a->cloud[a->base] };
    apsm_icp_options icp = search_options(a, moving, &fixed);
    apsm_pose pose;
    memset(ballot, 0, sizeof *ballot);
    for (size_t k = 0; k < POSE_OPTIONS; k++) ballot->residual[1][k] = INFINITY;
    apsm_pose_search(moving, &fixed, false, &icp, &pose, work);
    enter(&pose, 0, ballot);
    if (a->opt->mirror_check == APSM_MIRROR_OFF) return;
    icp.rival = pose.residual;
    apsm_pose_search(moving, &fixed, true, &icp, &pose, work);
    enter(&pose, 1, ballot);
}

static apsm_status search_task(apsm_context *ctx, size_t i, int worker, void *user)
{
    aligner *a = user;
    apsm_surface moving;
    apsm_bvh *own;
    if (i == a->base) return APSM_OK;
    const char *kind = a->other_base ? "poses, other template" : "poses";
    if (apsm_recall(ctx, kind, i, sizeof a->ballot[i], &a->ballot[i])) return APSM_OK;
    APSM_TRY(open_surface(ctx, a, i, &own, &moving));
    search(a, &moving, scratch(a, worker), &a->ballot[i]);
    apsm_bvh_free(own);
    return apsm_keep(ctx, kind, i, sizeof a->ballot[i], &a->ballot[i]);
}

/* ---- the orientation in which shapes come ---- */

/* 1 + 2 cos of the angle between two poses, R the rotation of the second. */
static double likeness(const double M[16], const double R[9])
{
    const double scale = vec3_norm(M);
    double trace = 0.0;
    for (size_t k = 0; k < 9; k++) trace += R[k] * M[4 * (k / 3) + k % 3];
    return trace / scale;
}

/* Root mean square distance over the cloud between its turns by M and by R, relative to the radius:
 * what a turn about the axis of a thin shaft hardly changes. */
static double apart(const apsm_cloud *cloud, const double M[16], const double R[9])
{
    const double scale = vec3_norm(M);
    double sum = 0.0;
    for (size_t k = 0; k < cloud->n; k++) {
        double x[3];
        vec3_sub(cloud->x + 3 * k, cloud->centre, x);
        for (size_t r = 0; r < 3; r++) {
            const double d = vec3_dot(M + 4 * r, x) / scale - vec3_dot(R + 3 * r, x);
            sum += d * d;
        }
    }
    return sqrt(sum / (double)cloud->n) / cloud->radius;
}

/* Turns shape i by less than 60 degrees from the orientation in which most shapes come, or, if it
 * is thin, its axis by less than 30. */
static bool hardly_turns(const aligner *a, size_t i, const double M[16])
{
    return likeness(M, a->common) > 2.0 || apart(&a->cloud[i], M, a->common) < 0.5;
}

/* The provisional template's own orientation first, then the mean of those that are near. */
static void find_common_orientation(aligner *a)
{
    for (size_t k = 0; k < 9; k++) a->common[k] = k % 4 == 0 ? 1.0 : 0.0;
    for (int round = 0; round < 2; round++) {
        double sum[9] = { 0 };
        for (size_t i = 0; i < a->n; i++) {
            const double *M = a->P + 16 * i;
            const double scale = vec3_norm(M);
            for (size_t k = 0; k < 9 && hardly_turns(a, i, M); k++)
                sum[k] += M[4 * (k / 3) + k % 3] / scale;
        }
        apsm_nearest_rotation(sum, a->common);
    }
}

/* Another pose than P, and nearer to the common orientation. */
static bool turns_less(const aligner *a, const double M[16], const double P[16])
{
    double R[9], sum[9];
    for (size_t k = 0; k < 9; k++) sum[k] = P[4 * (k / 3) + k % 3];
    apsm_nearest_rotation(sum, R);
    return likeness(M, R) < same_rotation && likeness(M, a->common) > likeness(P, a->common);
}

static apsm_status try_given_task(apsm_context *ctx, size_t i, int worker, void *user)
{
    aligner *a = user;
    const apsm_surface fixed = { a->bvh[a->base], &a->cloud[a->base] };
    apsm_surface moving;
    apsm_bvh *own;
    apsm_pose pose;
    a->fits[i] = a->turned[i] = false;
    if (i == a->base) return APSM_OK;
    APSM_TRY(open_surface(ctx, a, i, &own, &moving));
    apsm_icp_options icp = search_options(a, &moving, &fixed);
    icp.usual = a->common;
    icp.near = false;
    apsm_pose_from(&moving, &fixed, a->common, &icp, &pose, scratch(a, worker));
    apsm_bvh_free(own);
    a->fits[i] =
        hardly_turns(a, i, pose.M) && pose.residual <= APSM_GIVEN_RATIO * a->out->residual[i];
    a->turned[i] = a->fits[i] && turns_less(a, pose.M, a->P + 16 * i);
    a->fits[i] |= hardly_turns(a, i, a->P + 16 * i);
    memcpy(a->given + 16 * i, pose.M, sizeof pose.M);
    a->given_residual[i] = pose.residual;
    return APSM_OK;
}

/* A shape that comes as the others do has no other pose to choose. */
static void settle_given(aligner *a, size_t i)
{
    pose_ballot *b = &a->ballot[i];
    if (i == a->base || !a->fits[i]) return;
    if (a->turned[i]) {
        memcpy(b->M[0][0], a->given + 16 * i, sizeof b->M[0][0]);
        b->residual[0][0] = a->given_residual[i];
    }
    for (size_t k = 1; k < POSE_OPTIONS; k++) b->residual[0][k] = INFINITY;
}

/* Four fifths, or, of nine or more, two thirds: by chance one in seventeen hardly turns, and of
 * shapes that nearly agree with themselves when turned no more than a third (six kinds in any
 * pose). */
static bool are_enough(size_t n, size_t fit)
{
    enum { MANY = 9 };
    return n < MANY ? 5 * fit >= 4 * n : 3 * fit >= 2 * n;
}

/* Of the best poses, or others that fit about as well, most must hardly turn.  Where shapes are not
 * few the best may turn all of them: then it is the provisional template that nearly agrees with
 * itself when turned. */
static apsm_status take_given_poses(apsm_context *ctx, aligner *a)
{
    enum { FEW = 6 };
    size_t best = 0, fit = 0;
    for (size_t i = 0; i < a->n; i++) {
        if (i == a->base) continue;
        memcpy(a->P + 16 * i, a->ballot[i].M[0][0], 16 * sizeof *a->P);
        a->out->residual[i] = a->ballot[i].residual[0][0];
    }
    find_common_orientation(a);
    for (size_t i = 0; i < a->n; i++) best += i != a->base && hardly_turns(a, i, a->P + 16 * i);
    if (best == 0 && a->n < FEW && !a->opt->oriented) return APSM_OK;
    APSM_TRY(apsm_parallel_for(ctx, a->n, try_given_task, a, NULL));
    for (size_t i = 0; i < a->n; i++) fit += i != a->base && a->fits[i];
    a->oriented = a->opt->oriented || are_enough(a->n - 1, fit);
    for (size_t i = 0; a->oriented && i < a->n; i++) settle_given(a, i);
    return APSM_OK;
}

/* Whether most shapes fit the provisional template better when they are turned against the
 * orientation in which all come, and some so much that they would be: it is that one that is
 * turned, or looks like it. */
static bool is_base_turned(const aligner *a)
{
    size_t turned = 0, unfit = 0;
    for (size_t i = 0; i < a->n; i++) {
        turned += i != a->base && !hardly_turns(a, i, a->P + 16 * i);
        unfit += i != a->base && !a->fits[i];
    }
    return a->oriented && unfit > 0 && 2 * turned > a->n - 1;
}

/* Whether four fifths of the best poses agree with one of them: then the shapes come in one
 * orientation, and the provisional template in another. */
static bool others_agree(const aligner *a)
{
    enum { ASKED = 8 };
    for (size_t k = 0; k < ASKED && k < a->n; k++) {
        const size_t one = k * a->n / (a->n < ASKED ? a->n : ASKED);
        double R[9], block[9];
        size_t alike = 0;
        if (one == a->base) continue;
        for (size_t c = 0; c < 9; c++) block[c] = a->P[16 * one + 4 * (c / 3) + c % 3];
        apsm_nearest_rotation(block, R);
        for (size_t i = 0; i < a->n; i++) alike += i != a->base && likeness(a->P + 16 * i, R) > 2.0;
        if (alike > 2 && 5 * alike >= 4 * (a->n - 1)) return true;
    }
    return false;
}

/* Another provisional template. */
static apsm_status change_base(apsm_context *ctx, aligner *a)
{
    a->base = median_area(a, a->base);
    a->other_base = true;
    a->out->template_index = a->base;
    memset(&a->ballot[a->base], 0, sizeof a->ballot[a->base]);
    apsm_affine_identity(a->P + 16 * a->base);
    return hold_trees(ctx, a, 1, &a->base);
}

static apsm_status find_poses(apsm_context *ctx, aligner *a)
{
    APSM_TRY(apsm_dealt_for(ctx, a->n, search_task, a, "align"));
    APSM_TRY(take_given_poses(ctx, a));
    if (a->opt->template_index != APSM_TEMPLATE_AUTO) return APSM_OK;
    if (a->oriented ? !is_base_turned(a) : !others_agree(a)) return APSM_OK;
    APSM_TRY(change_base(ctx, a));
    APSM_TRY(apsm_dealt_for(ctx, a->n, search_task, a, "align"));
    return take_given_poses(ctx, a);
}

/* ---- the choice among the poses ---- */

static apsm_status heights_task(apsm_context *ctx, size_t i, int worker, void *user)
{
    aligner *a = user;
    (void)ctx, (void)worker;
    const apsm_mesh *mesh = a->mesh[i];
    double *faces = malloc((apsm_form_size(mesh->nf) + 1) * sizeof *faces);
    a->heights[i] = malloc(a->cloud[i].n * APSM_FORM_SCALES * sizeof *a->heights[i]);
    const bool ok = faces && a->heights[i];
    if (ok) pose_heights(mesh, &a->cloud[i], faces, a->heights[i]);
    free(faces);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}

/* The residual of the best clearly different pose over that of the pose taken. */
static double runner_up_ratio(const pose_ballot *ballot, size_t hand, size_t taken)
{
    double least = INFINITY;
    for (size_t k = 0; k < POSE_OPTIONS; k++)
        if (k != taken) least = fmin(least, ballot->residual[hand][k]);
    return fmax(1.0, ratio(least, ballot->residual[hand][taken]));
}

static void take(aligner *a, size_t i)
{
    const pose_ballot *b = &a->ballot[i];
    const pose_choice *c = &a->choice[i];
    const size_t hand = c->mirrored;
    memcpy(a->P + 16 * i, b->M[0][c->option[0]], 16 * sizeof *a->P);
    memcpy(a->mirror + 16 * i, b->M[1][c->option[1]], 16 * sizeof *a->mirror);
    a->out->residual[i] = b->residual[0][c->option[0]]; /* for the time being */
    a->out->runner_up_ratio[i] = runner_up_ratio(b, hand, c->option[hand]);
    if (a->opt->mirror_check != APSM_MIRROR_OFF)
        a->out->mirror_ratio[i] = ratio(b->residual[1][c->option[1]], a->out->residual[i]);
    if (a->opt->align == APSM_ALIGN_SIMILARITY) return;
    apsm_affine_remove_scale(a->cloud[i].centre, a->P + 16 * i);
    if (a->opt->mirror_check != APSM_MIRROR_OFF)
        apsm_affine_remove_scale(a->cloud[i].centre, a->mirror + 16 * i);
}

static apsm_status choose_poses(apsm_context *ctx, aligner *a)
{
    if (pose_is_contested(a->n, a->base, a->ballot))
        APSM_TRY(apsm_parallel_for(ctx, a->n, heights_task, a, NULL));
    APSM_TRY(pose_choose(ctx, a->n, a->base, a->cloud, a->heights, a->ballot,
                         a->opt->mirror_check == APSM_MIRROR_FIX, a->choice));
    for (size_t i = 0; i < a->n; i++)
        if (i != a->base) take(a, i);
    return APSM_OK;
}

/* Who is mirrored.  Against a provisional template the minority is.  (Then the P of mirrored
 * shapes are proper and the others' are not: only products P_t^-1 P_i count.) */
static apsm_status judge_mirrored(aligner *a)
{
    size_t mirrored = 0;
    double *scratch = malloc(a->n * sizeof *scratch);
    if (!scratch) return APSM_ERR_MEMORY;
    const bool differ = pose_hands_differ(a->n, a->base, a->choice, scratch);
    free(scratch);
    for (size_t i = 0; i < a->n; i++) {
        const int hand = i == a->base ? -1 : pose_hand(&a->choice[i], &a->ballot[i], differ);
        a->out->mirrored[i] = hand > 0;
        a->out->unclear_hand[i] = a->opt->mirror_check == APSM_MIRROR_FIX && hand == 0;
        mirrored += a->out->mirrored[i];
        if (a->out->mirrored[i] && a->opt->mirror_check == APSM_MIRROR_FIX)
            memcpy(a->P + 16 * i, a->mirror + 16 * i, 16 * sizeof *a->P);
    }
    if (a->opt->template_index != APSM_TEMPLATE_AUTO || 2 * mirrored <= a->n) return APSM_OK;
    for (size_t i = 0; i < a->n; i++) a->out->mirrored[i] = !a->out->mirrored[i];
    return APSM_OK;
}

/* Marks those whose x (n, logarithms) is farther from the others' median than chance and `by`.
 * scratch: 3 n. */
static void mark_strangers(aligner *a, const double *x, double by, double *scratch)
{
    static const double deviation = 0.05, most = 6.0;
    double *excess = scratch + a->n, *median = scratch + 2 * a->n;
    robust_excesses(a->n, x, deviation, excess, median, scratch);
    for (size_t i = 0; i < a->n; i++)
        a->out->stranger[i] |= fabs(excess[i]) > most && fabs(x[i] - median[i]) > by;
}

/* By size, and by how near the best pose comes, in its own size: such shapes make no template. */
static apsm_status find_strangers(aligner *a)
{
    enum { LEAST = 5 };
    if (a->n < LEAST) return APSM_OK;
    double *x = malloc(4 * a->n * sizeof *x), sum = 0.0;
    if (!x) return APSM_ERR_MEMORY;
    double *scratch = x + a->n;
    for (size_t i = 0; i < a->n; i++) x[i] = 0.5 * log(a->area[i]);
    mark_strangers(a, x, log(1.3), scratch);
    for (size_t i = 0; i < a->n; i++) {
        const pose_ballot *b = &a->ballot[i];
        const double least = fmin(b->residual[0][0], b->residual[1][0]);
        x[i] = log(fmax(least / a->cloud[a->base].radius, 1e-9));
        if (i != a->base) sum += x[i] / (double)(a->n - 1);
    }
    x[a->base] = sum;
    if (a->opt->align != APSM_ALIGN_NONE) mark_strangers(a, x, log(2.5), scratch);
    free(x);
    return APSM_OK;
}

static bool is_ambiguous(const aligner *a, size_t i)
{
    enum { FEW = 4 };
    const pose_choice *c = &a->choice[i];
    const apsm_alignment *out = a->out;
    if (i == a->base || a->opt->align == APSM_ALIGN_NONE) return false;
    if (out->mirrored[i] && a->opt->mirror_check != APSM_MIRROR_FIX) return false;
    if (a->oriented && hardly_turns(a, i, a->P + 16 * i)) return false;
    if (a->n < FEW) return out->runner_up_ratio[i] < APSM_AMBIGUOUS_RATIO;
    return c->evidence[c->mirrored] - c->second[c->mirrored] < POSE_CLEARLY;
}

static bool is_sought(const aligner *a, size_t i)
{
    return i != a->base && a->opt->align != APSM_ALIGN_NONE &&
           !(a->oriented && hardly_turns(a, i, a->P + 16 * i));
}

/* Who had better not be the template. */
static void find_unfit(aligner *a)
{
    size_t ambiguous = 0;
    a->out->oriented = a->oriented;
    for (size_t i = 0; i < a->n; i++) ambiguous += a->out->ambiguous[i] = is_ambiguous(a, i);
    for (size_t i = 0; i < a->n; i++) a->out->sought[i] = is_sought(a, i);
    for (size_t i = 0; i < a->n; i++)
        a->out->unfit[i] = a->out->stranger[i] || a->out->mirrored[i] ||
                           (a->out->ambiguous[i] && 2 * ambiguous < a->n);
}

/* U <- the rotation that is to be expected from one shape to another; returns U, or NULL if none
 * is. */
static const double *usual_between(const aligner *a, size_t from, size_t to, double U[9])
{
    if (!a->oriented) return NULL;
    for (size_t i = 0, k = from; i < 2; i++, k = to)
        if (k != a->base && !hardly_turns(a, k, a->P + 16 * k)) return NULL;
    for (size_t k = 0; k < 9; k++) {
        U[k] = k % 4 == 0 ? 1.0 : 0.0;
        if (to == a->base) U[k] = a->common[k];
        if (from == a->base) U[k] = a->common[3 * (k % 3) + k / 3];
    }
    return U;
}

/* P_to^-1 P_from */
static void between(const aligner *a, size_t from, size_t to, double M[16])
{
    apsm_similarity_invert(a->P + 16 * to, M);
    apsm_affine_multiply(M, a->P + 16 * from, M);
}

static apsm_status pair_task(apsm_context *ctx, size_t k, int worker, void *user)
{
    aligner *a = user;
    const apsm_medoid_plan *plan = a->plan;
    const size_t row = k / plan->shapes, column = k % plan->shapes;
    const size_t i = plan->candidate[row], j = plan->shape[column];
    const bool exact = plan->candidates == plan->shapes;
    (void)ctx;
    if (i == j || (exact && i > j)) return APSM_OK;
    if (!exact && (plan->out[row] || column % APSM_MEDOID_PARTS != a->part)) return APSM_OK;
    const apsm_surface moving = { a->bvh[j], &a->cloud[j] }, fixed = { a->bvh[i], &a->cloud[i] };
    apsm_icp_options icp = icp_options(a);
    double M[16], U[9], residual;
    roughly(&icp);
    icp.enough = enough_for_pairs;
    icp.usual = usual_between(a, j, i, U);
    between(a, j, i, M);
    apsm_icp(&moving, &fixed, &icp, M, &residual, scratch(a, worker));
    if (icp.scale) residual /= fixed.cloud->radius;
    a->R[k] = residual;
    if (exact) a->R[column * plan->shapes + row] = residual;
    return APSM_OK;
}

/* Residuals R of the plan's pairs; candidates that fall behind drop out. */
static apsm_status race(apsm_context *ctx, aligner *a, apsm_medoid_plan *plan, double *R)
{
    APSM_TRY(hold_trees(ctx, a, plan->candidates, plan->candidate));
    APSM_TRY(hold_trees(ctx, a, plan->shapes, plan->shape));
    a->plan = plan;
    a->R = R;
    const size_t parts = plan->candidates == plan->shapes ? 1 : APSM_MEDOID_PARTS;
    for (a->part = 0; a->part < parts; a->part++) {
        APSM_TRY(apsm_parallel_for(ctx, plan->candidates * plan->shapes, pair_task, a, NULL));
        if (a->part + 1 < parts) apsm_medoid_drop(plan, a->part + 1, R);
    }
    return APSM_OK;
}

static apsm_status find_medoid(apsm_context *ctx, aligner *a, size_t *medoid)
{
    apsm_medoid_plan plan;
    double R[APSM_MEDOID_CANDIDATES * APSM_MEDOID_SHAPES] = { 0 };
    size_t eligible = 0;
    for (size_t i = 0; i < a->n; i++)
        if (!a->out->unfit[i]) a->list[eligible++] = i;
    if (eligible == 0) a->list[eligible++] = a->base;
    apsm_medoid_draw(eligible, a->list, apsm_context_seed(ctx), &plan);
    const apsm_status status = race(ctx, a, &plan, R);
    if (status == APSM_OK) *medoid = apsm_medoid_pick(&plan, R);
    a->plan = NULL;
    a->R = NULL;
    return status;
}

/* M <- T(-centroid of the template) M, the world's frame. */
static void to_world(const aligner *a, double M[16])
{
    double c[3];
    if (a->opt->align == APSM_ALIGN_NONE) return;
    apsm_mesh_centroid(a->mesh[a->out->template_index], c);
    for (size_t r = 0; r < 3; r++) M[4 * r + 3] -= c[r];
}

static void close_resting(apsm_cloud cloud[2])
{
    for (size_t k = 0; k < 2; k++) apsm_cloud_free(&cloud[k]);
}

/* The clouds by which a shape comes to rest: some of its vertices, and all. */
static apsm_status open_resting(const apsm_mesh *mesh, const apsm_cloud *sample,
                                apsm_cloud cloud[2])
{
    APSM_TRY(apsm_cloud_of_some_vertices(mesh, sample, &cloud[0]));
    const apsm_status status = apsm_cloud_of_vertices(mesh, sample, &cloud[1]);
    if (status != APSM_OK) apsm_cloud_free(&cloud[0]);
    return status;
}

/* Brings shape i to rest from M. */
static apsm_status let_rest(const aligner *a, const apsm_surface *moving, const apsm_surface *fixed,
                            size_t i, const apsm_icp_options *icp, double M[16], double *residual,
                            double *work)
{
    apsm_cloud own[2];
    APSM_TRY(open_resting(a->mesh[i], moving->cloud, own));
    const apsm_surface from[2] = { { moving->bvh, &own[0] }, { moving->bvh, &own[1] } };
    const apsm_surface to[2] = { { fixed->bvh, &a->resting[0] }, { fixed->bvh, &a->resting[1] } };
    /* Some have to stand for all, and of meshes whose clouds are thinned anyway are not fewer. */
    const size_t first = own[0].n < FEW_VERTICES || a->resting[0].n < FEW_VERTICES ||
                         own[0].n + a->resting[0].n > (own[1].n + a->resting[1].n) / 2;
    apsm_icp_to_rest(2 - first, from + first, to + first, icp, M, residual, work);
    close_resting(own);
    return APSM_OK;
}

/* Registers shape i to the template from M: on the sample, then on some vertices and on all until
 * it rests, so that the pose is that of the surfaces and not of the points drawn or the way there.
 */
static apsm_status register_shape(const aligner *a, const apsm_surface *moving, size_t i, bool size,
                                  double M[16], double *residual, double *work)
{
    const apsm_surface fixed = { a->bvh[a->out->template_index],
                                 &a->cloud[a->out->template_index] };
    apsm_icp_options icp = icp_options(a);
    icp.scale |= size;
    double U[9];
    roughly(&icp);
    icp.usual = usual_between(a, i, a->out->template_index, U);
    apsm_icp(moving, &fixed, &icp, M, residual, work);
    icp.points = 0;
    icp.tolerance = at_rest;
    icp.enough = 0.0;
    if (icp.max_iterations > RESTING) icp.max_iterations = RESTING;
    return let_rest(a, moving, &fixed, i, &icp, M, residual, work);
}

/* What the registration of one shape finds; doubles only, since it is kept as bytes. */
typedef struct registered {
    double M[16], sized[16], residual;
} registered;

static apsm_status register_from(apsm_context *ctx, const aligner *a, size_t i, double *work,
                                 registered *r)
{
    apsm_surface moving;
    apsm_bvh *own;
    double unused;
    APSM_TRY(open_surface(ctx, a, i, &own, &moving));
    between(a, i, a->out->template_index, r->M);
    apsm_status status = register_shape(a, &moving, i, false, r->M, &r->residual, work);
    memcpy(r->sized, r->M, sizeof r->M);
    if (status == APSM_OK && a->any_cut && a->opt->align == APSM_ALIGN_RIGID)
        status = register_shape(a, &moving, i, true, r->sized, &unused, work);
    apsm_bvh_free(own);
    return status == APSM_OK ? status : fail(ctx, a, i, status, apsm_status_text(status));
}

static apsm_status register_task(apsm_context *ctx, size_t i, int worker, void *user)
{
    aligner *a = user;
    const char *kind = a->again ? "registration, cropped" : "registration";
    double *M = a->out->M + 16 * i, *sized = a->out->sized + 16 * i;
    registered r = { .residual = 0.0 };
    apsm_affine_identity(r.M);
    apsm_affine_identity(r.sized);
    if (i != a->out->template_index && !apsm_recall(ctx, kind, i, sizeof r, &r)) {
        APSM_TRY(register_from(ctx, a, i, scratch(a, worker), &r));
        APSM_TRY(apsm_keep(ctx, kind, i, sizeof r, &r));
    }
    memcpy(M, r.M, sizeof r.M);
    memcpy(sized, r.sized, sizeof r.sized);
    a->out->residual[i] = r.residual;
    to_world(a, M);
    to_world(a, sized);
    if (!isfinite(a->out->residual[i]))
        return fail(ctx, a, i, APSM_ERR_NONFINITE, "alignment left the finite numbers");
    return APSM_OK;
}

/* The planes, moved along with the shapes. */
static void tell_cuts(const aligner *a)
{
    for (size_t i = 0; i < a->n; i++)
        for (size_t c = 0; c < a->cloud[i].cuts; c++) {
            const double *plane = a->cloud[i].cut[c], *M = a->out->sized + 16 * i;
            apsm_cut *cut = &a->out->cut[a->out->cuts++];
            double x[3];
            for (size_t k = 0; k < 3; k++) x[k] = plane[3] * plane[k];
            apsm_affine_apply(M, 1, x, x);
            apsm_affine_apply_normals(M, 1, plane, cut->plane);
            cut->plane[3] = vec3_dot(cut->plane, x);
            cut->shape = i;
            cut->radius = a->cloud[i].radius * cbrt(fabs(apsm_affine_det(M)));
        }
}

static void report_cuts(apsm_context *ctx, const aligner *a)
{
    size_t cut = 0, first = 0;
    for (size_t i = 0; i < a->n; i++)
        if (a->cloud[i].cuts > 0 && cut++ == 0) first = i;
    if (cut > 0 && a->opt->align != APSM_ALIGN_NONE && a->names)
        apsm_log(ctx, APSM_LOG_INFO,
                 "%zu of %zu shapes end in a plane, as if cut off by the edge of an image (%s%s); "
                 "they are aligned by what they share",
                 cut, a->n, a->names[first], cut > 1 ? ", ..." : "");
}

static void report(apsm_context *ctx, const aligner *a)
{
    const apsm_alignment *out = a->out;
    report_cuts(ctx, a);
    for (size_t i = 0; i < a->n; i++) {
        char name[32];
        snprintf(name, sizeof name, "shape %zu", i);
        const char *who = a->names ? a->names[i] : name;
        if (out->mirrored[i] && a->opt->mirror_check == APSM_MIRROR_FIX)
            apsm_log(ctx, APSM_LOG_INFO, "%s: looks mirrored; its mirror image is used", who);
        else if (out->mirrored[i])
            apsm_log(ctx, APSM_LOG_WARNING,
                     "%s: looks mirrored; name the sides with --reflect-match, or set "
                     "mirror_check=fix; of shapes that are alike on both sides it does not matter",
                     who);
        if (out->ambiguous[i])
            apsm_log(ctx, APSM_LOG_WARNING,
                     "%s: ambiguous pose: another one is about as likely; check the result, or "
                     "align beforehand and set align=none",
                     who);
        if (out->stranger[i])
            apsm_log(ctx, APSM_LOG_WARNING,
                     "%s: is unlike the others in size or form; leave it out with --exclude if it "
                     "does not belong",
                     who);
    }
}

static apsm_status check(apsm_context *ctx, size_t n, const apsm_align_options *opt)
{
    if (n == 0) return apsm_fail(ctx, APSM_ERR_ARG, "align: no shapes");
    if (opt->template_index != APSM_TEMPLATE_AUTO && opt->template_index >= n)
        return apsm_fail(ctx, APSM_ERR_ARG, "align: template %zu of %zu shapes",
                         opt->template_index, n);
    if (opt->points < LEAST_POINTS)
        return apsm_fail(ctx, APSM_ERR_ARG, "align: %zu points a shape, at least %d are needed",
                         opt->points, LEAST_POINTS);
    if (!(opt->trim >= 0.0 && opt->trim < 1.0))
        return apsm_fail(ctx, APSM_ERR_ARG, "align: trim %g is not in [0, 1)", opt->trim);
    return APSM_OK;
}

/* For the sample, and for all vertices of two shapes. */
static size_t work_size(const aligner *a)
{
    size_t most = a->opt->points;
    for (size_t i = 0; i < a->n; i++) {
        const size_t n = apsm_cloud_vertices(a->mesh[i]);
        if (n > most) most = n;
    }
    return apsm_icp_work_size(most);
}

static apsm_status allocate(const apsm_context *ctx, aligner *a)
{
    const size_t n = a->n;
    a->work_size = work_size(a);
    a->cloud = calloc(n, sizeof *a->cloud);
    a->bvh = calloc(n, sizeof(apsm_bvh *));
    a->area = malloc(n * sizeof *a->area);
    a->P = malloc(16 * n * sizeof *a->P);
    a->mirror = malloc(16 * n * sizeof *a->mirror);
    a->heights = calloc(n, sizeof(double *));
    a->ballot = calloc(n, sizeof *a->ballot);
    a->choice = calloc(n, sizeof *a->choice);
    a->given = malloc(16 * n * sizeof *a->given);
    a->given_residual = malloc(n * sizeof *a->given_residual);
    a->fits = malloc(n * sizeof *a->fits);
    a->turned = malloc(n * sizeof *a->turned);
    a->list = malloc(n * sizeof *a->list);
    a->work = malloc((size_t)apsm_context_threads(ctx) * a->work_size * sizeof *a->work);
    a->out->n = n;
    a->out->M = malloc(16 * n * sizeof *a->out->M);
    a->out->residual = malloc(n * sizeof *a->out->residual);
    a->out->runner_up_ratio = malloc(n * sizeof *a->out->runner_up_ratio);
    a->out->mirror_ratio = malloc(n * sizeof *a->out->mirror_ratio);
    a->out->mirrored = calloc(n, sizeof *a->out->mirrored);
    a->out->sought = calloc(n, sizeof *a->out->sought);
    a->out->ambiguous = calloc(n, sizeof *a->out->ambiguous);
    a->out->stranger = calloc(n, sizeof *a->out->stranger);
    a->out->unfit = calloc(n, sizeof *a->out->unfit);
    a->out->unclear_hand = calloc(n, sizeof *a->out->unclear_hand);
    a->out->sized = malloc(16 * n * sizeof *a->out->sized);
    a->out->cut = malloc(APSM_MOST_CUTS * n * sizeof *a->out->cut);
    const bool enough = a->cloud && a->bvh && a->area && a->P && a->mirror && a->heights &&
                        a->ballot && a->choice && a->given && a->given_residual && a->fits &&
                        a->turned && a->list && a->work && a->out->M && a->out->residual &&
                        a->out->runner_up_ratio && a->out->mirror_ratio && a->out->mirrored &&
                        a->out->ambiguous && a->out->sought && a->out->stranger && a->out->unfit &&
                        a->out->unclear_hand && a->out->cut && a->out->sized;
    if (!enough) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < n; i++) {
        a->out->runner_up_ratio[i] = a->out->mirror_ratio[i] = INFINITY;
        apsm_affine_identity(a->P + 16 * i);
        apsm_affine_identity(a->mirror + 16 * i);
    }
    return APSM_OK;
}

static void release(aligner *a)
{
    for (size_t i = 0; i < a->n; i++) {
        if (a->cloud) apsm_cloud_free(&a->cloud[i]);
        if (a->bvh) apsm_bvh_free(a->bvh[i]);
        if (a->heights) free(a->heights[i]);
    }
    close_resting(a->resting);
    free(a->cloud);
    free(a->bvh);
    free(a->area);
    free(a->P);
    free(a->mirror);
    free(a->heights);
    free(a->ballot);
    free(a->choice);
    free(a->given);
    free(a->given_residual);
    free(a->fits);
    free(a->turned);
    free(a->list);
    free(a->work);
}

static apsm_status align(apsm_context *ctx, aligner *a)
{
    const bool given = a->opt->template_index != APSM_TEMPLATE_AUTO;
    APSM_TRY(apsm_parallel_for(ctx, a->n, sample_task, a, NULL));
    a->base = given ? a->opt->template_index : median_area(a, a->n);
    a->out->template_index = a->base;
    for (size_t i = 0; i < a->n && a->n <= HELD_TREES; i++) APSM_TRY(hold_trees(ctx, a, 1, &i));
    APSM_TRY(hold_trees(ctx, a, 1, &a->base));
    if (a->opt->align != APSM_ALIGN_NONE) APSM_TRY(find_poses(ctx, a));
    if (a->opt->align != APSM_ALIGN_NONE) APSM_TRY(choose_poses(ctx, a));
    if (a->opt->align != APSM_ALIGN_NONE) APSM_TRY(judge_mirrored(a));
    APSM_TRY(find_strangers(a));
    find_unfit(a);
    for (size_t i = 0; i < a->n; i++) a->any_cut |= a->cloud[i].cuts > 0;
    if (!given) APSM_TRY(find_medoid(ctx, a, &a->out->template_index));
    const size_t t = a->out->template_index;
    APSM_TRY(open_resting(a->mesh[t], &a->cloud[t], a->resting));
    APSM_TRY(apsm_dealt_for(ctx, a->n, register_task, a, "poses"));
    tell_cuts(a);
    report(ctx, a);
    return APSM_OK;
}

/* Registers all to the template from the poses they have. */
static apsm_status align_again(apsm_context *ctx, aligner *a, const double *M)
{
    const size_t t = a->base;
    a->out->template_index = t;
    memcpy(a->P, M, 16 * a->n * sizeof *M);
    APSM_TRY(apsm_parallel_for(ctx, a->n, sample_task, a, NULL));
    for (size_t i = 0; i < a->n; i++) a->cloud[i].cuts = 0;
    APSM_TRY(hold_trees(ctx, a, 1, &t));
    APSM_TRY(open_resting(a->mesh[t], &a->cloud[t], a->resting));
    return apsm_parallel_for(ctx, a->n, register_task, a, "poses");
}

apsm_status apsm_align_cropped(apsm_context *ctx, size_t n, const apsm_mesh *const *meshes,
                               const char *const *names, const apsm_align_options *opt,
                               apsm_alignment *alignment)
{
    apsm_alignment again = { 0 };
    aligner a = { .n = n,
                  .mesh = meshes,
                  .names = names,
                  .opt = opt,
                  .out = &again,
                  .base = alignment->template_index,
                  .again = true };
    APSM_TRY(check(ctx, n, opt));
    apsm_status status = allocate(ctx, &a);
    if (status == APSM_OK)
        status = align_again(ctx, &a, alignment->M);
    else
        status = apsm_fail(ctx, status, "align: out of memory for %zu shapes", n);
    if (status == APSM_OK) {
        memcpy(alignment->M, again.M, 16 * n * sizeof *again.M);
        memcpy(alignment->residual, again.residual, n * sizeof *again.residual);
    }
    release(&a);
    apsm_alignment_free(&again);
    return status;
}

apsm_status apsm_align_cohort(apsm_context *ctx, size_t n, const apsm_mesh *const *meshes,
                              const char *const *names, const apsm_align_options *opt,
                              apsm_alignment *alignment)
{
    aligner a = { .n = n, .mesh = meshes, .names = names, .opt = opt, .out = alignment };
    *alignment = (apsm_alignment){ 0 };
    APSM_TRY(check(ctx, n, opt));
    apsm_status status = allocate(ctx, &a);
    if (status == APSM_OK)
        status = align(ctx, &a);
    else
        status = apsm_fail(ctx, status, "align: out of memory for %zu shapes", n);
    release(&a);
    if (status != APSM_OK) apsm_alignment_free(alignment);
    return status;
}

void apsm_alignment_free(apsm_alignment *alignment)
{
    free(alignment->M);
    free(alignment->residual);
    free(alignment->runner_up_ratio);
    free(alignment->mirror_ratio);
    free(alignment->mirrored);
    free(alignment->sought);
    free(alignment->ambiguous);
    free(alignment->stranger);
    free(alignment->unfit);
    free(alignment->unclear_hand);
    free(alignment->cut);
    free(alignment->sized);
    *alignment = (apsm_alignment){ 0 };
}
