#include "run/turned.h"

#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"

apsm_status turned_find(apsm_run *run, groom_inputs *in)
{
    const apsm_surroundings *around = run->surroundings;
    size_t known = 0;
    if (!around || !around->turn) return APSM_OK;
    in->turn = malloc(9 * in->list.n * sizeof *in->turn);
    if (!in->turn) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < in->list.n; i++) {
        double *R = in->turn + 9 * i;
        const bool told = around->turn(around->user, in->list.cases[i].path, R);
        for (size_t k = 0; k < 9 && !told; k++) R[k] = k % 4 == 0;
        known += told;
    }
    if (known > 0) return APSM_OK;
    free(in->turn);
    in->turn = NULL;
    return APSM_OK;
}

static void as_map(const double R[9], double M[16])
{
    apsm_affine_identity(M);
    for (size_t k = 0; k < 9; k++) M[4 * (k / 3) + k % 3] = R[k];
}

/* Turned copies of the meshes, and their images' borders with them. */
typedef struct turned {
    size_t n;
    apsm_mesh *mesh;
    const apsm_mesh **meshes;
    apsm_borders *borders;
} turned;

static void turned_free(turned *t)
{
    for (size_t i = 0; t->mesh && i < t->n; i++) apsm_mesh_free(&t->mesh[i]);
    free(t->mesh);
    free(t->meshes);
    free(t->borders);
}

static apsm_status turned_new(const groom_inputs *in, const groomed_cohort *c, turned *t)
{
    const size_t n = in->list.n;
    *t = (turned){ n, calloc(n, sizeof *t->mesh), calloc(n, sizeof *t->meshes),
                   calloc(n, sizeof *t->borders) };
    if (!t->mesh || !t->meshes || !t->borders) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < n; i++) {
        double M[16];
        as_map(in->turn + 9 * i, M);
        APSM_TRY(apsm_mesh_copy(c->meshes[i], &t->mesh[i]));
        apsm_mesh_transform(&t->mesh[i], M);
        t->meshes[i] = &t->mesh[i];
        t->borders[i] = c->borders[i];
        for (size_t s = 0; s < t->borders[i].n; s++)
            apsm_affine_apply_normals(M, 1, c->borders[i].normal[s], t->borders[i].normal[s]);
    }
    return APSM_OK;
}

apsm_status turned_align(apsm_run *run, const groom_inputs *in, const groomed_cohort *c,
                         apsm_alignment *alignment)
{
    apsm_align_options options = c->options;
    turned t;
    apsm_status status = turned_new(in, c, &t);
    options.oriented = true;
    if (options.borders) options.borders = t.borders;
    if (status == APSM_OK)
        status = apsm_align_cohort(run->ctx, t.n, t.meshes, c->names, &options, alignment);
    for (size_t i = 0; i < t.n && status == APSM_OK; i++) {
        double M[16], *own = alignment->M + 16 * i, *sized = alignment->sized + 16 * i;
        as_map(in->turn + 9 * i, M);
        apsm_affine_multiply(own, M, own);
        apsm_affine_multiply(sized, M, sized);
    }
    turned_free(&t);
    return status;
}
