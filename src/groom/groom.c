/* The path of a mesh: repair, remesh, report. */
#include "groom/groom.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "core/number.h"
#include "geometry/vec3.h"
#include "groom/repair.h"

apsm_groom_options apsm_groom_defaults(void)
{
    return (apsm_groom_options){ APSM_OPTION_DEFAULTS(APSM_GROOM_OPTIONS).remesh_options =
                                     apsm_remesh_defaults(),
                                 .measure = true };
}

/* A line that grows; what does not fit is cut. */
typedef struct line {
    char text[600];
    size_t n;
} line;

static void add(line *l, const char *format, ...) APSM_PRINTF(2, 3);
static void add(line *l, const char *format, ...)
{
    va_list args;
    const char *comma = l->n ? "; " : "";
    l->n += (size_t)snprintf(l->text + l->n, sizeof l->text - l->n, "%s", comma);
    va_start(args, format);
    l->n += (size_t)apsm_vprint(l->text + l->n, sizeof l->text - l->n, format, args);
    va_end(args);
    if (l->n >= sizeof l->text) l->n = sizeof l->text - 1;
}

static void say_vertices_and_faces(line *l, const apsm_groom_report *r)
{
    if (r->merged_vertices) add(l, "%zu coinciding vertices merged", r->merged_vertices);
    if (r->unused_vertices) add(l, "%zu unused vertices dropped", r->unused_vertices);
    if (r->degenerate_faces) add(l, "%zu degenerate faces dropped", r->degenerate_faces);
    if (r->duplicate_faces) add(l, "%zu duplicate faces dropped", r->duplicate_faces);
    if (r->fin_faces) add(l, "%zu faces of fins and inner walls dropped", r->fin_faces);
    if (r->split_vertices) add(l, "%zu touching vertices split", r->split_vertices);
    if (r->flipped_faces) add(l, "%zu faces turned over", r->flipped_faces);
    if (r->inverted) add(l, "inside out: turned over");
}

/* One line for all that repair had to do; nothing if that is nothing. */
static void say_repair(apsm_context *ctx, const char *name, const apsm_groom_options *opt,
                       const apsm_groom_report *r)
{
    line l = { .n = 0 };
    say_vertices_and_faces(&l, r);
    if (r->dropped_components)
        add(&l, "%zu smaller parts dropped (%zu faces, %.2g %% of the area)", r->dropped_components,
            r->dropped_faces, 100.0 * r->dropped_area);
    if (r->holes)
        add(&l,
            "%zu holes closed with %zu faces, the largest near %.5g %.5g %.5g, %.2g %% of the area",
            r->holes, r->hole_faces, r->largest_cap_at[0], r->largest_cap_at[1],
            r->largest_cap_at[2], 100.0 * r->largest_cap);
    /* A cap of one per cent is no longer a mend but a guess at the anatomy: worth a look. */
    const bool guessed = r->largest_cap > 0.01, grave = guessed || r->dropped_area > 0.05;
    if (guessed && !opt->fill)
        add(&l, "say --fill if that is right, --open to leave openings as they are");
    if (r->openings)
        add(&l, "%zu opening%s left as %s", r->openings, r->openings == 1 ? "" : "s",
            r->openings == 1 ? "it is" : "they are");
    if (r->sided) add(&l, "too flat to tell its outside: the file's order of corners does");
    if (l.n) apsm_log(ctx, grave ? APSM_LOG_WARNING : APSM_LOG_INFO, "%s: %s", name, l.text);
    if (r->genus) /* the cohort says whether that is worth a warning */
        apsm_log(ctx, APSM_LOG_INFO, "%s: the surface has %ld handle%s (genus)", name, r->genus,
                 r->genus == 1 ? "" : "s");
}

static double half_edge_length(const apsm_mesh *m, size_t h)
{
    const uint32_t a = m->F[h], b = m->F[h % 3 == 2 ? h - 2 : h + 1];
    return sqrt(vec3_distance2(m->V + 3 * a, m->V + 3 * b));
}

/* Whether one vertex is at the end of all edges longer than half of the longest (out). */
static bool is_spike(const apsm_mesh *m, uint32_t *vertex, double *most)
{
    size_t at = 0;
    for (size_t h = 1; h < 3 * m->nf; h++)
        if (half_edge_length(m, h) > half_edge_length(m, at)) at = h;
    const uint32_t end[2] = { m->F[at], m->F[at % 3 == 2 ? at - 2 : at + 1] };
    bool all[2] = { true, true };
    *most = half_edge_length(m, at);
    for (size_t h = 0; h < 3 * m->nf; h++)
        for (int k = 0; k < 2; k++)
            all[k] &= m->F[h] == end[k] || m->F[h % 3 == 2 ? h - 2 : h + 1] == end[k] ||
                      half_edge_length(m, h) <= 0.5 * *most;
    *vertex = end[all[0] ? 0 : 1];
    return all[0] || all[1];
}

static apsm_status refuse_remesh(apsm_context *ctx, const char *name, const apsm_mesh *mesh,
                                 apsm_status status)
{
    uint32_t v;
    double most;
    if (status != APSM_ERR_GEOMETRY)
        return apsm_fail(ctx, status, "%s: %s", name, apsm_status_text(status));
    if (!is_spike(mesh, &v, &most))
        return apsm_fail(ctx, status,
                         "%s: cannot be remeshed: it consists of needles, triangles far longer "
                         "than wide; remesh the file with another program, or use --no-remesh",
                         name);
    return apsm_fail(ctx, status,
                     "%s: cannot be remeshed: edges %.3g times as long as the mean one end at a "
                     "stray vertex near %.6g %.6g %.6g; remove it",
                     name, most / apsm_mesh_mean_edge(mesh), mesh->V[3 * v], mesh->V[3 * v + 1],
                     mesh->V[3 * v + 2]);
}

apsm_status groom_remesh(apsm_context *ctx, const char *name, apsm_mesh *mesh,
                         const apsm_remesh_options *opt, apsm_remesh_report *report)
{
    apsm_bvh *tree;
    apsm_mesh fine = *mesh;
    APSM_TRY(apsm_bvh_build_unsigned(&fine, &tree));
    apsm_status status = apsm_remesh(ctx, &fine, tree, opt, mesh, report);
    apsm_bvh_free(tree);
    if (status != APSM_OK) {
        *mesh = fine; /* the caller frees it */
        return refuse_remesh(ctx, name, mesh, status);
    }
    apsm_mesh_free(&fine);
    return APSM_OK;
}

apsm_status groom_surface(apsm_context *ctx, const char *name, const apsm_mesh *mesh,
                          const apsm_groom_options *opt, apsm_mesh *mesh_out, apsm_groom_report *r)
{
    APSM_TRY(apsm_repair(ctx, name, mesh, opt, mesh_out, r));
    say_repair(ctx, name, opt, r);
    if (!opt->remesh) return APSM_OK;
    const apsm_status status =
        groom_remesh(ctx, name, mesh_out, &opt->remesh_options, opt->measure ? &r->remesh : NULL);
    if (status != APSM_OK) apsm_mesh_free(mesh_out);
    return status;
}

apsm_status apsm_groom_mesh(apsm_context *ctx, const char *name, const apsm_mesh *mesh,
                            const apsm_groom_options *options, apsm_mesh *mesh_out,
                            apsm_groom_report *report)
{
    const apsm_groom_options opt = options ? *options : apsm_groom_defaults();
    apsm_groom_report own, *r = report ? report : &own;
    *r = (apsm_groom_report){ 0 };
    return groom_surface(ctx, name, mesh, &opt, mesh_out, r);
}

void apsm_reflect(apsm_mesh *mesh, double M[16])
{
    double c[3];
    apsm_mesh_centroid(mesh, c);
    const double plane = (double)(float)c[0];
    const double mirror[16] = { -1, 0, 0, 2.0 * plane, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };
    memcpy(M, mirror, sizeof mirror);
    apsm_mesh_transform(mesh, M);
}
