/* answers.h -- what tests have found about a model, for its page. */
#ifndef APSM_REPORT_ANSWERS_H
#define APSM_REPORT_ANSWERS_H

#include "folder/model_folder.h"

/* *answers <- {"columns": [...], "tests": [...]} from statistics/ of the folder: the table that was
 * kept, and all results of `apsm test` for this very model; NULL if there are none.  Results of
 * another model are warned of and left out. */
apsm_status answers_read(apsm_context *ctx, const model_folder *m,
                         struct json_t **answers) APSM_NODISCARD;

#endif
