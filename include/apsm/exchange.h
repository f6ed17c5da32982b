/* exchange.h -- models for other programs, and shapes warped by particles.
 *
 * Experimental: may still change. */
#ifndef APSM_EXCHANGE_H
#define APSM_EXCHANGE_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"
#include "apsm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* All borrowed. */
typedef struct apsm_export_settings {
    const char *model;  /* model folder that has been evaluated */
    const char *format; /* one of apsm_export_formats */
    const char *path;   /* the file, or for formats of several files the folder, to write */
    size_t modes;       /* at most so many; 0: as many as the format usually has */
    size_t n_sd;        /* 0: two standard deviations */
    const double *sd;   /* where on a mode its meshes are, to both sides; positive */
    bool overwrite;     /* what an earlier export has left there */
} apsm_export_settings;

/* "vtp", "ply", "stl", "obj": a folder of meshes (mean, modes, shapes); "gltf": a file with the
 * modes as morph targets; "scalismo", "statismo": an HDF5 file; "monai", "slicermorph", "csv": a
 * folder of tables; "npz": NumPy arrays (docs/formats.md). Ends in NULL. */
APSM_API const char *const *apsm_export_formats(void);

/* The dense model: every vertex of the template's mesh follows the particles, by the warp of
 * docs/method.md.  Everything is in the world frame of the model.  A folder gets export.json, which
 * says what is in it and whether the model is certified.  APSM_ERR_STATE: the model has not been
 * evaluated, or something else is where the export would go; APSM_ERR_UNSUPPORTED: no such format
 * in this build. */
APSM_API apsm_status apsm_export_model_sized(apsm_context *ctx,
                                             const apsm_export_settings *settings,
                                             size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_export_model(apsm_context *ctx,
                                                           const apsm_export_settings *settings)
{
    return apsm_export_model_sized(ctx, settings, sizeof *settings);
}

/* Shapes of which a statistical model of another program is the model.  Owns its arrays. */
typedef struct apsm_foreign_model {
    size_t I, J;
    char (*names)[32];
    apsm_mesh *meshes; /* I: same faces, in the model's frame */
    double *P;         /* I x J x 3: the same J vertices of each, far from each other */
    bool of_shapes;    /* the file keeps their scores; else they are drawn from it */
    size_t left_out;   /* modes beyond what can be kept */
} apsm_foreign_model;

/* Reads a model file of Scalismo or Statismo with a mesh as representer, HDF5 or (if its name ends
 * in .json) HDF5/JSON; J particles, or as many as it has vertices.  Its noise is left out with a
 * warning.  APSM_ERR_UNSUPPORTED: HDF5 that is stored in chunks. */
APSM_API apsm_status apsm_read_statismo_sized(apsm_context *ctx, const char *path, size_t J,
                                              apsm_foreign_model *model,
                                              size_t size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_read_statismo(apsm_context *ctx, const char *path,
                                                            size_t J, apsm_foreign_model *model)
{
    return apsm_read_statismo_sized(ctx, path, J, model, sizeof *model);
}
APSM_API void apsm_foreign_model_free_sized(apsm_foreign_model *model, size_t size);
static inline void apsm_foreign_model_free(apsm_foreign_model *model)
{
    apsm_foreign_model_free_sized(model, sizeof *model);
}

/* The warp that takes a template's particles P0 (J x 3) to those of I shapes P (I x J x 3), of n
 * points X (n x 3) on, in or near the template: Y (I x n x 3, out).  APSM_ERR_GEOMETRY: fewer than
 * 5 distinct particles, or all in a plane. */
typedef struct apsm_warp_points_input {
    size_t J, I, n;
    const double *P0, *P, *X;
} apsm_warp_points_input;
APSM_API apsm_status apsm_warp_points_sized(apsm_context *ctx, const apsm_warp_points_input *input,
                                            size_t size, double *Y) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_warp_points(apsm_context *ctx,
                                                          const apsm_warp_points_input *input,
                                                          double *Y)
{
    return apsm_warp_points_sized(ctx, input, sizeof *input, Y);
}

/* All borrowed. */
typedef struct apsm_warp_settings {
    const apsm_mesh *mesh; /* the template's */
    const char *mesh_path; /* of its file, or NULL: a .vtk keeps its labels */
    size_t J, I;
    const double *P0;         /* J x 3: the template's particles, in the frame of its mesh */
    const double *P;          /* I x J x 3: of the shapes */
    const char *const *names; /* I */
    size_t n_attached;
    const char *const *attached; /* files in the template's frame: landmarks, .vtk */
    const char *extension;       /* of the meshes: "ply", "vtp", "stl", "obj", "vtk" */
    const char *folder;
    bool overwrite; /* what an earlier call has left in the folder */
} apsm_warp_settings;

/* Meshes of shapes from their particles: FOLDER/NAME.EXT, and for each attached file
 * NAME_ITS-NAME.  Each shape lies where its particles lie.  Tetrahedra that turn inside out are
 * told in a warning and listed in warp.json; *inverted (may be NULL) counts them.
 * APSM_ERR_GEOMETRY: the template's particles are not on its mesh. */
APSM_API apsm_status apsm_warp_files_sized(apsm_context *ctx, const apsm_warp_settings *settings,
                                           size_t size, size_t *inverted) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_warp_files(apsm_context *ctx,
                                                         const apsm_warp_settings *settings,
                                                         size_t *inverted)
{
    return apsm_warp_files_sized(ctx, settings, sizeof *settings, inverted);
}

#ifdef __cplusplus
}
#endif
#endif
