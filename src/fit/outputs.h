/* outputs.h -- files of `apsm fit`: docs/formats.md, "Fits". */
#ifndef APSM_FIT_OUTPUTS_H
#define APSM_FIT_OUTPUTS_H

#include "fit/fit_model.h"

#define FIT_JSON        "fit.json"
#define FIT_CSV         "fit.csv"
#define FORMAT_FIT      "apsm-fit"
#define FORMAT_FIT_CASE "apsm-fit-shape"
enum { FIT_VERSION = 1 };

/* What is kept of a shape for the tables.  Owns its texts and scores. */
typedef struct fit_row {
    const char *name, *path; /* borrowed */
    char sha256[65];
    bool failed;
    char *problem;    /* line of a failure, or figures' reason; NULL: none */
    apsm_fit figures; /* without arrays but score */
} fit_row;

/* Which model fitted: its path, sizes, and SHA-256 of its numbers. */
typedef struct fit_origin {
    const apsm_fit_model *model;
    const char *path;
    char sha256[65];
    const apsm_fit_options *options;
} fit_origin;
/* Settings and options of a program, checked; door: whose they are (session.c). */
apsm_status fit_take_settings(apsm_context *ctx, const char *door, const apsm_fit_settings *given,
                              size_t size, apsm_fit_settings *settings, apsm_fit_options *options);

void fit_origin_of(const apsm_fit_model *model, const char *path, const apsm_fit_options *options,
                   fit_origin *origin);

/* particles/, meshes/ and shapes/ of one fit in the folder; these folders are there. */
apsm_status fit_write_shape(apsm_context *ctx, const char *folder, const fit_origin *origin,
                            const fit_row *row, const apsm_fit *fit) APSM_NODISCARD;
/* meshes/mean.ply: the mean shape, in the world frame, with the faces of all fits. */
apsm_status fit_write_mean(apsm_context *ctx, const char *folder,
                           const apsm_fit_model *m) APSM_NODISCARD;
/* fit.json and fit.csv. */
apsm_status fit_write_tables(apsm_context *ctx, const char *folder, const fit_origin *origin,
                             size_t n, const fit_row *rows) APSM_NODISCARD;

#endif
