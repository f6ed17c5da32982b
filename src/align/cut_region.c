#include "align/cut_region.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/registration.h"
#include "geometry/bvh.h"
#include "geometry/clip.h"
#include "geometry/vec3.h"
#include "groom/repair.h"

/* Normals of what is taken for the same place may differ by 60 degrees. */
static const double same_side = 0.5;

static apsm_status refuse_nothing(apsm_context *ctx, const char *name)
{
    return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                     "%s: its constraints leave nothing of the surface; planes keep the side that "
                     "their normal points to, and lie in the frame of the file",
                     name);
}

/* What is done to a cut mesh: nothing closed, nothing turned over. */
static apsm_groom_options as_cut(const apsm_groom_options *opt)
{
    apsm_groom_options o = *opt;
    o.open = o.keep_sides = o.largest_component = true;
    o.open_share = 0.0;
    o.measure = false;
    return o;
}

static apsm_status finish(apsm_context *ctx, const char *name, const apsm_mesh *cut,
                          const apsm_groom_options *opt, apsm_mesh *part, apsm_groom_report *report)
{
    const apsm_groom_options o = as_cut(opt);
    apsm_groom_report r = { 0 };
    APSM_TRY(apsm_repair(ctx, name, cut, &o, part, &r));
    report->openings = r.openings;
    report->open_length = r.open_length;
    if (r.dropped_components)
        apsm_log(
            ctx, APSM_LOG_WARNING,
            "%s: its constraints leave %zu pieces; the largest is taken, the others are %.2g %% "
            "of the area",
            name, r.dropped_components + 1, 100.0 * r.dropped_area);
    for (size_t x = 0; x < 3 * part->nv; x++) part->V[x] = (double)(float)part->V[x];
    if (!opt->remesh) return APSM_OK;
    const apsm_status status = groom_remesh(ctx, name, part, &o.remesh_options, NULL);
    if (status != APSM_OK) apsm_mesh_free(part);
    return status;
}

apsm_status apsm_cut_region(apsm_context *ctx, const char *name, const apsm_mesh *whole,
                            const double *field, const apsm_groom_options *opt, apsm_mesh *part,
                            double *share, apsm_groom_report *report)
{
    apsm_mesh cut;
    size_t outside = 0;
    *part = (apsm_mesh){ 0 };
    *share = 1.0;
    for (size_t v = 0; v < whole->nv; v++) outside += field[v] > 0.0 ? 0 : 1;
    if (outside == 0) return apsm_mesh_copy(whole, part);
    APSM_TRY(apsm_mesh_clip_field(whole, field, &cut));
    const apsm_status status =
        cut.nf > 0 ? finish(ctx, name, &cut, opt, part, report) : refuse_nothing(ctx, name);
    apsm_mesh_free(&cut);
    if (status == APSM_OK) *share = apsm_mesh_area(part) / apsm_mesh_area(whole);
    return status;
}

/* ---- carrying ---- */

/* moved (a copy of from) <- by non-rigid registration to the shape. */
static apsm_status move_to(const apsm_mesh *from, const apsm_mesh *to, apsm_mesh *moved,
                           double *radius)
{
    apsm_cloud here = { 0 }, there = { 0 };
    apsm_registration *registration = NULL;
    double *N = malloc(3 * from->nv * sizeof *N), *work = NULL;
    apsm_status status = N ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_cloud_spread(from, APSM_REGISTRATION_POINTS, &here);
    if (status == APSM_OK) status = apsm_cloud_spread(to, APSM_REGISTRATION_POINTS, &there);
    if (status == APSM_OK) status = apsm_registration_new(&here, &registration);
    if (status == APSM_OK) {
        work = malloc(apsm_registration_work_size(registration, there.n) * sizeof *work);
        apsm_mesh_vertex_normals(from, N);
        status = work ? apsm_mesh_copy(from, moved) : APSM_ERR_MEMORY;
    }
    if (status == APSM_OK) {
        status = apsm_registration_move(registration, &there, from->nv, moved->V, N, work);
        if (status != APSM_OK) apsm_mesh_free(moved);
    }
    *radius = here.radius;
    apsm_registration_free(registration);
    apsm_cloud_free(&here);
    apsm_cloud_free(&there);
    free(work);
    free(N);
    return status;
}

static double interpolate(const apsm_mesh *mesh, const double *field, const apsm_surface_point *p)
{
    double f = 0.0;
    for (size_t k = 0; k < 3; k++) f += p->weight[k] * field[mesh->F[3 * (size_t)p->face + k]];
    return f;
}

static apsm_status take_field(const apsm_mesh *moved, const double *from_field, const apsm_mesh *to,
                              double *field)
{
    apsm_bvh *tree;
    double *N = malloc(3 * to->nv * sizeof *N);
    if (!N) return APSM_ERR_MEMORY;
    apsm_mesh_vertex_normals(to, N);
    const apsm_status status = apsm_bvh_build(moved, &tree);
    for (size_t v = 0; v < to->nv && status == APSM_OK; v++) {
        apsm_closest hit;
        apsm_bvh_closest_facing(tree, to->V + 3 * v, N + 3 * v, same_side, INFINITY, &hit);
        if (!(hit.distance2 < INFINITY)) apsm_bvh_closest(tree, to->V + 3 * v, INFINITY, &hit);
        field[v] = interpolate(moved, from_field, &hit.on);
    }
    if (status == APSM_OK) apsm_bvh_free(tree);
    free(N);
    return status;
}

/* Root mean square distance of the moved region's vertices from the surface. */
static apsm_status measure_miss(const apsm_mesh *moved, const double *from_field,
                                const apsm_mesh *to, double *miss)
{
    apsm_bvh *tree;
    double sum = 0.0;
    size_t n = 0;
    APSM_TRY(apsm_bvh_build_unsigned(to, &tree));
    for (size_t v = 0; v < moved->nv; v++) {
        apsm_closest hit;
        if (!(from_field[v] > 0.0)) continue;
        apsm_bvh_closest(tree, moved->V + 3 * v, INFINITY, &hit);
        sum += hit.distance2;
        n++;
    }
    apsm_bvh_free(tree);
    *miss = n ? sqrt(sum / (double)n) : 0.0;
    return APSM_OK;
}

apsm_status apsm_carry_field(const apsm_mesh *from, const double *from_field, const apsm_mesh *to,
                             double *field, apsm_carried *carried)
{
    apsm_mesh moved;
    double radius;
    APSM_TRY(move_to(from, to, &moved, &radius));
    apsm_status status = take_field(&moved, from_field, to, field);
    if (status == APSM_OK) status = measure_miss(&moved, from_field, to, &carried->miss);
    if (status == APSM_OK) carried->miss /= radius;
    apsm_mesh_free(&moved);
    return status;
}
