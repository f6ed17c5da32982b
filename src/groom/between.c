/* Interpolation between slices by shape (Raya & Udupa, "Shape-based interpolation of
 * multidimensional objects", 1990).
 *
 *   D_k(x)  signed distance in slice k to its contour, positive inside, between -W and W
 *   u(x, k + t) = 1/2 + ((1 - t) D_k(x) + t D_k+1(x)) / (2 W)                              (A3)
 *
 * Where a contour moves from slice to slice, the mask itself is the same between both contours, and
 * its surface a step; that of (A3) is a slope.  W is `reach` times the distance of the slices: the
 * larger, the longer the slopes, and the flatter the ends, beyond which slices are empty. */
#include "groom/between.h"

#include <math.h>
#include <stdlib.h>

#include "groom/envelope.h"

static const double reach = 0.6;

int between_axis(const antialias_input *in)
{
    int axis = -1, refined = 0;
    for (int c = 0; c < 3; c++)
        if (in->refine[c] > 1) axis = c, refined++;
    return refined == 1 ? axis : -1;
}

static double shortest(const antialias_input *in)
{
    return fmin(in->spacing[0], fmin(in->spacing[1], in->spacing[2]));
}

float between_slope(const antialias_input *in, int axis)
{
    return (float)(0.5 * shortest(in) / (reach * in->spacing[axis]));
}

/* A slice: nodes along a and b, so many steps apart. */
typedef struct plane {
    size_t n[2], step[2];
    double spacing[2];
} plane;

/* d[0], at the nodes that are not `value`, <- squared distance to those that are. */
static void distances(const plane *s, const unsigned char *mask, unsigned char value,
                      const envelope *e, float *d)
{
    for (size_t b = 0; b < s->n[1]; b++) {
        for (size_t a = 0; a < s->n[0]; a++)
            e->f[a] = mask[a * s->step[0] + b * s->step[1]] == value ? 0.0 : INFINITY;
        envelope_line(s->n[0], s->spacing[0], e);
        for (size_t a = 0; a < s->n[0]; a++) d[a + s->n[0] * b] = (float)e->f[a];
    }
    for (size_t a = 0; a < s->n[0]; a++) {
        for (size_t b = 0; b < s->n[1]; b++) e->f[b] = (double)d[a + s->n[0] * b];
        envelope_line(s->n[1], s->spacing[1], e);
        for (size_t b = 0; b < s->n[1]; b++) d[a + s->n[0] * b] = (float)e->f[b];
    }
}

/* D (out), with the steps of mask: over W, between -1 and 1.  The contour is half a node from the
 * nodes. */
static void signed_slice(const plane *s, const unsigned char *mask, double W, const envelope *e,
                         float *d, float *D)
{
    const double half = 0.5 * fmin(s->spacing[0], s->spacing[1]);
    for (unsigned char value = 0; value < 2; value++) {
        distances(s, mask, value, e, d);
        for (size_t b = 0; b < s->n[1]; b++)
            for (size_t a = 0; a < s->n[0]; a++) {
                const size_t at = a * s->step[0] + b * s->step[1];
                const double depth = fmin(sqrt((double)d[a + s->n[0] * b]) - half, W) / W;
                if (mask[at] != value) D[at] = (float)(value ? -depth : depth);
            }
    }
}

static apsm_status signed_slices(const antialias_input *in, int axis, float *D)
{
    const size_t step[3] = { 1, in->n[0], in->n[0] * in->n[1] };
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    const plane s = { { in->n[a], in->n[b] },
                      { step[a], step[b] },
                      { in->spacing[a], in->spacing[b] } };
    const double W = reach * in->spacing[axis];
    envelope e = { 0 };
    float *const d = malloc(s.n[0] * s.n[1] * sizeof *d);
    const apsm_status status =
        d ? envelope_new(s.n[0] > s.n[1] ? s.n[0] : s.n[1], &e) : APSM_ERR_MEMORY;
    for (size_t k = 0; k < in->n[axis] && status == APSM_OK; k++)
        signed_slice(&s, in->mask + k * step[axis], W, &e, d, D + k * step[axis]);
    envelope_free(&e);
    free(d);
    return status;
}

/* (A3) at fine node x. */
static float value_at(const antialias_input *in, int axis, const float *D, const size_t x[3])
{
    const size_t step[3] = { 1, in->n[0], in->n[0] * in->n[1] }, r = (size_t)in->refine[axis];
    const size_t above = x[axis] % r;
    const float t = (float)above / (float)r;
    size_t low = 0;
    for (int c = 0; c < 3; c++) low += step[c] * (c == axis ? x[c] / r : x[c]);
    const float next = above ? D[low + step[axis]] : 0.0f;
    return 0.5f + 0.5f * ((1.0f - t) * D[low] + t * next);
}

apsm_status between_slices(const antialias_input *in, int axis, float *values)
{
    size_t fine[3], i = 0, x[3];
    float *const D = malloc(in->n[0] * in->n[1] * in->n[2] * sizeof *D);
    const apsm_status status = D ? signed_slices(in, axis, D) : APSM_ERR_MEMORY;
    antialias_fine(in, fine);
    for (x[2] = 0; x[2] < fine[2] && status == APSM_OK; x[2]++)
        for (x[1] = 0; x[1] < fine[1]; x[1]++)
            for (x[0] = 0; x[0] < fine[0]; x[0]++) values[i++] = value_at(in, axis, D, x);
    free(D);
    return status;
}
