#include "folder/manifest_json.h"

#include <string.h>
#include <sys/stat.h>

#include "files/files.h"
#include "folder/names.h"
#include "folder/stages.h"

/* ---- the file ---- */

json_t *manifest_json_new(void)
{
    return json_pack("{s:s, s:i, s:s, s:{}, s:[], s:{}, s:{}}", "format", FORMAT_MANIFEST,
                     "version", MANIFEST_VERSION, "apsm", APSM_VERSION, "options", "inputs",
                     "stages", "outputs");
}

static apsm_status check(apsm_context *ctx, const char *path, const json_t *root)
{
    APSM_TRY(apsm_json_check(ctx, path, root, FORMAT_MANIFEST, MANIFEST_VERSION));
    if (json_is_object(json_object_get(root, "options")) &&
        json_is_array(json_object_get(root, "inputs")) &&
        json_is_object(json_object_get(root, "stages")))
        return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: lacks options, inputs or stages; remove it and groom again", path);
}

apsm_status manifest_json_read(apsm_context *ctx, const char *path, json_t **root, bool *is_intact)
{
    *root = NULL;
    apsm_status status = apsm_json_read(ctx, path, root);
    if (status == APSM_OK) status = check(ctx, path, *root);
    if (status == APSM_OK) status = apsm_json_is_intact(ctx, path, is_intact);
    if (status == APSM_OK) return APSM_OK;
    json_decref(*root);
    *root = NULL;
    return status;
}

apsm_status manifest_json_write(apsm_context *ctx, const char *path, json_t *root, bool is_intact)
{
    if (is_intact) return apsm_json_write_sealed(ctx, path, root);
    json_object_del(root, "sha256");
    return apsm_json_write(ctx, path, root);
}

/* ---- inputs ---- */

json_t *manifest_json_inputs(size_t n, const char *const *names, const char *const *paths,
                             char (*sha256)[65])
{
    json_t *inputs = json_array();
    int failed = !inputs;
    for (size_t i = 0; i < n && !failed; i++) {
        struct stat info;
        const json_int_t bytes = stat(paths[i], &info) == 0 ? (json_int_t)info.st_size : 0;
        failed = json_array_append_new(inputs,
                                       json_pack("{s:s, s:s, s:I, s:s}", "name", names[i], "path",
                                                 paths[i], "bytes", bytes, "sha256", sha256[i]));
    }
    if (!failed) return inputs;
    json_decref(inputs);
    return NULL;
}

const char *manifest_json_sha256(const json_t *root, const char *name)
{
    size_t i;
    json_t *input;
    json_array_foreach(json_object_get(root, "inputs"), i, input)
    {
        const char *it = json_string_value(json_object_get(input, "name"));
        if (it && strcmp(it, name) == 0) return json_string_value(json_object_get(input, "sha256"));
    }
    return NULL;
}

/* ---- stages ---- */

static bool has_begun(const json_t *begun, const char *stage)
{
    size_t k;
    json_t *one;
    json_array_foreach(begun, k, one) if (json_is_string(one) &&
                                          strcmp(json_string_value(one), stage) == 0) return true;
    return false;
}

int manifest_json_set_begun(json_t *root, const char *stage, bool with)
{
    const json_t *before = json_object_get(root, "begun");
    json_t *begun = json_array();
    int failed = !begun;
    for (size_t k = 0; stage_of_all(k) && !failed; k++) {
        const char *one = stage_of_all(k);
        if (strcmp(one, stage) == 0 ? with : has_begun(before, one))
            failed = json_array_append_new(begun, json_string(one));
    }
    if (!failed && json_array_size(begun) == 0)
        json_object_del(root, "begun");
    else if (!failed)
        failed = json_object_set(root, "begun", begun);
    json_decref(begun);
    return failed;
}

/* ---- what it says ---- */

bool manifest_json_is_joint(const json_t *root)
{
    return json_object_get(root, "joint") != NULL;
}

bool manifest_json_is_contours(const json_t *root)
{
    return json_object_get(root, "contours") != NULL;
}

bool manifest_is_of_images(const json_t *manifest)
{
    const json_t *groomed = json_object_get(manifest, "groomed"), *shape;
    size_t i;
    json_array_foreach(groomed, i, shape)
    {
        const char *kind = json_string_value(json_object_get(shape, "kind"));
        if (!kind || strcmp(kind, "mask") != 0) return false;
    }
    return json_array_size(groomed) > 0;
}

const char *manifest_unit(const json_t *manifest)
{
    const json_t *said = json_object_get(json_object_get(manifest, "options"), "unit");
    const char *unit = json_string_value(said);
    if (unit && *unit) return unit;
    if (json_is_true(json_object_get(json_object_get(manifest, "joint"), "of_images"))) return "mm";
    return manifest_is_of_images(manifest) ? "mm" : NULL;
}
