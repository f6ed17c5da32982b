/* outputs.h -- files of `apsm fit`: docs/formats.md, "Fits". */
#ifndef APSM_FIT_OUTPUTS_H
#define APSM_FIT_OUTPUTS_H

#include "files/records.h"
#include "fit/fit_model.h"

#define FIT_JSON        "fit.json"
#define FIT_CSV         "fit.csv"
#define FORMAT_FIT      "apsm-fit"
#define FORMAT_FIT_CASE "apsm-fit-shape"
enum { FIT_VERSION = 1 };

/* What the tables say of a shape. */
enum { FIT_PROBLEM = 1024 };
typedef struct fit_row {
    const char *name, *path; /* borrowed */
    char sha256[65];
    bool failed;
    char problem[FIT_PROBLEM]; /* line of a failure, or figures' reason; "": none */
    apsm_fit figures;          /* without arrays but score (borrowed) */
} fit_row;

/* Figures alone remain, the score included; nothing is freed. */
void fit_forget_arrays(apsm_fit *fit);

/* Rows of all shapes, in a file of the folder until the tables are made of them. */
typedef struct fit_rows {
    records file;
    size_t n, modes;
    fit_row *row;  /* the one that was read last, */
    double *score; /* with its scores behind it */
} fit_rows;
/* Zero-initialise with { .file.fd = -1 }.  The folder is borrowed. */
apsm_status fit_rows_open(apsm_context *ctx, const char *folder, size_t n, size_t modes,
                          fit_rows *rows) APSM_NODISCARD;
void fit_rows_close(fit_rows *rows);
/* Row i, any thread. */
apsm_status fit_rows_put(apsm_context *ctx, const fit_rows *rows, size_t i,
                         const fit_row *row) APSM_NODISCARD;
/* rows->row becomes row i; one thread. */
apsm_status fit_rows_get(apsm_context *ctx, fit_rows *rows, size_t i) APSM_NODISCARD;

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
                             fit_rows *rows) APSM_NODISCARD;

#endif
