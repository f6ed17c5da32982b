/* Two parts that touch: of every subject the surface that they share becomes a part of its own, and
 * they keep the rest; all three are open surfaces, whose rims correspond. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "assemble/job.h"
#include "core/number.h"
#include "files/files.h"
#include "groom/groom.h"
#include "initialize/cohort.h"
#include "joint/shared_boundary.h"
#include "options/options.h"

static const double usual_tolerance = 0.1; /* h */
#define EXTRACTED "extracted"

typedef struct sharing {
    joint_job *job;
    size_t part[3]; /* a, b, and what they share */
    double tolerance;
    apsm_options options;
} sharing;

/* ---- what is asked for ---- */

static apsm_status refuse(const joint_job *job, const char *why)
{
    return apsm_fail(job->ctx, APSM_ERR_ARG,
                     "--shared-boundary '%s': %s; write two parts of --parts, and after another "
                     "comma the tolerance in spacings if it is not 0.1",
                     job->settings->shared, why);
}

static size_t find_part(const joint_job *job, const char *name)
{
    size_t d = 0;
    while (d < job->n && strcmp(job->part[d].name, name) != 0) d++;
    return d;
}

static apsm_status parse(sharing *s, char *text)
{
    joint_job *job = s->job;
    char *rest = NULL, name[96];
    const char *a = strtok_r(text, ",", &rest), *b = strtok_r(NULL, ",", &rest),
               *tolerance = strtok_r(NULL, ",", &rest);
    s->tolerance = usual_tolerance;
    if (job->by_project) return refuse(job, "the parts are domains of a project");
    if (!a || !b || strtok_r(NULL, ",", &rest)) return refuse(job, "is not two parts");
    s->part[0] = find_part(job, a);
    s->part[1] = find_part(job, b);
    if (s->part[0] == job->n || s->part[1] == job->n || s->part[0] == s->part[1])
        return refuse(job, "is not two parts");
    if (tolerance && (!apsm_parse_number(tolerance, strlen(tolerance), &s->tolerance) ||
                      !(s->tolerance > 0.0 && s->tolerance <= 2.0)))
        return refuse(job, "the tolerance is no number up to 2");
    snprintf(name, sizeof name, "%.19s-%.19s", a, b);
    if (find_part(job, name) < job->n) return refuse(job, "a part has the name of what they share");
    s->part[2] = job->n;
    return joint_add_part(job, name, "shared boundary");
}

/* Of the options given, those of the method. */
static apsm_status take_options(sharing *s)
{
    const apsm_run_settings *run = &s->job->settings->run;
    char text[64];
    s->options = apsm_options_defaults();
    for (size_t k = 0; k < run->n_set; k++) {
        const char *key = run->set[k][0], *value = run->set[k][1];
        if (strcmp(key, "preset") == 0)
            APSM_TRY(apsm_options_preset(s->job->ctx, &s->options, value));
        else if (apsm_options_get(&s->options, key, text) == APSM_OK)
            APSM_TRY(apsm_options_set(s->job->ctx, &s->options, key, value));
    }
    return APSM_OK;
}

/* ---- one subject ---- */

static apsm_status read_part(apsm_context *ctx, const sharing *s, size_t i, int side,
                             apsm_mesh *mesh)
{
    const joint_job *job = s->job;
    const size_t d = s->part[side];
    const apsm_input_case *c = &job->list.cases[job->subject[i].input[d]];
    const apsm_groom_options opt = s->options.groom;
    apsm_labels labels = { 0 };
    apsm_input_shape shape = { 0 };
    if (job->by_label) APSM_TRY(apsm_labels_parse(ctx, job->part[d].what, &labels));
    apsm_status status = apsm_input_read(ctx, c, &labels, &shape);
    if (status == APSM_OK)
        status = shape.is_mesh
                     ? apsm_groom_mesh(ctx, c->path, &shape.mesh, &opt, mesh, NULL)
                     : groom_taken_segmentation(ctx, c->path, &shape.volume, &opt, mesh, NULL);
    apsm_input_shape_free(&shape);
    apsm_labels_free(&labels);
    return status;
}

/* MODEL_DIR/extracted/PART/NAME.ply */
static char *path_of(const sharing *s, size_t i, int which)
{
    const joint_job *job = s->job;
    char *folder = apsm_path_join(job->settings->run.folder, EXTRACTED);
    char *part = folder ? apsm_path_join(folder, job->part[s->part[which]].name) : NULL;
    char file[300], *path = NULL;
    snprintf(file, sizeof file, "%s.ply", job->subject[i].name);
    if (part && apsm_make_folder(job->ctx, folder) == APSM_OK &&
        apsm_make_folder(job->ctx, part) == APSM_OK)
        path = apsm_path_join(part, file);
    free(folder);
    free(part);
    return path;
}

/* The case takes the place of subject i's part. */
static apsm_status add_case(const sharing *s, size_t i, int which, char *path)
{
    joint_job *job = s->job;
    apsm_input_case *c = &job->list.cases[job->list.n];
    *c = (apsm_input_case){ .name = strdup(job->subject[i].name),
                            .path = path,
                            .kind = APSM_INPUT_MESH };
    job->subject[i].input[s->part[which]] = job->list.n++;
    return c->name ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status write_split(const sharing *s, size_t i, const apsm_shared_boundary *split)
{
    const apsm_mesh *const mesh[3] = { &split->rest[0], &split->rest[1], &split->shared };
    for (int k = 0; k < 3; k++) {
        char *path = path_of(s, i, k);
        if (!path) return APSM_ERR_MEMORY;
        const apsm_status status = apsm_write_mesh(s->job->ctx, path, mesh[k]);
        if (status != APSM_OK) {
            free(path);
            return status;
        }
        APSM_TRY(add_case(s, i, k, path));
    }
    return APSM_OK;
}

static apsm_status split_meshes(const sharing *s, size_t i, const apsm_mesh mesh[2])
{
    const joint_job *job = s->job;
    apsm_bvh *tree[2] = { NULL, NULL };
    apsm_shared_boundary split = { 0 };
    const double h =
        apsm_expected_spacing(apsm_mesh_area(&mesh[0]), (size_t)s->options.optimize.particles);
    apsm_status status = apsm_bvh_build_unsigned(&mesh[0], &tree[0]);
    if (status == APSM_OK) status = apsm_bvh_build_unsigned(&mesh[1], &tree[1]);
    if (status == APSM_OK) status = apsm_split_shared(tree[0], tree[1], s->tolerance * h, &split);
    if (status == APSM_ERR_GEOMETRY)
        status = apsm_fail(job->ctx, status,
                           "%s: its %s and %s do not touch: no part of one faces the other within "
                           "%.3g; raise the tolerance of --shared-boundary, or leave it out by "
                           "--exclude",
                           job->subject[i].name, job->part[s->part[0]].name,
                           job->part[s->part[1]].name, s->tolerance * h);
    if (status == APSM_OK) status = write_split(s, i, &split);
    apsm_shared_boundary_free(&split);
    apsm_bvh_free(tree[0]);
    apsm_bvh_free(tree[1]);
    return status;
}

static apsm_status split_subject(const sharing *s, size_t i)
{
    apsm_mesh mesh[2] = { { 0 }, { 0 } };
    apsm_status status = read_part(s->job->ctx, s, i, 0, &mesh[0]);
    if (status == APSM_OK) status = read_part(s->job->ctx, s, i, 1, &mesh[1]);
    if (status == APSM_OK) status = split_meshes(s, i, mesh);
    apsm_mesh_free(&mesh[0]);
    apsm_mesh_free(&mesh[1]);
    return status;
}

/* ---- all ---- */

/* Room for the new part and its cases; a subject that lacks a or b has neither any more. */
static apsm_status make_room(sharing *s)
{
    joint_job *job = s->job;
    apsm_input_case *cases =
        realloc(job->list.cases, (job->list.n + 3 * job->subjects) * sizeof *cases);
    if (!cases) return APSM_ERR_MEMORY;
    job->list.cases = cases;
    for (size_t i = 0; i < job->subjects; i++) {
        size_t *input = realloc(job->subject[i].input, job->n * sizeof *input);
        if (!input) return APSM_ERR_MEMORY;
        job->subject[i].input = input;
        input[job->n - 1] = APSM_NO_CASE;
        if (i >= job->complete) input[s->part[0]] = input[s->part[1]] = APSM_NO_CASE;
    }
    for (int k = 0; k < 3; k++) job->part[s->part[k]].open = true;
    return APSM_OK;
}

apsm_status joint_share(joint_job *job)
{
    sharing s = { .job = job };
    if (!job->settings->shared) return APSM_OK;
    char *text = strdup(job->settings->shared);
    apsm_status status = text ? parse(&s, text) : APSM_ERR_MEMORY;
    free(text);
    if (status == APSM_OK) status = take_options(&s);
    if (status == APSM_OK) status = make_room(&s);
    for (size_t i = 0; i < job->complete && status == APSM_OK; i++) {
        if (apsm_interrupted(job->ctx)) return APSM_ERR_INTERRUPTED;
        status = split_subject(&s, i);
    }
    if (status == APSM_OK)
        apsm_log(job->ctx, APSM_LOG_INFO,
                 "%s: what %s and %s share is a part of its own; all three are open surfaces",
                 job->part[s.part[2]].name, job->part[s.part[0]].name, job->part[s.part[1]].name);
    return status;
}
