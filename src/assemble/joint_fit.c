/* New subjects by a joint model: the parts one by one, then all of them together. */
#include "assemble/joint_fit.h"

#include <jansson.h>

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "apsm/report.h"
#include "core/sized.h"
#include "files/files.h"
#include "fit/fit_folder.h"
#include "fit/outputs.h"
#include "fit/parts.h"
#include "fit/rigid.h"
#include "fit/tail.h"
#include "geometry/affine.h"
#include "geometry/bvh.h"
#include "geometry/vec3.h"

static const double tail_review = 1e-3;

/* ---- one frame ---- */

static void object(joint_subject_fit *s, apsm_fit_verdict verdict, const char *format, ...)
    APSM_PRINTF(3, 4);
static void object(joint_subject_fit *s, apsm_fit_verdict verdict, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fit_worsen(&s->verdict, s->reason, verdict, format, args);
    va_end(args);
}

static const double *mean_of(const joint_model *m, size_t d)
{
    return m->whole->model.mean + 3 * m->folder.part[d].first;
}

/* x (J_d x 3): particles of part d in the input's frame, turned to the model's side. */
static void turned(const joint_model *m, const joint_subject_fit *s, size_t d, double *x)
{
    const size_t n = 3 * m->folder.part[d].J;
    memcpy(x, s->part[d].original, n * sizeof *x);
    for (size_t k = 0; s->mirrored && k < n; k += 3) x[k] = -x[k];
}

/* Particles of the fitted parts (or of `only` one of them) of x and of the mean, packed. */
static size_t pack_pairs(const joint_model *m, const joint_subject_fit *s, size_t only,
                         const double *x, double *from, double *to)
{
    size_t n = 0;
    for (size_t d = 0; d < m->n; d++) {
        const model_part *p = &m->folder.part[d];
        if (!s->fitted[d] || (only < m->n && d != only)) continue;
        memcpy(from + 3 * n, x + 3 * p->first, 3 * p->J * sizeof *from);
        memcpy(to + 3 * n, mean_of(m, d), 3 * p->J * sizeof *to);
        n += p->J;
    }
    return n;
}

/* M (n x 16, out): the maps that lay x (J x 3, turned) on the mean as the cohort was laid. */
static apsm_status align(const joint_model *m, const joint_subject_fit *s, const double *x,
                         double *M)
{
    const size_t J = m->folder.J;
    double *from = malloc(6 * J * sizeof *from);
    if (!from) return APSM_ERR_MEMORY;
    double *to = from + 3 * J;
    for (size_t d = 0; d < m->n; d++) {
        size_t only = m->n;
        if (m->alignment == APSM_JOINT_APART) only = s->fitted[d] ? d : m->n;
        if (m->alignment == APSM_JOINT_BY && s->fitted[m->align_by]) only = m->align_by;
        apsm_affine_identity(M + 16 * d);
        if (!m->aligned) continue;
        const size_t n = pack_pairs(m, s, only, x, from, to);
        apsm_affine_fit(n, from, to, NULL, m->scale, M + 16 * d);
    }
    free(from);
    return APSM_OK;
}

/* ---- what is missing ---- */

static posterior_model posterior_of_joint(const joint_model *m)
{
    const apsm_shape_model *s = &m->whole->model;
    const fit_calibration *c = &m->whole->calibration;
    return (posterior_model){ 3 * s->J, (size_t)c->modes, s->mean,
                              s->mode,  s->variance,      c->noise * m->whole->h * m->whole->h };
}

/* Means and deviations of the particles of missing parts to s->world and s->sd. */
static apsm_status take_missing(const joint_model *m, const posterior_model *q, const double *error,
                                joint_subject_fit *s)
{
    const size_t D = q->D, M = q->M;
    double *x = malloc((4 * D + M + M * M + posterior_particles_work_size(q)) * sizeof *x);
    if (!x) return APSM_ERR_MEMORY;
    double *block = x + D, *b = block + 3 * D, *B = b + M;
    posterior_scores scores = { .b = b, .B = B };
    const apsm_status status =
        posterior_of_particles(q, s->world, error, &scores, x, block, B + M * M);
    for (size_t d = 0; d < m->n && status == APSM_OK; d++) {
        const model_part *p = &m->folder.part[d];
        if (s->fitted[d]) continue;
        memcpy(s->world + 3 * p->first, x + 3 * p->first, 3 * p->J * sizeof *x);
        for (size_t j = p->first; j < p->first + p->J; j++)
            s->sd[j] = m->band[d] * sqrt((block[9 * j] + block[9 * j + 4] + block[9 * j + 8]) / 3);
    }
    free(x);
    return status;
}

static apsm_status complete(const joint_model *m, joint_subject_fit *s)
{
    const posterior_model q = posterior_of_joint(m);
    const bool free_pose = joint_pose_is_free(m, s->fitted);
    joint_posterior p = { 0 };
    double *error = malloc(m->folder.J * sizeof *error);
    apsm_status status = error ? joint_with_pose(m, free_pose, &q, &p) : APSM_ERR_MEMORY;
    for (size_t d = 0; d < m->n && error; d++)
        for (size_t j = 0; j < m->folder.part[d].J; j++)
            error[m->folder.part[d].first + j] = s->fitted[d] ? 0 : INFINITY;
    if (status == APSM_OK && free_pose) status = joint_find_pose(m, &p, q.M, error, s);
    if (status == APSM_OK) status = take_missing(m, &p.q, error, s);
    free(p.rows);
    free(error);
    return status;
}

/* ---- figures ---- */

static apsm_status score(const joint_model *m, joint_subject_fit *s)
{
    const apsm_shape_model *w = &m->whole->model;
    const fit_calibration *c = &m->whole->calibration;
    const size_t D = 3 * w->J, K = (size_t)c->modes;
    double d2 = 0, miss = 0, *x = malloc(D * sizeof *x);
    if (!x) return APSM_ERR_MEMORY;
    apsm_shape_model_scores(w, s->world, s->score);
    apsm_shape_model_synthesize(w, K, s->score, x);
    for (size_t k = 0; k < K; k++) d2 += s->score[k] * s->score[k] / w->variance[k];
    for (size_t k = 0; k < D; k++) miss += (s->world[k] - x[k]) * (s->world[k] - x[k]);
    free(x);
    s->mahalanobis = K > 0 ? sqrt(d2) : NAN;
    s->residual = sqrt(miss / (double)(D - K));
    s->tail = K > 0 ? fit_tail_mahalanobis(d2 / c->mahalanobis, (double)w->I, (double)K) : NAN;
    return APSM_OK;
}

/* The parts' fits in the frame of the world: pairs of them (n (n - 1) / 2) to s->contact. */
static apsm_status measure_contacts(const joint_model *m, joint_subject_fit *s)
{
    apsm_bvh **tree = calloc(m->n, sizeof(apsm_bvh *));
    apsm_mesh *mesh = calloc(m->n, sizeof *mesh);
    apsm_status status = tree && mesh ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t d = 0; d < m->n && status == APSM_OK; d++) {
        status = apsm_mesh_copy(&m->mean[d], &mesh[d]);
        if (status != APSM_OK) break;
        apsm_warp_apply(&m->warp[d], s->world + 3 * m->folder.part[d].first, mesh[d].V);
        status = apsm_bvh_build(&mesh[d], &tree[d]);
    }
    for (size_t a = 0, k = 0; a < m->n && status == APSM_OK; a++)
        for (size_t b = a + 1; b < m->n; b++)
            apsm_contact_measure(tree[a], tree[b], &s->contact[k++]);
    for (size_t d = 0; tree && mesh && d < m->n; d++) {
        apsm_bvh_free(tree[d]);
        apsm_mesh_free(&mesh[d]);
    }
    free(tree);
    free(mesh);
    return status;
}

static void judge(const joint_model *m, joint_subject_fit *s)
{
    for (size_t d = 0; d < m->n; d++)
        if (s->fitted[d] && s->part[d].verdict == APSM_FIT_REVIEW)
            object(s, APSM_FIT_REVIEW, "%.40s: %.180s", m->folder.part[d].name, s->part[d].reason);
    if (s->tail < tail_review)
        object(s, APSM_FIT_REVIEW,
               "as a whole far from the mean: Mahalanobis distance %.3g, beyond which one in %.0f "
               "lies",
               s->mahalanobis, fmin(1 / fmax(s->tail, 1e-12), 1e12));
}

/* All particles back to the frame of the input. */
static apsm_status to_original(const joint_model *m, joint_subject_fit *s)
{
    double F[16], back[16];
    apsm_affine_identity(F);
    if (s->mirrored) F[0] = -1;
    for (size_t d = 0; d < m->n; d++) {
        const model_part *p = &m->folder.part[d];
        apsm_affine_multiply(s->M + 16 * d, F, s->M + 16 * d);
        APSM_TRY(apsm_affine_invert(s->M + 16 * d, back));
        apsm_affine_apply(back, p->J, s->world + 3 * p->first, s->original + 3 * p->first);
    }
    return APSM_OK;
}

/* All particles in the world and in the input's frame; those of parts that are not fitted are what
 * the others let expect. */
static apsm_status lay(const joint_model *m, joint_subject_fit *s)
{
    double *x = malloc(3 * m->folder.J * sizeof *x);
    if (!x) return APSM_ERR_MEMORY;
    for (size_t d = 0; d < m->n; d++)
        if (s->fitted[d]) turned(m, s, d, x + 3 * m->folder.part[d].first);
    apsm_status status = align(m, s, x, s->M);
    for (size_t d = 0; d < m->n && status == APSM_OK; d++) {
        const model_part *p = &m->folder.part[d];
        if (s->fitted[d])
            apsm_affine_apply(s->M + 16 * d, p->J, x + 3 * p->first, s->world + 3 * p->first);
    }
    free(x);
    if (status == APSM_OK) status = complete(m, s);
    return status == APSM_OK ? to_original(m, s) : status;
}

apsm_status joint_put_together(apsm_context *ctx, const joint_model *m, joint_subject_fit *s)
{
    (void)ctx;
    APSM_TRY(lay(m, s));
    APSM_TRY(score(m, s));
    if (s->given == m->n) APSM_TRY(measure_contacts(m, s));
    judge(m, s);
    return APSM_OK;
}

/* ---- the parts of one subject ---- */

typedef struct fitting {
    const apsm_fit_settings *o;
    apsm_fit_options options;
    joint_job job;
    joint_model m;
    size_t *part_of;            /* job.n: number of the model's part */
    fit_reading *reading;       /* m.n */
    joint_subject_fit *subject; /* job.subjects */
    apsm_lock lock;
} fitting;

/* start: the pose to begin with, of that hand, or NULL. */
static apsm_status fit_part(apsm_context *ctx, const fitting *f, size_t d, const apsm_input_case *c,
                            int hand, const double *start, apsm_fit *fit)
{
    apsm_mesh mesh = { 0 };
    apsm_fit_options o = f->options;
    APSM_TRY(fit_read_surface(ctx, &f->reading[d], c, &mesh, &o.extent));
    o.hand = c->reflect && !start ? APSM_HAND_OTHER : hand;
    o.start = start;
    const apsm_status status = apsm_fit_surface(ctx, f->m.part[d], c->path, &mesh, &o, fit);
    apsm_mesh_free(&mesh);
    return status;
}

/* How much more the residuals speak for the other hand than for the same: below 0 the subject is of
 * the other side. */
static double evidence(const apsm_fit *fit)
{
    const double most = log(3), q = isfinite(fit->mirror_ratio) ? log(fit->mirror_ratio) : most;
    const double clear = fmin(fmax(q, 0), most);
    return fit->mirrored ? -clear : clear;
}

static const apsm_input_case *case_of(const fitting *f, size_t i, size_t k)
{
    const size_t input = f->job.subject[i].input[k];
    return input == APSM_NO_CASE ? NULL : &f->job.list.cases[input];
}

/* All parts of a subject are of one side: that which their residuals together prefer. */
static apsm_status settle_hand(apsm_context *ctx, const fitting *f, size_t i)
{
    joint_subject_fit *s = &f->subject[i];
    double sum = 0;
    for (size_t d = 0; d < f->m.n; d++)
        if (s->fitted[d]) sum += evidence(&s->part[d]);
    s->mirrored = sum < 0;
    for (size_t k = 0; k < f->job.n; k++) {
        const size_t d = f->part_of[k];
        if (!s->fitted[d] || s->part[d].mirrored == s->mirrored) continue;
        apsm_fit_free(&s->part[d]);
        const int hand = s->mirrored ? APSM_HAND_OTHER : APSM_HAND_SAME;
        APSM_TRY(fit_part(ctx, f, d, case_of(f, i, k), hand, NULL, &s->part[d]));
        s->fitted[d] = s->part[d].J > 0;
    }
    return APSM_OK;
}

/* Whether another pose of the part fits about as well. */
static bool is_turn_open(const joint_subject_fit *s, size_t d)
{
    return s->fitted[d] && !s->part[d].partial && s->part[d].runner_up < APSM_AMBIGUOUS_RATIO;
}

/* start (16, out): from the input to the part's world, by where s->original says that it is. */
static void start_of(const joint_model *m, const joint_subject_fit *s, size_t d, double *x,
                     double start[16])
{
    const model_part *p = &m->folder.part[d];
    double F[16];
    apsm_affine_identity(F);
    if (s->mirrored) F[0] = -1;
    apsm_affine_apply(F, p->J, s->original + 3 * p->first, x);
    apsm_affine_fit(p->J, x, m->part[d]->model.mean, NULL, m->scale, start);
    apsm_affine_multiply(start, F, start);
}

/* Part d anew from where the others let expect it; taken if it fits there about as well. */
static apsm_status turn_part(apsm_context *ctx, const fitting *f, size_t i, size_t k, double *x)
{
    joint_subject_fit *s = &f->subject[i];
    const size_t d = f->part_of[k];
    const int hand = s->mirrored ? APSM_HAND_OTHER : APSM_HAND_SAME;
    double start[16];
    apsm_fit fit = { 0 };
    start_of(&f->m, s, d, x, start);
    APSM_TRY(fit_part(ctx, f, d, case_of(f, i, k), hand, start, &fit));
    const bool better =
        fit.J > 0 && fit.pose_residual <= APSM_GIVEN_RATIO * s->part[d].pose_residual;
    apsm_fit *gone = better ? &s->part[d] : &fit;
    const apsm_fit kept = better ? fit : s->part[d];
    apsm_fit_free(gone);
    s->part[d] = kept;
    return APSM_OK;
}

/* s->fitted <- of those that were, the ones whose turn is told by their own surface: at least the
 * one of which it is told best.  Returns how many are not. */
static size_t leave_sure(size_t n, const bool *was, joint_subject_fit *s)
{
    size_t open = 0, sure = 0, best = n;
    for (size_t d = 0; d < n; d++) {
        s->fitted[d] = was[d];
        if (!is_turn_open(s, d)) continue;
        if (best == n || s->part[d].runner_up > s->part[best].runner_up) best = d;
    }
    for (size_t d = 0; d < n; d++) {
        const bool is_open = is_turn_open(s, d);
        if (is_open) s->fitted[d] = false;
        open += is_open;
        sure += s->fitted[d];
    }
    if (sure > 0 || open == 0) return open;
    s->fitted[best] = true;
    return open - 1;
}

/* Parts whose own surface does not tell how they are turned: the others do, if there are any. */
static apsm_status settle_turns(apsm_context *ctx, const fitting *f, size_t i)
{
    joint_subject_fit *s = &f->subject[i];
    const size_t n = f->m.n;
    bool *was = malloc(2 * n * sizeof *was), *open = was + n;
    double *x = malloc(3 * f->m.folder.J * sizeof *x);
    apsm_status status = was && x ? APSM_OK : APSM_ERR_MEMORY;
    size_t number = 0;
    if (status == APSM_OK) {
        memcpy(was, s->fitted, n * sizeof *was);
        number = leave_sure(n, was, s);
        if (number > 0) status = lay(&f->m, s);
        for (size_t d = 0; d < n; d++) open[d] = was[d] && !s->fitted[d];
        memcpy(s->fitted, was, n * sizeof *was);
    }
    for (size_t k = 0; k < f->job.n && status == APSM_OK && number > 0; k++)
        if (open[f->part_of[k]]) status = turn_part(ctx, f, i, k, x);
    free(was);
    free(x);
    return status;
}

static bool alloc_subject(const joint_model *m, joint_subject_fit *s)
{
    const size_t n = m->n, J = m->folder.J;
    s->path = calloc(n, sizeof *s->path);
    s->sha256 = calloc(n, sizeof *s->sha256);
    s->part = calloc(n, sizeof *s->part);
    s->fitted = calloc(n, sizeof *s->fitted);
    s->M = calloc(16 * n, sizeof *s->M);
    s->world = calloc(6 * J, sizeof *s->world);
    s->sd = calloc(J, sizeof *s->sd);
    s->score = calloc(m->whole->model.modes + 1, sizeof *s->score);
    s->contact = calloc(n * n, sizeof *s->contact);
    s->original = s->world ? s->world + 3 * J : NULL;
    return s->path && s->sha256 && s->part && s->fitted && s->M && s->world && s->sd && s->score &&
           s->contact;
}

/* What only a subject's files need; the tables' figures stay. */
static void forget_arrays(const joint_model *m, joint_subject_fit *s)
{
    for (size_t d = 0; s->part && d < m->n; d++) {
        apsm_fit *p = &s->part[d];
        const apsm_fit figures = *p;
        char reason[APSM_FIT_REASON];
        memcpy(reason, p->reason, sizeof reason);
        apsm_fit_free(p);
        p->verdict = figures.verdict;
        p->mirrored = figures.mirrored;
        p->distance = figures.distance;
        p->has_distance = figures.has_distance;
        p->tail = figures.tail;
        p->mahalanobis = figures.mahalanobis;
        memcpy(p->reason, reason, sizeof reason);
    }
    free(s->world);
    free(s->sd);
    s->world = s->original = s->sd = NULL;
}

static void free_subject(const joint_model *m, joint_subject_fit *s)
{
    forget_arrays(m, s);
    free(s->path);
    free(s->sha256);
    free(s->part);
    free(s->fitted);
    free(s->M);
    free(s->score);
    free(s->contact);
}

static apsm_status fit_parts(apsm_context *ctx, const fitting *f, size_t i)
{
    joint_subject_fit *s = &f->subject[i];
    for (size_t k = 0; k < f->job.n; k++) {
        const size_t d = f->part_of[k];
        const apsm_input_case *c = case_of(f, i, k);
        if (!c) continue;
        s->path[d] = c->path;
        s->given++;
        APSM_TRY(apsm_input_hash(ctx, c->path, s->sha256[d]));
        APSM_TRY(fit_part(ctx, f, d, c, f->options.hand, NULL, &s->part[d]));
        s->fitted[d] = s->part[d].J > 0;
        if (s->fitted[d]) continue;
        s->refused++;
        object(s, APSM_FIT_REFUSED, "%.40s: %.180s", f->m.folder.part[d].name, s->part[d].reason);
    }
    return APSM_OK;
}

/* A failure of one subject does not end the call. */
static apsm_status fail_subject(apsm_context *ctx, joint_subject_fit *s, apsm_status status)
{
    const char *line = apsm_error_text(ctx);
    if (status == APSM_ERR_MEMORY || status == APSM_ERR_INTERRUPTED) return status;
    s->failed = true;
    snprintf(s->reason, sizeof s->reason, "%s", *line ? line : apsm_status_text(status));
    return APSM_OK;
}

static apsm_status fit_subject(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    fitting *f = user;
    joint_subject_fit *s = &f->subject[i];
    s->name = f->job.subject[i].name;
    if (!alloc_subject(&f->m, s)) return APSM_ERR_MEMORY;
    apsm_status status = fit_parts(ctx, f, i);
    if (status == APSM_OK && s->refused == 0) {
        status = settle_hand(ctx, f, i);
        if (status == APSM_OK) status = settle_turns(ctx, f, i);
        if (status == APSM_OK) status = joint_put_together(ctx, &f->m, s);
        if (status == APSM_OK) status = joint_fit_write_subject(ctx, f->o->folder, &f->m, s);
    }
    if (status != APSM_OK) status = fail_subject(ctx, s, status);
    forget_arrays(&f->m, s);
    return status;
}

/* ---- all ---- */

/* The model's part of each that is named; each has its options of reading. */
static apsm_status match_parts(apsm_context *ctx, fitting *f)
{
    f->part_of = malloc((f->job.n + 1) * sizeof *f->part_of);
    f->reading = calloc(f->m.n + 1, sizeof *f->reading);
    if (!f->part_of || !f->reading) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < f->job.n; k++) {
        size_t d = 0;
        while (d < f->m.n && strcmp(f->m.folder.part[d].name, f->job.part[k].name) != 0) d++;
        if (d == f->m.n)
            return apsm_fail(ctx, APSM_ERR_ARG, "--parts: %s has no part '%s'; its first is '%s'",
                             f->m.folder.path, f->job.part[k].name, f->m.folder.part[0].name);
        f->part_of[k] = d;
        const char *labels = f->job.by_label ? f->job.part[k].what : f->o->labels;
        APSM_TRY(apsm_labels_parse(ctx, labels ? labels : "", &f->reading[d].labels));
        f->reading[d].groom = fit_model_groom(f->m.part[d]);
    }
    return APSM_OK;
}

static apsm_status open_folder(apsm_context *ctx, const apsm_fit_settings *o, apsm_lock *lock)
{
    static const char *const files[] = { JOINT_FIT_CSV };
    static const char *const folders[] = { "particles", "meshes" };
    const fit_folder f = { .path = o->folder,
                           .what = "fits",
                           .maker = "fit",
                           .marker = JOINT_FIT_JSON,
                           .files = 1,
                           .file = files,
                           .folders = 2,
                           .folder = folders,
                           .overwrite = o->overwrite };
    APSM_TRY(fit_folder_lock(ctx, &f, lock));
    return fit_folder_make(ctx, &f);
}

/* --parts of the model's own making, unless they were its project's domains or are given. */
static const char *parts_of(const joint_model *m, const char *given)
{
    const char *made =
        json_string_value(json_object_get(json_object_get(m->folder.manifest, "options"), "parts"));
    if (given) return given;
    return made && strcmp(made, "domains") != 0 ? made : NULL;
}

static apsm_status open_fitting(apsm_context *ctx, fitting *f, const char *parts,
                                joint_settings *js, const char *set[][2])
{
    const apsm_fit_settings *o = f->o;
    APSM_TRY(joint_model_load(ctx, o->model, &f->m));
    if (o->landmarks)
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "%s: is a joint model; landmarks alone are fitted by models of one part",
                         o->model);
    if (f->options.aligned)
        return apsm_fail(
            ctx, APSM_ERR_UNSUPPORTED,
            "--aligned: the parts of a joint are searched for one by one; leave it out");
    js->parts = parts_of(&f->m, parts);
    js->run.folder = o->model;
    js->run.n_inputs = o->n_inputs;
    js->run.inputs = o->inputs;
    const char *const keys[] = { "exclude", "reflect_match", "labels" };
    const char *const values[] = { o->exclude, o->reflect_match, o->labels };
    for (size_t k = 0; k < 3; k++) {
        if (!values[k] || !*values[k]) continue;
        set[js->run.n_set][0] = keys[k];
        set[js->run.n_set++][1] = values[k];
    }
    js->run.set = (const char *const(*)[2])set;
    f->job = (joint_job){ .ctx = ctx, .settings = js, .fits = true };
    APSM_TRY(joint_parse(&f->job));
    APSM_TRY(match_parts(ctx, f));
    APSM_TRY(joint_group(&f->job));
    APSM_TRY(open_folder(ctx, o, &f->lock));
    f->subject = calloc(f->job.subjects + 1, sizeof *f->subject);
    return f->subject ? APSM_OK : APSM_ERR_MEMORY;
}

static void count(apsm_context *ctx, const fitting *f, apsm_fit_totals *totals)
{
    size_t *of[] = { &totals->good, &totals->review, &totals->refused };
    for (size_t i = 0; i < f->job.subjects; i++) {
        const joint_subject_fit *s = &f->subject[i];
        ++*(s->failed ? &totals->failed : of[s->verdict]);
        if (s->failed || s->verdict != APSM_FIT_GOOD)
            apsm_log(ctx, APSM_LOG_WARNING, "%s: %s: %s", s->name,
                     s->failed ? "failed" : apsm_fit_verdict_text(s->verdict), s->reason);
        else if (s->given < f->m.n)
            apsm_log(ctx, APSM_LOG_INFO, "%s: %zu of %zu parts are what the others let expect",
                     s->name, f->m.n - s->given, f->m.n);
    }
}

static void close_fitting(fitting *f)
{
    for (size_t i = 0; f->subject && i < f->job.subjects; i++) free_subject(&f->m, &f->subject[i]);
    for (size_t d = 0; f->reading && d < f->m.n; d++) apsm_labels_free(&f->reading[d].labels);
    free(f->subject);
    free(f->reading);
    free(f->part_of);
    joint_job_free(&f->job);
    joint_model_free(&f->m);
    apsm_unlock_folder(&f->lock);
}

apsm_status apsm_joint_fit_sized(apsm_context *ctx, const apsm_fit_settings *given, size_t size,
                                 const char *parts, apsm_fit_totals *totals, size_t totals_size)
{
    apsm_fit_settings known = { 0 }, *const settings = &known;
    apsm_fit_totals counted = { 0 };
    fitting f = { .o = settings };
    joint_settings js = { 0 };
    const char *set[3][2];
    if (!totals) return apsm_fail(ctx, APSM_ERR_ARG, "apsm_joint_fit: no place for the totals");
    APSM_TRY(fit_take_settings(ctx, "apsm_joint_fit", given, size, settings, &f.options));
    if (settings->shards > 0)
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "%s: fits of joints are not made in shares; leave --shard out",
                         settings->model);
    apsm_status status = open_fitting(ctx, &f, parts, &js, set);
    if (status == APSM_OK) status = apsm_parallel_for(ctx, f.job.subjects, fit_subject, &f, "fit");
    if (status == APSM_OK)
        status = joint_fit_write_tables(ctx, settings, &f.m, f.job.subjects, f.subject);
    if (status == APSM_OK) count(ctx, &f, &counted);
    apsm_give_sized(&counted, sizeof counted, totals, totals_size);
    close_fitting(&f);
    return status;
}
