/* options.h -- every option of the method: the steps' own lists in one struct. */
#ifndef APSM_OPTIONS_OPTIONS_H
#define APSM_OPTIONS_OPTIONS_H

#include "align/common_ends.h"
#include "evaluate/metrics.h"
#include "files/project.h"
#include "folder/writing.h"
#include "groom/groom.h"
#include "initialize/cohort.h"
#include "landmarks/landmark_table.h"
#include "optimize/options.h"

struct apsm_options {
    apsm_optimize_options optimize;
    apsm_groom_options groom; /* measure: false */
    apsm_align_options align;
    apsm_landmark_options landmarks;
    apsm_cuts_options cuts;
    apsm_field_options field;
    apsm_evaluate_options evaluate;
    apsm_writing_options writing;
};

/* Their lists, in the order of docs/options.md, and where each is in the struct: those that decide
 * the particles, and those that can change without making them different. */
#define APSM_DECISIVE_STEPS(STEP)                                                                  \
    APSM_OPTIMIZE_STEPS(STEP, optimize)                                                            \
    STEP(APSM_GROOM_OPTIONS, groom)                                                                \
    STEP(APSM_REMESH_OPTIONS, groom.remesh_options)                                                \
    STEP(APSM_ALIGN_OPTIONS, align)                                                                \
    STEP(APSM_LANDMARK_OPTIONS, landmarks)                                                         \
    STEP(APSM_CUTS_OPTIONS, cuts)                                                                  \
    STEP(APSM_FIELD_OPTIONS, field)
#define APSM_HARMLESS_STEPS(STEP)                                                                  \
    STEP(APSM_EVALUATE_OPTIONS, evaluate)                                                          \
    STEP(APSM_WRITING_OPTIONS, writing)

apsm_options apsm_options_defaults(void);

/* An option that can change without making the particles different. */
bool apsm_option_is_harmless(const char *key);

/* The options that the project of a model folder names; the others are as by default. */
apsm_status apsm_options_of_project(apsm_context *ctx, const apsm_project *project,
                                    apsm_options *options) APSM_NODISCARD;

#endif
