/* model_folder.h -- what a run has left in a model folder, read back: everything that says
 * something about a finished model (report, pictures, fit, statistics) stands on this. */
#ifndef APSM_FOLDER_MODEL_FOLDER_H
#define APSM_FOLDER_MODEL_FOLDER_H

#include "apsm/mesh.h"
#include "files/project.h"
#include "model/shape_model.h"

struct json_t;

/* What to read beside project and model; | joins them. */
enum {
    FOLDER_PARTICLES = 1,   /* P, and model.score, which says whether they are the model's */
    FOLDER_SCORES = 2,      /* model.score */
    FOLDER_EVALUATED = 4,   /* evaluation */
    FOLDER_CERTIFIED = 8,   /* certificate */
    FOLDER_MANIFESTED = 16, /* manifest */
    FOLDER_ALL = 31
};

/* A part of a subject, such as a bone of a joint: particles first .. first + J - 1.  Owns its name.
 */
typedef struct model_part {
    char *name; /* NULL: the only one */
    size_t first, J;
    size_t template_index; /* the shape whose mesh stands for the part's */
} model_part;

/* Owns everything.  Zero-initialise with {0}; model_folder_free leaves it so. */
typedef struct model_folder {
    char *path;
    apsm_project project;  /* subjects[i].name, .alignment, ... of shape i */
    const char **names;    /* I, borrowed from the project */
    size_t I, J;           /* shapes, particles */
    size_t template_index; /* < I */
    size_t parts;          /* 1, or as many as a subject has parts */
    model_part *part;
    apsm_shape_model model;                             /* in the world frame */
    double *P;                                          /* I x J x 3, world frame, or NULL */
    struct json_t *evaluation, *certificate, *manifest; /* the files, or NULL */
} model_folder;

/* Reads the project, the model, and the parts that are asked for.  m is overwritten, and {0} on
 * failure.  APSM_ERR_STATE: the folder holds no project, has not been evaluated, files in it are
 * of other shapes than the project's, or the particles are not those of the model; APSM_ERR_FORMAT,
 * _IO: a file is damaged.  Particles are read in parallel. */
apsm_status model_folder_read(apsm_context *ctx, const char *path, unsigned parts,
                              model_folder *m) APSM_NODISCARD;
void model_folder_free(model_folder *m);

/* Path of a file (folder/names.h) in the folder: malloc'ed, NULL if out of memory. */
char *model_folder_path(const model_folder *m, const char *name);

/* Row-major map from shape i's own (groomed) frame to the world frame of the model; where there are
 * several parts, that of the first. */
void model_folder_to_world(const model_folder *m, size_t i, double M[16]);
/* The groomed mesh of part d of shape i, in the world frame. */
apsm_status model_folder_part_mesh(apsm_context *ctx, const model_folder *m, size_t i, size_t d,
                                   apsm_mesh *mesh) APSM_NODISCARD;
/* The groomed meshes of all parts of shape i (template_index: the template's) as one. */
apsm_status model_folder_mesh(apsm_context *ctx, const model_folder *m, size_t i,
                              apsm_mesh *mesh) APSM_NODISCARD;
/* p (J x 3, out) <- the particles of shape i in its own frame. */
apsm_status model_folder_local_particles(apsm_context *ctx, const model_folder *m, size_t i,
                                         double *p) APSM_NODISCARD;

/* Whether the certificate (which must have been read) certifies shape i; all: every shape. */
bool model_folder_is_certified(const model_folder *m, size_t i);
bool model_folder_is_all_certified(const model_folder *m);

#endif
