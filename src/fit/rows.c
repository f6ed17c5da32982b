/* Rows of the tables of fits: while shapes are fitted, in any order, they wait in a file. */
#include <stdlib.h>
#include <string.h>

#include "fit/outputs.h"

static size_t record_size(size_t modes)
{
    return sizeof(fit_row) + modes * sizeof(double);
}

apsm_status fit_rows_open(apsm_context *ctx, const char *folder, size_t n, size_t modes,
                          fit_rows *rows)
{
    *rows = (fit_rows){ .file.fd = -1, .n = n, .modes = modes };
    rows->row = malloc(record_size(modes));
    if (!rows->row) return APSM_ERR_MEMORY;
    rows->score = (double *)(rows->row + 1);
    return records_open(ctx, folder, record_size(modes), &rows->file);
}

void fit_rows_close(fit_rows *rows)
{
    records_close(&rows->file);
    free(rows->row);
    *rows = (fit_rows){ .file.fd = -1 };
}

void fit_forget_arrays(apsm_fit *f)
{
    f->local = f->world = f->original = NULL;
    f->variance = f->sd = f->sd_normal = f->mesh_sd = NULL;
    f->observed = f->mesh_observed = NULL;
    f->mesh = f->cropped = (apsm_mesh){ 0 };
}

apsm_status fit_rows_put(apsm_context *ctx, const fit_rows *rows, size_t i, const fit_row *row)
{
    fit_row *record = calloc(1, record_size(rows->modes));
    if (!record) return APSM_ERR_MEMORY;
    *record = *row;
    if (row->figures.score)
        memcpy(record + 1, row->figures.score, rows->modes * sizeof *row->figures.score);
    const apsm_status status = records_put(ctx, &rows->file, i, record);
    free(record);
    return status;
}

apsm_status fit_rows_get(apsm_context *ctx, fit_rows *rows, size_t i)
{
    APSM_TRY(records_get(ctx, &rows->file, i, rows->row));
    rows->row->figures.score = rows->score;
    return APSM_OK;
}
