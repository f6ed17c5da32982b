/* session.h -- what the steps of a run share: the folder, its project and options, and whatever
 * has been loaded from it so far. */
#ifndef APSM_SESSION_H
#define APSM_SESSION_H

#include <time.h>

#include "apsm/run.h"
#include "core/deal.h"
#include "evaluate/figures.h"
#include "files/files.h"
#include "files/project.h"
#include "files/store.h"
#include "folder/names.h"
#include "initialize/cohort.h"
#include "judge/certify.h"
#include "landmarks/landmark_table.h"
#include "optimize/optimizer.h"
#include "options/options.h"

struct json_t;
struct given_shape;

/* What the last steps came to, as in the files. */
typedef struct run_results {
    size_t I, J;
    double *P; /* I x J x 3, world frame, with the digits of the files; NULL: no particles yet */
    bool evaluated;
    apsm_shape_model model;
    apsm_figures figures;
    cohort_certificate certificate;
} run_results;

/* Scalar fields of the groomed meshes (run/features.h).  Owns its arrays. */
typedef struct run_features {
    size_t I, S;
    char **name;    /* S */
    double *weight; /* S: 0: only sampled */
    double normals; /* weight of the normals */
    double **value; /* I: S x nv */
} run_features;

/* What is loaded of the groomed shapes' cohort. */
typedef enum run_fields {
    RUN_NOT_LOADED,
    RUN_OWN_SURFACES, /* no field; but for the template and a share's own, shapes have their mesh
                         alone */
    RUN_NO_FIELDS,
    RUN_TEMPLATE_FIELD,
    RUN_OWN_FIELDS /* of all shapes, or of the process's own where a company shares them */
} run_fields;

struct apsm_run {
    apsm_context *ctx;
    char *folder; /* NULL: a job in memory, without any file */
    apsm_lock lock;
    apsm_options options;
    bool resume, overwrite;
    bool helps;      /* keeps its share of a step for another process, and writes nothing else */
    bool share_kept; /* it has done so: the step ends there */
    size_t shard, shards;
    const apsm_company *company; /* &company_known, or NULL */
    const apsm_surroundings *surroundings;
    apsm_company company_known; /* what the program that gave them knows of */
    apsm_surroundings surroundings_known;
    apsm_deal deal; /* while groom or initialize is under way, if there are shards */
    bool dry;
    bool has_manifest;   /* in the folder */
    bool is_intact;      /* the manifest: as it was sealed, or new */
    size_t made_folders; /* by this run: its own, and those above it */
    const char *last;    /* the last stage that will be run after this one; NULL: none */
    char **inputs;       /* n_inputs, owned */
    size_t n_inputs;
    apsm_project project;
    struct json_t *manifest; /* object; see manifest.h */
    apsm_mesh *mesh;         /* project.n groomed meshes in their own frames, or NULL */
    size_t mesh_count;
    bool meshes_stored;       /* their arrays are in the store */
    size_t memory;            /* limit; 0: none */
    struct kept_work *kept;   /* kept.h; NULL: no step that keeps finished shapes is under way */
    apsm_store *store;        /* with a limit, once something was moved to it */
    char identity[65];        /* run_identity's, "" until it was asked for */
    apsm_cohort cohort;       /* I = 0: not loaded */
    run_fields loaded;        /* of the cohort */
    const char **names;       /* project.n, borrowed from the project */
    double *transforms;       /* project.n x 16: local to world */
    landmark_table landmarks; /* in the groomed frames; I = 0: not loaded */
    run_features features;    /* S = 0: none */
    bool use_landmarks;       /* the project asks that they guide the particles */
    run_results results;
    /* Of a job in memory. */
    struct given_shape *given; /* n_given, in the order of their names once groomed; memory.h */
    size_t n_given;
    apsm_optimizer_state initial; /* what RUN_INITIAL holds of a job in a folder; I = 0: nothing */
};

/* For messages: where the job is. */
static inline const char *run_place(const apsm_run *run)
{
    return run->folder ? run->folder : "job in memory";
}

static inline bool run_is_in_memory(const apsm_run *run)
{
    return run->folder == NULL;
}

/* Names of files in the model folder. */
#define RUN_PROJECT    FOLDER_PROJECT
#define RUN_MANIFEST   FOLDER_MANIFEST
#define RUN_INITIAL    FOLDER_INITIAL
#define RUN_CHECKPOINT FOLDER_CHECKPOINT
#define RUN_JOURNAL    FOLDER_JOURNAL

/* Path of a file in the model folder: malloc'ed, NULL if out of memory or if there is no folder. */
char *run_path(const apsm_run *run, const char *name);
/* Path made as by printf below the folder. */
char *run_pathf(const apsm_run *run, const char *format, ...) APSM_PRINTF(2, 3);

/* Removes a file of the model folder if it is there; path is run_path's, and freed.  This, and
 * whatever else writes a file, does nothing in a job in memory. */
apsm_status run_remove(apsm_run *run, char *path);

apsm_status run_write_project(apsm_run *run);

/* The store for shapes, or NULL if the run has no limit of memory. */
apsm_status run_open_store(apsm_run *run, apsm_store **store);
/* Frees a mesh whose arrays are perhaps in the store. */
void run_free_mesh(apsm_mesh *mesh, bool stored);

/* Whether a company goes through optimize and evaluate together, each process with its own shapes.
 * Not with method psm, and not where the template feels the others' gradients. */
bool run_is_shared(const apsm_run *run);
/* part with the company's deal, if it is. */
apsm_status run_shared(apsm_run *run, apsm_status (*part)(apsm_run *run, void *user), void *user);

#endif
