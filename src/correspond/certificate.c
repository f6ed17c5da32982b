/* The certificate of correspondence.  docs/method.md, "Certificate".
 *
 * Swapped pair: j and k such that exchanging them reduces the mismatches of both.  Standing at k's
 * place, j has k's distances, with k where j was.  Asked at F = 1.5, where neighbours that change
 * places show, and at 2.0.  Measured on 207 ellipsoids and bent plates with known correspondence:
 * no false alarm, nor with particles thrown about by 0.1 h; of planted swaps of neighbours 99 %
 * are named on ellipsoids and 60-80 % on thin plates (nearly all of the rest show as mismatches
 * or folds).
 *
 * Fold: three template particles, each among the 6 nearest of the other two, span a triangle with
 * an orientation, (b - a) x (c - a) . n, n the mean of their normals.  Its sign must not change.
 * Triangles that are almost a line or stand on the surface say nothing and are passed over, and so
 * are those with corners on both sides of a sheet: its sides may shift against each other. */
#include "correspond/certificate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"

#define APSM_REVIEW_TEXT(name, text) text,
static const char *const review_text[] = { APSM_REVIEW_LIST(APSM_REVIEW_TEXT) };

const char *apsm_review_text(apsm_review reason)
{
    return (unsigned)reason < APSM_REVIEW_COUNT ? review_text[reason] : "unknown reason";
}

apsm_certificate_options apsm_certificate_defaults(void)
{
    return (apsm_certificate_options){ .mismatched = 0.02,
                                       .stretch = 1.75,
                                       .off_surface = 0.01,
                                       .coincident = 0.1,
                                       .least_height = 0.25,
                                       .least_cosine = 0.25 };
}

void apsm_certificate_free(apsm_certificate *c)
{
    free(c->mismatched_strict_list);
    free(c->mismatched_list);
    free(c->lost_list);
    free(c->swap);
    free(c->fold);
    *c = (apsm_certificate){ 0 };
}

/* Room for one more item of this size; lists double at powers of two. */
static apsm_status grow(void **list, size_t n, size_t size)
{
    if (n & (n - 1)) return APSM_OK;
    void *more = realloc(*list, (n ? 2 * n : 1) * size);
    if (!more) return APSM_ERR_MEMORY;
    *list = more;
    return APSM_OK;
}

static apsm_status list_mismatched(size_t J, const uint32_t *count, size_t n, uint32_t **list)
{
    *list = malloc((n + 1) * sizeof **list);
    if (!*list) return APSM_ERR_MEMORY;
    for (uint32_t j = 0, k = 0; j < J; j++)
        if (count[j] > 0) (*list)[k++] = j;
    return APSM_OK;
}

/* ---- lost neighbours ---- */

/* A neighbour is mismatched, too, where another particle has come near or where the surface is
 * stretched one way: it is lost if it has itself got farther than smooth maps take it. */

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* How much farther neighbours are than on the template: the median over all whose distance is
 * known, 1 if none is.  ratio: scratch, one for each reference neighbour. */
static double typical_stretch(const apsm_certificate_input *in, double *ratio)
{
    const apsm_neighbourhoods *r = in->reference;
    size_t n = 0;
    for (uint32_t j = 0; j < in->J; j++)
        for (size_t i = r->start[j]; i < r->start[j + 1]; i++) {
            const double d = apsm_neighbour_distance(in->shape, j, r->index[i]);
            if (d < INFINITY && r->distance[i] > 0.0) ratio[n++] = d / r->distance[i];
        }
    if (n == 0) return 1.0;
    qsort(ratio, n, sizeof *ratio, ascending);
    return ratio[n / 2];
}

/* Whether a neighbour at this distance is mismatched.  From a particle that reaches no other, alone
 * on its part of the surface, nothing is near: most is INFINITY, and so is d. */
static bool is_mismatched(double d, double most)
{
    return !(d <= most && most < INFINITY);
}

/* count[j]: neighbours that j has lost; returns how many particles have lost any. */
static size_t count_lost(const apsm_certificate_input *in, double stretch, uint32_t *count)
{
    const apsm_neighbourhoods *r = in->reference;
    size_t particles = 0;
    for (uint32_t j = 0; j < in->J; j++) {
        const double most = 2.0 * in->shape->closest[j];
        count[j] = 0;
        for (size_t i = r->start[j]; i < r->start[j + 1]; i++) {
            const double d = apsm_neighbour_distance(in->shape, j, r->index[i]);
            count[j] += is_mismatched(d, most) && !(d <= stretch * r->distance[i]);
        }
        particles += count[j] > 0;
    }
    return particles;
}

static apsm_status find_lost(const apsm_certificate_input *in, const apsm_certificate_options *o,
                             uint32_t *count, apsm_certificate *c)
{
    double *ratio = malloc((in->reference->start[in->J] + 1) * sizeof *ratio);
    if (!ratio) return APSM_ERR_MEMORY;
    c->lost = count_lost(in, o->stretch * typical_stretch(in, ratio), count);
    free(ratio);
    return list_mismatched(in->J, count, c->lost, &c->lost_list);
}

/* ---- swaps ---- */

/* Mismatches of j if it stood where `place` is, and `place` where j is. */
static size_t mismatches_at(const apsm_certificate_input *in, double factor, uint32_t j,
                            uint32_t place)
{
    const apsm_neighbourhoods *r = in->reference;
    const double most = factor * in->shape->closest[place];
    size_t n = 0;
    for (size_t i = r->start[j]; i < r->start[j + 1]; i++) {
        const uint32_t k = r->index[i] == place ? j : r->index[i];
        n += is_mismatched(apsm_neighbour_distance(in->shape, place, k), most);
    }
    return n;
}

static bool swapped(const apsm_certificate_input *in, double factor, const uint32_t *count,
                    uint32_t j, uint32_t k)
{
    return count[j] > 0 && count[k] > 0 && mismatches_at(in, factor, j, k) < count[j] &&
           mismatches_at(in, factor, k, j) < count[k];
}

static apsm_status find_swaps(const apsm_certificate_input *in, const uint32_t *strict,
                              const uint32_t *count, apsm_certificate *c)
{
    for (uint32_t j = 0; j < in->J; j++)
        for (uint32_t k = j + 1; strict[j] > 0 && k < in->J; k++) {
            if (!swapped(in, 1.5, strict, j, k) && !swapped(in, 2.0, count, j, k)) continue;
            APSM_TRY(grow((void **)&c->swap, c->swaps, sizeof *c->swap));
            c->swap[c->swaps][0] = j;
            c->swap[c->swaps++][1] = k;
        }
    return APSM_OK;
}

/* ---- folds ---- */

static bool are_neighbours(const uint32_t *N6, uint32_t j, uint32_t k)
{
    bool found = false;
    for (size_t i = 0; i < 6; i++) found |= N6[6 * (size_t)j + i] == k;
    return found;
}

int apsm_triangle_orientation(const double *P, const double *N, const uint32_t t[3],
                              const apsm_certificate_options *o)
{
    const double *a = P + 3 * (size_t)t[0], *b = P + 3 * (size_t)t[1], *c = P + 3 * (size_t)t[2];
    double e[3], f[3], cross[3], n[3] = { 0 };
    vec3_sub(b, a, e);
    vec3_sub(c, a, f);
    vec3_cross(e, f, cross);
    for (int i = 0; i < 3; i++) {
        if (vec3_dot(N + 3 * (size_t)t[i], N + 3 * (size_t)t[(i + 1) % 3]) < 0.0) return 0;
        vec3_add_scaled(n, 1.0, N + 3 * (size_t)t[i]);
    }
    const double longest2 = fmax(fmax(vec3_dot(e, e), vec3_dot(f, f)), vec3_distance2(b, c));
    const double area2 = vec3_normalise(cross); /* twice the area: longest side times height */
    const double spread = vec3_normalise(n) / 3.0;
    const double cosine = vec3_dot(cross, n) * spread;
    if (!(area2 >= o->least_height * longest2) || !(fabs(cosine) >= o->least_cosine)) return 0;
    return cosine > 0.0 ? 1 : -1;
}

static apsm_status check_triangle(const apsm_certificate_input *in,
                                  const apsm_certificate_options *o, uint32_t a, uint32_t b,
                                  uint32_t c, apsm_certificate *out)
{
    const uint32_t t[3] = { a, b, c };
    const int before = apsm_triangle_orientation(in->template_P, in->template_N, t, o);
    const int now = apsm_triangle_orientation(in->P, in->N, t, o);
    if (before * now >= 0) return APSM_OK;
    APSM_TRY(grow((void **)&out->fold, out->folds, sizeof *out->fold));
    memcpy(out->fold[out->folds++], t, sizeof t);
    return APSM_OK;
}

static apsm_status find_folds(const apsm_certificate_input *in, const apsm_certificate_options *o,
                              apsm_certificate *out)
{
    for (uint32_t a = 0; a < in->J; a++) {
        uint32_t mutual[6];
        size_t n = 0;
        for (size_t i = 0; i < 6; i++) {
            const uint32_t b = in->N6[6 * (size_t)a + i];
            if (b > a && are_neighbours(in->N6, b, a)) mutual[n++] = b;
        }
        for (size_t i = 0; i < n; i++)
            for (size_t k = 0; k < n; k++) {
                const uint32_t b = mutual[i], c = mutual[k];
                if (b >= c || !are_neighbours(in->N6, b, c) || !are_neighbours(in->N6, c, b))
                    continue;
                APSM_TRY(check_triangle(in, o, a, b, c, out));
            }
    }
    return APSM_OK;
}

/* ---- measures and verdict ---- */

static void measure(const apsm_certificate_input *in, apsm_certificate *c)
{
    double least = INFINITY;
    for (size_t j = 0; j < in->J; j++) {
        const double d = in->distance[j] / in->h;
        c->off_surface_mean += d / (double)in->J;
        if (!(d <= c->off_surface_max)) c->off_surface_max = d;
        for (size_t k = 0; k < j; k++)
            least = fmin(least, vec3_distance2(in->P + 3 * j, in->P + 3 * k));
    }
    c->min_separation = sqrt(least) / in->h;
}

static bool all_finite(size_t n, const double *x)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i])) return false;
    return true;
}

static void judge(const apsm_certificate_options *o, apsm_certificate *c)
{
    const double share = (double)c->lost / (double)(c->J ? c->J : 1);
    c->reasons |= (unsigned)(share > o->mismatched) << APSM_REVIEW_MISMATCHED;
    c->reasons |= (unsigned)(c->swaps > 0) << APSM_REVIEW_SWAPPED;
    c->reasons |= (unsigned)(c->folds > 0) << APSM_REVIEW_FOLDED;
    c->reasons |= (unsigned)!(c->off_surface_max <= o->off_surface) << APSM_REVIEW_OFF_SURFACE;
    c->reasons |= (unsigned)!(c->min_separation >= o->coincident) << APSM_REVIEW_COINCIDENT;
    c->certified = c->reasons == 0;
}

static apsm_status examine(const apsm_certificate_input *in, const apsm_certificate_options *o,
                           uint32_t *strict, uint32_t *count, apsm_certificate *c)
{
    c->mismatched_strict = apsm_mismatches(in->reference, in->shape, 1.5, strict);
    c->mismatched = apsm_mismatches(in->reference, in->shape, 2.0, count);
    APSM_TRY(list_mismatched(in->J, strict, c->mismatched_strict, &c->mismatched_strict_list));
    APSM_TRY(list_mismatched(in->J, count, c->mismatched, &c->mismatched_list));
    APSM_TRY(find_swaps(in, strict, count, c));
    APSM_TRY(find_lost(in, o, count, c));
    APSM_TRY(find_folds(in, o, c));
    measure(in, c);
    judge(o, c);
    return APSM_OK;
}

apsm_status apsm_certify(const apsm_certificate_input *in, const apsm_certificate_options *o,
                         apsm_certificate *c)
{
    apsm_certificate_free(c);
    if (in->reference->J != in->J || in->shape->J != in->J || in->shape->factor < 2.0)
        return APSM_ERR_ARG;
    c->J = in->J;
    if (!all_finite(3 * in->J, in->P)) {
        c->reasons = 1u << APSM_REVIEW_NONFINITE;
        return APSM_OK;
    }
    uint32_t *count = malloc((2 * in->J + 1) * sizeof *count);
    if (!count) return APSM_ERR_MEMORY;
    const apsm_status status = examine(in, o, count, count + in->J, c);
    free(count);
    if (status != APSM_OK) apsm_certificate_free(c);
    return status;
}
