#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "files/files.h"
#include "fit/compare.h"
#include "fit/fit_folder.h"
#include "geometry/affine.h"
#include "geometry/bvh.h"
#include "geometry/vec3.h"

/* A compare.json of ours stands for all three. */
static apsm_status check_ours(apsm_context *ctx, const char *folder)
{
    json_t *root = NULL;
    char *path = apsm_path_join(folder, COMPARE_JSON);
    apsm_status status = path ? apsm_json_read(ctx, path, &root) : APSM_ERR_MEMORY;
    if (status == APSM_OK)
        status = apsm_json_check(ctx, path, root, FORMAT_COMPARE, COMPARE_VERSION);
    json_decref(root);
    free(path);
    return status;
}

apsm_status compare_check_folder(apsm_context *ctx, const apsm_compare_settings *o)
{
    static const char *const name[] = { COMPARE_JSON, COMPARE_CSV, COMPARE_PLY };
    const fit_folder f = { .path = o->folder,
                           .what = "a comparison",
                           .maker = "comparison",
                           .marker = COMPARE_JSON,
                           .files = 3,
                           .file = name,
                           .overwrite = o->overwrite };
    bool done;
    APSM_TRY(fit_folder_claim(ctx, &f));
    APSM_TRY(apsm_folder_holds(o->folder, COMPARE_JSON, &done));
    return done ? check_ours(ctx, o->folder) : APSM_OK;
}

/* ---- JSON ---- */

static json_t *json_side(const compare_side *s, const apsm_comparison *c, int k)
{
    return json_pack("{s:s, s:I, s:I, s:I, s:f, s:f}", "path", s->path, "shapes",
                     (json_int_t)c->shapes[k], "particles", (json_int_t)c->particles[k], "modes",
                     (json_int_t)c->modes[k], "variance_per_point", c->variance[k],
                     "explained_by_the_other", k ? c->explained_b : c->explained_a);
}

static json_t *json_rebuilt(const apsm_comparison *c)
{
    json_t *rows = json_array();
    for (size_t q = 0; rows && q < c->counts; q++)
        if (json_array_append_new(rows, json_pack("{s:I, s:f, s:f, s:f}", "modes",
                                                  (json_int_t)c->count[q], "a", c->rebuilt[0][q],
                                                  "b", c->rebuilt[1][q], "p", c->p[q]))) {
            json_decref(rows);
            return NULL;
        }
    return rows;
}

static json_t *json_comparison(const compare_side side[2], const apsm_comparison *c)
{
    return json_pack("{s:s, s:i, s:o, s:o, s:o, s:b, s:f, s:{s:f, s:f}, s:o, s:o, s:o, s:I, s:o}",
                     "format", FORMAT_COMPARE, "version", COMPARE_VERSION, "a",
                     json_side(&side[0], c, 0), "b", json_side(&side[1], c, 1), "b_to_a",
                     apsm_json_vector(16, c->M), "mirrored", c->mirrored, "size_ratio",
                     c->size_ratio, "mean_distance", "mean", c->mean_mean, "max", c->mean_max,
                     "cosines", apsm_json_vector(c->angles, c->cosine), "a_within_b",
                     apsm_json_vector(c->angles, c->share_a), "b_within_a",
                     apsm_json_vector(c->angles, c->share_b), "common_shapes",
                     (json_int_t)c->common, "left_out_distance", json_rebuilt(c));
}

/* ---- CSV ---- */

static apsm_status write_csv(apsm_context *ctx, const char *path, const apsm_comparison *c)
{
    apsm_writer *w;
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    apsm_writer_printf(w, "mode,angle_degrees,a_within_b,b_within_a\n");
    for (size_t k = 0; k < c->angles; k++) {
        const double row[] = { acos(c->cosine[k]) * 180 / 3.14159265358979323846, c->share_a[k],
                               c->share_b[k] };
        apsm_writer_printf(w, "%zu", k + 1);
        for (size_t l = 0; l < 3; l++) {
            apsm_writer_write(w, ",", 1);
            apsm_writer_number(w, row[l]);
        }
        apsm_writer_write(w, "\n", 1);
    }
    return apsm_writer_commit(w);
}

/* ---- the mean surface of A with its distance from B's ---- */

/* Along the normals of A, positive where B lies outside. */
static void differences(const apsm_mesh *a, const apsm_bvh *b, const double *N, double *out)
{
    for (size_t v = 0; v < a->nv; v++) {
        double d[3];
        apsm_closest nearest;
        apsm_bvh_closest(b, a->V + 3 * v, INFINITY, &nearest);
        vec3_sub(nearest.x, a->V + 3 * v, d);
        out[v] = copysign(vec3_norm(d), vec3_dot(d, N + 3 * v));
    }
}

static apsm_status write_ply(apsm_context *ctx, const char *path, const compare_side side[2],
                             const apsm_comparison *c)
{
    const apsm_mesh *a = &side[0].mean;
    apsm_mesh b = { 0 };
    apsm_bvh *tree = NULL;
    double *N = malloc(4 * a->nv * sizeof *N), *difference = N ? N + 3 * a->nv : N;
    const apsm_mesh_field field = { "difference", difference };
    apsm_status status = N ? apsm_mesh_copy(&side[1].mean, &b) : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        apsm_mesh_transform(&b, c->M);
        status = apsm_bvh_build_unsigned(&b, &tree);
    }
    if (status == APSM_OK) {
        apsm_mesh_vertex_normals(a, N);
        differences(a, tree, N, difference);
        status = apsm_write_mesh_fields(ctx, path, a, 1, &field);
    }
    apsm_bvh_free(tree);
    apsm_mesh_free(&b);
    free(N);
    return status;
}

/* compare.json comes last: where it is, the others are whole. */
apsm_status compare_write(apsm_context *ctx, const apsm_compare_settings *o,
                          const compare_side side[2], const apsm_comparison *c)
{
    json_t *root = json_comparison(side, c);
    char *csv = apsm_path_join(o->folder, COMPARE_CSV),
         *ply = apsm_path_join(o->folder, COMPARE_PLY);
    char *json = apsm_path_join(o->folder, COMPARE_JSON);
    apsm_status status = csv && ply && json ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_make_folder(ctx, o->folder);
    if (status == APSM_OK) status = write_csv(ctx, csv, c);
    if (status == APSM_OK) status = write_ply(ctx, ply, side, c);
    if (status == APSM_OK) status = apsm_json_write(ctx, json, root);
    json_decref(root);
    free(csv);
    free(ply);
    free(json);
    return status;
}
