/* history_csv.h -- history.csv: what every epoch of the optimisation came to. */
#ifndef APSM_FOLDER_HISTORY_CSV_H
#define APSM_FOLDER_HISTORY_CSV_H

#include "optimize/optimizer.h"

/* Writes atomically. */
apsm_status history_csv_write(apsm_context *ctx, const char *path, size_t n,
                              const apsm_epoch_record *records) APSM_NODISCARD;

#endif
