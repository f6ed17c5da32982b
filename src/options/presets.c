/* Presets, and the options that set others. */
#include "options/presets.h"

#include <stdio.h>
#include <string.h>

#include "options/options.h"

/* The earlier paper's method; docs/method.md, "Comparison methods".  Its gamma/2 |P_i - mean|^2 has
 * the gradient gamma (P_i - mean): a length, so gamma is the share of the way to the mean made in
 * an epoch. */
static const char *const xu2023[][2] = {
    { "correspondence", "frobenius-squared" },
    { "gamma", "0.1" },
    { "snap", "none" },
    { "geodesic_correspondence", "false" },
    { "fidelity", "0" },
    { "stage1_epochs", "50" },
    { "settle_epochs", "0" },
    { "stage2_epochs", "50" },
    { "alpha", "10" },
    { "stage2_alpha_factor", "0.5" },
    { "beta", "0.02" },
};
enum { XU2023_LENGTH = sizeof xu2023 / sizeof xu2023[0] };

/* The method has just changed from `before`. */
static apsm_status follow_method(apsm_context *ctx, apsm_options *options, int before)
{
    const apsm_options defaults = apsm_options_defaults();
    const bool now = options->optimize.method == APSM_METHOD_XU2023;
    if (now == (before == APSM_METHOD_XU2023)) return APSM_OK;
    for (size_t k = 0; k < XU2023_LENGTH; k++) {
        char text[64];
        APSM_TRY(apsm_options_get(&defaults, xu2023[k][0], text));
        APSM_TRY(options_set_one(ctx, options, xu2023[k][0], now ? xu2023[k][1] : text));
    }
    return APSM_OK;
}

enum { NUMBER = 64 };

/* A length in the input's unit, which a user may call mm: number (out) without it. */
static bool is_length(const char *value, char number[NUMBER])
{
    const size_t length = strlen(value);
    if (length <= 2 || length >= NUMBER || strcmp(value + length - 2, "mm") != 0) return false;
    snprintf(number, NUMBER, "%.*s", (int)length - 2, value);
    return true;
}

/* Model folders of earlier days have the words of error_scale under this name. */
static apsm_status set_error(apsm_context *ctx, apsm_options *options, const char *value)
{
    if (strcmp(value, "relative") == 0 || strcmp(value, "raw") == 0)
        return options_set_one(ctx, options, "error_scale", value);
    char number[NUMBER];
    return options_set_one(ctx, options, "error", is_length(value, number) ? number : value);
}

/* A radius of masks, as a share of the size or as a length: the last one that is given counts. */
static apsm_status set_radius(apsm_context *ctx, apsm_options *options, const char *share,
                              const char *length, const char *value)
{
    char number[NUMBER];
    if (is_length(value, number)) return options_set_one(ctx, options, length, number);
    APSM_TRY(options_set_one(ctx, options, share, value));
    return options_set_one(ctx, options, length, "0");
}

enum { AUTO_START = 32 }; /* particles */

apsm_status apsm_options_set(apsm_context *ctx, apsm_options *options, const char *key,
                             const char *value)
{
    const int before = options->optimize.method;
    if (strcmp(key, "particles") == 0 && strcmp(value, "auto") == 0) {
        options->optimize.particles = AUTO_START;
        options->optimize.search.particles_auto = true;
        return APSM_OK;
    }
    if (strcmp(key, "error") == 0) return set_error(ctx, options, value);
    if (strcmp(key, "closing") == 0) return set_radius(ctx, options, key, "closing_length", value);
    if (strcmp(key, "opening") == 0) return set_radius(ctx, options, key, "opening_length", value);
    APSM_TRY(options_set_one(ctx, options, key, value));
    return follow_method(ctx, options, before);
}

/* The paper's readings, all at once.  Its losses are means in input units (mm) and its step is
 * plain descent, which hardly moves the particles: docs/method.md has the measurement. */
static const char *const paper_literal[][2] = {
    { "alpha", "10" },
    { "stage2_alpha_factor", "0.5" },
    { "stage1_epochs", "200" },
    { "settle_epochs", "0" },
    { "stage2_epochs", "200" },
    { "tau_absolute", "1" },
    { "sampling_scale", "mean" },
    { "error_scale", "raw" },
    { "error_gradient", "through-w" },
    { "rotation", "axis" },
    { "neighbour_scale", "none" },
    { "template_gradient", "true" },
    { "eigen_reg_absolute", "0.1" },
    { "eigen_scale", "none" },
    { "step", "literal" },
    { "learning_rate", "1" },
    { "step_clip", "0" },
    { "decay1_at", "1" },
    { "decay2_at", "1" },
    { "burn_in", "1" },
    { "snap", "field" },
    { "initialize", "fps" },
    { "geodesic_interval", "25" },
    { "geodesic_factor", "1.5" },
    { "geodesic_target", "farthest" },
    { "geodesic_walk", "1" },
    { "geodesic_guard", "false" },
    { "stop_rule", "matched" },
    { "definition", "paper" },
    { "fidelity", "0" },
};

static apsm_status set_all(apsm_context *ctx, apsm_options *options, const char *const pairs[][2],
                           size_t n)
{
    for (size_t k = 0; k < n; k++)
        APSM_TRY(apsm_options_set(ctx, options, pairs[k][0], pairs[k][1]));
    return APSM_OK;
}

apsm_status apsm_options_preset(apsm_context *ctx, apsm_options *options, const char *name)
{
    static const struct {
        const char *name, *beta, *gamma;
    } cohorts[] = { { "paper-literal-femur", "0.01", "0.5" },
                    { "paper-literal-liver", "0.05", "5" },
                    { "paper-literal-hip", "0.01", "0.1" } };
    if (strcmp(name, "default") == 0) return *options = apsm_options_defaults(), APSM_OK;
    for (size_t k = 0; k < sizeof cohorts / sizeof cohorts[0]; k++) {
        if (strcmp(name, cohorts[k].name) != 0) continue;
        const char *const of_cohort[][2] = { { "beta", cohorts[k].beta },
                                             { "gamma", cohorts[k].gamma } };
        APSM_TRY(
            set_all(ctx, options, paper_literal, sizeof paper_literal / sizeof paper_literal[0]));
        return set_all(ctx, options, of_cohort, 2);
    }
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "unknown preset '%s': give default, paper-literal-femur, "
                     "paper-literal-liver or paper-literal-hip",
                     name);
}
