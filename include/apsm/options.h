/* options.h -- every option of the method: set and asked for by name and as text, as `--set` and
 * the configuration file do.  docs/options.md lists them.  Each is declared by the step of the
 * method that it belongs to. */
#ifndef APSM_OPTIONS_H
#define APSM_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_options apsm_options;

/* How an option looks from outside. */
typedef enum apsm_option_kind {
    APSM_OPTION_INT,
    APSM_OPTION_REAL,
    APSM_OPTION_BOOL,
    APSM_OPTION_ENUM
} apsm_option_kind;
typedef struct apsm_option_info {
    const char *name;
    apsm_option_kind kind;
    const char *dflt;   /* as text; NULL for an ENUM: the first of its words */
    double least, most; /* INT and REAL */
    const char *words;  /* ENUM: "first|second" */
    const char *doc;
} apsm_option_info;

/* All as by default; the caller's, *options is NULL on failure. */
APSM_API apsm_status apsm_options_new(apsm_context *ctx, apsm_options **options) APSM_NODISCARD;
APSM_API void apsm_options_free(apsm_options *options); /* NULL is allowed */

/* The table; *n is its length. */
APSM_API const apsm_option_info *apsm_options_table(size_t *n);

/* Sets one option from text, as `--set key=value` does.  Unknown key (the nearest one is
 * named), a value that does not parse or is out of range: APSM_ERR_ARG with a line.
 * method = xu2023 also sets what makes the method of the earlier paper (docs/method.md, "Comparison
 * methods"): correspondence = frobenius-squared, gamma = 0.1 (a tenth of the way to the mean in
 * every epoch), snap = none, geodesic_correspondence = false, fidelity = 0, and the schedule of 50
 * + 50 epochs with its weights; another method then takes these back to their defaults. */
APSM_API apsm_status apsm_options_set(apsm_context *ctx, apsm_options *options, const char *key,
                                      const char *value) APSM_NODISCARD;
/* Value of an option as text that apsm_options_set reads back exactly; buffer of 64 bytes. */
APSM_API apsm_status apsm_options_get(const apsm_options *options, const char *key,
                                      char text[64]) APSM_NODISCARD;

/* Presets: "default", "paper-literal-femur", "paper-literal-liver", "paper-literal-hip": every
 * paper reading at once with that cohort's weights. */
APSM_API apsm_status apsm_options_preset(apsm_context *ctx, apsm_options *options,
                                         const char *name) APSM_NODISCARD;

/* Refuses contradictions between options. */
APSM_API apsm_status apsm_options_check(apsm_context *ctx,
                                        const apsm_options *options) APSM_NODISCARD;

/* Number of edits between two words, for "did you mean". */
APSM_API size_t apsm_edit_distance(const char *a, const char *b);

#ifdef __cplusplus
}
#endif
#endif
