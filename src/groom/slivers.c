/* Faces without area: a needle is collapsed along its shortest edge, a cap (a vertex on the
 * opposite side) is flipped away. */
#include <math.h>

#include "geometry/vec3.h"
#include "groom/fan.h"
#include "groom/repair.h"

/* Height over longest side below which a face counts as without area. */
static const double flat = 1e-6;
enum { ROUNDS = 20 };

static double side2(const surgery *s, uint32_t h)
{
    return vec3_distance2(s->V + 3 * he_from(s, h), s->V + 3 * he_to(s, h));
}

static bool any_flat(const apsm_mesh *m)
{
    for (size_t f = 0; f < m->nf; f++) {
        double side[3][3], n[3], longest = 0.0;
        for (size_t k = 0; k < 3; k++) {
            vec3_sub(m->V + 3 * m->F[3 * f + (k + 1) % 3], m->V + 3 * m->F[3 * f + k], side[k]);
            longest = fmax(longest, vec3_dot(side[k], side[k]));
        }
        vec3_cross(side[0], side[1], n);
        /* a little more than `flat`: which corner the cross product is taken at is rounding */
        if (!(vec3_dot(n, n) > 2.0 * flat * flat * longest * longest)) return true;
    }
    return false;
}

/* Mends face f if it is flat; false if it is and could not be. */
static bool mend(surgery *s, uint32_t f, size_t *mended)
{
    uint32_t longest = 3 * f, shortest = 3 * f;
    if (he_ghost_face(s, 3 * f)) return true;
    for (uint32_t h = 3 * f + 1; h < 3 * f + 3; h++) {
        if (side2(s, h) > side2(s, longest)) longest = h;
        if (side2(s, h) < side2(s, shortest)) shortest = h;
    }
    double n[3];
    fan_face_normal(s, longest, n);
    const double l2 = side2(s, longest);
    if (vec3_dot(n, n) > flat * flat * l2 * l2) return true;
    (*mended)++;
    if (!surgery_pulls(s, shortest)) shortest = s->twin[shortest];
    const bool collapsible = surgery_pulls(s, shortest) && surgery_collapsible(s, shortest);
    if (side2(s, shortest) <= 0.01 * l2 && collapsible) {
        surgery_collapse(s, shortest);
        return true;
    }
    const uint32_t c = he_apex(s, longest), d = he_apex(s, s->twin[longest]);
    if (!he_on_border(s, longest) && !surgery_joined(s, c, d) &&
        surgery_valence(s, he_from(s, longest)) > 3 && surgery_valence(s, he_to(s, longest)) > 3) {
        surgery_flip(s, longest);
        return true;
    }
    if (!collapsible) return false;
    surgery_collapse(s, shortest);
    return true;
}

apsm_status repair_slivers(repair *r)
{
    surgery s;
    size_t mended = 0, before = 1, after = 0;
    apsm_mesh_defects d;
    if (!any_flat(&r->mesh)) return APSM_OK;
    APSM_TRY(apsm_mesh_inspect(&r->mesh, &d));
    const bool open_refused = d.border_edges && !r->opt->open;
    if (open_refused || d.nonmanifold_edges || d.nonmanifold_vertices || d.flipped_edges)
        return APSM_OK; /* said by the check of the result */
    APSM_TRY(surgery_begin(&s, &r->mesh));
    for (int round = 0; round < ROUNDS && after != before; round++) {
        before = mended;
        for (uint32_t f = 0; f < s.nf; f++)
            if (he_live(&s, 3 * f)) (void)mend(&s, f, &mended);
        after = mended;
    }
    apsm_status status = APSM_OK;
    if (mended) {
        apsm_mesh mesh;
        status = surgery_result(&s, &mesh);
        if (status == APSM_OK) {
            apsm_mesh_free(&r->mesh);
            r->mesh = mesh;
            r->report->degenerate_faces += mended;
        }
    }
    surgery_free(&s);
    return status;
}
