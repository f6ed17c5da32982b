/* particle_files.h -- shapes that a model was fitted to, by their world particles. */
#ifndef APSM_STATISTICS_PARTICLE_FILES_H
#define APSM_STATISTICS_PARTICLE_FILES_H

#include "folder/model_folder.h"

/* Owns everything; zero-initialise with {0}, particle_files_free leaves it so. */
typedef struct particle_files {
    size_t n;
    char **name;          /* n: of the file, without "_world" and extension */
    double *P;            /* n x J x 3 */
    struct json_t **note; /* n: texts, what to know before it is trusted; NULL: nothing */
} particle_files;

/* Files of particles in the model's world frame, or folders that fit has made, which stand for all
 * ..._world.particles in their particles/, in the order of their names.  APSM_ERR_ARG: a name
 * twice, a folder without such files, another number of particles than the model's, fits to another
 * model.  Fits that need review, and shapes that are the model's own, are logged and noted. */
apsm_status particle_files_read(apsm_context *ctx, size_t n, const char *const *paths,
                                const model_folder *m, particle_files *files) APSM_NODISCARD;
/* Logs it of file k, and adds it to its note. */
apsm_status particle_files_note(apsm_context *ctx, particle_files *files, size_t k,
                                const char *format, ...) APSM_PRINTF(4, 5) APSM_NODISCARD;
/* The text, or "". */
const char *particle_files_note_text(const particle_files *files, size_t k);
void particle_files_free(particle_files *files);

#endif
