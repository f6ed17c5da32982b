/* exporting.h -- an export under way, and its formats. */
#ifndef APSM_EXCHANGE_EXPORTING_H
#define APSM_EXCHANGE_EXPORTING_H

#include "apsm/exchange.h"
#include "exchange/dense.h"
#include "exchange/out_folder.h"
#include "files/files.h"

typedef struct exporting {
    apsm_context *ctx;
    const apsm_export_settings *settings;
    dense_model dense;
    size_t modes; /* to write: at most those there are */
    size_t n_sd;
    const double *sd;
    out_folder folder;
} exporting;

/* *path (malloc'ed) <- a file of the export's folder, whose name is noted and must be new. */
apsm_status exporting_file(exporting *e, char **path, const char *format, ...) APSM_NODISCARD
    APSM_PRINTF(3, 4);

/* A table of that name, opened; and a JSON file (root is taken over; NULL: out of memory). */
apsm_status exporting_table(exporting *e, const char *name, apsm_writer **w) APSM_NODISCARD;
apsm_status exporting_json(exporting *e, const char *name, struct json_t *root) APSM_NODISCARD;

/* Each writes what its format holds. */
apsm_status export_meshes(exporting *e) APSM_NODISCARD;
apsm_status export_scene(exporting *e) APSM_NODISCARD; /* of the meshes that are there */
apsm_status export_gltf(exporting *e) APSM_NODISCARD;
apsm_status export_tables(exporting *e) APSM_NODISCARD;
apsm_status export_npz(exporting *e) APSM_NODISCARD;
apsm_status export_monai(exporting *e) APSM_NODISCARD;
apsm_status export_slicermorph(exporting *e) APSM_NODISCARD;
apsm_status export_statismo(exporting *e) APSM_NODISCARD;

#endif
