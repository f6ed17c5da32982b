/* groom_inputs.h -- from the INPUT arguments to clean meshes in memory; groom and check share it.
 */
#ifndef APSM_RUN_GROOM_INPUTS_H
#define APSM_RUN_GROOM_INPUTS_H

#include "geometry/region.h"
#include "groom/groom.h"
#include "input/input.h"
#include "session/session.h"

/* Owns its arrays, each list.n long; zero-initialise with {0}. */
typedef struct groom_inputs {
    apsm_input_list list;
    apsm_labels labels;
    apsm_project source; /* whose shapes they are; {0}: none, or the run's own (own_source) */
    bool own_source;
    struct fixed_shapes *fixed; /* shapes whose particles stay (fixed.h); NULL: none */
    char *ignored;              /* what it asks for and is not done; NULL: nothing */
    apsm_groom_options options;
    apsm_store *store;        /* where the meshes' arrays are; NULL: in memory */
    apsm_mesh *mesh;          /* in their own frames, mirrored where asked for */
    double (*reflection)[16]; /* input to groomed frame */
    bool *reflected;
    apsm_groom_report *report; /* what grooming did; the frame is that of the input */
    bool *is_mask;
    double *cropped;     /* share of the surface that cropping took away */
    char **limits;       /* files of constraints (regions.h); NULL: none */
    apsm_region *region; /* what they say */
    apsm_mesh *whole;    /* NULL, or the surfaces before constraints cut them ... */
    double *kept;        /* ... and what share they left */
    char (*sha256)[65];
    apsm_status *status;
    char **problem; /* the line of a failure, else NULL */
    char **notes;   /* what of a header had to be decided (apsm_volume), else NULL */
    char **picked;  /* names of the labels taken (apsm_volume), else NULL */
    bool *recalled; /* groomed before an interruption */
    bool *again;    /* NULL, or: what is groomed another time, with the options as they are now */
    double *voxel;  /* mean edge of a voxel; 0: a mesh */
    double *slices; /* how far these are apart, over the edge of a pixel; 0: a mesh */
    double *turn;   /* n x 9: how shapes are turned, by others (turned.h); NULL: nobody knows */
} groom_inputs;

/* Lists the cases of run's inputs; a project among them stands for the shapes it names. */
apsm_status groom_inputs_list(apsm_run *run, groom_inputs *in);
/* Refuses inputs that are not the shapes of the groomed project, by their names, or that have
 * changed since; with none, those that the project names. */
apsm_status groom_inputs_compare(apsm_run *run);
/* Reads and grooms all; failures are in status and problem, and do not end the call. */
apsm_status groom_inputs_read(apsm_run *run, groom_inputs *in);
/* Reads all and grooms none: what fails here fails in groom. */
apsm_status groom_inputs_try(apsm_run *run, groom_inputs *in);
/* Refuses shapes that cannot be used: every one is told, not only the first. */
apsm_status groom_inputs_refuse_bad(apsm_run *run, const groom_inputs *in);
/* *index <- the shape that option template names, or APSM_TEMPLATE_AUTO. */
apsm_status groom_inputs_template(apsm_run *run, const groom_inputs *in, size_t *index);
void groom_inputs_free(groom_inputs *in);

/* Puts mesh, which it takes over (in an error the caller keeps it), in the place of the groomed
 * one. */
apsm_status groom_inputs_replace(apsm_context *ctx, const groom_inputs *in, size_t i,
                                 apsm_mesh *mesh);
/* Moves the arrays of a mesh to where those of the others are. */
apsm_status groom_inputs_store(apsm_context *ctx, const groom_inputs *in, apsm_mesh *mesh);

/* Mirrors a groomed mesh; its coordinates stay float32 numbers, as in the file. */
apsm_status groom_inputs_reflect(apsm_context *ctx, groom_inputs *in, size_t i);

#endif
