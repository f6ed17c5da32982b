/* run.h -- the whole job, step by step: groom, initialize, optimize, evaluate.
 *
 * In a model folder every step reads what the one before left there and can be repeated on its own;
 * docs/formats.md says what the folder holds.  Without a folder shapes come in as arrays, results
 * go out as arrays, and no file is touched: the steps are the same, and so are the results.  They
 * do not depend on the threads, on whether the steps ran in one process, or on interruptions. */
#ifndef APSM_RUN_H
#define APSM_RUN_H

#include <stdbool.h>

#include "apsm/evaluate.h"
#include "apsm/model.h"
#include "apsm/options.h"
#include "apsm/volume.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What is asked for; begin with {0}.  All borrowed during apsm_run_open.  Later versions may add
 * fields at the end. */
typedef struct apsm_run_settings {
    const char *folder; /* MODEL_DIR; NULL: a job in memory, which takes nothing but set */
    /* groom only; n_inputs 0: the inputs that the project already names */
    size_t n_inputs;
    const char *const *inputs;
    /* Options in the order given: "preset", any name of apsm/options.h, or one of the texts
     * "labels", "reflect_match", "exclude", "pattern", "ignore", "domain", "template", "seed",
     * "landmarks" and "unit".
     * They go on top of those stored in the project. */
    size_t n_set;
    const char *const (*set)[2];
    size_t memory;  /* bytes of resident memory to keep to, shapes being moved to a file in state/;
                       0: no limit.  The result is the same. */
    bool resume;    /* go on with an unfinished run: stored options and inputs must agree */
    bool overwrite; /* groom may replace a model that is already in the folder */
    bool fresh;     /* a project in the folder does not matter */
    bool dry;       /* only apsm_run_dry will be called: nothing is made or locked */
    /* Of several processes: groom and initialize do the shapes shard, shard + shards, ... (from 0)
     * of a step whose result another process will gather, keep them in state/, and end; the same
     * call without it finds them there.  shards 0: all shapes. */
    size_t shard, shards;
    /* Both structs are copied; what `user` points to is borrowed until apsm_run_close.  NULL: the
     * processes do not know each other; nothing lies around. */
    const struct apsm_company *company;
    const struct apsm_surroundings *surroundings;
    /* sizeof what company and surroundings point to, which may grow at their ends; 0: as they were
       when these two fields were added. */
    size_t company_size, surroundings_size;
} apsm_run_settings;

/* What lies around the shapes, such as the other bones of a joint: rebuilt surfaces that go into it
 * are penalised (option "contact"), and it may tell how they are turned.  A project's poses are
 * then those of the whole, and fixed shapes are aligned as the others are. */
typedef struct apsm_surroundings {
    void *user;
    /* Surfaces around the shape that was read from path, in the frame of its groomed mesh: n meshes
     * in a malloc'ed array, all given away.  Called by several threads.  NULL: not known yet. */
    apsm_status (*of)(void *user, apsm_context *ctx, const char *path, size_t *n,
                      apsm_mesh **meshes);
    /* For groom: whether it is known how that shape is turned, and R (9, out), a rotation of its
     * groomed mesh that gives all such shapes one orientation.  NULL: nothing is known. */
    bool (*turn)(void *user, const char *path, double R[9]);
} apsm_surroundings;

/* Processes that do a job together, each with its own run of the same folder and settings but
 * shard.  The first of them (0) does apsm_run_all, the others apsm_run_help. */
typedef struct apsm_company {
    void *user;
    /* Waits for all of them; returns the largest value given. */
    size_t (*meet)(void *user, size_t value);
    /* all (bytes of each, by shard) <- own (bytes).  NULL: optimize and evaluate are the first's.
     */
    void (*gather)(void *user, size_t bytes, const void *own, void *all);
} apsm_company;

typedef struct apsm_run apsm_run; /* opaque: one job */

/* Opens or makes the folder, locks it against a second run, reads its project and settles the
 * options.  *run is owned by the caller, NULL on failure.  ctx is borrowed until apsm_run_close.
 * size: of settings as the program knows them; what it does not know of is as in {0}. */
APSM_API apsm_status apsm_run_open_sized(apsm_context *ctx, const apsm_run_settings *settings,
                                         size_t size, apsm_run **run) APSM_NODISCARD;
APSM_API void apsm_run_close(apsm_run *run); /* NULL is allowed */

static inline APSM_NODISCARD apsm_status apsm_run_open(apsm_context *ctx,
                                                       const apsm_run_settings *settings,
                                                       apsm_run **run)
{
    return apsm_run_open_sized(ctx, settings, sizeof *settings, run);
}

/* Particles and surfaces that another program has made; all borrowed. */
typedef struct apsm_import {
    size_t I, J;
    const char *const *names; /* I */
    const double *P;          /* I x J x 3: in one frame, the world's */
    const apsm_mesh *meshes;  /* I: closed, each in its own frame */
    const double *to_world;   /* I x 16: from that to the world's */
    const char *const *paths; /* I: where the meshes come from; what the project names.  NULL: from
                                 no file; then it names those that are written */
    size_t template_index;
    bool drawn; /* shapes were drawn from a model: nobody's; the manifest says so */
} apsm_import;
/* Makes a model of them in the run's folder, which holds none yet: nothing is groomed or optimised;
 * evaluated, certified and reported as one of our own, so that it can be fitted, tested, exported
 * and extended. */
APSM_API apsm_status apsm_run_import_sized(apsm_run *run, const apsm_import *input,
                                           size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_run_import(apsm_run *run, const apsm_import *input)
{
    return apsm_run_import_sized(run, input, sizeof *input);
}

/* Whether text is a value of "unit": a word of a few letters, to show behind lengths. */
APSM_API apsm_status apsm_run_check_unit(apsm_context *ctx, const char *text) APSM_NODISCARD;
/* Whether text is a value of "ignore": words with commas, of constraints, landmarks, normals,
 * fields, geodesics, fixed, domains, reflect and shared. */
APSM_API apsm_status apsm_run_check_ignore(apsm_context *ctx, const char *text) APSM_NODISCARD;

/* The options in force, and any text setting ("" if not set). */
APSM_API const apsm_options *apsm_run_options(const apsm_run *run);
APSM_API const char *apsm_run_text(const apsm_run *run, const char *name);

/* What would be done, without doing it: inputs are listed and their headers read; time and
 * memory are estimated from measured rates.  One log line each. */
APSM_API apsm_status apsm_run_dry(apsm_run *run) APSM_NODISCARD;

/* ---- a job in memory: its shapes ----
 * name: what the shape is called, unique; no more than 200 bytes of UTF-8, without control
 * characters and slashes.  reflect: mirror it, as reflect_match does with files.  Everything is
 * copied.  APSM_ERR_ARG: the job has a folder, an array is NULL, a number is not finite or an index
 * is out of range; APSM_ERR_STATE: the shapes have been groomed already. */

/* A triangle mesh, V nv x 3 and F nf x 3 (counter-clockwise seen from outside). */
APSM_API apsm_status apsm_run_add_mesh(apsm_run *run, const char *name, bool reflect, size_t nv,
                                       const double *V, size_t nf,
                                       const uint32_t *F) APSM_NODISCARD;
/* A segmentation as volume.h has it; the option "labels" says which labels are the shape. */
APSM_API apsm_status apsm_run_add_volume(apsm_run *run, const char *name, bool reflect,
                                         const apsm_volume *volume) APSM_NODISCARD;

/* ---- the steps ---- */

/* Inputs to groomed meshes and transforms. */
APSM_API apsm_status apsm_run_groom(apsm_run *run) APSM_NODISCARD;
/* Groomed meshes to first particles. */
APSM_API apsm_status apsm_run_initialize(apsm_run *run) APSM_NODISCARD;
/* First particles to corresponding ones.  With settings.resume from the last checkpoint. */
APSM_API apsm_status apsm_run_optimize(apsm_run *run) APSM_NODISCARD;
/* Particles to model, certificate, figures and reconstructed meshes. */
APSM_API apsm_status apsm_run_evaluate(apsm_run *run) APSM_NODISCARD;
/* A finished model in a folder without some of its shapes: nothing is groomed or optimised again;
 * mean, modes, figures and report are made anew, and what the run wrote for these shapes goes.
 * Refused: the template, unknown names, fewer than three shapes left. */
APSM_API apsm_status apsm_run_exclude(apsm_run *run, size_t n,
                                      const char *const *names) APSM_NODISCARD;
/* A finished model in a folder with the run's inputs more: each is groomed, fitted to the model
 * (apsm/fit.h) and enrolled; the particles of the others stay, byte for byte.  If one is refused,
 * none is added. */
APSM_API apsm_status apsm_run_add(apsm_run *run) APSM_NODISCARD;
/* Reads and judges everything without writing: report gets one line for each problem, *problems
 * their number.  With inputs: each is groomed in memory; without: the folder's project. */
APSM_API apsm_status apsm_run_check(apsm_run *run, void (*report)(void *user, const char *line),
                                    void *user, size_t *problems) APSM_NODISCARD;
/* The report of what is in the folder, which may be another program's project. */
APSM_API apsm_status apsm_run_report(apsm_run *run) APSM_NODISCARD;
/* All five; with settings.resume those that are not yet done.  In memory there is no report. */
APSM_API apsm_status apsm_run_all(apsm_run *run) APSM_NODISCARD;
/* The part of a company's process other than the first in apsm_run_all: settings as the first has
 * them, with its own shard.  It writes to its file in state/ alone. */
APSM_API apsm_status apsm_run_help_sized(apsm_context *ctx, const apsm_run_settings *settings,
                                         size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_run_help(apsm_context *ctx,
                                                       const apsm_run_settings *settings)
{
    return apsm_run_help_sized(ctx, settings, sizeof *settings);
}

/* ---- results, of any job ----
 * Borrowed from the run: good until its next step or apsm_run_close.  Shapes are in the order of
 * their names, byte by byte; i must be below apsm_run_shapes.  What is not there yet is NULL or 0.
 */

APSM_API size_t apsm_run_shapes(const apsm_run *run);
APSM_API const char *apsm_run_shape_name(const apsm_run *run, size_t i);
APSM_API size_t
apsm_run_template(const apsm_run *run); /* index; apsm_run_shapes if none is chosen yet */
/* Row-major map from the shape's own frame, that of its input (mirrored, if it was), to the frame
 * that all have in common; both are those of docs/formats.md, "local" and "world". */
APSM_API void apsm_run_to_world(const apsm_run *run, size_t i, double M[16]);
/* The groomed mesh in its own frame; NULL: not in memory. */
APSM_API const apsm_mesh *apsm_run_mesh(const apsm_run *run, size_t i);
/* Particles (shapes x *J x 3) in the common frame, of the last step that moved any. */
APSM_API const double *apsm_run_particles(const apsm_run *run, size_t *J);

/* Of evaluate. */
APSM_API const apsm_shape_model *apsm_run_model(const apsm_run *run);
APSM_API const apsm_figures *apsm_run_figures(const apsm_run *run);

/* The certificate of shape i: whether its correspondence is sound, and if not, the k-th reason why
 * (a constant text; NULL beyond the last). */
APSM_API bool apsm_run_is_certified(const apsm_run *run, size_t i);
APSM_API const char *apsm_run_review(const apsm_run *run, size_t i, size_t k);

/* What apsm_run_verify has looked at. */
typedef struct apsm_verification {
    size_t outputs, inputs; /* files of the model folder, input shapes */
    size_t problems;        /* lines reported */
} apsm_verification;

/* Whether a model folder's files and inputs are what its manifest says, and the options in its
 * files agree.  Reads everything, writes nothing.  report gets one line for each disagreement, and
 * note one for what is unfinished. */
APSM_API apsm_status apsm_run_verify_sized(apsm_context *ctx, const char *folder,
                                           void (*report)(void *user, const char *line),
                                           void (*note)(void *user, const char *line), void *user,
                                           apsm_verification *result, size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status
apsm_run_verify(apsm_context *ctx, const char *folder, void (*report)(void *user, const char *line),
                void (*note)(void *user, const char *line), void *user, apsm_verification *result)
{
    return apsm_run_verify_sized(ctx, folder, report, note, user, result, sizeof *result);
}

#ifdef __cplusplus
}
#endif
#endif
