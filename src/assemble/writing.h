/* writing.h -- what the writers of a joint's files share. */
#ifndef APSM_ASSEMBLE_WRITING_H
#define APSM_ASSEMBLE_WRITING_H

#include <jansson.h>

#include "assemble/job.h"

typedef struct writing {
    const joint_job *job;
    const joint_cohort *c;
    const joint_figures *f;
    json_t *files; /* names written, to be listed with their SHA-256 */
} writing;

/* MODEL_DIR/name, noted as ours; malloc'ed. */
char *writing_path(writing *w, const char *format, ...) APSM_PRINTF(2, 3);
/* One that is JSON (takes the reference over; NULL: out of memory). */
apsm_status writing_json(writing *w, const char *name, json_t *root);

const char *writing_subject(const writing *w, size_t i);
const char *writing_part(const writing *w, size_t d);
/* How many particles part d has. */
size_t writing_particles(const writing *w, size_t d);
/* "parts" of model.json and manifest.json; a new reference. */
json_t *writing_parts(const writing *w);

apsm_status joint_write_project(writing *w); /* write_project.c */
apsm_status joint_write_model(writing *w);   /* write_model.c */
apsm_status joint_write_judged(writing *w);  /* write_judged.c */
apsm_status joint_write_meshes(writing *w);  /* write_meshes.c */

#endif
