/* The model of a folder alone. */
#include <stdlib.h>

#include "apsm/model.h"
#include "folder/model_folder.h"

apsm_status apsm_model_open(apsm_context *ctx, const char *folder, apsm_shape_model **model)
{
    model_folder m = { 0 };
    if (!folder || !model)
        return apsm_fail(ctx, APSM_ERR_ARG, "apsm_model_open: an argument is NULL");
    *model = NULL;
    APSM_TRY(model_folder_read(ctx, folder, FOLDER_SCORES, &m));
    *model = malloc(sizeof **model);
    if (*model) {
        **model = m.model;
        m.model = (apsm_shape_model){ 0 };
    }
    model_folder_free(&m);
    return *model ? APSM_OK : apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", folder);
}
