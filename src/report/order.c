/* Breadth-first over vertices: all faces around vertex 0 as a fan, then around 1 and so on,
 * vertices being numbered as they turn up.  Within a fan the first corner stays and the second is
 * the third of the face before, so that most differences between faces are 0 or small. */
#include "report/order.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

static const uint32_t none = UINT32_MAX;

typedef struct ordering {
    const apsm_mesh *mesh;
    uint32_t *first, *face; /* faces of vertex v: face[first[v]] to face[first[v + 1] - 1] */
    uint32_t *number, *old; /* of an old vertex, none: not met; of a new one */
    unsigned char *done;    /* faces */
    size_t met, written;
    uint32_t *F; /* faces as they come out */
} ordering;

static void list_faces(ordering *o)
{
    const apsm_mesh *m = o->mesh;
    memset(o->first, 0, (m->nv + 2) * sizeof *o->first);
    for (size_t k = 0; k < 3 * m->nf; k++) o->first[m->F[k] + 2]++;
    for (size_t v = 0; v < m->nv; v++) o->first[v + 2] += o->first[v + 1];
    for (size_t k = 0; k < 3 * m->nf; k++) o->face[o->first[m->F[k] + 1]++] = (uint32_t)(k / 3);
}

static uint32_t meet(ordering *o, uint32_t v)
{
    if (o->number[v] == none) {
        o->old[o->met] = v;
        o->number[v] = (uint32_t)o->met++;
    }
    return o->number[v];
}

/* Corner of face f that is vertex v. */
static size_t corner(const ordering *o, uint32_t f, uint32_t v)
{
    const uint32_t *F = o->mesh->F + 3 * (size_t)f;
    return F[0] == v ? 0 : F[1] == v ? 1 : 2;
}

/* A face of v still to come; best the one whose corner after v is `after`. */
static uint32_t next_face(const ordering *o, uint32_t v, uint32_t after)
{
    uint32_t any = none;
    for (uint32_t k = o->first[v]; k < o->first[v + 1]; k++) {
        const uint32_t f = o->face[k];
        if (o->done[f]) continue;
        if (o->mesh->F[3 * (size_t)f + (corner(o, f, v) + 1) % 3] == after) return f;
        if (any == none) any = f;
    }
    return any;
}

static void write_fan(ordering *o, uint32_t v)
{
    uint32_t last = none;
    for (uint32_t f; (f = next_face(o, v, last)) != none;) {
        const size_t c = corner(o, f, v);
        for (size_t k = 0; k < 3; k++) {
            last = o->mesh->F[3 * (size_t)f + (c + k) % 3];
            o->F[3 * o->written + k] = meet(o, last);
        }
        o->done[f] = 1;
        o->written++;
    }
}

static void write_faces(ordering *o)
{
    size_t next = 0;
    for (size_t v = 0; v < o->mesh->nv; v++) {
        if (o->number[v] != none || o->first[v] == o->first[v + 1]) continue;
        meet(o, (uint32_t)v); /* another piece of the surface */
        while (next < o->met) write_fan(o, o->old[next++]);
    }
}

static void take_over(const ordering *o, apsm_mesh *mesh, double *V)
{
    for (size_t n = 0; n < o->met; n++)
        memcpy(V + 3 * n, mesh->V + 3 * (size_t)o->old[n], 3 * sizeof *V);
    memcpy(mesh->V, V, 3 * o->met * sizeof *V);
    memcpy(mesh->F, o->F, 3 * mesh->nf * sizeof *o->F);
    mesh->nv = o->met;
}

apsm_status order_mesh(apsm_mesh *mesh, uint32_t *old)
{
    const size_t nv = mesh->nv, nf = mesh->nf;
    ordering o = { .mesh = mesh,
                   .first = malloc((nv + 2) * sizeof *o.first),
                   .face = malloc((3 * nf + 1) * sizeof *o.face),
                   .number = malloc((nv + 1) * sizeof *o.number),
                   .old = malloc((nv + 1) * sizeof *o.old),
                   .done = calloc(nf + 1, 1),
                   .F = malloc((3 * nf + 1) * sizeof *o.F) };
    double *V = malloc((3 * nv + 1) * sizeof *V);
    const bool room = o.first && o.face && o.number && o.old && o.done && o.F && V;
    if (room) {
        memset(o.number, 0xff, nv * sizeof *o.number);
        list_faces(&o);
        write_faces(&o);
        take_over(&o, mesh, V);
        if (old) memcpy(old, o.old, o.met * sizeof *old);
    }
    free(o.first);
    free(o.face);
    free(o.number);
    free(o.old);
    free(o.done);
    free(o.F);
    free(V);
    return room ? APSM_OK : APSM_ERR_MEMORY;
}
