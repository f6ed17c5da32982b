/* writing.h -- what is written beside the model, and how often. */
#ifndef APSM_FOLDER_WRITING_H
#define APSM_FOLDER_WRITING_H

#include "core/option.h"

#define APSM_WRITING_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                      \
    BOOL(S, original_frame, false,                                                                 \
         "also write particles in the frame of the input files, with mirrored shapes mirrored "    \
         "back")                                                                                   \
    REAL(S, checkpoint_seconds, 10, 0, 1e9,                                                        \
         "seconds between two checkpoints, more if writing one takes long; 0: after every epoch")
typedef struct apsm_writing_options {
    APSM_OPTION_FIELDS(APSM_WRITING_OPTIONS)
} apsm_writing_options;

#endif
