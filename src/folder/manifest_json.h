/* manifest_json.h -- manifest.json: options, inputs, stages and files of a model folder.
 * docs/formats.md says what stands in it. */
#ifndef APSM_FOLDER_MANIFEST_JSON_H
#define APSM_FOLDER_MANIFEST_JSON_H

#include <jansson.h>

#include "apsm/context.h"

/* Without anything done; NULL if out of memory. */
json_t *manifest_json_new(void);
/* *root: a new reference, NULL on failure; *is_intact: as it was sealed. */
apsm_status manifest_json_read(apsm_context *ctx, const char *path, json_t **root,
                               bool *is_intact) APSM_NODISCARD;
/* Seals it if it is intact: sealed anew, one that somebody has changed would vouch for the change.
 */
apsm_status manifest_json_write(apsm_context *ctx, const char *path, json_t *root,
                                bool is_intact) APSM_NODISCARD;

/* "inputs": what they are called, where they are, bytes, SHA-256; NULL if out of memory. */
json_t *manifest_json_inputs(size_t n, const char *const *names, const char *const *paths,
                             char (*sha256)[65]);
/* The stored SHA-256 of a named input, or NULL. */
const char *manifest_json_sha256(const json_t *root, const char *name);

/* "begun" <- it with the stage (with), or without, in their order; no key for none.  Not 0: out of
 * memory.  The files of stages that have begun and not ended are a run's, though not listed. */
int manifest_json_set_begun(json_t *root, const char *stage, bool with);

/* Whether the folder holds a joint of several parts (src/assemble), not a model of one. */
bool manifest_json_is_joint(const json_t *root);
bool manifest_json_is_contours(const json_t *root); /* or a model of contours */
/* Whether all shapes come from images, whose lengths are mm and whose axes are the patient's. */
bool manifest_is_of_images(const json_t *root);
/* The unit of lengths: what the user said (borrowed), "mm" for images, or NULL: not known. */
const char *manifest_unit(const json_t *root);

#endif
