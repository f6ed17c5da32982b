/* Joint spaces in the objective of the fidelity stage: 1/2 lambda sum_v (depth_v / h)^2 over the
 * vertices y_v = W_v p of the warped template that lie in another part of the subject, depth_v the
 * distance of y_v from that part's surface.  Its gradient in y_v is the unit vector from the
 * nearest place of that surface to y_v, carried to the particles by the row of W, as for pulls.
 *
 * A shape's own surface keeps the space; the warped template, which follows it to within the
 * distance that is minimised, may not.  So few vertices take part, or none: then nothing changes.
 * Where the shape's own surface goes into the other part, as masks may, only what is deeper counts.
 */
#include "optimize/fidelity_shape.h"

#include <math.h>

#include "geometry/vec3.h"

void fidelity_find_contacts(const apsm_fidelity *f, size_t i, fidelity_state *s,
                            const fidelity_work *w)
{
    const apsm_obstacles *o = &f->cohort->obstacles;
    s->contacts = 0;
    if (o->I == 0 || o->n[i] == 0 || !(f->o.contact > 0)) return;
    for (size_t v = 0; v < f->warp.nv; v++) {
        apsm_closest own;
        double at[3], unused[3], depth;
        const double *y = w->Y + 3 * v;
        if (!((depth = apsm_obstacles_depth(o, i, y, at)) > 0)) continue;
        apsm_bvh_closest(f->cohort->shape[i].bvh, y, INFINITY, &own);
        depth -= apsm_obstacles_depth(o, i, own.x, unused);
        if (!(depth > 0)) continue;
        fidelity_match *m = &s->match[s->n + s->contacts++];
        *m = (fidelity_match){ .vertex = (uint32_t)v, .distance = depth / f->h };
        vec3_sub(y, at, m->direction);
        vec3_normalise(m->direction);
    }
}

void fidelity_value_contacts(const fidelity_weights *q, fidelity_state *s)
{
    double sum = 0;
    for (size_t k = s->n; k < s->n + s->contacts; k++)
        sum += s->match[k].distance * s->match[k].distance;
    s->value += 0.5 * q->contact * sum;
}

void fidelity_add_contacts(const apsm_fidelity *f, const fidelity_weights *q,
                           const fidelity_state *s, fidelity_work *w)
{
    const size_t J = f->J, n = 2 * J;
    double *row = w->Se; /* scratch: 2J of 3J */
    for (size_t k = s->n; k < s->n + s->contacts; k++) {
        const fidelity_match *m = &s->match[k];
        const double *part = f->warp.W + m->vertex * J;
        for (size_t x = 0; x < n; x++)
            row[x] = part[x / 2] * vec3_dot(m->direction, w->tangent + 3 * x);
        for (size_t x = 0; x < n; x++) {
            w->g[x] += q->contact * m->distance * row[x];
            for (size_t y = 0; y <= x && !w->sparse; y++)
                w->H[x * n + y] += q->contact * row[x] * row[y];
        }
        if (w->sparse) fidelity_put_vertex(f, m->vertex, m->direction, sqrt(q->contact), w);
    }
}
