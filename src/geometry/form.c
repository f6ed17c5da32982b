/* Form agreement.
 *
 *   u_js = sum_f A_f (c_f - p_j) . n_j / (r_s sum_f A_f),  over faces with |c_f - p_j| < r_s and
 *          n_f . n_j > 0                                                            (J1)
 *   a_i  = mean over s of artanh corr_j(u_ijs, median over i' != i of u_i'js)       (J2)
 */
#include "geometry/form.h"

#include <math.h>

#include "core/robust.h"
#include "geometry/vec3.h"

const double apsm_form_radius[APSM_FORM_SCALES] = { 1.2, 2.4, 4.8 };
/* Beyond, two shapes are alike but for rounding. */
static const double most_correlation = 0.995;
/* Fewer faces than this tell nothing of a scale. */
enum { LEAST_FACES = 3 };

void apsm_form_faces(const apsm_mesh *mesh, double *faces)
{
    for (size_t f = 0; f < mesh->nf; f++) {
        const uint32_t *F = mesh->F + 3 * f;
        const double *a = mesh->V + 3 * F[0], *b = mesh->V + 3 * F[1], *c = mesh->V + 3 * F[2];
        double *face = faces + APSM_FORM_FACE * f, u[3], v[3];
        vec3_sub(b, a, u);
        vec3_sub(c, a, v);
        vec3_cross(u, v, face + 3);
        for (size_t k = 0; k < 3; k++) face[k] = (a[k] + b[k] + c[k]) / 3.0;
        face[6] = 0.5 * vec3_normalise(face + 3);
    }
}

/* The heights around one point. */
static void heights_at(size_t nf, const double *faces, const double p[3], const double n[3],
                       double h, double *height)
{
    double sum[APSM_FORM_SCALES] = { 0 }, area[APSM_FORM_SCALES] = { 0 };
    size_t count[APSM_FORM_SCALES] = { 0 };
    const double farthest = apsm_form_radius[APSM_FORM_SCALES - 1] * h;
    for (size_t f = 0; f < nf; f++) {
        const double *face = faces + APSM_FORM_FACE * f;
        const double d2 = vec3_distance2(face, p);
        if (!(d2 < farthest * farthest) || !(vec3_dot(face + 3, n) > 0.0)) continue;
        const double up = vec3_dot(face, n) - vec3_dot(p, n);
        for (size_t s = APSM_FORM_SCALES; s-- > 0;) {
            const double r = apsm_form_radius[s] * h;
            if (!(d2 < r * r)) break;
            sum[s] += face[6] * up;
            area[s] += face[6];
            count[s]++;
        }
    }
    for (size_t s = 0; s < APSM_FORM_SCALES; s++)
        height[s] = count[s] >= LEAST_FACES && area[s] > 0.0
                        ? sum[s] / (area[s] * apsm_form_radius[s] * h)
                        : 0.0;
}

void apsm_form_heights(size_t nf, const double *faces, size_t J, const double *P, const double *N,
                       double h, double *height)
{
    for (size_t j = 0; j < J; j++)
        heights_at(nf, faces, P + 3 * j, N + 3 * j, h, height + APSM_FORM_SCALES * j);
}

double apsm_form_agreement(size_t J, const double *own, const double *usual, const uint32_t *at)
{
    double sum = 0.0;
    for (size_t s = 0; s < APSM_FORM_SCALES; s++) {
        const double r = robust_correlation(J, APSM_FORM_SCALES, own + s, usual + s, at);
        sum += atanh(fmin(fmax(r, 0.0), most_correlation));
    }
    return sum / APSM_FORM_SCALES;
}
