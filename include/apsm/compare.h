/* compare.h -- the same anatomy in two models: do they have the same mean, the same variation, and
 * which describes the same shapes better?
 *
 * Experimental: may still change. */
#ifndef APSM_COMPARE_H
#define APSM_COMPARE_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What `apsm compare` is asked for; borrowed. */
typedef struct apsm_compare_settings {
    const char *a, *b;  /* model folders, or files of apsm_fit_model_write; not of several parts */
    const char *folder; /* where results go, or NULL: nothing is written */
    bool overwrite;     /* results of an earlier comparison in folder */
} apsm_compare_settings;

enum { APSM_COMPARE_MODES = 10, APSM_COMPARE_COUNTS = 5 };

/* Lengths in the unit of A.  Modes are compared at 1,000 points of A's mean surface, each with the
 * nearest point of B's in the pose of A. */
typedef struct apsm_comparison {
    size_t shapes[2], particles[2], modes[2];
    bool mirrored;              /* B was turned over: it is of the other side */
    double M[16];               /* B's world to A's: rigid */
    double size_ratio;          /* root mean square radius of B's mean surface over A's */
    double mean_mean, mean_max; /* two-way distance of the mean surfaces */
    double variance[2];         /* total, per point: mean squared deviation */
    size_t angles;              /* leading modes whose spans are compared: at most 10, or as many as
                                   the smaller model has */
    double cosine[APSM_COMPARE_MODES];  /* of the principal angles, descending */
    double share_a[APSM_COMPARE_MODES]; /* of mode k of A, in the span of B's `angles` modes */
    double share_b[APSM_COMPARE_MODES];
    double explained_a; /* share of A's variance within the span of B's `angles` modes */
    double explained_b;
    size_t common; /* shapes of the same name in both, without the templates; 0: none is compared */
    size_t counts; /* numbers of modes for which left-out shapes were rebuilt */
    size_t count[APSM_COMPARE_COUNTS];
    double rebuilt[2][APSM_COMPARE_COUNTS]; /* mean two-way distance of left-out shapes' surfaces
                                               rebuilt from so many modes */
    double p[APSM_COMPARE_COUNTS];          /* two-sided, that the models do equally well (signs of
                                               the shapes' differences) */
} apsm_comparison;

/* APSM_ERR_ARG: sizes so different that the unit must be another; APSM_ERR_STATE: results of
 * something else are in folder.  Common shapes are left out in ten folds of either model; shapes
 * are rebuilt in parallel, the same for any number of threads. */
APSM_API apsm_status apsm_models_compare_sized(apsm_context *ctx,
                                               const apsm_compare_settings *settings, size_t size,
                                               apsm_comparison *comparison,
                                               size_t comparison_size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_models_compare(apsm_context *ctx,
                                                             const apsm_compare_settings *settings,
                                                             apsm_comparison *comparison)
{
    return apsm_models_compare_sized(ctx, settings, sizeof *settings, comparison,
                                     sizeof *comparison);
}

#ifdef __cplusplus
}
#endif
#endif
