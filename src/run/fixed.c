#include "run/fixed.h"
#include "run/source.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/particles_file.h"
#include "files/project_columns.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "landmarks/landmark_table.h"

enum { LEAST_PARTICLES = 7, MOST_BYTES = 1 << 28 };
/* World particles, against their extent, are the local ones moved; local ones, in spacings, are on
 * the groomed surface. */
static const double same_place = 1e-3, on_surface = 0.25;

/* A file as it is. */
typedef struct text {
    char *bytes; /* NULL: none */
    size_t size;
} text;

typedef struct fixed_shape {
    bool is, mirrored, posed;
    double pose[16];
    text local, world;
    double *P; /* J x 3, local; NULL if not fixed */
} fixed_shape;

struct fixed_shapes {
    size_t I, J, n;
    fixed_shape *shape; /* I */
};

void fixed_free(struct fixed_shapes *f)
{
    if (!f) return;
    for (size_t i = 0; f->shape && i < f->I; i++) {
        free(f->shape[i].local.bytes);
        free(f->shape[i].world.bytes);
        free(f->shape[i].P);
    }
    free(f->shape);
    free(f);
}

/* ---- which ---- */

static bool is_in_list(const char *list, const char *name)
{
    for (const char *at = list; *at;) {
        const size_t length = strcspn(at, ",");
        if (strlen(name) == length && strncmp(at, name, length) == 0) return true;
        at += length + (at[length] == ',');
    }
    return false;
}

static bool is_wanted(const char *option, const apsm_project *p, const apsm_subject *s)
{
    if (source_is_fixed(p, s) || is_in_list(option, s->name)) return true;
    return strcmp(option, "all") == 0 && s->local_particles;
}

/* Every name of the option is that of a shape. */
static apsm_status check_names(apsm_run *run, const char *option, const apsm_input_list *list)
{
    char name[APSM_KEY_LENGTH];
    if (strcmp(option, "all") == 0) return APSM_OK;
    for (const char *at = option; *at;) {
        const size_t length = strcspn(at, ",");
        size_t i = 0;
        snprintf(name, sizeof name, "%.*s", (int)length, at);
        while (i < list->n && strcmp(list->cases[i].name, name) != 0) i++;
        if (i == list->n)
            return apsm_fail(run->ctx, APSM_ERR_ARG,
                             "--fixed: '%s' is none of the %zu shapes; the first is called '%s'",
                             name, list->n, list->cases[0].name);
        at += length + (at[length] == ',');
    }
    return APSM_OK;
}

/* ---- what the project gives ---- */

static apsm_status read_text(apsm_context *ctx, const char *path, text *t)
{
    return path ? apsm_read_file(ctx, path, MOST_BYTES, &t->bytes, &t->size) : APSM_ERR_MEMORY;
}

/* Where particles of the project are; of the run's own project, those that it has kept. */
static char *stored_path(const apsm_run *run, const groom_inputs *in, const apsm_project *p,
                         const apsm_subject *s, const char *frame, const char *stored)
{
    if (in->own_source && fixed_is(s))
        return run_pathf(run, "fixed/%s_%s.particles", s->name, frame);
    return apsm_project_path(p, stored);
}

static apsm_status no_particles(apsm_run *run, const apsm_project *p, const apsm_subject *s)
{
    char key[APSM_KEY_LENGTH];
    return apsm_fail(run->ctx, APSM_ERR_FORMAT,
                     "%s is fixed, and the project gives no particles of it (column %s); give "
                     "them, or go on without by --ignore fixed",
                     s->name, apsm_project_key(p, "local_particles_", key));
}

static double extent(size_t J, const double *P)
{
    double low[3], high[3];
    memcpy(low, P, sizeof low);
    memcpy(high, P, sizeof high);
    for (size_t x = 0; x < 3 * J; x++) {
        low[x % 3] = fmin(low[x % 3], P[x]);
        high[x % 3] = fmax(high[x % 3], P[x]);
    }
    return sqrt(vec3_distance2(low, high));
}

/* World particles that are given must be the local ones, moved by the pose. */
static apsm_status check_world(apsm_run *run, const char *path, const char *name, size_t J,
                               const fixed_shape *f)
{
    double *W = malloc(6 * J * sizeof *W), most = 0;
    if (!W) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_particles_read_n(run->ctx, path, J, W);
    if (status == APSM_OK) {
        apsm_affine_apply(f->pose, J, f->P, W + 3 * J);
        for (size_t j = 0; j < J; j++)
            most = fmax(most, sqrt(vec3_distance2(W + 3 * j, W + 3 * (J + j))));
        most /= extent(J, W + 3 * J);
    }
    free(W);
    if (status != APSM_OK || most <= same_place) return status;
    return apsm_fail(run->ctx, APSM_ERR_FORMAT,
                     "%s: %s: not the local particles moved by alignment and procrustes of the "
                     "project, but up to %.2g of the shape's size away",
                     path, name, most);
}

static apsm_status read_world(apsm_run *run, const groom_inputs *in, const apsm_project *p,
                              const apsm_subject *s, size_t J, fixed_shape *f)
{
    if (!f->posed || !s->world_particles) return APSM_OK;
    char *path = stored_path(run, in, p, s, "world", s->world_particles);
    apsm_status status = read_text(run->ctx, path, &f->world);
    if (status == APSM_OK) status = check_world(run, path, s->name, J, f);
    free(path);
    return status;
}

static apsm_status read_shape(apsm_run *run, const groom_inputs *in, const apsm_project *p,
                              const apsm_subject *s, size_t i)
{
    struct fixed_shapes *all = in->fixed;
    fixed_shape *f = &all->shape[i];
    size_t J;
    if (!s->local_particles && !(in->own_source && fixed_is(s))) return no_particles(run, p, s);
    char *path = stored_path(run, in, p, s, "local", s->local_particles);
    apsm_status status = read_text(run->ctx, path, &f->local);
    if (status == APSM_OK) status = apsm_particles_read(run->ctx, path, &J, &f->P);
    if (status == APSM_OK && all->n > 0 && J != all->J)
        status = apsm_fail(run->ctx, APSM_ERR_FORMAT,
                           "%s: %zu particles, and other fixed shapes have %zu", path, J, all->J);
    free(path);
    APSM_TRY(status);
    f->is = true;
    f->mirrored = s->mirrored;
    /* Where a subject's parts lie in the frame of all says nothing of the frame of one part. */
    f->posed = !run->surroundings && (s->has_alignment || s->has_procrustes);
    apsm_affine_multiply(s->procrustes, s->alignment, f->pose);
    all->J = J;
    all->n++;
    return read_world(run, in, p, s, J, f);
}

static apsm_status read_all(apsm_run *run, groom_inputs *in, const apsm_project *p)
{
    const char *option = apsm_run_text(run, "fixed");
    for (size_t i = 0; i < in->list.n; i++) {
        const size_t k = apsm_project_find(p, in->list.cases[i].name);
        if (k < p->n && is_wanted(option, p, &p->subjects[k]))
            APSM_TRY(read_shape(run, in, p, &p->subjects[k], i));
    }
    return APSM_OK;
}

/* ---- what does not go together ---- */

static apsm_status check_poses(apsm_run *run, const groom_inputs *in)
{
    const struct fixed_shapes *f = in->fixed;
    size_t posed = 0, other = 0;
    for (size_t i = 0; i < f->I; i++) {
        if (!f->shape[i].is) continue;
        posed += f->shape[i].posed;
        if (!f->shape[i].posed) other = i;
        if (f->shape[i].posed && !(apsm_affine_det(f->shape[i].pose) > 0))
            return apsm_fail(run->ctx, APSM_ERR_FORMAT,
                             "%s is fixed, and its alignment mirrors or flattens it",
                             in->list.cases[i].name);
    }
    if (posed == 0 || posed == f->n) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_ARG,
                     "%s is fixed and has no alignment in the project, while other fixed shapes "
                     "have one; give it to all of them or to none",
                     in->list.cases[other].name);
}

static bool has_constraints(const groom_inputs *in)
{
    for (size_t i = 0; in->limits && i < in->list.n; i++)
        if (in->limits[i]) return true;
    return false;
}

static apsm_status refuse_movers(apsm_run *run, const groom_inputs *in)
{
    const apsm_optimize_options *o = &run->options.optimize;
    const char *what = NULL;
    if (o->method == APSM_METHOD_PSM) what = "method psm";
    if (o->search.particles_auto) what = "particles_auto";
    if (run->options.landmarks.landmarks_use == APSM_LANDMARKS_HOLD) what = "landmarks that hold";
    if (run->options.cuts.cuts == APSM_CUTS_CROP) what = "cropping";
    if (has_constraints(in)) what = "constraints";
    if (!what) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_UNSUPPORTED,
                     "fixed shapes and %s do not go together: their particles would have to change",
                     what);
}

static apsm_status check_template(apsm_run *run, const groom_inputs *in)
{
    const struct fixed_shapes *f = in->fixed;
    size_t t;
    APSM_TRY(groom_inputs_template(run, in, &t));
    if (t >= f->I || f->shape[t].is) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_ARG,
                     "template '%s' is not fixed: where some shapes are, their particles are "
                     "carried to the others, and the template must be one of them",
                     in->list.cases[t].name);
}

/* As many particles as the fixed shapes have: another number that was asked for is a contradiction.
 */
static apsm_status take_number(apsm_run *run, size_t J)
{
    char number[32];
    const long asked = run->options.optimize.particles;
    if (asked == (long)J) return APSM_OK;
    if (asked != apsm_options_defaults().optimize.particles)
        return apsm_fail(run->ctx, APSM_ERR_ARG,
                         "%ld particles are asked for, and fixed shapes have %zu: drop -J", asked,
                         J);
    apsm_log(run->ctx, APSM_LOG_INFO, "%zu particles, as the fixed shapes have", J);
    snprintf(number, sizeof number, "%zu", J);
    APSM_TRY(apsm_options_set(run->ctx, &run->options, "particles", number));
    return apsm_project_set(&run->project, "apsm", "particles", number);
}

static apsm_status check_all(apsm_run *run, const groom_inputs *in)
{
    const struct fixed_shapes *f = in->fixed;
    if (f->n == f->I)
        return apsm_fail(run->ctx, APSM_ERR_ARG,
                         "all %zu shapes are fixed: there is nothing to optimise; `apsm import` "
                         "makes a model of particles as they are",
                         f->I);
    if (f->J < LEAST_PARTICLES)
        return apsm_fail(run->ctx, APSM_ERR_ARG, "fixed shapes with %zu particles; %d are needed",
                         f->J, LEAST_PARTICLES);
    APSM_TRY(refuse_movers(run, in));
    APSM_TRY(check_poses(run, in));
    APSM_TRY(check_template(run, in));
    return take_number(run, f->J);
}

apsm_status fixed_find(apsm_run *run, groom_inputs *in, const apsm_project *source, bool ignored)
{
    const char *option = apsm_run_text(run, "fixed");
    if (!source && *option)
        return apsm_fail(run->ctx, APSM_ERR_ARG,
                         "--fixed %s: only a project gives particles of its shapes; give one as "
                         "input (or add shapes to a finished model by `apsm add`)",
                         option);
    if (ignored && *option)
        return apsm_fail(run->ctx, APSM_ERR_ARG,
                         "--fixed and --ignore fixed contradict each other");
    if (!source || ignored) return APSM_OK;
    APSM_TRY(check_names(run, option, &in->list));
    in->fixed = calloc(1, sizeof *in->fixed);
    if (!in->fixed) return APSM_ERR_MEMORY;
    in->fixed->I = in->list.n;
    in->fixed->shape = calloc(in->list.n, sizeof *in->fixed->shape);
    if (!in->fixed->shape) return APSM_ERR_MEMORY;
    APSM_TRY(read_all(run, in, source));
    if (in->fixed->n > 0) return check_all(run, in);
    fixed_free(in->fixed);
    in->fixed = NULL;
    if (!*option) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_ARG,
                     "--fixed all: the project gives particles of no shape");
}

/* ---- template and poses ---- */

void fixed_prefer(const groom_inputs *in, bool *unfit)
{
    for (size_t i = 0; in->fixed && i < in->fixed->I; i++)
        unfit[i] = unfit[i] || !in->fixed->shape[i].is;
}

void fixed_trust(const groom_inputs *in, apsm_alignment *a)
{
    for (size_t i = 0; in->fixed && i < in->fixed->I; i++)
        if (in->fixed->shape[i].is && in->fixed->shape[i].posed)
            a->ambiguous[i] = a->sought[i] = a->mirrored[i] = a->unclear_hand[i] = false;
}

/* Whoever chose may have had too few shapes to choose from. */
static void settle_template(const struct fixed_shapes *f, apsm_alignment *a)
{
    size_t best = f->I;
    if (f->shape[a->template_index].is) return;
    for (size_t i = 0; i < f->I; i++)
        if (f->shape[i].is && (best == f->I || a->residual[i] < a->residual[best])) best = i;
    a->template_index = best;
}

typedef struct looking {
    const groom_inputs *in;
    double *away; /* I: mean distance of the particles from the surface, in their spacing */
} looking;

static apsm_status look_at_surface(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    const looking *l = user;
    const struct fixed_shapes *f = l->in->fixed;
    const apsm_mesh *mesh = &l->in->mesh[i];
    double sum = 0;
    apsm_bvh *bvh = NULL;
    if (!f->shape[i].is) return APSM_OK;
    APSM_TRY(apsm_bvh_build(mesh, &bvh));
    for (size_t j = 0; j < f->J; j++) {
        apsm_closest c;
        apsm_bvh_closest(bvh, f->shape[i].P + 3 * j, INFINITY, &c);
        sum += sqrt(c.distance2);
    }
    apsm_bvh_free(bvh);
    l->away[i] = sum / (double)f->J / apsm_expected_spacing(apsm_mesh_area(mesh), f->J);
    return APSM_OK;
}

static apsm_status check_surfaces(apsm_run *run, const groom_inputs *in)
{
    const struct fixed_shapes *f = in->fixed;
    looking l = { in, calloc(f->I, sizeof *l.away) };
    if (!l.away) return APSM_ERR_MEMORY;
    apsm_status status = apsm_parallel_for(run->ctx, f->I, look_at_surface, &l, NULL);
    for (size_t i = 0; i < f->I && status == APSM_OK; i++)
        if (!(l.away[i] <= on_surface))
            status = apsm_fail(run->ctx, APSM_ERR_GEOMETRY,
                               "%s is fixed, and its particles are %.2g spacings away from its "
                               "groomed surface on average: they are of another shape, frame or "
                               "hand, or it was groomed otherwise",
                               in->list.cases[i].name, l.away[i]);
    free(l.away);
    return status;
}

apsm_status fixed_settle(apsm_run *run, const groom_inputs *in, bool cropped, apsm_alignment *a)
{
    const struct fixed_shapes *f = in->fixed;
    double back[16], move[16];
    if (!f) return APSM_OK;
    if (cropped)
        return apsm_fail(run->ctx, APSM_ERR_UNSUPPORTED,
                         "shapes were cut off at different places, and fixed ones cannot be "
                         "cropped; keep all as they are (--cuts keep)");
    for (size_t i = 0; i < f->I; i++)
        if (f->shape[i].is && f->shape[i].mirrored != in->reflected[i])
            return apsm_fail(run->ctx, APSM_ERR_UNSUPPORTED,
                             "%s is fixed with particles of the %s shape, and was groomed as %s",
                             in->list.cases[i].name,
                             f->shape[i].mirrored ? "mirrored" : "unmirrored",
                             in->reflected[i] ? "mirrored" : "it is");
    APSM_TRY(check_surfaces(run, in));
    settle_template(f, a);
    const fixed_shape *t = &f->shape[a->template_index];
    if (!t->posed) return APSM_OK;
    APSM_TRY(apsm_affine_invert(a->M + 16 * a->template_index, back));
    apsm_affine_multiply(t->pose, back, move);
    for (size_t i = 0; i < f->I; i++) {
        double *M = a->M + 16 * i, moved[16];
        apsm_affine_multiply(move, M, moved);
        memcpy(M, f->shape[i].is ? f->shape[i].pose : moved, sizeof moved);
    }
    return APSM_OK;
}

/* ---- files ---- */

static apsm_status write_text(apsm_context *ctx, const char *path, const text *t)
{
    apsm_writer *w = NULL;
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    apsm_writer_write(w, t->bytes, t->size);
    return apsm_writer_commit(w);
}

static apsm_status write_world(apsm_run *run, const fixed_shape *f, size_t J, const double M[16],
                               const char *path)
{
    if (f->world.bytes) return write_text(run->ctx, path, &f->world);
    double *W = malloc(3 * J * sizeof *W);
    if (!W) return APSM_ERR_MEMORY;
    apsm_affine_apply(M, J, f->P, W);
    const apsm_status status = apsm_particles_write(run->ctx, path, J, W);
    free(W);
    return status;
}

static apsm_status write_shape(apsm_run *run, const groom_inputs *in, size_t i, const double M[16])
{
    const char *name = in->list.cases[i].name;
    const fixed_shape *f = &in->fixed->shape[i];
    char *local = run_pathf(run, "fixed/%s_local.particles", name),
         *world = run_pathf(run, "fixed/%s_world.particles", name);
    apsm_status status = local && world ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = write_text(run->ctx, local, &f->local);
    if (status == APSM_OK) status = write_world(run, f, in->fixed->J, M, world);
    free(local);
    free(world);
    return status;
}

static bool is_fixed(const groom_inputs *in, size_t i)
{
    return in->fixed && in->fixed->shape[i].is;
}

apsm_status fixed_write(apsm_run *run, const groom_inputs *in, const apsm_alignment *a)
{
    for (size_t i = 0; i < in->list.n; i++) {
        const char *name = in->list.cases[i].name;
        if (is_fixed(in, i)) continue;
        APSM_TRY(run_remove(run, run_pathf(run, "fixed/%s_local.particles", name)));
        APSM_TRY(run_remove(run, run_pathf(run, "fixed/%s_world.particles", name)));
    }
    if (!in->fixed) return APSM_OK;
    char *folder = run_path(run, "fixed");
    apsm_status status = folder ? apsm_make_folder(run->ctx, folder) : APSM_ERR_MEMORY;
    free(folder);
    for (size_t i = 0; i < in->list.n && status == APSM_OK; i++)
        if (is_fixed(in, i)) status = write_shape(run, in, i, a->M + 16 * i);
    return status;
}

apsm_status fixed_mark(const groom_inputs *in, size_t i, apsm_subject *s)
{
    return apsm_subject_set_column(s, "fixed_particles", is_fixed(in, i) ? "yes" : NULL);
}

/* ---- of a run whose shapes are groomed ---- */

bool fixed_is(const apsm_subject *s)
{
    return apsm_says_yes(apsm_subject_column(s, "fixed_particles"));
}

apsm_status fixed_flag(apsm_run *run)
{
    apsm_cohort *c = &run->cohort;
    for (size_t i = 0; i < run->project.n; i++) {
        if (!fixed_is(&run->project.subjects[i])) continue;
        if (!c->fixed) c->fixed = calloc(c->I, sizeof *c->fixed);
        if (!c->fixed) return APSM_ERR_MEMORY;
        c->fixed[i] = true;
    }
    return APSM_OK;
}

apsm_status fixed_load(apsm_run *run, size_t J, double *P)
{
    for (size_t i = 0; i < run->project.n; i++) {
        const apsm_subject *s = &run->project.subjects[i];
        if (!fixed_is(s)) continue;
        char *path = run_pathf(run, "fixed/%s_world.particles", s->name);
        const apsm_status status =
            path ? apsm_particles_read_n(run->ctx, path, J, P + i * J * 3) : APSM_ERR_MEMORY;
        free(path);
        APSM_TRY(status);
    }
    return APSM_OK;
}

apsm_status fixed_copy(apsm_context *ctx, const apsm_run *run, const apsm_subject *s,
                       const char *frame, const char *path)
{
    text t = { 0 };
    char *from = run_pathf(run, "fixed/%s_%s.particles", s->name, frame);
    apsm_status status = read_text(ctx, from, &t);
    if (status == APSM_OK) status = write_text(ctx, path, &t);
    free(t.bytes);
    free(from);
    return status;
}

apsm_status fixed_hash(const apsm_run *run, apsm_sha256 *sha)
{
    static const char *const frames[] = { "local", "world" };
    for (size_t i = 0; i < run->project.n; i++) {
        const apsm_subject *s = &run->project.subjects[i];
        for (size_t k = 0; k < 2 && fixed_is(s); k++) {
            char hex[65], *path = run_pathf(run, "fixed/%s_%s.particles", s->name, frames[k]);
            const apsm_status status =
                path ? apsm_sha256_file(run->ctx, path, hex) : APSM_ERR_MEMORY;
            free(path);
            APSM_TRY(status);
            apsm_sha256_add_text(sha, s->name);
            apsm_sha256_add_text(sha, hex);
        }
    }
    return APSM_OK;
}
