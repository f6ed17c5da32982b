/* options.h -- those of all that moves particles, each declared beside its kernel. */
#ifndef APSM_OPTIMIZE_OPTIONS_H
#define APSM_OPTIMIZE_OPTIONS_H

#include "correspond/geodesic_correspondence.h"
#include "initialize/projection.h"
#include "optimize/correspondence_loss.h"
#include "optimize/eigenshape_loss.h"
#include "optimize/fidelity.h"
#include "optimize/rbf_shape.h"
#include "optimize/sampling_loss.h"
#include "optimize/schedule.h"
#include "optimize/snap.h"

enum { APSM_METHOD_ADAPTIVE, APSM_METHOD_XU2023, APSM_METHOD_PSM };
#define APSM_OPTIMIZER_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                    \
    ENUM(S, method, "adaptive|xu2023|psm",                                                         \
         "the engine's own method, or one to compare it with: xu2023 is a set of options of it "   \
         "(see apsm_options_set), psm the entropy-based particles of ShapeWorks")                  \
    INT(S, particles, 128, 4, 100000, "J: particles on every shape, or auto (see particles_auto)") \
    INT(S, batch, 0, 0, 1000000, "K: shapes a minibatch; 0: all up to 256 shapes, else 64")

/* apsm_search_particles */
#define APSM_SEARCH_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                       \
    BOOL(S, particles_auto, false,                                                                 \
         "search the smallest number of particles that meets `error`, from `particles` upward; "   \
         "particles = auto sets this and begins with 32")                                          \
    REAL(S, error, 0, 0, 1e300,                                                                    \
         "mean two-way surface distance that particles_auto has to meet on shapes left out, in "   \
         "the input's unit; a number may end in mm if that is the unit")
typedef struct apsm_search_options {
    APSM_OPTION_FIELDS(APSM_SEARCH_OPTIONS)
} apsm_search_options;

/* apsm_psm_optimize: names and defaults of ShapeWorks, lengths in psm_unit. */
#define APSM_PSM_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                          \
    REAL(S, psm_initial_relative_weighting, 0.05, 0, 1e6,                                          \
         "weight of the correspondence term while particles are split")                            \
    REAL(S, psm_relative_weighting, 1, 0, 1e6, "weight of the correspondence term afterwards")     \
    REAL(S, psm_starting_regularization, 1000, 1e-9, 1e12, "of the entropy, at the start")         \
    REAL(S, psm_ending_regularization, 10, 1e-9, 1e12, "of the entropy, at the end")               \
    REAL(S, psm_starting_share, 0, 0, 1,                                                           \
         "starting regularization as a share of the largest eigenvalue, ending at a tenth of "     \
         "that; 0: the two absolute values; 0.05 is ShapeWorks' advice")                           \
    INT(S, psm_iterations_per_split, 1000, 0, 1000000, "iterations after each split")              \
    INT(S, psm_optimization_iterations, 1000, 0, 1000000,                                          \
        "iterations when all particles are there")                                                 \
    BOOL(S, psm_shape_statistics_in_init, false,                                                   \
         "the entropy during splitting too, not the distance from the mean (part of ShapeWorks' "  \
         "multiscale)")                                                                            \
    BOOL(S, psm_procrustes, false, "register the shapes anew as the optimisation goes on")         \
    INT(S, psm_procrustes_interval, 10, 1, 1000000, "iterations between two registrations")        \
    BOOL(S, psm_procrustes_scaling, false, "registrations remove size")                            \
    BOOL(S, psm_procrustes_rotation_translation, true, "registrations remove pose")                \
    BOOL(S, psm_sampling_scale, false,                                                             \
         "sampling gradients times a shape's area over 12,250 psm_unit^2: sizes balance alike")    \
    REAL(S, psm_unit, 1, 1e-9, 1e9, "length that stands for ShapeWorks' mm, in the input's unit")
typedef struct apsm_psm_options {
    APSM_OPTION_FIELDS(APSM_PSM_OPTIONS)
} apsm_psm_options;

/* The h of the steps is set where it is known. */
struct apsm_optimize_options {
    APSM_OPTION_FIELDS(APSM_OPTIMIZER_OPTIONS)
    apsm_search_options search;
    apsm_schedule_options schedule;
    apsm_projection_options first;
    apsm_sampling_options sampling;
    apsm_rbf_options rbf;
    apsm_correspondence_options correspondence;
    apsm_eigenshape_options eigenshape;
    apsm_step_options step;
    apsm_walk_options walk;
    apsm_fidelity_options fidelity;
    apsm_psm_options psm;
};

static inline apsm_optimize_options apsm_optimize_defaults(void)
{
    return (apsm_optimize_options){ .search = { APSM_OPTION_DEFAULTS(APSM_SEARCH_OPTIONS) },
                                    .schedule = { APSM_OPTION_DEFAULTS(APSM_SCHEDULE_OPTIONS) },
                                    .first = { APSM_OPTION_DEFAULTS(APSM_PROJECTION_OPTIONS) },
                                    .sampling = { APSM_OPTION_DEFAULTS(APSM_SAMPLING_OPTIONS) },
                                    .rbf = { APSM_OPTION_DEFAULTS(APSM_RBF_OPTIONS) },
                                    .correspondence = { APSM_OPTION_DEFAULTS(
                                        APSM_CORRESPONDENCE_OPTIONS) },
                                    .eigenshape = { APSM_OPTION_DEFAULTS(APSM_EIGENSHAPE_OPTIONS) },
                                    .step = { APSM_OPTION_DEFAULTS(APSM_STEP_OPTIONS) },
                                    .walk = { APSM_OPTION_DEFAULTS(APSM_WALK_OPTIONS) },
                                    .fidelity = { APSM_OPTION_DEFAULTS(APSM_FIDELITY_OPTIONS) },
                                    .psm = { APSM_OPTION_DEFAULTS(APSM_PSM_OPTIONS) },
                                    APSM_OPTION_DEFAULTS(APSM_OPTIMIZER_OPTIONS) };
}

/* Their lists, and where each is in the struct. */
#define APSM_OPTIMIZE_STEPS(STEP, at)                                                              \
    STEP(APSM_OPTIMIZER_OPTIONS, at)                                                               \
    STEP(APSM_SEARCH_OPTIONS, at.search)                                                           \
    STEP(APSM_SCHEDULE_OPTIONS, at.schedule)                                                       \
    STEP(APSM_PROJECTION_OPTIONS, at.first)                                                        \
    STEP(APSM_SAMPLING_OPTIONS, at.sampling)                                                       \
    STEP(APSM_RBF_OPTIONS, at.rbf)                                                                 \
    STEP(APSM_CORRESPONDENCE_OPTIONS, at.correspondence)                                           \
    STEP(APSM_EIGENSHAPE_OPTIONS, at.eigenshape)                                                   \
    STEP(APSM_STEP_OPTIONS, at.step)                                                               \
    STEP(APSM_WALK_OPTIONS, at.walk)                                                               \
    STEP(APSM_FIDELITY_OPTIONS, at.fidelity)                                                       \
    STEP(APSM_PSM_OPTIONS, at.psm)

#endif
