#include "statistics/results.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"

char *results_folder(const char *model_folder, const char *out)
{
    return out ? strdup(out) : apsm_path_join(model_folder, "statistics");
}

static bool has(const char *folder, const char *name)
{
    char *path = apsm_path_join(folder, name);
    const bool there = path && (apsm_file_exists(path) || apsm_is_folder(path));
    free(path);
    return there;
}

static bool is_ours(apsm_context *ctx, const char *path, const char *format)
{
    json_t *root = NULL;
    if (apsm_json_read(ctx, path, &root) != APSM_OK) return false;
    const char *found = json_string_value(json_object_get(root, "format"));
    const bool ours = found && strcmp(found, format) == 0;
    json_decref(root);
    return ours;
}

static apsm_status refuse(apsm_context *ctx, const char *folder, const char *name)
{
    return apsm_fail(ctx, APSM_ERR_STATE,
                     "%s/%s: is there, but not as apsm writes it, and is not replaced; move it, or "
                     "name another folder by -o",
                     folder, name);
}

apsm_status results_claim(apsm_context *ctx, const char *folder, const char *json,
                          const char *format, size_t n, const char *const *others)
{
    if (has(folder, json)) {
        char *path = apsm_path_join(folder, json);
        if (!path) return APSM_ERR_MEMORY;
        const bool ours = is_ours(ctx, path, format);
        free(path);
        return ours ? APSM_OK : refuse(ctx, folder, json);
    }
    for (size_t k = 0; k < n; k++)
        if (has(folder, others[k])) return refuse(ctx, folder, others[k]);
    return APSM_OK;
}

void results_plain_name(char *text)
{
    for (char *c = text; *c; c++)
        if (strchr("/:. \\", *c)) *c = '_';
}
