/* render.h -- pictures of a model as PNG files, drawn by the processor alone: no window system, no
 * browser. */
#ifndef APSM_RENDER_H
#define APSM_RENDER_H

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum apsm_picture {
    APSM_PICTURE_MEAN,   /* the mean shape */
    APSM_PICTURE_MODES,  /* the first modes at -2, 0 and +2 standard deviations */
    APSM_PICTURE_SHAPE,  /* one shape with its particles */
    APSM_PICTURE_COHORT, /* all shapes with particles and names */
    APSM_PICTURE_COUNT
} apsm_picture;

/* "mean", "modes", "shape", "cohort"; a constant text. */
APSM_API const char *apsm_picture_name(apsm_picture what);

/* Begin with {0}; later versions may add fields at the end. */
typedef struct apsm_render_options {
    apsm_picture what;
    const char *shape; /* name of the shape of APSM_PICTURE_SHAPE; NULL: the template */
    double view[3];    /* direction towards the viewer; 0 0 0: as the report looks at first */
    size_t width;      /* pixels, 0: chosen; else APSM_RENDER_LEAST to APSM_RENDER_MOST */
} apsm_render_options;

enum { APSM_RENDER_LEAST = 64, APSM_RENDER_MOST = 8000 };

/* Writes one picture of the model in folder to path, atomically.  Colours are those of the report:
 * a particle has the same on every shape.  APSM_ERR_STATE: the folder has not been evaluated, or
 * has no modes to show; APSM_ERR_ARG: no such shape, a bad width or view.  The bytes do not depend
 * on the threads.  O(I V + pixels) time. */
APSM_API apsm_status apsm_render_sized(apsm_context *ctx, const char *folder,
                                       const apsm_render_options *options, size_t size,
                                       const char *path) APSM_NODISCARD;

static inline APSM_NODISCARD apsm_status apsm_render(apsm_context *ctx, const char *folder,
                                                     const apsm_render_options *options,
                                                     const char *path)
{
    return apsm_render_sized(ctx, folder, options, sizeof *options, path);
}

#ifdef __cplusplus
}
#endif
#endif
