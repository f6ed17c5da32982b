/* mode_trust_json.h -- of evaluation.json: how far each mode can be trusted. */
#ifndef APSM_FOLDER_MODE_TRUST_JSON_H
#define APSM_FOLDER_MODE_TRUST_JSON_H

#include "model/mode_trust.h"

struct json_t;

/* An array, one object a mode; NULL if out of memory. */
struct json_t *mode_trust_json(size_t modes, const apsm_mode_trust *trust);

/* One line about mode k (from 0) of that array, which is cut to size; false if there is none. */
bool mode_trust_line(const struct json_t *modes, size_t k, char *line, size_t size);

#endif
