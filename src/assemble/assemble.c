/* The job: the parts one after the other, each as a job of its own, then all of them together. */
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "assemble/job.h"
#include "core/sized.h"
#include "files/files.h"
#include "files/shards.h"
#include "folder/manifest_json.h"
#include "folder/names.h"
#include "run/source.h"
#include "session/manifest.h"

/* ---- the folder ---- */

/* Whether no file is in it, or none but what shares have kept of the parts. */
static bool holds_nothing(const char *folder, bool but_shares)
{
    apsm_file_list list = { 0 };
    bool nothing = apsm_list_files(NULL, folder, true, &list) == APSM_OK;
    for (size_t k = 0; k < list.n && nothing; k++)
        nothing =
            but_shares && strncmp(list.path[k], "parts/", 6) == 0 && shard_is_one(list.path[k]);
    apsm_file_list_free(&list);
    return nothing;
}

/* Whether the folder's manifest says that it holds a joint. */
static apsm_status is_joint(const joint_job *job, bool *ours)
{
    json_t *root = NULL;
    char *path = apsm_path_join(job->settings->run.folder, FOLDER_MANIFEST);
    *ours = false;
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    if (apsm_file_exists(path)) {
        status = apsm_json_read(job->ctx, path, &root);
        *ours = status == APSM_OK && manifest_json_is_joint(root);
        json_decref(root);
    }
    free(path);
    return status;
}

/* A folder that holds something must be ours, and is then only gone on with or replaced if asked.
 */
static apsm_status check_folder(const joint_job *job)
{
    const apsm_run_settings *s = &job->settings->run;
    bool ours;
    APSM_TRY(apsm_refuse_root(job->ctx, s->folder));
    if (!apsm_is_folder(s->folder) || holds_nothing(s->folder, true)) return APSM_OK;
    APSM_TRY(is_joint(job, &ours));
    if (ours && (s->resume || s->overwrite)) return APSM_OK;
    if (ours)
        return apsm_fail(job->ctx, APSM_ERR_STATE,
                         "%s: holds a joint model already; continue it with --resume, replace it "
                         "with --overwrite, or choose another folder",
                         s->folder);
    return apsm_fail(job->ctx, APSM_ERR_STATE,
                     "%s: holds files that are no joint model of ours; choose another folder",
                     s->folder);
}

/* The mark that the folder is ours, before anything else is in it. */
static apsm_status mark_folder(const joint_job *job)
{
    char *path = apsm_path_join(job->settings->run.folder, FOLDER_MANIFEST);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    if (!apsm_file_exists(path)) {
        json_t *root = json_pack("{s:s, s:i, s:s, s:{}, s:[], s:{}, s:{}, s:{}}", "format",
                                 FORMAT_MANIFEST, "version", MANIFEST_VERSION, "apsm", APSM_VERSION,
                                 "options", "inputs", "stages", "outputs", "joint");
        status = apsm_json_write_sealed(job->ctx, path, root);
        json_decref(root);
    }
    free(path);
    return status;
}

/* ---- one part ---- */

/* The options that a part's job is given: all but those that are settled here. */
static size_t options_of_part(const joint_job *job, size_t d, const char *(*set)[2])
{
    const apsm_run_settings *s = &job->settings->run;
    size_t n = 0;
    for (size_t k = 0; k < s->n_set; k++) {
        if (strcmp(s->set[k][0], "exclude") == 0 || strcmp(s->set[k][0], "pattern") == 0) continue;
        set[n][0] = s->set[k][0];
        set[n++][1] = s->set[k][1];
    }
    if (job->part[d].open) {
        set[n][0] = "open";
        set[n++][1] = "true";
    } else if (job->by_label || job->by_project) {
        set[n][0] = job->by_label ? "labels" : "domain";
        set[n++][1] = job->part[d].what;
    }
    return n;
}

static size_t inputs_of_part(const joint_job *job, size_t d, const char **inputs)
{
    size_t n = 0;
    if (job->by_project) {
        inputs[0] = job->settings->run.inputs[0];
        return 1;
    }
    for (size_t i = 0; i < job->subjects; i++) {
        const size_t k = job->subject[i].input[d];
        if (k != APSM_NO_CASE) inputs[n++] = job->list.cases[k].path;
    }
    return n;
}

/* Arrays that a part's job is described with, and what lies around the part: NULL before all are
 * groomed. */
typedef struct describing {
    const char *(*set)[2];
    const char **inputs;
    joint_around *around;
} describing;

/* ---- several processes: all go through the parts, and the first alone writes ---- */

static bool helps(const joint_job *job)
{
    return job->settings->run.company && job->settings->run.shard > 0;
}

/* It keeps what it grooms of the parts, and knows nobody. */
static bool is_share(const apsm_run_settings *run)
{
    return run->shards > 0 && !run->company;
}

/* Waits for all of them; what the first one says. */
static size_t meet(const joint_job *job, size_t word)
{
    const apsm_company *company = job->settings->run.company;
    return company ? company->meet(company->user, word) : word;
}

/* What the first says of a part. */
enum { GROOMS = 1, RESUMES = 2 };

/* Grooms unless that is done, or helps the first to do so. */
static apsm_status groom_part(const joint_job *job, apsm_run_settings *s, bool again)
{
    apsm_run *run = NULL;
    size_t word = 0;
    if (!helps(job)) {
        APSM_TRY(apsm_run_open(job->ctx, s, &run));
        const bool done = !again && job->settings->run.resume && stage_is_done(run, "groom");
        word = (done ? 0 : GROOMS) | (s->resume ? RESUMES : 0);
    }
    word = meet(job, word);
    s->resume = word & RESUMES;
    apsm_status status = run || !(word & GROOMS) ? APSM_OK : apsm_run_open(job->ctx, s, &run);
    if (status == APSM_OK && (word & GROOMS)) status = apsm_run_groom(run);
    apsm_run_close(run);
    if (status == APSM_OK) meet(job, 0);
    return status;
}

static apsm_status run_all(const joint_job *job, const apsm_run_settings *s)
{
    apsm_run *run = NULL;
    if (helps(job)) return apsm_run_help(job->ctx, s);
    apsm_status status = apsm_run_open(job->ctx, s, &run);
    if (status == APSM_OK) status = s->dry ? apsm_run_dry(run) : apsm_run_all(run);
    apsm_run_close(run);
    return status;
}

static apsm_run_settings settings_of_part(const joint_job *job, size_t d, const describing *w)
{
    apsm_run_settings settings = job->settings->run;
    settings.folder = job->part[d].folder;
    settings.n_set = options_of_part(job, d, w->set);
    settings.set = (const char *const(*)[2])w->set;
    settings.n_inputs = inputs_of_part(job, d, w->inputs);
    settings.inputs = w->inputs;
    return settings;
}

/* Grooming of part d once more, with what the others tell of poses. */
static apsm_status groom_again(const joint_job *job, size_t d, const describing *w)
{
    apsm_run_settings settings = settings_of_part(job, d, w);
    const apsm_surroundings surroundings = { w->around, joint_around_of, joint_around_turn };
    settings.resume = false;
    settings.overwrite = true;
    settings.surroundings = &surroundings;
    settings.surroundings_size = sizeof surroundings;
    w->around->of = d;
    apsm_log(job->ctx, APSM_LOG_INFO, "part %s is aligned as the whole subjects are",
             job->part[d].name);
    return groom_part(job, &settings, true);
}

static apsm_status orient_parts(const joint_job *job, describing *w)
{
    joint_around around = { 0 };
    bool *again = malloc(job->n * sizeof *again);
    apsm_status status = again ? joint_around_read(job, &around) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = joint_orient(&around, again);
    w->around = &around;
    for (size_t d = 0; d < job->n && status == APSM_OK; d++)
        if (again[d]) status = groom_again(job, d, w);
    w->around = NULL;
    joint_around_free(&around);
    free(again);
    return status;
}

/* All steps of part d; the first alone, as long as nothing is known of the others. */
static apsm_status run_part(const joint_job *job, size_t d, const describing *w)
{
    apsm_run_settings settings = settings_of_part(job, d, w);
    const apsm_surroundings surroundings = { w->around, w->around ? joint_around_of : NULL, NULL };
    settings.resume = w->around || (settings.resume && apsm_is_folder(settings.folder));
    if (w->around) {
        w->around->of = d;
        settings.overwrite = false;
    }
    settings.surroundings = &surroundings;
    settings.surroundings_size = sizeof surroundings;
    apsm_log(job->ctx, APSM_LOG_INFO, "part %s (%zu of %zu)", job->part[d].name, d + 1, job->n);
    return settings.dry || w->around ? run_all(job, &settings) : groom_part(job, &settings, false);
}

static apsm_status run_parts(const joint_job *job)
{
    joint_around around = { .job = job };
    describing w = { malloc((job->settings->run.n_set + 1) * sizeof *w.set),
                     malloc((job->subjects + 1) * sizeof *w.inputs), NULL };
    apsm_status status = w.set && w.inputs ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t d = 0; d < job->n && status == APSM_OK; d++) status = run_part(job, d, &w);
    const bool ends = job->settings->run.dry || is_share(&job->settings->run);
    if (status == APSM_OK && !ends) status = orient_parts(job, &w);
    if (status == APSM_OK && !ends) {
        w.around = &around;
        status = joint_around_read(job, &around);
        for (size_t d = 0; d < job->n && status == APSM_OK; d++) status = run_part(job, d, &w);
        joint_around_free(&around);
    }
    free(w.set);
    free(w.inputs);
    return status;
}

/* ---- all ---- */

static apsm_status put_together(joint_job *job)
{
    joint_cohort cohort = { 0 };
    joint_figures figures = { 0 };
    apsm_status status = joint_load(job, &cohort);
    if (status == APSM_OK) status = joint_measure(job, &cohort, &figures);
    if (status == APSM_OK) status = joint_write(job, &cohort, &figures);
    joint_figures_free(&figures, cohort.n);
    joint_cohort_free(&cohort);
    return status;
}

/* A folder that was made for parts of which none was begun. */
static void remove_made(const joint_job *job)
{
    const char *folder = job->settings->run.folder;
    char *parts = apsm_path_join(folder, "parts"), *mark = apsm_path_join(folder, FOLDER_MANIFEST);
    if (parts && mark && (!apsm_is_folder(parts) || holds_nothing(parts, false))) {
        rmdir(parts);
        unlink(mark);
    }
    free(parts);
    free(mark);
}

static apsm_status run_locked(joint_job *job)
{
    apsm_lock lock;
    size_t made;
    APSM_TRY(apsm_make_locked_folder(job->ctx, job->settings->run.folder, &made, &lock));
    apsm_status status = mark_folder(job);
    if (status == APSM_OK) status = joint_share(job);
    if (status == APSM_OK) meet(job, 0);
    if (status == APSM_OK) status = run_parts(job);
    if (status == APSM_OK) status = put_together(job);
    const bool for_nothing = made > 0 && status != APSM_OK && status != APSM_ERR_INTERRUPTED;
    if (for_nothing) remove_made(job); /* while it is locked */
    apsm_unlock_folder(&lock);
    if (for_nothing) apsm_remove_empty_folders(job->settings->run.folder, made);
    return status;
}

/* Without lock, folder and what becomes of the parts, which are the first's. */
static apsm_status help(const joint_job *job)
{
    meet(job, 0);
    return run_parts(job);
}

static apsm_status take_settings(apsm_context *ctx, const apsm_run_settings *run, size_t run_size,
                                 const apsm_joint_settings *given, size_t size, joint_settings *s)
{
    static const char door[] = "apsm_joint_run";
    apsm_joint_settings known = { 0 };
    *s = (joint_settings){ 0 };
    APSM_TRY(apsm_take_settings(ctx, door, run, run_size, &s->run, sizeof s->run));
    APSM_TRY(apsm_take_settings(ctx, door, given, size, &known, sizeof known));
    s->parts = known.parts;
    s->align = known.align;
    s->shared = known.shared;
    return APSM_OK;
}

apsm_status apsm_joint_wanted_sized(apsm_context *ctx, const apsm_run_settings *run,
                                    size_t run_size, const apsm_joint_settings *given, size_t size,
                                    bool *wanted)
{
    joint_settings settings;
    APSM_TRY(take_settings(ctx, run, run_size, given, size, &settings));
    const apsm_run_settings *s = &settings.run;
    const joint_job job = { .ctx = ctx, .settings = &settings };
    const char *ignore = joint_setting(&job, "ignore");
    apsm_project project = { 0 };
    *wanted = settings.parts != NULL;
    if (*wanted || s->n_inputs != 1 || !apsm_is_project_file(s->inputs[0]) ||
        joint_setting(&job, "domain") || (ignore && source_list_has(ignore, "domains")))
        return APSM_OK;
    APSM_TRY(apsm_project_read(ctx, s->inputs[0], &project));
    *wanted = apsm_project_domains(&project) > 1;
    apsm_project_free(&project);
    return APSM_OK;
}

/* What the process does of the job. */
static apsm_status do_job(joint_job *job)
{
    const apsm_run_settings *run = &job->settings->run;
    if (helps(job)) return help(job);
    return run->dry || is_share(run) ? run_parts(job) : run_locked(job);
}

static void forget_company(apsm_run_settings *run)
{
    run->company = NULL;
    run->shard = run->shards = 0;
}

apsm_status apsm_joint_run_sized(apsm_context *ctx, const apsm_run_settings *run, size_t run_size,
                                 const apsm_joint_settings *given, size_t size)
{
    joint_settings settings;
    APSM_TRY(take_settings(ctx, run, run_size, given, size, &settings));
    joint_job job = { .ctx = ctx, .settings = &settings };
    /* What two parts share is cut by the first, which then does all. */
    if (settings.shared && helps(&job)) return APSM_OK;
    if (settings.shared && is_share(&settings.run))
        return apsm_fail(
            ctx, APSM_ERR_UNSUPPORTED,
            "--shared-boundary: what two parts share is cut by one process; leave --shard out");
    if (settings.shared) forget_company(&settings.run);
    apsm_status status = joint_parse(&job);
    if (status == APSM_OK && !helps(&job)) status = check_folder(&job);
    if (status == APSM_OK) status = joint_group(&job);
    if (status == APSM_OK) status = do_job(&job);
    joint_job_free(&job);
    return status;
}
