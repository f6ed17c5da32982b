/* particle_sets.h -- particles of many shapes, from files of any program, cohorts and projects. */
#ifndef APSM_CLI_PARTICLE_SETS_H
#define APSM_CLI_PARTICLE_SETS_H

#include <stdbool.h>

#include "apsm/mesh.h"

/* Particles of one shape; all owned. */
typedef struct cli_set {
    char *name;          /* fit for a file */
    char *file;          /* of the particles, for messages */
    char *mesh;          /* groomed mesh that a project names, else NULL */
    double to_world[16]; /* of that mesh */
    size_t n;
    double *P; /* n x 3 */
} cli_set;

typedef struct cli_sets {
    size_t n, capacity;
    cli_set *sets;
    bool cohort;         /* an input stands for a cohort, however many shapes it has */
    char *template_used; /* name of the template of a project that was made by apsm, else NULL */
} cli_sets;

/* Reads all inputs: particle files, .npy of several shapes, projects and model folders (the world
 * particles of their shapes).  sets is first zeroed; free it on failure, too. */
apsm_status cli_sets_read(apsm_context *ctx, size_t n, const char *const *inputs,
                          cli_sets *sets) APSM_NODISCARD;
void cli_sets_free(cli_sets *sets);

/* By the names that ShapeWorks gives its files: local particles lie where each shape lay, world
 * particles where all are aligned. */
typedef enum cli_frames {
    CLI_FRAMES_UNKNOWN,
    CLI_FRAMES_LOCAL,
    CLI_FRAMES_WORLD,
    CLI_FRAMES_MIXED
} cli_frames;
cli_frames cli_sets_frames(const cli_sets *sets);
/* Warns of a mixture, which is what *.particles matches in a folder of ShapeWorks. */
void cli_sets_warn(apsm_context *ctx, const cli_sets *sets);

#endif
