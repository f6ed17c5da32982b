/* Quality of a triangle with sides l: q = 4 sqrt(3) area / (l1^2 + l2^2 + l3^2), 1 if equilateral,
 * 0 if flat (Bank).  Area vectors are kept unnormalised where only signs matter. */
#include "groom/fan.h"

#include <float.h>
#include <math.h>

#include "geometry/vec3.h"

static const double needle = 0.1;                   /* quality below which a face is a needle */
static const double turn_cos = 0.5;                 /* a face may turn by 60 degrees */
static const double two_root3 = 3.4641016151377544; /* 2 sqrt(3): area vectors hold 2 area */

static void area_vector(const double a[3], const double b[3], const double c[3], double n[3])
{
    double u[3], v[3];
    vec3_sub(b, a, u);
    vec3_sub(c, a, v);
    vec3_cross(u, v, n);
}

/* What quality is made of, and enough to compare where it is clear, without roots and quotients. */
typedef struct measure {
    double n2, l2; /* squared area vector, sum of squared sides */
} measure;

/* Of a face with area vector n. */
static measure measure_of(const double a[3], const double b[3], const double c[3],
                          const double n[3])
{
    return (measure){ vec3_dot(n, n),
                      vec3_distance2(a, b) + vec3_distance2(b, c) + vec3_distance2(c, a) };
}

static measure measure_face(const double a[3], const double b[3], const double c[3])
{
    double n[3];
    area_vector(a, b, c, n);
    return measure_of(a, b, c, n);
}

static double quality_of(measure m)
{
    return m.l2 > 0.0 ? two_root3 * sqrt(m.n2) / m.l2 : 0.0;
}

static double quality(const double a[3], const double b[3], const double c[3])
{
    return quality_of(measure_face(a, b, c));
}

/* Whether quality is above the bound by more than rounding. */
static bool clearly_above(measure m, double bound)
{
    const double b = bound * m.l2 * (1.0 + 1e-9);
    return two_root3 * two_root3 * m.n2 > b * b;
}

/* Whether the quality of m is below factor times that of o by more than rounding; false, too, where
 * the eighth power of a length leaves the range of numbers. */
static bool clearly_below(measure m, double factor, measure o)
{
    const double a = factor * m.l2 * (1.0 - 1e-9), most = o.n2 * (a * a);
    return m.n2 * (o.l2 * o.l2) < most && most > DBL_MIN / DBL_EPSILON;
}

void fan_face_normal(const surgery *s, uint32_t h, double n[3])
{
    const uint32_t *c = s->F + (h - h % 3);
    area_vector(s->V + 3 * c[0], s->V + 3 * c[1], s->V + 3 * c[2], n);
}

static void fan_area(const surgery *s, uint32_t v, double sum[3])
{
    sum[0] = sum[1] = sum[2] = 0.0;
    uint32_t h = s->out[v];
    do {
        double n[3];
        if (!he_ghost_face(s, h)) {
            fan_face_normal(s, h, n);
            vec3_add_scaled(sum, 1.0, n);
        }
        h = he_turn(s, h);
    } while (h != s->out[v]);
}

/* The face of half-edge h when its corner, now at o, is at x. */
static bool keeps_facing(const surgery *s, uint32_t h, const double o[3], const double x[3])
{
    const double *p = s->V + 3 * he_to(s, h), *q = s->V + 3 * he_apex(s, h);
    double was[3], is[3];
    area_vector(o, p, q, was);
    area_vector(x, p, q, is);
    const measure old = measure_of(o, p, q, was), new = measure_of(x, p, q, is);
    const bool clear = clearly_above(old, needle) && clearly_above(new, needle);
    const double before = clear ? 1.0 : quality_of(old), after = clear ? 1.0 : quality_of(new);
    if (after < needle && after <= before) return false;
    if (before < needle) { /* its own normal means little */
        double fan[3];
        fan_area(s, he_from(s, h), fan);
        return vec3_dot(is, fan) > 0.0;
    }
    const double c = vec3_dot(was, is);
    return c > 0.0 && c * c > turn_cos * turn_cos * vec3_dot(was, was) * vec3_dot(is, is);
}

bool fan_keeps_facing(const surgery *s, uint32_t v, const double x[3], uint32_t skip1,
                      uint32_t skip2)
{
    uint32_t h = s->out[v];
    do {
        if (h / 3 != skip1 && h / 3 != skip2 && !he_ghost_face(s, h) &&
            !keeps_facing(s, h, s->V + 3 * v, x))
            return false;
        h = he_turn(s, h);
    } while (h != s->out[v]);
    return true;
}

/* Inside the prism over the triangle: distance to its plane; else to its sides. */
static double triangle_distance2(const double x[3], const double a[3], const double b[3],
                                 const double c[3])
{
    const double *corner[3] = { a, b, c };
    double n[3], best = INFINITY;
    area_vector(a, b, c, n);
    bool inside = vec3_dot(n, n) > 0.0;
    for (int k = 0; k < 3; k++) {
        const double *p = corner[k], *q = corner[(k + 1) % 3];
        double side[3];
        area_vector(p, q, x, side);
        if (vec3_dot(side, n) < 0.0) {
            inside = false;
            best = fmin(best, vec3_segment_distance2(x, p, q));
        }
    }
    if (inside) {
        double e[3];
        vec3_sub(x, a, e);
        const double along = vec3_dot(e, n);
        return along * along / vec3_dot(n, n);
    }
    if (!(best < INFINITY)) /* no area */
        for (int k = 0; k < 3; k++)
            best = fmin(best, vec3_segment_distance2(x, corner[k], corner[(k + 1) % 3]));
    return best;
}

bool fan_stays(const surgery *s, uint32_t v, const double x[3], double away, uint32_t skip1,
               uint32_t skip2)
{
    const double *was = s->V + 3 * (size_t)v;
    const bool near = vec3_distance2(was, x) <= away * away; /* x is a corner of all */
    uint32_t h = s->out[v];
    do {
        if (h / 3 != skip1 && h / 3 != skip2 && !he_ghost_face(s, h) &&
            (near || triangle_distance2(was, x, s->V + 3 * he_to(s, h), s->V + 3 * he_apex(s, h)) <=
                         away * away))
            return true;
        h = he_turn(s, h);
    } while (h != s->out[v]);
    return false;
}

double fan_face_quality(const surgery *s, uint32_t h)
{
    const uint32_t *c = s->F + (h - h % 3);
    return quality(s->V + 3 * c[0], s->V + 3 * c[1], s->V + 3 * c[2]);
}

double fan_quality(const surgery *s, uint32_t v, const double x[3])
{
    double least = 1.0;
    uint32_t h = s->out[v];
    do {
        if (!he_ghost_face(s, h))
            least = fmin(least, quality(x, s->V + 3 * he_to(s, h), s->V + 3 * he_apex(s, h)));
        h = he_turn(s, h);
    } while (h != s->out[v]);
    return least;
}

/* Adds h's face to the sums of fan_middle. */
static void add_middle(const surgery *s, uint32_t h, double g[3], double n[3], double *total)
{
    const uint32_t v = he_from(s, h), a = he_to(s, h), b = he_apex(s, h);
    double m[3];
    if (he_ghost_face(s, h)) return;
    fan_face_normal(s, h, m);
    vec3_add_scaled(n, 1.0, m);
    const double edge = (s->size[v] + s->size[a] + s->size[b]) / 3.0;
    const double w = vec3_norm(m) / (edge * edge);
    for (int c = 0; c < 3; c++)
        g[c] +=
            w *
            (s->V[3 * v + (uint32_t)c] + s->V[3 * a + (uint32_t)c] + s->V[3 * b + (uint32_t)c]) /
            3.0;
    *total += w;
}

bool fan_middle(const surgery *s, uint32_t v, double g[3], double n[3])
{
    double total = 0.0;
    g[0] = g[1] = g[2] = n[0] = n[1] = n[2] = 0.0;
    uint32_t h = s->out[v];
    do {
        add_middle(s, h, g, n, &total);
        h = he_turn(s, h);
    } while (h != s->out[v]);
    if (!(total > 0.0) || !(vec3_normalise(n) > 0.0)) return false;
    for (int c = 0; c < 3; c++) g[c] /= total;
    return true;
}

bool fan_flip_gains(const surgery *s, uint32_t h, double factor)
{
    const double *a = s->V + 3 * he_from(s, h), *b = s->V + 3 * he_to(s, h);
    const double *c = s->V + 3 * he_apex(s, h), *d = s->V + 3 * he_apex(s, s->twin[h]);
    const measure one = measure_face(a, b, c), other = measure_face(b, a, d);
    double before = NAN;
    for (int k = 0; k < 2; k++) {
        const measure made = k == 0 ? measure_face(a, d, c) : measure_face(d, b, c);
        if (clearly_below(made, factor, one) && clearly_below(made, factor, other)) return false;
        if (k == 0) before = fmin(quality_of(one), quality_of(other));
        const double after = quality_of(made);
        if (!(before > 0.0 ? after / before > factor : after > 0.0)) return false;
    }
    return true;
}

static bool within_turn(const double a[3], const double b[3])
{
    const double c = vec3_dot(a, b);
    return c > 0.0 && c * c > turn_cos * turn_cos * vec3_dot(a, a) * vec3_dot(b, b);
}

bool fan_flip_is_flat(const surgery *s, uint32_t h, double away)
{
    const double *a = s->V + 3 * he_from(s, h), *b = s->V + 3 * he_to(s, h);
    const double *c = s->V + 3 * he_apex(s, h), *d = s->V + 3 * he_apex(s, s->twin[h]);
    double n1[3], n2[3], m1[3], m2[3], ab[3], dc[3], across[3], gap[3];
    area_vector(a, b, c, n1);
    area_vector(b, a, d, n2);
    area_vector(a, d, c, m1);
    area_vector(d, b, c, m2);
    vec3_add_scaled(n1, 1.0, n2); /* of both */
    if (!within_turn(m1, n1) || !within_turn(m2, n1)) return false;
    vec3_sub(b, a, ab);
    vec3_sub(c, d, dc);
    vec3_sub(c, a, gap);
    vec3_cross(ab, dc, across);
    const double along = vec3_dot(gap, across);
    return along * along <= away * away * vec3_dot(across, across);
}
