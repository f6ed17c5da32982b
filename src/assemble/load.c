/* The models of the parts, put together as the parts lie in every subject.
 *
 * A part's particles are known on its groomed mesh, which is the input's surface in the input's own
 * frame, or for mirrored shapes its image R x.  All parts of a subject share the input's frame x;
 * so the groomed part goes to  x = F R^-1 x_groomed,  F = diag(-1, 1, 1) for subjects that were
 * mirrored (one plane for all their parts), else the identity: a rigid motion in either case. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "assemble/job.h"
#include "files/files.h"
#include "files/particles_file.h"
#include "files/project_columns.h"
#include "geometry/affine.h"

apsm_parts joint_parts(const joint_cohort *cohort)
{
    return (apsm_parts){ cohort->n, cohort->first };
}

static apsm_status allocate(const joint_job *job, joint_cohort *c)
{
    *c = (joint_cohort){ .I = job->complete, .n = job->n };
    c->first = calloc(c->n + 1, sizeof *c->first);
    c->folder = calloc(c->n, sizeof *c->folder);
    c->row = malloc(c->I * c->n * sizeof *c->row);
    c->place = malloc(c->I * c->n * 16 * sizeof *c->place);
    c->align = malloc(c->I * c->n * 16 * sizeof *c->align);
    c->mirrored = calloc(c->I, sizeof *c->mirrored);
    return c->first && c->folder && c->row && c->place && c->align && c->mirrored ? APSM_OK
                                                                                  : APSM_ERR_MEMORY;
}

static apsm_status read_parts(const joint_job *job, joint_cohort *c)
{
    for (size_t d = 0; d < c->n; d++) {
        APSM_TRY(model_folder_read(job->ctx, job->part[d].folder,
                                   FOLDER_PARTICLES | FOLDER_EVALUATED | FOLDER_CERTIFIED |
                                       FOLDER_MANIFESTED,
                                   &c->folder[d]));
        c->first[d + 1] = c->first[d] + c->folder[d].J;
    }
    c->J = c->first[c->n];
    c->P = malloc(c->I * c->J * 3 * sizeof *c->P);
    c->Q = malloc(c->I * c->J * 3 * sizeof *c->Q);
    return c->P && c->Q ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status find_rows(const joint_job *job, size_t d, const joint_paths *known,
                             joint_cohort *c)
{
    for (size_t i = 0; i < c->I; i++) {
        const apsm_input_case *input = &job->list.cases[job->subject[i].input[d]];
        const size_t row = joint_paths_find(known, input->path);
        if (row == SIZE_MAX)
            return apsm_fail(job->ctx, APSM_ERR_STATE,
                             "%s: is not among the shapes of %s; run the whole job again with "
                             "--overwrite",
                             input->path, job->part[d].folder);
        c->row[i * c->n + d] = row;
    }
    return APSM_OK;
}

static apsm_status match(const joint_job *job, joint_cohort *c)
{
    for (size_t d = 0; d < c->n; d++) {
        joint_paths known = { 0 };
        apsm_status status = joint_paths_of_project(&c->folder[d].project, &known);
        if (status == APSM_OK) status = find_rows(job, d, &known, c);
        joint_paths_free(&known);
        APSM_TRY(status);
    }
    return APSM_OK;
}

static const apsm_subject *subject_of(const joint_cohort *c, size_t i, size_t d)
{
    return &c->folder[d].project.subjects[c->row[i * c->n + d]];
}

/* ---- places ---- */

apsm_status joint_place(apsm_context *ctx, const apsm_subject *s, double place[16])
{
    double reflection[16];
    const char *text = apsm_subject_column(s, "reflection");
    bool plain;
    apsm_affine_identity(place);
    if (!s->mirrored || !text) return APSM_OK;
    if (apsm_transform_parse(text, reflection, &plain) != 16)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: reflection in the project is not 16 numbers; groom again", s->name);
    APSM_TRY(apsm_affine_invert(reflection, place));
    for (int k = 0; k < 4; k++) place[k] = -place[k]; /* F */
    return APSM_OK;
}

static apsm_status place_subject(const joint_job *job, joint_cohort *c, size_t i)
{
    c->mirrored[i] = subject_of(c, i, 0)->mirrored;
    for (size_t d = 0; d < c->n; d++) {
        if (subject_of(c, i, d)->mirrored != c->mirrored[i])
            return apsm_fail(
                job->ctx, APSM_ERR_STATE,
                "%s: its %s was mirrored and its %s was not; let --reflect-match match "
                "all parts of a subject or none, and do not use --mirror-check fix",
                job->subject[i].name, job->part[c->mirrored[i] ? 0 : d].name,
                job->part[c->mirrored[i] ? d : 0].name);
        APSM_TRY(joint_place(job->ctx, subject_of(c, i, d), c->place + 16 * (i * c->n + d)));
    }
    return APSM_OK;
}

/* Particles in the frame that the subject's parts share. */
static apsm_status take_particles(const joint_cohort *c, size_t i, size_t d)
{
    const model_folder *m = &c->folder[d];
    const size_t row = c->row[i * c->n + d];
    const apsm_subject *s = &m->project.subjects[row];
    double world[16], back[16];
    apsm_affine_multiply(s->procrustes, s->alignment, world);
    APSM_TRY(apsm_affine_invert(world, back));
    apsm_affine_multiply(c->place + 16 * (i * c->n + d), back, back);
    apsm_affine_apply(back, m->J, m->P + 3 * row * m->J, c->P + 3 * (i * c->J + c->first[d]));
    return APSM_OK;
}

static apsm_status align(const joint_job *job, joint_cohort *c)
{
    const char *word = joint_setting(job, "align");
    const apsm_parts parts = joint_parts(c);
    const apsm_joint_align_options options = { .alignment = job->alignment,
                                               .by = job->align_by,
                                               .scale = word && strcmp(word, "similarity") == 0,
                                               .reference = 0 };
    if (!word || strcmp(word, "none") != 0)
        return apsm_joint_align(job->ctx, c->I, &parts, c->P, &options, c->align, c->Q);
    for (size_t k = 0; k < c->I * c->n; k++) apsm_affine_identity(c->align + 16 * k);
    memcpy(c->Q, c->P, c->I * c->J * 3 * sizeof *c->Q);
    return APSM_OK;
}

apsm_status joint_load(joint_job *job, joint_cohort *cohort)
{
    APSM_TRY(allocate(job, cohort));
    APSM_TRY(read_parts(job, cohort));
    APSM_TRY(match(job, cohort));
    for (size_t i = 0; i < cohort->I; i++) {
        APSM_TRY(place_subject(job, cohort, i));
        for (size_t d = 0; d < cohort->n; d++) APSM_TRY(take_particles(cohort, i, d));
    }
    return align(job, cohort);
}

void joint_cohort_free(joint_cohort *c)
{
    for (size_t d = 0; c->folder && d < c->n; d++) model_folder_free(&c->folder[d]);
    free(c->first);
    free(c->folder);
    free(c->row);
    free(c->place);
    free(c->align);
    free(c->mirrored);
    free(c->P);
    free(c->Q);
    *c = (joint_cohort){ 0 };
}

apsm_status joint_mesh(apsm_context *ctx, const joint_cohort *c, size_t i, size_t d,
                       apsm_mesh *mesh)
{
    double M[16];
    const size_t k = i * c->n + d;
    char *path = apsm_project_path(&c->folder[d].project, subject_of(c, i, d)->groomed);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_read_mesh(ctx, path, mesh);
    free(path);
    APSM_TRY(status);
    apsm_affine_multiply(c->align + 16 * k, c->place + 16 * k, M);
    apsm_mesh_transform(mesh, M);
    return APSM_OK;
}
