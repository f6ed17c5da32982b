/* The files of a joint model.  Everything is written under names that manifest.json lists; it comes
 * last, and a folder without it, or with other files, is not replaced (assemble.c). */
#include "assemble/writing.h"

#include <stdlib.h>

#include "apsm/report.h"
#include "files/files.h"
#include "folder/manifest_json.h"
#include "folder/names.h"

static apsm_status make_folders(const writing *w)
{
    static const char *const names[] = { "particles", "meshes" };
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        char *path = apsm_path_join(w->job->settings->run.folder, names[k]);
        const apsm_status status = path ? apsm_make_folder(w->job->ctx, path) : APSM_ERR_MEMORY;
        free(path);
        APSM_TRY(status);
    }
    return APSM_OK;
}

static json_t *json_incomplete(const writing *w)
{
    json_t *names = json_array();
    for (size_t i = w->job->complete; i < w->job->subjects; i++)
        json_array_append_new(names, json_string(writing_subject(w, i)));
    return names;
}

/* Files that were written: their stage, bytes and SHA-256, as in the manifest of a single part. */
static apsm_status list_file(const writing *w, const char *name, json_t *list)
{
    char hex[65], *path = apsm_path_join(w->job->settings->run.folder, name);
    long long bytes = 0;
    apsm_status status = path ? apsm_sha256_file(w->job->ctx, path, hex) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_file_size(w->job->ctx, path, &bytes);
    free(path);
    APSM_TRY(status);
    json_t *entry = json_pack("[s, I, s]", "joint", (json_int_t)bytes, hex);
    return json_object_set_new(list, name, entry) == 0 ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status list_files(const writing *w, json_t *list)
{
    size_t k;
    const json_t *name;
    json_array_foreach(w->files, k, name) APSM_TRY(list_file(w, json_string_value(name), list));
    return APSM_OK;
}

static json_t *json_options(const writing *w)
{
    const apsm_run_settings *s = &w->job->settings->run;
    const char *align = w->job->settings->align;
    const char *parts = w->job->settings->parts;
    json_t *options = json_pack("{s:s, s:s}", "parts", parts ? parts : "domains", "align_parts",
                                align ? align : "global");
    for (size_t k = 0; k < s->n_set; k++)
        json_object_set_new(options, s->set[k][0], json_string(s->set[k][1]));
    return options;
}

/* Their SHA-256 are in the manifests of the parts. */
static json_t *json_inputs(const writing *w)
{
    json_t *inputs = json_array();
    for (size_t k = 0; k < w->job->list.n; k++) {
        const apsm_input_case *c = &w->job->list.cases[k];
        long long bytes = 0;
        if (apsm_is_folder(c->path) || apsm_file_size(NULL, c->path, &bytes) != APSM_OK) bytes = 0;
        json_array_append_new(inputs, json_pack("{s:s, s:s, s:I}", "name", c->name, "path", c->path,
                                                "bytes", (json_int_t)bytes));
    }
    return inputs;
}

static bool are_of_images(const writing *w)
{
    for (size_t d = 0; d < w->c->n; d++)
        if (!manifest_is_of_images(w->c->folder[d].manifest)) return false;
    return true;
}

static apsm_status write_manifest(writing *w)
{
    json_t *files = json_object();
    char *path = apsm_path_join(w->job->settings->run.folder, FOLDER_MANIFEST);
    apsm_status status = path && files ? list_files(w, files) : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        json_t *root = json_pack(
            "{s:s, s:i, s:s, s:o, s:o, s:{}, s:{s:o, s:o, s:b}, s:O}", "format", FORMAT_MANIFEST,
            "version", MANIFEST_VERSION, "apsm", APSM_VERSION, "options", json_options(w), "inputs",
            json_inputs(w), "stages", "joint", "parts", writing_parts(w), "left_out",
            json_incomplete(w), "of_images", are_of_images(w), "outputs", files);
        status = apsm_json_write_sealed(w->job->ctx, path, root);
        json_decref(root);
    }
    json_decref(files);
    free(path);
    return status;
}

/* The report reads the manifest, which then lists the report too. */
static apsm_status write_report(writing *w)
{
    APSM_TRY(write_manifest(w));
    APSM_TRY(apsm_report_write(w->job->ctx, w->job->settings->run.folder));
    if (json_array_append_new(w->files, json_string(FOLDER_REPORT)) != 0) return APSM_ERR_MEMORY;
    return write_manifest(w);
}

static apsm_status write_all(writing *w)
{
    APSM_TRY(make_folders(w));
    APSM_TRY(joint_write_project(w));
    APSM_TRY(joint_write_model(w));
    APSM_TRY(joint_write_judged(w));
    APSM_TRY(joint_write_meshes(w));
    return write_report(w);
}

apsm_status joint_write(const joint_job *job, const joint_cohort *cohort,
                        const joint_figures *figures)
{
    writing w = { job, cohort, figures, json_array() };
    const apsm_status status = w.files ? write_all(&w) : APSM_ERR_MEMORY;
    json_decref(w.files);
    return status;
}
