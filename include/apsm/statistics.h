/* statistics.h -- from a model and what is known of its subjects to answers: do groups differ,
 * where, by how much, after age and sex?  docs/statistics.md says what is done; every figure is in
 * the files. */
#ifndef APSM_STATISTICS_H
#define APSM_STATISTICS_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* All borrowed.  {0} and the first five members are enough; zero stands for the default. */
typedef struct apsm_test_settings {
    const char *folder;   /* a model folder */
    const char *subjects; /* .csv or .tsv of what is known; NULL: the project's columns alone */
    const char *formula;  /* "~ group + age + sex" */
    const char *of;       /* the term that is tested; NULL: the first */
    const char *out;      /* folder of the results; NULL: statistics/ in the model folder */
    const char *on;       /* "form" (shape and size, default), "shape", "size" or "modes" */
    const char *within;   /* column whose levels were measured repeatedly; NULL: none */
    size_t permutations;  /* default 10,000; all there are, if they are not more */
    size_t bootstraps;    /* default 1,000; SIZE_MAX: none */
    bool unequal;         /* errors may vary by different amounts but are symmetric: signs are drawn
                             in place of orders */
    double stop_risk;     /* random orders end early when all that is at 5 % is known, at most with
                             this probability of being wrong; 0 (default): never */
} apsm_test_settings;

/* Writes OF_ON.json and OF_ON.csv (one line a particle, mode, or the size) and logs what they say.
 * Subjects with unknown values are left out, and counted.  Nothing of the model changes. */
APSM_API apsm_status apsm_statistics_test_sized(apsm_context *ctx,
                                                const apsm_test_settings *settings,
                                                size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_statistics_test(apsm_context *ctx,
                                                              const apsm_test_settings *settings)
{
    return apsm_statistics_test_sized(ctx, settings, sizeof *settings);
}

/* Left and right of the same subjects, one side mirrored: directional and fluctuating asymmetry.
 * settings: of is the column of the sides (two categories), within that of the subjects; formula is
 * NULL.  Writes asymmetry_ON.json, asymmetry_ON_subjects.csv (a column of each subject's amount,
 * for further tests), and as apsm_statistics_test asymmetry_directional_ON and, if sides were
 * measured repeatedly, asymmetry_fluctuating_ON. */
APSM_API apsm_status apsm_statistics_asymmetry_sized(apsm_context *ctx,
                                                     const apsm_test_settings *settings,
                                                     size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status
apsm_statistics_asymmetry(apsm_context *ctx, const apsm_test_settings *settings)
{
    return apsm_statistics_asymmetry_sized(ctx, settings, sizeof *settings);
}

/* All borrowed; {0} and the first two are enough. */
typedef struct apsm_measure_settings {
    const char *folder;     /* a model folder */
    const char *definition; /* .json: what is measured (docs/formats.md) */
    size_t n_files;
    const char *const *files; /* more shapes: world particles, or folders that fit has made */
    const char *subjects;     /* .csv or .tsv whose columns are written out again; or NULL */
    const char *out;          /* folder of the results; NULL: statistics/ in the model folder */
} apsm_measure_settings;

/* Distances, angles, diameters, areas, volumes, thickness, defined once on the template, of every
 * shape, the mean, and the modes at two standard deviations.  Writes measurements.json and .csv,
 * measurements_model.csv, and with files measurements_files.csv. */
APSM_API apsm_status apsm_statistics_measure_sized(apsm_context *ctx,
                                                   const apsm_measure_settings *settings,
                                                   size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status
apsm_statistics_measure(apsm_context *ctx, const apsm_measure_settings *settings)
{
    return apsm_statistics_measure_sized(ctx, settings, sizeof *settings);
}

/* All borrowed; {0} and the first three are enough. */
typedef struct apsm_norm_settings {
    const char *folder; /* a model folder */
    size_t n_files;
    const char *const *files; /* world particles, or folders that fit has made */
    const char *subjects; /* .csv or .tsv with lines for the shapes of the model and the files */
    const char *formula;  /* what is allowed for, "~ age + sex"; NULL: nothing */
    const char *out;      /* folder of the results; NULL: statistics/ in the model folder */
} apsm_norm_settings;

/* How unusual a shape is among those of the model, given what is known of it: as a whole, mode by
 * mode, particle by particle.  Writes norm.json, norm.csv and for each file NAME_norm.csv. */
APSM_API apsm_status apsm_statistics_norm_sized(apsm_context *ctx,
                                                const apsm_norm_settings *settings,
                                                size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_statistics_norm(apsm_context *ctx,
                                                              const apsm_norm_settings *settings)
{
    return apsm_statistics_norm_sized(ctx, settings, sizeof *settings);
}

/* All borrowed; {0} and the first two are enough. */
typedef struct apsm_predict_settings {
    const char *folder;   /* a model folder */
    const char *of;       /* column: numbers, or two groups */
    const char *subjects; /* .csv or .tsv of what is known; NULL: what was kept, the project's */
    size_t n_files;
    const char *const *files; /* new shapes: world particles, or folders that fit has made */
    const char *at;  /* "40,60": values for which the shape to be expected is written; NULL: none */
    const char *out; /* folder of the results; NULL: statistics/ in the model folder */
} apsm_predict_settings;

/* A column from the shape, by ridge regression on the particles: how well, by ten-fold
 * cross-validation with every step inside the folds; of new shapes, with an interval; and how the
 * shape changes with the column.  Writes OF_prediction.json and .csv, and
 * OF_prediction_at_VALUE.ply.
 */
APSM_API apsm_status apsm_statistics_predict_sized(apsm_context *ctx,
                                                   const apsm_predict_settings *settings,
                                                   size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status
apsm_statistics_predict(apsm_context *ctx, const apsm_predict_settings *settings)
{
    return apsm_statistics_predict_sized(ctx, settings, sizeof *settings);
}

/* All borrowed, and needed. */
typedef struct apsm_landmark_settings {
    const char *folder; /* a model folder */
    const char *file;   /* named points: .mrk.json, .fcsv, .csv */
    const char *out;    /* folder of the results */
    bool aligned;       /* points are on the mean, in the world; else on the template's input */
} apsm_landmark_settings;

/* Points placed once, carried to every shape (in the frame of its input; with aligned in the
 * world), to the mean and to its modes at two standard deviations (in the world).  Writes
 * NAME.mrk.json for each and landmarks.csv. */
APSM_API apsm_status apsm_statistics_landmarks_sized(apsm_context *ctx,
                                                     const apsm_landmark_settings *settings,
                                                     size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status
apsm_statistics_landmarks(apsm_context *ctx, const apsm_landmark_settings *settings)
{
    return apsm_statistics_landmarks_sized(ctx, settings, sizeof *settings);
}

#ifdef __cplusplus
}
#endif
#endif
