#include "fit/fit_folder.h"

#include <stdlib.h>

#include "files/files.h"
#include "folder/names.h"

static apsm_status refuse_model(apsm_context *ctx, const fit_folder *f)
{
    static const char *const of_models[] = { FOLDER_PROJECT, FOLDER_MANIFEST };
    for (size_t k = 0; k < 2; k++) {
        bool model;
        APSM_TRY(apsm_folder_holds(f->path, of_models[k], &model));
        if (model)
            return apsm_fail(ctx, APSM_ERR_STATE,
                             "%s: is a model folder; give %s a folder of their own", f->path,
                             f->what);
    }
    return APSM_OK;
}

static apsm_status refuse_strangers(apsm_context *ctx, const fit_folder *f)
{
    for (size_t k = 0; k < f->files + f->folders; k++) {
        const bool is_file = k < f->files;
        const char *name = is_file ? f->file[k] : f->folder[k - f->files];
        bool there;
        APSM_TRY(apsm_folder_holds(f->path, name, &there));
        if (!there || (!is_file && f->overwrite)) continue;
        return apsm_fail(
            ctx, APSM_ERR_STATE, "%s: holds a %s that no %s has left%s; give another folder%s",
            f->path, name, f->maker, is_file ? "" : " whole", is_file ? "" : ", or --overwrite");
    }
    return APSM_OK;
}

apsm_status fit_folder_check(apsm_context *ctx, const fit_folder *f)
{
    bool whole;
    APSM_TRY(apsm_refuse_root(ctx, f->path));
    APSM_TRY(refuse_model(ctx, f));
    APSM_TRY(apsm_folder_holds(f->path, f->marker, &whole));
    if (whole && !f->overwrite)
        return apsm_fail(ctx, APSM_ERR_STATE,
                         "%s: holds %s already; give another folder, or --overwrite", f->path,
                         f->what);
    return whole ? APSM_OK : refuse_strangers(ctx, f);
}

apsm_status fit_folder_make(apsm_context *ctx, const fit_folder *f)
{
    for (size_t k = 0; k < f->folders; k++) {
        char *path = apsm_path_join(f->path, f->folder[k]);
        const apsm_status status = path ? apsm_make_folder(ctx, path) : APSM_ERR_MEMORY;
        free(path);
        APSM_TRY(status);
    }
    return APSM_OK;
}

apsm_status fit_folder_claim(apsm_context *ctx, const fit_folder *f)
{
    APSM_TRY(fit_folder_check(ctx, f));
    return fit_folder_make(ctx, f);
}

apsm_status fit_folder_lock(apsm_context *ctx, const fit_folder *f, apsm_lock *lock)
{
    size_t made;
    APSM_TRY(fit_folder_check(ctx, f));
    APSM_TRY(apsm_make_locked_folder(ctx, f->path, &made, lock));
    return fit_folder_check(ctx, f); /* who held it may have ended in between */
}
