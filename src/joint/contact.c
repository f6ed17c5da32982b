#include "joint/contact.h"

#include <math.h>

#include "geometry/vec3.h"

static double face_area(const apsm_mesh *mesh, size_t f)
{
    const double *p = mesh->V + 3 * mesh->F[3 * f], *q = mesh->V + 3 * mesh->F[3 * f + 1],
                 *r = mesh->V + 3 * mesh->F[3 * f + 2];
    double u[3], v[3], n[3];
    vec3_sub(q, p, u);
    vec3_sub(r, p, v);
    vec3_cross(u, v, n);
    return 0.5 * vec3_norm(n);
}

/* The vertices of one against the surface of the other; adds areas. */
static void measure_from(const apsm_mesh *mesh, const apsm_bvh *other, apsm_contact *c,
                         double area[2])
{
    for (size_t v = 0; v < mesh->nv; v++) {
        const double d = apsm_bvh_signed_distance(other, mesh->V + 3 * v, NULL);
        c->gap = fmin(c->gap, fabs(d));
        c->depth = fmax(c->depth, -d);
    }
    for (size_t f = 0; f < mesh->nf; f++) {
        double centre[3] = { 0 };
        const double a = face_area(mesh, f);
        for (int k = 0; k < 3; k++)
            vec3_add_scaled(centre, 1.0 / 3, mesh->V + 3 * mesh->F[3 * f + (size_t)k]);
        area[0] += a;
        if (apsm_bvh_signed_distance(other, centre, NULL) < 0) area[1] += a;
    }
}

void apsm_contact_measure(const apsm_bvh *a, const apsm_bvh *b, apsm_contact *contact)
{
    double area[2] = { 0 };
    *contact = (apsm_contact){ .gap = INFINITY };
    measure_from(apsm_bvh_mesh(a), b, contact, area);
    measure_from(apsm_bvh_mesh(b), a, contact, area);
    if (contact->depth > 0) contact->gap = 0;
    contact->overlap = area[0] > 0 ? area[1] / area[0] : 0;
}
