/* From particles to everything that is said about them: model.json, scores.csv, meshes/,
 * evaluation.json and .csv, certificate.json. */
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "files/particles_file.h"
#include "fit/calibration_file.h"
#include "folder/certificate_json.h"
#include "folder/evaluation_json.h"
#include "folder/model_json.h"
#include "folder/names.h"
#include "geometry/affine.h"
#include "judge/certify.h"
#include "run/features.h"
#include "run/landmarks.h"
#include "run/results.h"
#include "run/shapes.h"
#include "run/state.h"
#include "session/guard.h"
#include "session/kept.h"
#include "session/manifest.h"
#include "session/session.h"

/* Modes whose meshes are written: those that make up this share of the variance, at most. */
static const double shown_share = 0.95;
enum { MOST_SHOWN = 10 };

typedef struct evaluation_work {
    apsm_run *run;
    size_t I, J;
    double *P; /* I x J x 3, world */
    apsm_shape_model model;
    apsm_evaluation evaluation;
    apsm_warp warp; /* of the template's mesh */
    cohort_certificate certificate;
    landmark_errors landmarks; /* L 0: none */
} evaluation_work;

static const char *name_of(const evaluation_work *w, size_t i)
{
    return w->run->project.subjects[i].name;
}

/* ---- particles in ---- */

static apsm_status read_first(apsm_run *run, evaluation_work *w)
{
    double *P = NULL;
    const char *stored = run->project.subjects[0].world_particles;
    if (!stored)
        return apsm_fail(run->ctx, APSM_ERR_STATE,
                         "%s: no particles yet; run `apsm optimize -o %s` first", run->folder,
                         run->folder);
    char *path = apsm_project_path(&run->project, stored);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_particles_read(run->ctx, path, &w->J, &P);
    free(path);
    free(P);
    return status;
}

static apsm_status read_particles(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    evaluation_work *w = user;
    const apsm_subject *s = &w->run->project.subjects[i];
    if (!s->world_particles)
        return apsm_fail(ctx, APSM_ERR_STATE, "%s: has no particles; run `apsm optimize -o %s`",
                         s->name, w->run->folder);
    char *path = apsm_project_path(&w->run->project, s->world_particles);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_particles_read_n(ctx, path, w->J, w->P + i * w->J * 3);
    free(path);
    return status;
}

static apsm_status copy_particles(apsm_run *run, evaluation_work *w)
{
    if (!run->results.P)
        return apsm_fail(run->ctx, APSM_ERR_STATE, "job in memory: optimize its particles first");
    w->J = run->results.J;
    w->P = malloc(w->I * w->J * 3 * sizeof *w->P);
    if (!w->P) return APSM_ERR_MEMORY;
    memcpy(w->P, run->results.P, w->I * w->J * 3 * sizeof *w->P);
    return APSM_OK;
}

static apsm_status load_particles(apsm_run *run, evaluation_work *w)
{
    w->I = run->project.n;
    if (run_is_in_memory(run)) return copy_particles(run, w);
    APSM_TRY(read_first(run, w));
    w->P = malloc(w->I * w->J * 3 * sizeof *w->P);
    if (!w->P) return APSM_ERR_MEMORY;
    return apsm_parallel_for(run->ctx, w->I, read_particles, w, NULL);
}

/* ---- figures ---- */

static apsm_status lend_shape(apsm_context *ctx, size_t i, const apsm_mesh **mesh,
                              const apsm_bvh **bvh, void *user)
{
    (void)ctx;
    const apsm_cohort *cohort = user;
    *mesh = &cohort->shape[i].mesh;
    *bvh = cohort->shape[i].bvh;
    return APSM_OK;
}

static apsm_status compute(evaluation_work *w)
{
    apsm_run *run = w->run;
    const size_t t = run->cohort.template_index;
    const apsm_mesh *mesh = &run->cohort.shape[t].mesh;
    const apsm_mesh_source shapes = { lend_shape, NULL, &run->cohort };
    const apsm_evaluate_input input = {
        .I = w->I,
        .J = w->J,
        .P = w->P,
        .model = &w->model,
        .options = run->options.evaluate,
        .shape = run->options.evaluate.surface_distance ? &shapes : NULL,
        .template_mesh = mesh,
        .template_index = t,
        .warp = &w->warp,
    };
    APSM_TRY(apsm_shape_model_fit(run->ctx, w->I, w->J, w->P, &w->model));
    APSM_TRY(apsm_warp_share(run->ctx, APSM_PHI_R, mesh->nv, mesh->V, w->J, w->P + t * w->J * 3,
                             &w->warp));
    APSM_TRY(apsm_evaluate(run->ctx, &input, &w->evaluation));
    if (!apsm_is_share(run->ctx)) APSM_TRY(landmarks_judge(run, w->J, w->P, &w->landmarks));
    return certify_cohort(run->ctx, &run->cohort, w->J, w->P,
                          json_object_get(run->manifest, "notes"), &w->certificate);
}

/* ---- model.json, scores.csv ---- */

static apsm_status write_model(const evaluation_work *w)
{
    apsm_run *run = w->run;
    char *model = run_path(run, FOLDER_MODEL), *scores = run_path(run, FOLDER_SCORES_CSV);
    apsm_status status = model && scores ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = model_json_write(run->ctx, model, &w->model);
    if (status == APSM_OK)
        status = scores_csv_write(run->ctx, scores, run->names, "mode", &w->model);
    free(model);
    free(scores);
    return status;
}

/* ---- evaluation.json, evaluation.csv, certificate.json ---- */

static apsm_status write_figures(const evaluation_work *w)
{
    apsm_run *run = w->run;
    const evaluation_told told = { &w->evaluation,
                                   run->names,
                                   run->cohort.template_index,
                                   &w->landmarks,
                                   (const char *const *)run->landmarks.name,
                                   landmarks_use_word(run) };
    char *json = run_path(run, FOLDER_EVALUATION), *csv = run_path(run, FOLDER_EVALUATION_CSV),
         *certificate = run_path(run, FOLDER_CERTIFICATE);
    apsm_status status = json && csv && certificate ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = evaluation_json_write(run->ctx, json, &told);
    if (status == APSM_OK) status = evaluation_csv_write(run->ctx, csv, &told, &w->certificate);
    if (status == APSM_OK)
        status = certificate_json_write(run->ctx, certificate, &run->cohort, &w->certificate);
    free(json);
    free(csv);
    free(certificate);
    return status;
}

/* ---- meshes/ ---- */

/* The template's mesh warped to particles p, moved by M (NULL: left in the world frame). */
static apsm_status write_warped(apsm_context *ctx, const evaluation_work *w, const double *p,
                                const double *M, char *path)
{
    const apsm_mesh *from = &w->run->cohort.shape[w->run->cohort.template_index].mesh;
    apsm_mesh mesh = { 0 };
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = apsm_mesh_copy(from, &mesh);
    if (status == APSM_OK) {
        apsm_warp_apply(&w->warp, p, mesh.V);
        if (M) apsm_mesh_transform(&mesh, M);
        status = apsm_write_mesh(ctx, path, &mesh);
    }
    apsm_mesh_free(&mesh);
    free(path);
    return status;
}

static apsm_status write_reconstruction(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const evaluation_work *w = user;
    double to_local[16];
    APSM_TRY(apsm_affine_invert(w->run->transforms + 16 * i, to_local));
    return write_warped(ctx, w, w->P + i * w->J * 3, to_local,
                        run_pathf(w->run, "meshes/%s_reconstructed.ply", name_of(w, i)));
}

static size_t shown_modes(const apsm_evaluation *e)
{
    size_t n = 0;
    while (n < e->modes && n < MOST_SHOWN && (n == 0 || e->compactness[n - 1] < shown_share)) n++;
    return n;
}

static apsm_status write_mode(const evaluation_work *w, size_t k, double sd, const char *label,
                              double *p)
{
    const apsm_shape_model *m = &w->model;
    const double b = sd * sqrt(m->variance[k]);
    for (size_t x = 0; x < m->J * 3; x++) p[x] = m->mean[x] + b * m->mode[k * m->J * 3 + x];
    return write_warped(w->run->ctx, w, p, NULL,
                        run_pathf(w->run, "meshes/mode_%02zu_%s2sd.ply", k + 1, label));
}

static apsm_status write_modes(const evaluation_work *w)
{
    double *p = malloc(w->J * 3 * sizeof *p);
    if (!p) return APSM_ERR_MEMORY;
    const size_t n = shown_modes(&w->evaluation);
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < n && status == APSM_OK; k++) {
        status = write_mode(w, k, -2, "minus", p);
        if (status == APSM_OK) status = write_mode(w, k, 2, "plus", p);
    }
    free(p);
    return status;
}

/* An earlier model may have shown more modes. */
static apsm_status remove_other_modes(const evaluation_work *w)
{
    apsm_run *run = w->run;
    for (size_t k = shown_modes(&w->evaluation); k < MOST_SHOWN; k++) {
        APSM_TRY(run_remove(run, run_pathf(run, "meshes/mode_%02zu_minus2sd.ply", k + 1)));
        APSM_TRY(run_remove(run, run_pathf(run, "meshes/mode_%02zu_plus2sd.ply", k + 1)));
    }
    return APSM_OK;
}

/* The mean shape, with the mean of every field that is sampled. */
static apsm_status write_mean(evaluation_work *w)
{
    apsm_run *run = w->run;
    const size_t S = run->features.S;
    char *path = run_path(run, "meshes/mean.ply");
    if (S == 0) return write_warped(run->ctx, w, w->model.mean, NULL, path);
    const apsm_mesh *from = &run->cohort.shape[run->cohort.template_index].mesh;
    apsm_mesh mesh = { 0 };
    double *value = NULL;
    apsm_mesh_field *fields = calloc(S, sizeof *fields);
    apsm_status status = path && fields ? apsm_mesh_copy(from, &mesh) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = features_mean(run, &w->warp, w->J, w->P, &value);
    if (status == APSM_OK) {
        apsm_warp_apply(&w->warp, w->model.mean, mesh.V);
        for (size_t s = 0; s < S; s++)
            fields[s] = (apsm_mesh_field){ run->features.name[s], value + s * mesh.nv };
        status = apsm_write_mesh_fields(run->ctx, path, &mesh, S, fields);
    }
    apsm_mesh_free(&mesh);
    free(fields);
    free(value);
    free(path);
    return status;
}

static apsm_status write_meshes(evaluation_work *w)
{
    apsm_run *run = w->run;
    char *folder = run_path(run, "meshes");
    if (!folder) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_make_folder(run->ctx, folder);
    free(folder);
    APSM_TRY(status);
    APSM_TRY(write_mean(w));
    APSM_TRY(write_modes(w));
    APSM_TRY(remove_other_modes(w));
    return apsm_parallel_for(run->ctx, w->I, write_reconstruction, w, "reconstruct");
}

/* ---- the last lines a user reads ---- */

static void tell(const evaluation_work *w)
{
    apsm_context *ctx = w->run->ctx;
    const apsm_evaluation *e = &w->evaluation;
    if (e->surface)
        apsm_log(ctx, APSM_LOG_INFO, "surface distance: mean %.4g, max %.4g (two-way; template %s)",
                 e->surface_summary.two_way.mean, e->surface_summary.two_way.max,
                 name_of(w, w->run->cohort.template_index));
    if (e->others > 0)
        apsm_log(ctx, APSM_LOG_INFO,
                 "surface distance with %zu other shapes as template: mean %.4g, max %.4g",
                 e->others, e->other_templates.mean, e->other_templates.max);
    if (e->n_generalization > 0)
        apsm_log(ctx, APSM_LOG_INFO,
                 "one mode: compactness %.3f, generalization %.4g, specificity %.4g (%s)",
                 e->compactness[0], e->generalization[0], e->specificity[0],
                 apsm_definition_name(e->definition));
    landmarks_tell(w->run, &w->landmarks);
    certify_tell(ctx, &w->run->cohort, &w->certificate);
}

static apsm_status compute_part(apsm_run *run, void *user)
{
    (void)run;
    return compute(user);
}

/* What shares have kept is found; of a share all is that there is to do. */
static apsm_status compute_with_kept(evaluation_work *w)
{
    apsm_run *run = w->run;
    char identity[65];
    APSM_TRY(kept_begin_shares(run));
    if (!run->kept) return run_shared(run, compute_part, w);
    APSM_TRY(run_identity(run, identity));
    kept_pieces_of_particles(run, identity, w->I * w->J * 3, w->P);
    kept_deal_shares(run);
    const apsm_status status = compute(w);
    apsm_context_set_keeper(run->ctx, NULL);
    return kept_end_share(run, status);
}

/* What fits by the model will need; of two shapes none can be. */
static apsm_status write_calibration(const evaluation_work *w)
{
    apsm_run *run = w->run;
    bool made = false;
    if (w->I >= 3) APSM_TRY(fit_calibrate_folder(run->ctx, run->folder, &made));
    return made ? APSM_OK : run_remove(run, run_path(run, FOLDER_CALIBRATION));
}

static apsm_status evaluate_and_write(evaluation_work *w)
{
    APSM_TRY(compute_with_kept(w));
    if (run_is_in_memory(w->run) || w->run->helps) return APSM_OK;
    APSM_TRY(write_model(w));
    APSM_TRY(write_figures(w));
    APSM_TRY(features_write_table(w->run, w->J, w->P));
    APSM_TRY(write_meshes(w));
    return write_calibration(w);
}

/* What was found becomes the session's. */
static apsm_status hand_over(evaluation_work *w)
{
    apsm_run *run = w->run;
    run_forget_results(run);
    run->results = (run_results){ .I = w->I,
                                  .J = w->J,
                                  .P = w->P,
                                  .evaluated = true,
                                  .model = w->model,
                                  .certificate = w->certificate };
    w->P = NULL;
    w->model = (apsm_shape_model){ 0 };
    w->certificate = (cohort_certificate){ 0 };
    return figures_take(&w->evaluation, &run->results.figures);
}

static apsm_status conclude(evaluation_work *w, const stage_clock *clock)
{
    apsm_run *run = w->run;
    APSM_TRY(run_write_project(run)); /* the definition may be another one */
    APSM_TRY(manifest_set_options(run));
    APSM_TRY(stage_end(run, "evaluate", clock));
    tell(w);
    return hand_over(w);
}

apsm_status apsm_run_evaluate(apsm_run *run)
{
    if (!run) return APSM_ERR_ARG;
    APSM_TRY(manifest_refuse_joint(run));
    const stage_clock clock = stage_begin();
    evaluation_work w = { .run = run };
    const bool share = run->helps && !run->company;
    apsm_status status = run->helps && !share ? APSM_OK : guard_files(run, "evaluate", NULL);
    if (status == APSM_OK) status = run_load_cohort(run, share ? RUN_OWN_SURFACES : RUN_NO_FIELDS);
    if (status == APSM_OK) status = load_particles(run, &w);
    if (status == APSM_OK && !run->helps) status = stage_start(run, "evaluate");
    if (status == APSM_OK) status = evaluate_and_write(&w);
    if (status == APSM_OK && !run->helps) status = conclude(&w, &clock);
    if (status == APSM_OK && !run->helps) status = kept_end_shares(run);
    certify_free(&w.certificate);
    apsm_evaluation_free(&w.evaluation);
    landmark_errors_free(&w.landmarks);
    apsm_shape_model_free(&w.model);
    apsm_warp_free(&w.warp);
    free(w.P);
    return status;
}
