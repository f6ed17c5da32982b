#include "joint/contact.h"

#include <math.h>

#include "geometry/bvh_guess.h"
#include "geometry/face.h"

/* What is asked of one surface: its tree, and the box outside of which nothing lies inside it. */
typedef struct solid {
    const apsm_bvh *tree;
    double lo[3], hi[3];
    bool open; /* nothing lies inside */
} solid;

static bool in_box(const solid *s, const double x[3])
{
    if (s->open) return false;
    for (int k = 0; k < 3; k++)
        if (x[k] < s->lo[k] || x[k] > s->hi[k]) return false;
    return true;
}

/* Only points nearer than the gap so far, or in the other's box, need a look. */
static void measure_vertex(const double x[3], const solid *other, apsm_contact *c)
{
    apsm_closest at;
    if (in_box(other, x)) {
        const double d = apsm_bvh_signed_distance(other->tree, x, NULL);
        c->gap = fmin(c->gap, fabs(d));
        c->depth = fmax(c->depth, -d);
    } else {
        apsm_bvh_closest(other->tree, x, c->gap * c->gap, &at);
        c->gap = fmin(c->gap, sqrt(at.distance2));
    }
}

/* The vertices of one against the surface of the other; adds areas. */
static void measure_from(const apsm_mesh *mesh, const solid *other, apsm_contact *c, double area[2])
{
    for (size_t v = 0; v < mesh->nv; v++) measure_vertex(mesh->V + 3 * v, other, c);
    for (size_t f = 0; f < mesh->nf; f++) {
        double centre[3] = { 0 };
        const double a = face_area(mesh, f);
        for (int k = 0; k < 3; k++)
            vec3_add_scaled(centre, 1.0 / 3, mesh->V + 3 * mesh->F[3 * f + (size_t)k]);
        area[0] += a;
        if (c->depth > 0 && in_box(other, centre) &&
            apsm_bvh_signed_distance(other->tree, centre, NULL) < 0)
            area[1] += a;
    }
}

void apsm_contact_measure(const apsm_bvh *a, const apsm_bvh *b, apsm_contact *contact)
{
    double area[2] = { 0 };
    solid first = { .tree = a, .open = bvh_is_open(a) },
          second = { .tree = b, .open = bvh_is_open(b) };
    apsm_mesh_bounds(apsm_bvh_mesh(a), first.lo, first.hi);
    apsm_mesh_bounds(apsm_bvh_mesh(b), second.lo, second.hi);
    *contact = (apsm_contact){ .gap = INFINITY };
    measure_from(apsm_bvh_mesh(a), &second, contact, area);
    measure_from(apsm_bvh_mesh(b), &first, contact, area);
    if (contact->depth > 0) contact->gap = 0;
    contact->overlap = area[0] > 0 ? area[1] / area[0] : 0;
}
