/* groomed.h -- what grooming did to every shape, for the model's files: "groomed" in manifest.json,
 * docs/formats.md, and the notes that touch whether the model can be trusted. */
#ifndef APSM_RUN_GROOMED_H
#define APSM_RUN_GROOMED_H

#include "align/align.h"
#include "run/groom_inputs.h"

struct json_t;

/* Borders (n, out) of the shapes' images, in the frames of the meshes, which may be mirrored. */
void groomed_borders(const groom_inputs *in, apsm_borders *borders);

/* A new reference; NULL if out of memory. */
struct json_t *groomed_json(const groom_inputs *in);
/* Adds to notes (run/notes.h); not 0 if out of memory. */
int groomed_add_notes(const groom_inputs *in, struct json_t *notes);

#endif
