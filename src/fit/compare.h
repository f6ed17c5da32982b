/* compare.h -- two models side by side, and the files of `apsm compare`. */
#ifndef APSM_FIT_COMPARE_H
#define APSM_FIT_COMPARE_H

#include "apsm/compare.h"
#include "fit/fit_model.h"
#include "folder/model_folder.h"
#include "model/warp.h"

#define COMPARE_JSON   "compare.json"
#define COMPARE_CSV    "compare.csv"
#define COMPARE_PLY    "mean_difference.ply"
#define FORMAT_COMPARE "apsm-compare"
enum { COMPARE_VERSION = 1 };

/* One of the two.  From a folder or a file; the other is empty. */
typedef struct compare_side {
    const char *path; /* borrowed */
    model_folder folder;
    apsm_fit_model *file;
    const apsm_shape_model *model; /* borrowed from one of them, as T (J x 3: the template's) */
    const double *T;
    apsm_mesh template_mesh, mean; /* the same faces; world frame */
    apsm_warp warp;                /* of the template's vertices */
} compare_side;

apsm_status compare_side_open(apsm_context *ctx, const char *path, compare_side *s) APSM_NODISCARD;
void compare_side_free(compare_side *s);

/* Two-sided probability that of n fair coins `less` or fewer, or as many of the other side, fall on
 * one. */
double compare_sign_p(size_t less, size_t n);

/* Whether results may be written to the folder. */
apsm_status compare_check_folder(apsm_context *ctx, const apsm_compare_settings *o) APSM_NODISCARD;
/* compare.json, compare.csv (a line for each mode), mean_difference.ply (A's mean with the signed
 * distance of B's). */
apsm_status compare_write(apsm_context *ctx, const apsm_compare_settings *o,
                          const compare_side side[2], const apsm_comparison *c) APSM_NODISCARD;

#endif
