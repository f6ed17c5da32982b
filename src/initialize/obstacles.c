#include "initialize/obstacles.h"

#include <stdlib.h>
#include <string.h>

#include "geometry/bvh_guess.h"

apsm_status apsm_obstacles_begin(size_t I, apsm_obstacles *o)
{
    *o = (apsm_obstacles){ I, calloc(I + 1, sizeof *o->n), calloc(I + 1, sizeof *o->of) };
    if (o->n && o->of) return APSM_OK;
    apsm_obstacles_free(o);
    return APSM_ERR_MEMORY;
}

static void free_one(apsm_obstacle *o)
{
    if (!o) return;
    apsm_bvh_free(o->bvh);
    apsm_mesh_free(&o->mesh);
    free(o);
}

/* The obstacle that a mesh (taken) makes; one = NULL if it is open. */
static apsm_status make_one(apsm_mesh *mesh, apsm_obstacle **one)
{
    apsm_obstacle *o = *one = calloc(1, sizeof *o);
    if (!o) return APSM_ERR_MEMORY;
    o->mesh = *mesh;
    *mesh = (apsm_mesh){ 0 };
    apsm_mesh_bounds(&o->mesh, o->lo, o->hi);
    const apsm_status status = apsm_bvh_build(&o->mesh, &o->bvh);
    if (status == APSM_OK && !bvh_is_open(o->bvh)) return APSM_OK;
    free_one(o);
    *one = NULL;
    return status;
}

static apsm_status take(apsm_obstacles *o, size_t i, apsm_mesh *mesh)
{
    apsm_obstacle *one = NULL, **list = realloc(o->of[i], (o->n[i] + 1) * sizeof *list);
    if (!list) return APSM_ERR_MEMORY;
    o->of[i] = list;
    APSM_TRY(make_one(mesh, &one));
    if (one) list[o->n[i]++] = one;
    return APSM_OK;
}

apsm_status apsm_obstacles_add(apsm_obstacles *o, size_t i, apsm_mesh *mesh)
{
    const apsm_status status = take(o, i, mesh);
    apsm_mesh_free(mesh);
    return status;
}

void apsm_obstacles_free(apsm_obstacles *o)
{
    for (size_t i = 0; o->n && o->of && i < o->I; i++) {
        for (size_t k = 0; k < o->n[i]; k++) free_one(o->of[i][k]);
        free(o->of[i]);
    }
    free(o->n);
    free(o->of);
    *o = (apsm_obstacles){ 0 };
}

static bool in_box(const apsm_obstacle *o, const double x[3])
{
    for (int c = 0; c < 3; c++)
        if (x[c] < o->lo[c] || x[c] > o->hi[c]) return false;
    return true;
}

double apsm_obstacles_depth(const apsm_obstacles *o, size_t i, const double x[3], double nearest[3])
{
    double deepest = 0;
    for (size_t k = 0; k < o->n[i]; k++) {
        apsm_closest at;
        if (!in_box(o->of[i][k], x)) continue;
        const double depth = -apsm_bvh_signed_distance(o->of[i][k]->bvh, x, &at);
        if (!(depth > deepest)) continue;
        deepest = depth;
        memcpy(nearest, at.x, sizeof at.x);
    }
    return deepest;
}
