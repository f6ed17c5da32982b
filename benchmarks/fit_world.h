/* fit_world.h -- what the benchmarks of fits share: a model, and the model of the others for every
 * fold of its shapes. */
#ifndef APSM_BENCH_FIT_WORLD_H
#define APSM_BENCH_FIT_WORLD_H

#include "bench.h"

#include "fit/fit_model.h"
#include "fit/parts.h"
#include "folder/model_folder.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"

typedef struct left_out {
    apsm_context *ctx;
    model_folder folder;
    apsm_fit_model *joint;
    size_t folds;
} left_out;

/* Ends the program if something failed. */
static inline void must_fit(const left_out *b, apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "%s\n", apsm_error_text(b->ctx));
    exit(1);
}

static inline void open_model(left_out *b, const char *path, size_t folds)
{
    b->ctx = apsm_context_new();
    const unsigned parts = FOLDER_PARTICLES | FOLDER_SCORES | FOLDER_EVALUATED;
    must_fit(b, model_folder_read(b->ctx, path, parts, &b->folder));
    must_fit(b, apsm_fit_model_load(b->ctx, path, &b->joint));
    b->folds = folds;
}

static inline void close_model(left_out *b)
{
    apsm_fit_model_free(b->joint);
    model_folder_free(&b->folder);
    apsm_context_free(b->ctx);
}

static inline apsm_fit_model *without_fold(const left_out *b, size_t fold)
{
    apsm_fit_model *m;
    bool *out = bench_alloc(b->folder.I * sizeof *out);
    for (size_t i = 0; i < b->folder.I; i++) out[i] = i % b->folds == fold;
    must_fit(b, fit_model_without(b->ctx, b->joint, out, &m));
    free(out);
    return m;
}

static inline const double *joint_particles(const left_out *b, size_t i)
{
    return b->folder.P + i * 3 * b->folder.J;
}

/* Mean distance of particles from those of the joint model. */
static inline double apart(size_t J, const double *p, const double *q)
{
    double sum = 0;
    for (size_t j = 0; j < J; j++) sum += sqrt(vec3_distance2(p + 3 * j, q + 3 * j));
    return sum / (double)J;
}

/* From the world of the model to shape i's own frame. */
static inline void from_world(const left_out *b, size_t i, double back[16])
{
    double M[16];
    model_folder_to_world(&b->folder, i, M);
    must_fit(b, apsm_affine_invert(M, back));
}

/* n particles of the mean, each the farthest from those before. */
static inline void spread_particles(const apsm_fit_model *m, size_t n, size_t *index)
{
    const size_t J = m->model.J;
    const double *mean = m->model.mean;
    double *far = bench_doubles(J);
    for (size_t j = 0; j < J; j++) far[j] = INFINITY;
    index[0] = 0;
    for (size_t k = 1; k < n; k++) {
        index[k] = 0;
        for (size_t j = 0; j < J; j++) {
            far[j] = fmin(far[j], vec3_distance2(mean + 3 * j, mean + 3 * index[k - 1]));
            if (far[j] > far[index[k]]) index[k] = j;
        }
    }
    free(far);
}

#endif
