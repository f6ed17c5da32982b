/* A case to its shape, through its format. */
#include <stdlib.h>

#include "apsm/formats.h"
#include "formats/image.h"
#include "input/input.h"

void apsm_input_shape_free(apsm_input_shape *shape)
{
    apsm_mesh_free(&shape->mesh);
    apsm_volume_free(&shape->volume);
    *shape = (apsm_input_shape){ 0 };
}

/* Whether the bound takes what is around the labels, too. */
static bool takes_zero(const apsm_labels *labels)
{
    return (labels->side == '<' && labels->level > 0.0) ||
           (labels->side == '>' && labels->level < 0.0);
}

static apsm_status read_image(apsm_context *ctx, const apsm_input_case *one,
                              const apsm_labels *labels, apsm_volume *volume)
{
    if (one->kind == APSM_INPUT_DICOM) return apsm_read_dicom(ctx, one->path, volume);
    return takes_zero(labels) ? apsm_read_volume(ctx, one->path, volume)
                              : volume_read_foreground(ctx, one->path, volume);
}

apsm_status apsm_input_read(apsm_context *ctx, const apsm_input_case *one,
                            const apsm_labels *labels, apsm_input_shape *shape)
{
    *shape = (apsm_input_shape){ .is_mesh = one->kind == APSM_INPUT_MESH };
    if (shape->is_mesh) return apsm_read_mesh(ctx, one->path, &shape->mesh);
    APSM_TRY(read_image(ctx, one, labels, &shape->volume));
    return apsm_input_finish(ctx, one->path, labels, shape);
}

static apsm_status refuse_flat(apsm_context *ctx, const char *path, const apsm_volume *v)
{
    const size_t *const n = v->whole[0] ? v->whole : v->n;
    if (n[0] > 1 && n[1] > 1 && n[2] > 1) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: is a flat image, not 3-D; give the whole stack of slices", path);
}

apsm_status apsm_input_finish(apsm_context *ctx, const char *path, const apsm_labels *labels,
                              apsm_input_shape *shape)
{
    apsm_status status = refuse_flat(ctx, path, &shape->volume);
    shape->is_mesh = shape->volume.value != NULL;
    if (status == APSM_OK)
        status = shape->is_mesh
                     ? apsm_field_surface(ctx, path, labels, &shape->volume, &shape->mesh)
                     : apsm_label_union(ctx, path, labels, &shape->volume);
    if (shape->is_mesh) {
        free(shape->volume.value);
        shape->volume.value = NULL;
    }
    if (status != APSM_OK) apsm_input_shape_free(shape);
    return status;
}
