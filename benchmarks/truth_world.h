/* truth_world.h -- the shapes of a known correspondence where a model's grooming has put them. */
#ifndef APSM_BENCH_TRUTH_WORLD_H
#define APSM_BENCH_TRUTH_WORLD_H

#include <stdio.h>
#include <stdlib.h>

#include "apsm/formats.h"
#include "files/project.h"
#include "geometry/affine.h"

/* Ends the program if something failed. */
static inline void must(apsm_context *ctx, apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "%s %s\n", apsm_status_text(status), apsm_error_text(ctx));
    exit(1);
}

/* TRUTH_DIR/NAME.ply in the frame of the aligned groomed mesh. */
static inline apsm_mesh read_truth(apsm_context *ctx, const char *truth, const apsm_subject *s)
{
    char path[2048];
    apsm_mesh mesh = { 0 };
    double M[16];
    const char *text = apsm_subject_column(s, "reflection");
    snprintf(path, sizeof path, "%s/%s.ply", truth, s->name);
    must(ctx, apsm_read_mesh(ctx, path, &mesh));
    if (text) {
        char *end = NULL;
        for (int k = 0; k < 16; k++) M[k] = strtod(k ? end : text, &end);
        apsm_affine_apply(M, mesh.nv, mesh.V, mesh.V);
    }
    apsm_affine_apply(s->alignment, mesh.nv, mesh.V, mesh.V);
    return mesh;
}

/* The groomed mesh in the same frame. */
static inline apsm_mesh read_groomed(apsm_context *ctx, const char *model, const apsm_subject *s)
{
    char path[2048];
    apsm_mesh mesh = { 0 };
    snprintf(path, sizeof path, "%s/%s", model, s->groomed);
    must(ctx, apsm_read_mesh(ctx, path, &mesh));
    apsm_mesh_transform(&mesh, s->alignment);
    return mesh;
}

#endif
