/* One input to a surface, groomed as the cohort was. */
#include "fit/reading.h"

#include <string.h>

#include "geometry/topology.h"

/* A cap of more than this share of the surface is a part that is not there. */
static const double small_cap = 0.02;

/* *extent: WHOLE or PART.  A part is taken as it is. */
static apsm_status groom_surface(apsm_context *ctx, const fit_reading *r, const char *path,
                                 apsm_mesh *raw, apsm_mesh *mesh, int *extent)
{
    apsm_groom_report report;
    bool may_be_part = false;
    if (*extent == APSM_EXTENT_AUTO) APSM_TRY(apsm_mesh_find_open(raw, &may_be_part));
    apsm_status status = APSM_ERR_GEOMETRY;
    if (*extent != APSM_EXTENT_PART) {
        memset(&report, 0, sizeof report);
        status = apsm_groom_mesh(ctx, path, raw, &r->groom, mesh, &report);
        if (!may_be_part || (status == APSM_OK && report.largest_cap <= small_cap)) {
            *extent = APSM_EXTENT_WHOLE;
            return status;
        }
        if (status == APSM_OK) apsm_mesh_free(mesh);
    }
    *extent = APSM_EXTENT_PART;
    *mesh = *raw;
    *raw = (apsm_mesh){ 0 };
    return APSM_OK;
}

apsm_status fit_read_surface(apsm_context *ctx, const fit_reading *r, const apsm_input_case *c,
                             apsm_mesh *mesh, int *extent)
{
    apsm_input_shape shape = { 0 };
    apsm_groom_report report = { 0 };
    apsm_status status = apsm_input_read(ctx, c, &r->labels, &shape);
    if (status == APSM_OK && shape.is_mesh)
        status = groom_surface(ctx, r, c->path, &shape.mesh, mesh, extent);
    else if (status == APSM_OK) {
        status = groom_taken_segmentation(ctx, c->path, &shape.volume, &r->groom, mesh, &report);
        if (*extent == APSM_EXTENT_AUTO)
            *extent = report.border ? APSM_EXTENT_PART : APSM_EXTENT_WHOLE;
    }
    apsm_input_shape_free(&shape);
    return status;
}
