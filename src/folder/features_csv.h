/* features_csv.h -- features.csv of a model folder, read back: fields of the surfaces, sampled at
 * the particles of every shape. */
#ifndef APSM_FOLDER_FEATURES_CSV_H
#define APSM_FOLDER_FEATURES_CSV_H

#include "apsm/context.h"

/* Owns everything; zero-initialise with {0}, sampled_fields_free leaves it so. */
typedef struct sampled_fields {
    size_t I, J, S;
    char **name;   /* S */
    double *value; /* I x J x S */
} sampled_fields;

/* Of the I shapes of these names, J particles each, in any order and among others. APSM_ERR_FORMAT,
 * with file and line: a shape or a particle is missing, or a line is none of such a table. */
apsm_status features_csv_read(apsm_context *ctx, const char *path, size_t I,
                              const char *const *names, size_t J,
                              sampled_fields *fields) APSM_NODISCARD;
/* The file that evaluate writes. */
apsm_status features_csv_write(apsm_context *ctx, const char *path, const char *const *names,
                               const sampled_fields *fields) APSM_NODISCARD;
void sampled_fields_free(sampled_fields *fields);

#endif
