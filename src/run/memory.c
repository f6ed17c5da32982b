#include "run/memory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct given_shape {
    char *name;
    bool reflect;
    apsm_input_shape shape;
} given_shape;

/* ---- the door ---- */

static apsm_status bad(const apsm_run *run, const char *name, const char *what)
{
    return apsm_fail(run->ctx, APSM_ERR_ARG, "%s: %s", name, what);
}

apsm_status run_check_name(const apsm_run *run, const char *name)
{
    enum { MOST = 200 };
    bool fine = apsm_is_utf8(name) && *name && strlen(name) <= MOST;
    for (const char *c = name; *c; c++)
        fine = fine && (unsigned char)*c >= 32 && *c != 127 && *c != '/';
    if (fine) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_ARG,
                     "a shape's name has to be 1 to %d bytes of UTF-8 without control characters "
                     "and slashes",
                     MOST);
}

static apsm_status check_name(const apsm_run *run, const char *name)
{
    APSM_TRY(run_check_name(run, name));
    for (size_t k = 0; k < run->n_given; k++)
        if (strcmp(run->given[k].name, name) == 0)
            return bad(run, name, "a shape of this name is there already");
    return APSM_OK;
}

static bool all_finite(size_t n, const double *x)
{
    for (size_t k = 0; k < n; k++)
        if (!isfinite(x[k])) return false;
    return true;
}

static apsm_status check_mesh(const apsm_run *run, const char *name, const apsm_mesh *mesh)
{
    if (!mesh->V || !mesh->F || mesh->nv == 0 || mesh->nf == 0)
        return bad(run, name, "a mesh needs vertices and faces");
    if (mesh->nv >= UINT32_MAX || mesh->nf >= UINT32_MAX / 3)
        return bad(run, name, "a mesh has fewer than 2^32 vertices and corners");
    if (!all_finite(3 * mesh->nv, mesh->V)) return bad(run, name, "a vertex is not finite");
    for (size_t k = 0; k < 3 * mesh->nf; k++)
        if (mesh->F[k] >= mesh->nv)
            return bad(run, name, "a face names a vertex that is not there");
    return APSM_OK;
}

/* Columns of direction: unit vectors that span space; a tilted gantry makes them lean. */
static bool is_grid(const double D[9])
{
    const double tolerance = 2e-3, least = 0.1;
    const double det = D[0] * (D[4] * D[8] - D[5] * D[7]) - D[1] * (D[3] * D[8] - D[5] * D[6]) +
                       D[2] * (D[3] * D[7] - D[4] * D[6]);
    for (int a = 0; a < 3; a++) {
        const double square = D[a] * D[a] + D[3 + a] * D[3 + a] + D[6 + a] * D[6 + a];
        if (!(fabs(square - 1) <= 2 * tolerance)) return false;
    }
    return fabs(det) > least;
}

static apsm_status check_voxels(const apsm_run *run, const char *name, const apsm_volume *v)
{
    const size_t layers = v->layers ? v->layers : 1;
    if ((!v->label && !v->value) || v->n[0] == 0 || v->n[1] == 0 || v->n[2] == 0)
        return bad(run, name, "an image needs voxels");
    if (v->n[1] > SIZE_MAX / sizeof *v->label / layers / v->n[0] / v->n[2])
        return bad(run, name, "an image of more voxels than there is memory for");
    if (v->segments > 0 && !v->segment) return bad(run, name, "segments without their array");
    for (size_t k = 0; k < v->segments; k++)
        if (v->segment[k].layer >= layers) return bad(run, name, "a segment of no layer");
    for (size_t k = 0; v->value && k < v->n[0] * v->n[1] * v->n[2]; k++)
        if (!isfinite(v->value[k])) return bad(run, name, "a voxel is not finite");
    return APSM_OK;
}

static apsm_status check_volume(const apsm_run *run, const char *name, const apsm_volume *v)
{
    APSM_TRY(check_voxels(run, name, v));
    for (int k = 0; k < 3; k++)
        if (!(v->spacing[k] > 0)) return bad(run, name, "the spacing of a grid has to be positive");
    if (!all_finite(3, v->origin) || !all_finite(3, v->spacing) || !is_grid(v->direction))
        return bad(run, name,
                   "the grid has to be finite, and the columns of its direction unit vectors that "
                   "span space");
    return APSM_OK;
}

static apsm_status check_state(const apsm_run *run, const char *name)
{
    if (!run_is_in_memory(run))
        return bad(run, run->folder, "a job in a folder reads its shapes from files");
    if (run->project.n > 0)
        return apsm_fail(run->ctx, APSM_ERR_STATE, "%s: the job's shapes are groomed already",
                         name);
    return check_name(run, name);
}

/* ---- handing over ---- */

/* Takes shape over; in an error, too. */
static apsm_status append(apsm_run *run, const char *name, bool reflect, apsm_input_shape *shape)
{
    given_shape *grown = realloc(run->given, (run->n_given + 1) * sizeof *grown);
    if (grown) {
        run->given = grown;
        grown[run->n_given] = (given_shape){ strdup(name), reflect, *shape };
        if (grown[run->n_given].name) return run->n_given++, APSM_OK;
    }
    apsm_input_shape_free(shape);
    return apsm_fail(run->ctx, APSM_ERR_MEMORY, "%s: out of memory", name);
}

apsm_status apsm_run_add_mesh(apsm_run *run, const char *name, bool reflect, size_t nv,
                              const double *V, size_t nf, const uint32_t *F)
{
    if (!run || !name) return APSM_ERR_ARG;
    APSM_TRY(check_state(run, name));
    /* borrowed for the check and the copy, which only read */
    const apsm_mesh given = { nv, nf, (double *)(uintptr_t)V, (uint32_t *)(uintptr_t)F };
    apsm_input_shape shape = { .is_mesh = true };
    APSM_TRY(check_mesh(run, name, &given));
    if (apsm_mesh_copy(&given, &shape.mesh) != APSM_OK)
        return apsm_fail(run->ctx, APSM_ERR_MEMORY, "%s: out of memory", name);
    return append(run, name, reflect, &shape);
}

apsm_status apsm_run_add_volume(apsm_run *run, const char *name, bool reflect,
                                const apsm_volume *volume)
{
    if (!run || !name || !volume) return APSM_ERR_ARG;
    APSM_TRY(check_state(run, name));
    apsm_input_shape shape = { .is_mesh = false };
    APSM_TRY(check_volume(run, name, volume));
    if (apsm_volume_copy(volume, &shape.volume) != APSM_OK)
        return apsm_fail(run->ctx, APSM_ERR_MEMORY, "%s: out of memory", name);
    return append(run, name, reflect, &shape);
}

void memory_free(apsm_run *run)
{
    for (size_t k = 0; k < run->n_given; k++) {
        free(run->given[k].name);
        apsm_input_shape_free(&run->given[k].shape);
    }
    free(run->given);
    run->given = NULL;
    run->n_given = 0;
    apsm_optimizer_state_free(&run->initial);
}

/* ---- as inputs of groom ---- */

static int by_name(const void *a, const void *b)
{
    return strcmp(((const given_shape *)a)->name, ((const given_shape *)b)->name);
}

apsm_status memory_list(apsm_run *run, groom_inputs *in)
{
    bool meshes_only = true;
    for (size_t k = 0; k < 4; k++) {
        static const char *const of_files[] = { "exclude", "reflect_match", "pattern", "ignore",
                                                "fixed" };
        if (*apsm_run_text(run, of_files[k]))
            return apsm_fail(run->ctx, APSM_ERR_ARG,
                             "%s: is for files; a job in memory says it when a shape is added",
                             of_files[k]);
    }
    if (run->n_given == 0)
        return apsm_fail(run->ctx, APSM_ERR_ARG, "job in memory: no shapes have been added");
    APSM_TRY(apsm_labels_parse(run->ctx, apsm_run_text(run, "labels"), &in->labels));
    qsort(run->given, run->n_given, sizeof *run->given, by_name);
    in->list.cases = calloc(run->n_given, sizeof *in->list.cases);
    if (!in->list.cases) return apsm_fail(run->ctx, APSM_ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < run->n_given; i++) {
        const given_shape *g = &run->given[i];
        apsm_input_case *c = &in->list.cases[in->list.n++];
        APSM_TRY(apsm_text_set(&c->name, g->name));
        APSM_TRY(apsm_text_set(&c->path, g->name));
        c->kind = g->shape.is_mesh ? APSM_INPUT_MESH : APSM_INPUT_VOLUME;
        c->reflect = g->reflect;
        meshes_only = meshes_only && g->shape.is_mesh;
    }
    if (in->labels.n == 0 || !meshes_only) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_ARG, "labels: all shapes are meshes, which have none");
}

apsm_status memory_read(apsm_context *ctx, const apsm_run *run, size_t i, const apsm_labels *labels,
                        apsm_input_shape *shape)
{
    const given_shape *g = &run->given[i];
    *shape = (apsm_input_shape){ .is_mesh = g->shape.is_mesh };
    if (shape->is_mesh) return apsm_mesh_copy(&g->shape.mesh, &shape->mesh);
    APSM_TRY(apsm_volume_copy(&g->shape.volume, &shape->volume));
    return apsm_input_finish(ctx, g->name, labels, shape);
}
