/* One binary glTF 2.0 file (.glb): the mean as a mesh whose morph targets are the modes, each at
 * one standard deviation, so that a weight is a number of standard deviations.
 *
 * Format: Khronos glTF 2.0, 3.7 (geometry) and 4 (GLB).  Its scenes have y up: a node turns LPS. */
#include <jansson.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "exchange/exporting.h"

enum { FLOAT = 5126, UINT = 5125, VERTEX_BUFFER = 34962, INDEX_BUFFER = 34963 };
enum { JSON_CHUNK = 0x4E4F534A, BIN_CHUNK = 0x004E4942, GLB_MAGIC = 0x46546C67 };

typedef struct glb {
    json_t *views, *accessors;
    size_t bytes; /* of the binary part so far */
} glb;

/* The next view and its accessor; returns the accessor's number. */
static int add_accessor(glb *g, size_t count, bool indices, const float *lo, const float *hi)
{
    const size_t bytes = count * (indices ? 4 : 12);
    const int number = (int)json_array_size(g->accessors);
    json_array_append_new(g->views, json_pack("{s:i, s:I, s:I, s:i}", "buffer", 0, "byteOffset",
                                              (json_int_t)g->bytes, "byteLength", (json_int_t)bytes,
                                              "target", indices ? INDEX_BUFFER : VERTEX_BUFFER));
    json_t *accessor = json_pack("{s:i, s:i, s:I, s:s}", "bufferView", number, "componentType",
                                 indices ? UINT : FLOAT, "count", (json_int_t)count, "type",
                                 indices ? "SCALAR" : "VEC3");
    if (lo) {
        json_object_set_new(accessor, "min",
                            json_pack("[f, f, f]", (double)lo[0], (double)lo[1], (double)lo[2]));
        json_object_set_new(accessor, "max",
                            json_pack("[f, f, f]", (double)hi[0], (double)hi[1], (double)hi[2]));
    }
    json_array_append_new(g->accessors, accessor);
    g->bytes += bytes;
    return number;
}

static int add_positions(glb *g, size_t n, const double *x)
{
    float lo[3], hi[3];
    for (int c = 0; c < 3; c++) lo[c] = hi[c] = (float)x[c];
    for (size_t k = 0; k < 3 * n; k++) {
        lo[k % 3] = fminf(lo[k % 3], (float)x[k]);
        hi[k % 3] = fmaxf(hi[k % 3], (float)x[k]);
    }
    return add_accessor(g, n, false, lo, hi);
}

static json_t *mode_name(size_t k)
{
    char name[32];
    snprintf(name, sizeof name, "mode_%02zu", k + 1);
    return json_string(name);
}

/* The mesh; y (nv x 3) is scratch. */
static json_t *describe_mesh(const exporting *e, glb *g, double *y)
{
    const apsm_mesh *mean = &e->dense.mean;
    json_t *targets = json_array(), *weights = json_array(), *names = json_array();
    const int position = add_positions(g, mean->nv, mean->V);
    const int normal = add_accessor(g, mean->nv, false, NULL, NULL);
    const int index = add_accessor(g, 3 * mean->nf, true, NULL, NULL);
    for (size_t k = 0; k < e->modes; k++) {
        dense_model_mode(&e->dense, k, y);
        json_array_append_new(targets,
                              json_pack("{s:i}", "POSITION", add_positions(g, mean->nv, y)));
        json_array_append_new(weights, json_real(0));
        json_array_append_new(names, mode_name(k));
    }
    json_t *primitive = json_pack("{s:{s:i, s:i}, s:i, s:i}", "attributes", "POSITION", position,
                                  "NORMAL", normal, "indices", index, "material", 0);
    json_t *mesh = json_pack("{s:s, s:[O], s:{s:O}}", "name", "mean", "primitives", primitive,
                             "extras", "targetNames", names);
    if (e->modes > 0) {
        json_object_set(primitive, "targets", targets);
        json_object_set(mesh, "weights", weights);
    }
    json_decref(primitive);
    json_decref(targets);
    json_decref(weights);
    json_decref(names);
    return mesh;
}

/* Left, posterior, superior become x, -z, y. */
static json_t *describe_scene(const exporting *e, glb *g, double *y)
{
    json_t *mesh = describe_mesh(e, g, y);
    json_t *material = json_pack("{s:s, s:b, s:{s:[f, f, f, f], s:f, s:f}}", "name", "surface",
                                 "doubleSided", 1, "pbrMetallicRoughness", "baseColorFactor", 0.86,
                                 0.83, 0.75, 1.0, "metallicFactor", 0.0, "roughnessFactor", 0.7);
    json_t *node = json_pack("{s:s, s:i, s:[i,i,i,i, i,i,i,i, i,i,i,i, i,i,i,i], s:{s:s}}", "name",
                             "model", "mesh", 0, "matrix", 1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0,
                             0, 0, 1, "extras", "frame",
                             "vertices are LPS in the unit of the inputs; a weight is a number of "
                             "standard deviations");
    return json_pack("{s:{s:s, s:s}, s:i, s:[{s:[i]}], s:[o], s:[o], s:[o], s:[{s:I}], s:O, s:O}",
                     "asset", "version", "2.0", "generator", "apsm", "scene", 0, "scenes", "nodes",
                     0, "nodes", node, "meshes", mesh, "materials", material, "buffers",
                     "byteLength", (json_int_t)g->bytes, "bufferViews", g->views, "accessors",
                     g->accessors);
}

/* ---- bytes ---- */

static void put_u32(apsm_writer *w, uint32_t x)
{
    const unsigned char b[4] = { (unsigned char)x, (unsigned char)(x >> 8),
                                 (unsigned char)(x >> 16), (unsigned char)(x >> 24) };
    apsm_writer_write(w, b, sizeof b);
}

static void put_floats(apsm_writer *w, size_t n, const double *x)
{
    for (size_t k = 0; k < n; k++) {
        const float f = (float)x[k];
        uint32_t bits;
        memcpy(&bits, &f, sizeof bits);
        put_u32(w, bits);
    }
}

/* In the order in which the accessors were made. */
static void put_binary(apsm_writer *w, const exporting *e, double *y)
{
    const apsm_mesh *mean = &e->dense.mean;
    put_floats(w, 3 * mean->nv, mean->V);
    apsm_mesh_vertex_normals(mean, y);
    put_floats(w, 3 * mean->nv, y);
    for (size_t k = 0; k < 3 * mean->nf; k++) put_u32(w, mean->F[k]);
    for (size_t k = 0; k < e->modes; k++) {
        dense_model_mode(&e->dense, k, y);
        put_floats(w, 3 * mean->nv, y);
    }
}

static apsm_status write_glb(const exporting *e, const char *json, size_t bytes, double *y)
{
    const size_t length = strlen(json), padded = (length + 3) / 4 * 4, all = 28 + padded + bytes;
    apsm_writer *w = NULL;
    if (all > UINT32_MAX)
        return apsm_fail(e->ctx, APSM_ERR_ARG, "%s: a .glb holds 4 GB at most; give fewer --modes",
                         e->settings->path);
    APSM_TRY(apsm_writer_open(e->ctx, e->settings->path, &w));
    put_u32(w, GLB_MAGIC);
    put_u32(w, 2);
    put_u32(w, (uint32_t)all);
    put_u32(w, (uint32_t)padded);
    put_u32(w, JSON_CHUNK);
    apsm_writer_write(w, json, length);
    apsm_writer_write(w, "   ", padded - length);
    put_u32(w, (uint32_t)bytes);
    put_u32(w, BIN_CHUNK);
    put_binary(w, e, y);
    return apsm_writer_commit(w);
}

static bool ends_in(const char *path, const char *end)
{
    const size_t n = strlen(path), m = strlen(end);
    return n > m && strcmp(path + n - m, end) == 0;
}

apsm_status export_gltf(exporting *e)
{
    if (!ends_in(e->settings->path, ".glb"))
        return apsm_fail(e->ctx, APSM_ERR_ARG,
                         "%s: glTF is written as one binary file; end it in "
                         ".glb",
                         e->settings->path);
    double *y = malloc(3 * e->dense.mean.nv * sizeof *y);
    glb g = { json_array(), json_array(), 0 };
    json_t *root = y && g.views && g.accessors ? describe_scene(e, &g, y) : NULL;
    char *json = root ? json_dumps(root, JSON_COMPACT) : NULL;
    const apsm_status status = json ? write_glb(e, json, g.bytes, y) : APSM_ERR_MEMORY;
    free(json);
    json_decref(root);
    json_decref(g.views);
    json_decref(g.accessors);
    free(y);
    return status == APSM_ERR_MEMORY
               ? apsm_fail(e->ctx, status, "%s: out of memory", e->settings->path)
               : status;
}
