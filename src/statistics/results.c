#include "statistics/results.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"

char *results_folder(const char *model_folder, const char *out)
{
    return out ? strdup(out) : apsm_path_join(model_folder, "statistics");
}

/* What cannot be read as JSON is not ours; want of memory is told. */
static apsm_status read_format(apsm_context *ctx, const char *path, const char *format, bool *ours)
{
    json_t *root = NULL;
    *ours = false;
    const apsm_status status = apsm_json_read(ctx, path, &root);
    if (status == APSM_ERR_MEMORY) return status;
    const char *found = json_string_value(json_object_get(root, "format"));
    *ours = found && strcmp(found, format) == 0;
    json_decref(root);
    return APSM_OK;
}

static apsm_status refuse(apsm_context *ctx, const char *folder, const char *name)
{
    return apsm_fail(ctx, APSM_ERR_STATE,
                     "%s/%s: is there, but not as apsm writes it, and is not replaced; move it, or "
                     "name another folder by -o",
                     folder, name);
}

static apsm_status claim_json(apsm_context *ctx, const char *folder, const char *json,
                              const char *format)
{
    bool ours;
    char *path = apsm_path_join(folder, json);
    const apsm_status status = path ? read_format(ctx, path, format, &ours) : APSM_ERR_MEMORY;
    free(path);
    APSM_TRY(status);
    return ours ? APSM_OK : refuse(ctx, folder, json);
}

apsm_status results_claim(apsm_context *ctx, const char *folder, const char *json,
                          const char *format, size_t n, const char *const *others)
{
    bool there;
    APSM_TRY(apsm_folder_holds(folder, json, &there));
    if (there) return claim_json(ctx, folder, json, format);
    for (size_t k = 0; k < n; k++) {
        APSM_TRY(apsm_folder_holds(folder, others[k], &there));
        if (there) return refuse(ctx, folder, others[k]);
    }
    return APSM_OK;
}

void results_plain_name(char *text)
{
    for (char *c = text; *c; c++)
        if (strchr("/:. \\", *c)) *c = '_';
}
