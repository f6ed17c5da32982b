/* Slips.  With m and Y the mean and the deviations of the other shapes, and F_d all deformations of
 * m by polynomials of degree d,
 *
 *   r = (p_i - m) less its projection on the span of Y and F_d                       (J3a)
 *   a_j = | mean over the patch around j of r less its part along the normal | / h,
 *   b_j = rms over the patch of its part along the normal / h,   s_j = a_j^2 / (a_j + b_j)   (J3b)
 *   t_j = s_j / max(sqrt((u_j^2 + mean of u over the patch^2) / 2), .05)              (J3c)
 *
 * u the median of the others' s.  What varies smoothly over the whole shape is no slip, neither is
 * what the others do; directions are averaged and not lengths, since a region slips together and
 * noise does not; and a form that is unlike the others' departs along the normals too, a slip not.
 */
#include "judge/slip.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"
#include "judge/left_out.h"

/* Radii of the patches of looks 0 and 1, and of 2, in h. */
static const double wide = 4.0, narrow = 2.3;
static const double least_usual = 0.05; /* h */

apsm_status apsm_patches_make(size_t k, size_t J, const double *P, const double *N, double h,
                              apsm_patches *patches)
{
    const double radius = (k < 2 ? wide : narrow) * h, reach2 = radius * radius;
    size_t n = 0;
    *patches = (apsm_patches){ .J = J, .start = malloc((J + 1) * sizeof *patches->start) };
    if (!patches->start) return APSM_ERR_MEMORY;
    for (int pass = 0; pass < 2; pass++) {
        n = 0;
        for (size_t j = 0; j < J; j++) {
            patches->start[j] = n;
            for (size_t l = 0; l < J; l++) {
                if (vec3_distance2(P + 3 * j, P + 3 * l) > reach2) continue;
                if (l != j && !(vec3_dot(N + 3 * j, N + 3 * l) > 0.0)) continue;
                if (pass) patches->at[n] = (uint32_t)l;
                n++;
            }
        }
        patches->start[J] = n;
        if (!pass) patches->at = malloc((n + 1) * sizeof *patches->at);
        if (!patches->at) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

void apsm_patches_free(apsm_patches *patches)
{
    free(patches->start);
    free(patches->at);
    *patches = (apsm_patches){ 0 };
}

void apsm_patches_mean(const apsm_patches *p, const double *x, double *mean)
{
    for (size_t j = 0; j < p->J; j++) {
        double sum = 0.0;
        for (size_t a = p->start[j]; a < p->start[j + 1]; a++) sum += x[p->at[a]];
        mean[j] = sum / (double)(p->start[j + 1] - p->start[j]);
    }
}

/* s (J) <- length of the mean of r (J x 3) over the patch of each. */
static void mean_lengths(const apsm_patches *p, const double *r, double h, double *s)
{
    for (size_t j = 0; j < p->J; j++) {
        double sum[3] = { 0 };
        for (size_t a = p->start[j]; a < p->start[j + 1]; a++)
            vec3_add_scaled(sum, 1.0, r + 3 * (size_t)p->at[a]);
        s[j] = vec3_norm(sum) / (h * (double)(p->start[j + 1] - p->start[j]));
    }
}

size_t apsm_slip_looks(size_t I, size_t J)
{
    return apsm_left_out_degrees(I, J);
}

size_t apsm_slip_work_size(size_t J)
{
    return (size_t)APSM_SLIP_LOOKS * 3 * J + 2 * J + apsm_left_out_work_size(J);
}

/* r (J x 3) <- its part along the surface; along2 (J) <- the square of that along the normal, in h.
 */
static void split(size_t J, const double *N, double h, double *r, double *along2)
{
    for (size_t j = 0; j < J; j++) {
        const double along = vec3_dot(r + 3 * j, N + 3 * j);
        vec3_add_scaled(r + 3 * j, -along, N + 3 * j);
        along2[j] = along * along / (h * h);
    }
}

void apsm_slip_look(const apsm_slip_cohort *c, size_t i, const double *N, double *slipped,
                    double *work)
{
    const size_t J = c->J;
    double *rests = work + apsm_left_out_work_size(J);
    double *along2 = rests + 3 * J * APSM_SLIP_LOOKS, *form2 = along2 + J;
    apsm_left_out_rests(c->I, J, c->P, i, rests, work);
    for (size_t k = 0; k < APSM_SLIP_LOOKS; k++) {
        double *r = rests + 3 * J * k, *s = slipped + J * k;
        split(J, N, c->h, r, along2);
        apsm_patches_mean(&c->patches[k], along2, form2);
        mean_lengths(&c->patches[k], r, c->h, s);
        for (size_t j = 0; j < J; j++) s[j] *= s[j] > 0.0 ? s[j] / (s[j] + sqrt(form2[j])) : 0.0;
    }
}

void apsm_slip_times(const apsm_patches *patches, const double *slipped, const double *usual,
                     double *times, double *mean)
{
    apsm_patches_mean(patches, usual, mean);
    for (size_t j = 0; j < patches->J; j++)
        times[j] =
            slipped[j] / fmax(sqrt(0.5 * (usual[j] * usual[j] + mean[j] * mean[j])), least_usual);
}
