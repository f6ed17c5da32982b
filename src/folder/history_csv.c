#include "folder/history_csv.h"

#include <math.h>

#include "files/files.h"

static void write_cell(apsm_writer *w, double x)
{
    apsm_writer_printf(w, ",");
    if (isfinite(x)) apsm_writer_number(w, x); /* an empty cell: does not apply */
}

static void write_record(apsm_writer *w, const apsm_epoch_record *r)
{
    apsm_writer_printf(w, "%ld,%ld", r->stage, r->epoch);
    const double weight[] = { r->alpha, r->beta, r->gamma, r->c };
    for (size_t k = 0; k < sizeof weight / sizeof weight[0]; k++) write_cell(w, weight[k]);
    for (size_t t = 0; t < APSM_TERMS; t++) write_cell(w, r->loss[t]);
    const double figures[] = { r->surface_error, r->step, r->mismatched, r->worst_mismatched };
    for (size_t k = 0; k < sizeof figures / sizeof figures[0]; k++) write_cell(w, figures[k]);
    apsm_writer_printf(w, ",%ld\n", r->walked);
}

apsm_status history_csv_write(apsm_context *ctx, const char *path, size_t n,
                              const apsm_epoch_record *records)
{
    apsm_writer *w = NULL;
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    apsm_writer_printf(w, "stage,epoch,alpha,beta,gamma,c");
    for (size_t t = 0; t < APSM_TERMS; t++) apsm_writer_printf(w, ",%s", apsm_loss_name(t));
    apsm_writer_printf(w, ",surface_error,step,mismatched,worst_mismatched,walked\n");
    for (size_t k = 0; k < n; k++) write_record(w, &records[k]);
    return apsm_writer_commit(w);
}
