/* groomed.h -- the groomed shapes as a cohort, aligned; and what grooming did to every one, for the
 * model's files: "groomed" in manifest.json, docs/formats.md, and the notes that touch whether the
 * model can be trusted. */
#ifndef APSM_RUN_GROOMED_H
#define APSM_RUN_GROOMED_H

#include "align/align.h"
#include "run/groom_inputs.h"

struct json_t;

/* What alignment takes of n groomed shapes.  Zero-initialise with {0}; the arrays are its own, what
 * they point to is the shapes'. */
typedef struct groomed_cohort {
    const apsm_mesh **meshes;
    const char **names;
    apsm_borders *borders; /* of the images, in the frames of the meshes, which may be mirrored */
    apsm_align_options options; /* of the run, with template and borders */
} groomed_cohort;

void groomed_cohort_free(groomed_cohort *cohort);
/* Aligns the shapes; free alignment also after an error. */
apsm_status groomed_align(apsm_run *run, const groom_inputs *in, groomed_cohort *cohort,
                          apsm_alignment *alignment) APSM_NODISCARD;

/* A new reference; NULL if out of memory. */
struct json_t *groomed_json(const groom_inputs *in);
/* Adds to notes (session/notes.h); not 0 if out of memory. */
int groomed_add_notes(const groom_inputs *in, struct json_t *notes);
/* Adds that the shape's file is that of another; not 0 if out of memory. */
int groomed_note_same(struct json_t *notes, const char *shape, const char *as);

#endif
