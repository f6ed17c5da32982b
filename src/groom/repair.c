/* Repair of a triangle mesh: the order of the steps, and what they share.
 *
 *   weld      vertices that coincide become one
 *   faces     degenerate and duplicate faces go
 *   stitch    edges with more than two faces are resolved, vertices split into their fans
 *   orient    neighbours agree on what is outside
 *   parts     the largest part stays
 *   holes     openings are closed, or those that may stay are counted
 *   slivers   faces without area are edited away
 *   outward   the volume is positive (of an open mesh: with lids over its openings)
 * No step moves a vertex by more than opt->merge diagonals. */
#include "groom/repair.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/robust.h"
#include "geometry/rim.h"
#include "geometry/vec3.h"

/* A closed surface with less volume than this, over area^(3/2), is a sheet (a ball has 0.094). */
static const double least_volume = 1e-6;
/* An open one with less under its lids does not say which side is outside (a hemisphere has 0.13).
 */
static const double least_bulge = 0.05;
/* Farther out than so many times what is usual, no vertex of a shape is. */
static const double stray = 1000.0;

void sets_init(uint32_t *parent, size_t n)
{
    for (size_t i = 0; i < n; i++) parent[i] = (uint32_t)i;
}

uint32_t sets_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i) {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    return i;
}

void sets_join(uint32_t *parent, uint32_t i, uint32_t j)
{
    i = sets_root(parent, i);
    j = sets_root(parent, j);
    if (i < j)
        parent[j] = i;
    else
        parent[i] = j;
}

apsm_status repair_drop(apsm_mesh *mesh, const unsigned char *drop)
{
    uint32_t *name = malloc(mesh->nv * sizeof *name + 1);
    if (!name) return APSM_ERR_MEMORY;
    memset(name, 0xff, mesh->nv * sizeof *name);
    size_t nf = 0, nv = 0;
    for (size_t f = 0; f < mesh->nf; f++) {
        if (drop && drop[f]) continue;
        memmove(mesh->F + 3 * nf, mesh->F + 3 * f, 3 * sizeof *mesh->F);
        for (size_t k = 0; k < 3; k++) name[mesh->F[3 * nf + k]] = 0;
        nf++;
    }
    for (size_t v = 0; v < mesh->nv; v++) {
        if (name[v] == APSM_NONE) continue;
        memmove(mesh->V + 3 * nv, mesh->V + 3 * v, 3 * sizeof *mesh->V);
        name[v] = (uint32_t)nv++;
    }
    for (size_t h = 0; h < 3 * nf; h++) mesh->F[h] = name[mesh->F[h]];
    mesh->nf = nf;
    mesh->nv = nv;
    free(name);
    return APSM_OK;
}

static apsm_status check_input(const repair *r)
{
    const apsm_mesh *m = &r->mesh;
    if (m->nv == 0 || m->nf == 0)
        return apsm_fail(r->ctx, APSM_ERR_GEOMETRY, "%s: the mesh is empty", r->name);
    for (size_t v = 0; v < m->nv; v++)
        if (!isfinite(m->V[3 * v]) || !isfinite(m->V[3 * v + 1]) || !isfinite(m->V[3 * v + 2]))
            return apsm_fail(r->ctx, APSM_ERR_NONFINITE,
                             "%s: vertex %zu has a coordinate that is not a number; export the "
                             "mesh again",
                             r->name, v);
    for (size_t h = 0; h < 3 * m->nf; h++)
        if (m->F[h] >= m->nv)
            return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                             "%s: face %zu names vertex %u of %zu; the file is damaged", r->name,
                             h / 3, m->F[h], m->nv);
    return APSM_OK;
}

/* The corner farthest from the corners' middle (out), how far that is, and what is usual. */
static double farthest_corner(const apsm_mesh *m, double *scratch, double *usual,
                              uint32_t *farthest)
{
    const size_t n = 3 * m->nf;
    double middle[3], most = 0.0;
    for (size_t c = 0; c < 3; c++) {
        for (size_t h = 0; h < n; h++) scratch[h] = m->V[3 * m->F[h] + c];
        middle[c] = robust_select(n, scratch, n / 2);
    }
    for (size_t h = 0; h < n; h++) {
        scratch[h] = sqrt(vec3_distance2(m->V + 3 * m->F[h], middle));
        if (scratch[h] > most) most = scratch[h], *farthest = m->F[h];
    }
    *usual = robust_select(n, scratch, n / 2);
    return most;
}

/* Beside a vertex so far away all others would count as one. */
static apsm_status refuse_stray(const repair *r)
{
    const apsm_mesh *m = &r->mesh;
    double usual, *scratch = malloc(3 * m->nf * sizeof *scratch);
    uint32_t v = 0;
    if (!scratch) return APSM_ERR_MEMORY;
    const double most = farthest_corner(m, scratch, &usual, &v);
    free(scratch);
    if (!(most > stray * usual) || !(usual > 0.0)) return APSM_OK;
    return apsm_fail(r->ctx, APSM_ERR_GEOMETRY,
                     "%s: vertex %u, at %.6g %.6g %.6g, lies %.2g times as far from the middle of "
                     "the shape as is usual; remove it, or export the mesh again",
                     r->name, v, m->V[3 * v], m->V[3 * v + 1], m->V[3 * v + 2], most / usual);
}

/* How far the corners lie from the plane of the largest face; n: scratch. */
static double thickness(const apsm_mesh *m, double n[3])
{
    double largest = 0.0, most = 0.0, at[3];
    size_t first = 0;
    for (size_t f = 0; f < m->nf; f++) {
        face_vector(m, f, n);
        const double area = vec3_dot(n, n);
        if (area > largest) largest = area, first = f;
    }
    face_normal(m, first, n);
    for (size_t h = 0; h < 3 * m->nf; h++) {
        vec3_sub(m->V + 3 * m->F[h], m->V + 3 * m->F[3 * first], at);
        most = fmax(most, fabs(vec3_dot(at, n)));
    }
    return most;
}

/* Vertices of no face, which may be anywhere, have no say in what counts as near or flat. */
static apsm_status drop_unused(repair *r)
{
    const size_t nv = r->mesh.nv;
    APSM_TRY(repair_drop(&r->mesh, NULL));
    r->report->unused_vertices = nv - r->mesh.nv;
    return APSM_OK;
}

/* What has no volume, or none that can be reckoned with. */
static apsm_status refuse_flat(const repair *r)
{
    static const double flat = 1e-6, range = 1e60;
    double lo[3], hi[3], n[3];
    apsm_mesh_bounds(&r->mesh, lo, hi);
    vec3_sub(hi, lo, n);
    const double size = fmax(n[0], fmax(n[1], n[2]));
    if (size > range || (size > 0.0 && size < 1.0 / range))
        return apsm_fail(r->ctx, APSM_ERR_GEOMETRY,
                         "%s: is %.3g long, which is no length of a shape; is the file damaged?",
                         r->name, size);
    if (thickness(&r->mesh, n) > flat * size) return APSM_OK;
    apsm_mesh_defects d;
    APSM_TRY(apsm_mesh_inspect(&r->mesh, &d));
    if (d.border_edges > 0) return APSM_OK; /* a sheet: an open surface, or one that needs a cap */
    return apsm_fail(r->ctx, APSM_ERR_GEOMETRY,
                     "%s: all its points lie in a plane, or on a line: it encloses no volume; "
                     "export the whole surface",
                     r->name);
}

static apsm_status something_left(const repair *r)
{
    if (r->mesh.nf > 0) return APSM_OK;
    return apsm_fail(r->ctx, APSM_ERR_GEOMETRY,
                     "%s: no proper face is left after removing degenerate and doubled ones; the "
                     "mesh encloses no volume",
                     r->name);
}

/* Volume under lids from every border edge to its loop's middle. */
static double lid_volume(const apsm_rim *rim)
{
    const apsm_mesh *m = rim->mesh;
    double sum = 0.0;
    for (size_t loop = 0; loop < rim->loops; loop++) {
        const uint32_t first = rim->loop_start[loop], end = rim->loop_start[loop + 1];
        double middle[3] = { 0.0, 0.0, 0.0 };
        for (uint32_t e = first; e < end; e++)
            vec3_add_scaled(middle, 1.0 / (end - first), m->V + 3 * m->F[rim->half_edge[e]]);
        for (uint32_t e = first; e < end; e++) {
            const uint32_t h = rim->half_edge[e];
            double n[3];
            vec3_cross(m->V + 3 * m->F[h % 3 == 2 ? h - 2 : h + 1], m->V + 3 * m->F[h], n);
            sum += vec3_dot(n, middle) / 6.0;
        }
    }
    return sum;
}

/* Of the mesh with its openings, if any, under lids. */
static apsm_status closed_volume(repair *r, double area, double *volume)
{
    apsm_topology topology;
    apsm_rim rim;
    *volume = apsm_mesh_volume(&r->mesh);
    if (!r->report->openings) return APSM_OK;
    APSM_TRY(apsm_topology_build(&r->mesh, &topology));
    const apsm_status status = apsm_rim_build(&r->mesh, &topology, &rim);
    apsm_topology_free(&topology);
    if (status != APSM_OK) return status;
    *volume += lid_volume(&rim);
    r->report->open_length = apsm_rim_length(&rim) / sqrt(area);
    apsm_rim_free(&rim);
    return APSM_OK;
}

static apsm_status face_outward(repair *r)
{
    apsm_mesh *m = &r->mesh;
    const double area = apsm_mesh_area(m), unit = area * sqrt(area);
    double volume;
    APSM_TRY(closed_volume(r, area, &volume));
    if (r->opt->keep_sides) return APSM_OK;
    if (r->report->openings) {
        r->report->sided = !(fabs(volume) > least_bulge * unit);
        if (r->report->sided) return APSM_OK;
    }
    if (!(fabs(volume) > least_volume * unit))
        return apsm_fail(r->ctx, APSM_ERR_GEOMETRY,
                         "%s: the surface encloses no volume (a sheet?); give it thickness",
                         r->name);
    if (volume < 0.0) {
        for (size_t f = 0; f < m->nf; f++) {
            const uint32_t t = m->F[3 * f + 1];
            m->F[3 * f + 1] = m->F[3 * f + 2];
            m->F[3 * f + 2] = t;
        }
        r->report->inverted = true;
    }
    return APSM_OK;
}

static apsm_status check_result(repair *r)
{
    apsm_mesh_defects d;
    APSM_TRY(apsm_mesh_inspect(&r->mesh, &d));
    const bool closed = d.border_edges == 0 || r->report->openings > 0;
    if (!closed || d.nonmanifold_edges || d.nonmanifold_vertices || d.flipped_edges ||
        d.degenerate_faces || d.components != 1) {
        const double *at = d.border_edges ? d.border_at : d.nonmanifold_at;
        return apsm_fail(r->ctx, APSM_ERR_GEOMETRY,
                         "%s: could not be made one closed surface (%zu border, %zu non-manifold "
                         "edges, %zu degenerate faces, near %.6g %.6g %.6g); mend it there by hand",
                         r->name, d.border_edges, d.nonmanifold_edges, d.degenerate_faces, at[0],
                         at[1], at[2]);
    }
    /* twice the number of edges is that of half-edges, those of a border twice */
    const size_t edges = (3 * r->mesh.nf + d.border_edges) / 2;
    const long euler = (long)(r->mesh.nv - d.unused_vertices) - (long)edges + (long)r->mesh.nf;
    r->report->genus = (2 - (long)r->report->openings - euler) / 2;
    return APSM_OK;
}

static apsm_status run(repair *r)
{
    APSM_TRY(check_input(r));
    APSM_TRY(refuse_stray(r));
    APSM_TRY(drop_unused(r));
    APSM_TRY(refuse_flat(r));
    APSM_TRY(repair_weld(r));
    APSM_TRY(repair_faces(r));
    APSM_TRY(something_left(r));
    APSM_TRY(repair_stitch(r));
    APSM_TRY(something_left(r));
    APSM_TRY(repair_orient(r));
    APSM_TRY(repair_parts(r));
    APSM_TRY(repair_holes(r));
    APSM_TRY(repair_slivers(r));
    APSM_TRY(face_outward(r));
    return check_result(r);
}

apsm_status apsm_repair(apsm_context *ctx, const char *name, const apsm_mesh *mesh,
                        const apsm_groom_options *opt, apsm_mesh *mesh_out,
                        apsm_groom_report *report)
{
    const apsm_groom_options defaults = apsm_groom_defaults();
    apsm_groom_report unused = { 0 };
    repair r = { ctx, name, opt ? opt : &defaults, report ? report : &unused, { 0 } };
    *mesh_out = (apsm_mesh){ 0 };
    APSM_TRY(apsm_mesh_copy(mesh, &r.mesh));
    const apsm_status status = run(&r);
    if (status == APSM_OK)
        *mesh_out = r.mesh;
    else
        apsm_mesh_free(&r.mesh);
    return status;
}
