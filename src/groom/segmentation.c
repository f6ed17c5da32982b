/* From a segmentation to a mesh: mask, anti-aliasing, iso-surface, then the path of a mesh.
 *
 * Axes along which voxels are much longer than along the finest are refined so that the surface
 * between slices far apart is interpolated on a grid of nearly cubic cells. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"
#include "geometry/isosurface.h"
#include "groom/agreement.h"
#include "groom/antialias.h"
#include "groom/between.h"
#include "groom/fair.h"
#include "groom/groom.h"
#include "groom/mask.h"
#include "groom/repair.h"
#include "groom/tunnels.h"

enum { MOST_REFINED = 8, LEAST_VOXELS = 8, CONTOURS = 4 };
static const double least_smoothing = 0.53, thick_slices = 3.0;
static const double few_smoothing = 0.8, few_slices = 5.4, many_slices = 6.0;
static const double volume_tolerance = 0.003;          /* relative */
static const double first_step = 0.005, outward = 0.3; /* of the level */

static void choose_refinement(const apsm_volume *v, antialias_input *in)
{
    const double least = fmin(v->spacing[0], fmin(v->spacing[1], v->spacing[2]));
    for (int c = 0; c < 3; c++) {
        const double ratio = floor(v->spacing[c] / least + 0.5);
        in->refine[c] = ratio < MOST_REFINED ? (int)ratio : MOST_REFINED;
        in->spacing[c] = v->spacing[c];
    }
}

/* What smoothing = 1 means for these voxels.  Half of it is nearer to the true surface and to the
 * mask where voxels are cubes, and where slices are interpolated by their shapes, unless the shape
 * is but few slices high, mostly ends, which a wider smoothing rounds.  Where voxels are long along
 * two axes its reach has to cover them.  docs/results.md, "Masks". */
static double suitable_smoothing(const apsm_volume *v, const antialias_input *in, double size)
{
    const double least = fmin(v->spacing[0], fmin(v->spacing[1], v->spacing[2]));
    const double most = fmax(v->spacing[0], fmax(v->spacing[1], v->spacing[2]));
    if (between_axis(in) < 0) return fmin(fmax(most / least / thick_slices, least_smoothing), 1.0);
    const double lacking = (many_slices - size / most) / (many_slices - few_slices);
    return least_smoothing + (few_smoothing - least_smoothing) * fmin(fmax(lacking, 0.0), 1.0);
}

/* The surface, in LPS, of fine-grid values <= level. */
static apsm_status contour(apsm_context *ctx, const apsm_volume *v, const mask *m,
                           const antialias_input *in, const float *values, double level,
                           apsm_mesh *surface)
{
    size_t fine[3];
    double M[16], to_lps[16];
    antialias_fine(in, fine);
    APSM_TRY(apsm_isosurface(ctx, fine, values, level, surface));
    /* fine index -> voxel index -> LPS */
    apsm_volume_index_to_lps(v, M);
    memcpy(to_lps, M, sizeof M);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            to_lps[4 * r + 3] += M[4 * r + c] * (double)m->origin[c];
            to_lps[4 * r + c] = M[4 * r + c] / in->refine[c];
        }
    apsm_mesh_transform(surface, to_lps);
    return APSM_OK;
}

/* A mesh of flat triangles has a little more or less volume than the function.  The level is moved
 * by the secant rule until the mesh has the mask's volume, but not so far inward that a firm inner
 * voxel gets out. */
static apsm_status contour_volume(apsm_context *ctx, const apsm_volume *v, const mask *m,
                                  const antialias_input *in, const float *values, double inward,
                                  double wanted, apsm_mesh *surface)
{
    double level = 0.0, last = 0.0, last_off = 0.0;
    for (int i = 0; i < CONTOURS; i++) {
        apsm_mesh next;
        APSM_TRY(contour(ctx, v, m, in, values, level, &next));
        const double off = apsm_mesh_volume(&next) / wanted - 1.0;
        apsm_mesh_free(surface);
        *surface = next;
        if (fabs(off) <= volume_tolerance || in->smoothing <= 0.0) break;
        const double slope = i > 0 && level != last ? (off - last_off) / (level - last) : 0.0;
        last = level;
        last_off = off;
        level = slope > 0.0 ? level - off / slope : off < 0.0 ? first_step : -first_step;
        level = fmin(fmax(level, -inward), outward);
        if (level == last) break;
    }
    return APSM_OK;
}

static apsm_status extract(apsm_context *ctx, const apsm_volume *v, const mask *m,
                           antialias_input *in, double fairing, apsm_mesh *surface,
                           apsm_groom_report *r)
{
    size_t fine[3];
    memcpy(in->n, m->n, sizeof in->n);
    in->mask = m->in;
    in->smoothing *= suitable_smoothing(v, in, mask_size(v, r->voxels));
    antialias_fine(in, fine);
    float *values = malloc(fine[0] * fine[1] * fine[2] * sizeof *values);
    if (!values) return APSM_ERR_MEMORY;
    double inward;
    apsm_status status = antialias(in, values, &inward);
    if (status == APSM_OK)
        status = contour_volume(ctx, v, m, in, values, inward, r->mask_volume, surface);
    const double voxel = cbrt(v->spacing[0] * v->spacing[1] * v->spacing[2]);
    if (status == APSM_OK && fairing > 0) status = fair_surface(surface, fairing * voxel, voxel);
    if (status == APSM_OK) r->smoothing_volume = apsm_mesh_volume(surface) / r->mask_volume - 1.0;
    free(values);
    return status;
}

/* What changes more than a hundredth of the shape should be seen. */
static apsm_log_level level_of(double share)
{
    return share > 0.01 ? APSM_LOG_WARNING : APSM_LOG_INFO;
}

static void say_mask(apsm_context *ctx, const char *name, const apsm_groom_report *r)
{
    const double all = (double)(r->dropped_voxels + r->voxels);
    if (r->dropped_parts)
        apsm_log(ctx, level_of((double)r->dropped_voxels / all),
                 "%s: %zu smaller part%s of the label dropped (%zu voxels of %zu)", name,
                 r->dropped_parts, r->dropped_parts == 1 ? "" : "s", r->dropped_voxels,
                 r->dropped_voxels + r->voxels);
    if (r->filled_voxels)
        apsm_log(ctx, level_of((double)r->filled_voxels / all), "%s: cavities of %zu voxels filled",
                 name, r->filled_voxels);
    if (r->opened_voxels)
        apsm_log(ctx, APSM_LOG_INFO, "%s: %zu voxels cut off by the opening", name,
                 r->opened_voxels);
    if (r->border) {
        static const char *const sides[] = { " -i", " +i", " -j", " +j", " -k", " +k" };
        char touched[32] = "";
        for (int s = 0; s < 6; s++)
            if (r->border & (1 << s)) strcat(touched, sides[s]);
        apsm_log(ctx, APSM_LOG_WARNING,
                 "%s: the label touches the image's border (%s); the surface is closed there", name,
                 touched + 1);
    }
}

static apsm_status check_volume(apsm_context *ctx, const char *name, const apsm_volume *v)
{
    for (int c = 0; c < 3; c++)
        if (v->n[c] == 0 || !(v->spacing[c] > 0.0) || !isfinite(v->spacing[c]))
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s: the image's spacing or size is not positive", name);
    return APSM_OK;
}

/* Axes need not be at right angles. */
static double voxel_volume(const apsm_volume *v)
{
    double M[16];
    apsm_volume_index_to_lps(v, M);
    return fabs(apsm_affine_det(M));
}

/* m (out) is the caller's to free. */
static apsm_status make_mask(apsm_context *ctx, const char *name, const apsm_volume *volume,
                             const apsm_groom_options *opt, mask *m, apsm_groom_report *r)
{
    antialias_input in = { .smoothing = opt->smooth };
    size_t rim[3];
    choose_refinement(volume, &in);
    antialias_rim(&in, rim);
    APSM_TRY(mask_make(ctx, name, volume, opt, rim, m, r));
    memcpy(r->supersampling, in.refine, sizeof in.refine);
    r->mask_volume = (double)r->voxels * voxel_volume(volume);
    say_mask(ctx, name, r);
    if (r->voxels >= LEAST_VOXELS) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_GEOMETRY, "%s: the label has only %zu voxel%s; no shape", name,
                     r->voxels, r->voxels == 1 ? "" : "s");
}

static double least_spacing(const apsm_volume *v)
{
    return fmin(v->spacing[0], fmin(v->spacing[1], v->spacing[2]));
}

/* The volume (labels borrowed) with `unit` as the unit of length, and at a whole number of units
 * from the origin; rest (out): what is missing there, in the input's unit.  On a grid many lengths
 * are equal, and rounding would decide between them, in every unit otherwise: voxels are the unit.
 * Images begin at whole or half voxels, so that no rounding decides how many are whole. */
static apsm_volume in_unit(const apsm_volume *volume, double unit, double rest[3])
{
    apsm_volume v = *volume;
    for (int c = 0; c < 3; c++) {
        v.spacing[c] /= unit;
        v.origin[c] = floor(v.origin[c] / unit + 0.3);
        rest[c] = volume->origin[c] - unit * v.origin[c];
    }
    return v;
}

/* Back to the input's. */
static void lengths_in_unit(apsm_groom_report *r, double unit)
{
    double *const lengths[] = { &r->remesh.edge,
                                &r->remesh.forward_mean,
                                &r->remesh.forward_max,
                                &r->remesh.backward_mean,
                                &r->remesh.backward_max,
                                &r->largest_cap_at[0],
                                &r->largest_cap_at[1],
                                &r->largest_cap_at[2],
                                &r->departure,
                                &r->closing,
                                &r->opening };
    for (size_t k = 0; k < sizeof lengths / sizeof *lengths; k++) *lengths[k] *= unit;
}

/* The surface of a mask, with voxels as the unit. */
static apsm_status groom_mask(apsm_context *ctx, const char *name, const apsm_volume *grid,
                              const apsm_groom_options *opt, const mask *m, apsm_mesh *mesh_out,
                              apsm_groom_report *r)
{
    apsm_mesh surface = { 0 };
    antialias_input in = { .smoothing = opt->smooth }; /* at most */
    choose_refinement(grid, &in);
    apsm_status status = extract(ctx, grid, m, &in, opt->fairing * opt->smooth, &surface, r);
    if (status == APSM_OK) status = groom_surface(ctx, name, &surface, opt, mesh_out, r);
    apsm_mesh_free(&surface);
    return status == APSM_OK ? mask_agreement(grid, m, mesh_out, r) : status;
}

static void say_mended(apsm_context *ctx, const char *name, double unit, const apsm_groom_report *r)
{
    apsm_log(
        ctx, APSM_LOG_WARNING,
        "%s: %ld handle%s: %zu voxels of tunnels filled and %zu of strands cut, none wider than "
        "%.4g, %ld left; --closing 0 keeps them all, --closing 0.1 fills narrow sinuses as well",
        name, r->handles_before, r->handles_before == 1 ? "" : "s", r->closed_voxels, r->cut_voxels,
        2.0 * unit * r->closing, r->genus);
}

/* Handles, found on the surface, are filled or cut where they are narrow; mesh and report are
 * replaced if that leaves fewer. */
static apsm_status mend_handles(apsm_context *ctx, const char *name, const apsm_volume *grid,
                                const apsm_groom_options *opt, mask *m, double unit,
                                apsm_mesh *mesh, apsm_groom_report *r)
{
    tunnels_report t;
    apsm_mesh other = { 0 };
    APSM_TRY(mask_keep_given(m));
    APSM_TRY(mask_mend_tunnels(m, grid->spacing, mask_size(grid, r->voxels), &t));
    if (t.filled + t.cut == 0) return APSM_OK;
    apsm_groom_report mended = { .voxels = r->voxels + t.filled - t.cut,
                                 .dropped_parts = r->dropped_parts,
                                 .dropped_voxels = r->dropped_voxels,
                                 .filled_voxels = r->filled_voxels,
                                 .closing = t.radius,
                                 .opening = r->opening,
                                 .opened_voxels = r->opened_voxels,
                                 .closed_voxels = t.filled,
                                 .cut_voxels = t.cut,
                                 .handles_before = r->genus,
                                 .border = r->border };
    mended.mask_volume = (double)mended.voxels * voxel_volume(grid);
    memcpy(mended.border_normal, r->border_normal, sizeof mended.border_normal);
    memcpy(mended.supersampling, r->supersampling, sizeof mended.supersampling);
    const apsm_status status = groom_mask(ctx, name, grid, opt, m, &other, &mended);
    if (status == APSM_OK && mended.genus < r->genus) {
        const apsm_mesh given = *mesh;
        *mesh = other;
        other = given;
        *r = mended;
        say_mended(ctx, name, unit, r);
    }
    apsm_mesh_free(&other);
    return status;
}

static apsm_status groom_grid(apsm_context *ctx, const char *name, const apsm_volume *grid,
                              const apsm_groom_options *opt, double unit, mask *m,
                              apsm_mesh *mesh_out, apsm_groom_report *r)
{
    apsm_status status = groom_mask(ctx, name, grid, opt, m, mesh_out, r);
    const bool one_by_one = opt->closing < 0.0 && !(opt->closing_length > 0.0);
    if (status == APSM_OK && one_by_one && r->genus > 0)
        status = mend_handles(ctx, name, grid, opt, m, unit, mesh_out, r);
    if (status != APSM_OK) apsm_mesh_free(mesh_out);
    return status;
}

/* taken: the volume itself, or NULL; its labels are freed once the mask is made. */
static apsm_status groom_voxels(apsm_context *ctx, const char *name, const apsm_volume *volume,
                                apsm_volume *taken, apsm_groom_options opt, apsm_mesh *mesh_out,
                                apsm_groom_report *r)
{
    mask m = { .in = NULL };
    double rest[3];
    APSM_TRY(check_volume(ctx, name, volume));
    const double unit = least_spacing(volume);
    opt.closing_length /= unit;
    opt.opening_length /= unit;
    const apsm_volume grid = in_unit(volume, unit, rest);
    apsm_status status = make_mask(ctx, name, &grid, &opt, &m, r);
    if (taken) {
        free(taken->label);
        free(taken->small);
        taken->label = NULL;
        taken->small = NULL;
    }
    if (status == APSM_OK) status = groom_grid(ctx, name, &grid, &opt, unit, &m, mesh_out, r);
    mask_free(&m);
    if (status != APSM_OK) return status;
    for (size_t k = 0; k < 3 * mesh_out->nv; k++)
        mesh_out->V[k] = (double)(float)(unit * mesh_out->V[k] + rest[k % 3]);
    r->mask_volume *= unit * unit * unit;
    lengths_in_unit(r, unit);
    return APSM_OK;
}

apsm_status apsm_groom_segmentation(apsm_context *ctx, const char *name, const apsm_volume *volume,
                                    const apsm_groom_options *options, apsm_mesh *mesh_out,
                                    apsm_groom_report *report)
{
    apsm_groom_report own, *r = report ? report : &own;
    *r = (apsm_groom_report){ 0 };
    *mesh_out = (apsm_mesh){ 0 };
    return groom_voxels(ctx, name, volume, NULL, options ? *options : apsm_groom_defaults(),
                        mesh_out, r);
}

apsm_status groom_taken_segmentation(apsm_context *ctx, const char *name, apsm_volume *volume,
                                     const apsm_groom_options *options, apsm_mesh *mesh_out,
                                     apsm_groom_report *report)
{
    apsm_groom_report own, *r = report ? report : &own;
    *r = (apsm_groom_report){ 0 };
    *mesh_out = (apsm_mesh){ 0 };
    return groom_voxels(ctx, name, volume, volume, *options, mesh_out, r);
}
