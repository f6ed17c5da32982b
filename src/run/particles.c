/* Files of particles, in every frame that is wanted. */
#include "run/particles.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/particles_file.h"
#include "geometry/affine.h"
#include "run/fixed.h"
#include "run/results.h"
#include "session/session.h"

typedef struct particle_files {
    apsm_run *run;
    size_t J;
    const double *P;
} particle_files;

/* Writes one file and stores its path, relative to the folder, in *slot.  Of a fixed shape it is a
 * copy of what was given. */
static apsm_status write_frame(apsm_context *ctx, const apsm_run *run, const apsm_subject *s,
                               const char *frame, size_t J, const double *P, char **slot)
{
    char relative[1024];
    if (snprintf(relative, sizeof relative, "particles/%s_%s.particles", s->name, frame) >=
        (int)sizeof relative)
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: name too long", s->name);
    char *path = run_path(run, relative);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = slot && fixed_is(s) ? fixed_copy(ctx, run, s, frame, path)
                                             : apsm_particles_write(ctx, path, J, P);
    free(path);
    if (status == APSM_OK && slot) status = apsm_text_set(slot, relative);
    return status;
}

/* The 16 numbers of the project's column, separated by spaces. */
static apsm_status parse_reflection(apsm_context *ctx, const char *name, const char *text,
                                    double M[16])
{
    for (int k = 0; k < 16; k++) {
        text += strspn(text, " ");
        const size_t length = strcspn(text, " ");
        if (!apsm_parse_number(text, length, &M[k]))
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s: reflection in the project is not 16 numbers; groom again", name);
        text += length;
    }
    return APSM_OK;
}

static apsm_status write_original(apsm_context *ctx, const apsm_run *run, const apsm_subject *s,
                                  size_t J, double *P)
{
    double M[16], inverse[16];
    const char *text = apsm_subject_column(s, "reflection");
    if (text) {
        APSM_TRY(parse_reflection(ctx, s->name, text, M));
        APSM_TRY(apsm_affine_invert(M, inverse));
        apsm_affine_apply(inverse, J, P, P);
    }
    return write_frame(ctx, run, s, "original", J, P, NULL);
}

/* In all frames; to_world: of the subject's groomed frame. */
static apsm_status write_frames(apsm_context *ctx, const apsm_run *run, apsm_subject *s, size_t J,
                                const double *world, const double to_world[16])
{
    double inverse[16], *local = malloc(J * 3 * sizeof *local);
    if (!local) return APSM_ERR_MEMORY;
    apsm_status status = apsm_affine_invert(to_world, inverse);
    if (status == APSM_OK) {
        apsm_affine_apply(inverse, J, world, local);
        status = write_frame(ctx, run, s, "local", J, local, &s->local_particles);
    }
    if (status == APSM_OK)
        status = write_frame(ctx, run, s, "world", J, world, &s->world_particles);
    if (status == APSM_OK && run->options.writing.original_frame)
        status = write_original(ctx, run, s, J, local);
    free(local);
    return status;
}

static apsm_status write_subject(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const particle_files *f = user;
    return write_frames(ctx, f->run, &f->run->project.subjects[i], f->J, f->P + i * f->J * 3,
                        f->run->transforms + 16 * i);
}

apsm_status run_write_particles_of(apsm_run *run, size_t i, size_t J, const double *world)
{
    apsm_subject *s = &run->project.subjects[i];
    return write_frames(run->ctx, run, s, J, world, s->alignment);
}

/* Steps that come later, and who asks for the results, get what stands in the files. */
static apsm_status remember(apsm_run *run, size_t J, const double *P)
{
    const size_t n = run->project.n * J;
    run_forget_results(run);
    run->results.P = malloc(n * 3 * sizeof *P);
    if (!run->results.P) return apsm_fail(run->ctx, APSM_ERR_MEMORY, "out of memory");
    memcpy(run->results.P, P, n * 3 * sizeof *P);
    run->results.I = run->project.n;
    run->results.J = J;
    APSM_TRY(apsm_particles_round(run->ctx, n, run->results.P));
    return fixed_load(run, J, run->results.P);
}

/* Who optimises the project further asks for as many. */
static apsm_status tell_shapeworks(apsm_run *run, size_t J)
{
    char text[32];
    snprintf(text, sizeof text, "%zu", J);
    return apsm_project_set(&run->project, "optimize", "number_of_particles", text);
}

apsm_status run_write_particles(apsm_run *run, size_t J, const double *P)
{
    APSM_TRY(remember(run, J, P));
    if (run_is_in_memory(run)) return APSM_OK;
    char *folder = run_path(run, "particles");
    if (!folder) return APSM_ERR_MEMORY;
    apsm_status status = apsm_make_folder(run->ctx, folder);
    free(folder);
    particle_files f = { run, J, P };
    if (status == APSM_OK) status = tell_shapeworks(run, J);
    if (status == APSM_OK)
        status = apsm_parallel_for(run->ctx, run->project.n, write_subject, &f, NULL);
    return status == APSM_OK ? run_write_project(run) : status;
}
