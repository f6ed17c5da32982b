/* Shading: a main light from the upper left behind the viewer with a soft highlight, a weak one
 * from the lower right.  Hollows are darkened by unsharp masking of the depth buffer (Luft, Colditz
 * & Deussen 2006): cheap, smooth, and it shows grooves that a light along them would hide. */
#include "report/raster.h"

#include <math.h>
#include <string.h>

#include "geometry/vec3.h"
#include "report/colours.h"

void raster_clear(raster *r)
{
    for (size_t k = 0; k < r->width * r->height; k++) r->depth[k] = -INFINITY;
    memset(r->rgb, 0, 3 * r->width * r->height);
}

/* x (samples from the left, from the top, towards the viewer) of a point. */
static void project(const raster *r, const raster_view *view, const double p[3], float x[3])
{
    const double d[3] = { p[0] - view->middle[0], p[1] - view->middle[1], p[2] - view->middle[2] };
    x[0] = (float)(vec3_dot(view->right, d) * view->scale + 0.5 * (double)r->width);
    x[1] = (float)(0.5 * (double)r->height - vec3_dot(view->up, d) * view->scale);
    x[2] = (float)(vec3_dot(view->to, d) * view->scale);
}

/* ---- Light ---- */

static float positive(float x)
{
    return x > 0 ? x : 0;
}

static unsigned char byte_of(float x)
{
    return (unsigned char)(x <= 0 ? 0 : x >= 1 ? 255 : 255 * x + 0.5f);
}

/* out <- colour in the light, for the unit normal n (right, up, towards the viewer). */
static void shade(const float n[3], const float colour[3], unsigned char out[3])
{
    static const float light[3] = { -0.386f, 0.515f, 0.765f },
                       weak[3] = { 0.667f, -0.333f, 0.667f };
    static const float half[3] = { -0.206f, 0.274f, 0.939f }; /* between light and viewer */
    const float d = n[0] * light[0] + n[1] * light[1] + n[2] * light[2];
    const float w = n[0] * weak[0] + n[1] * weak[1] + n[2] * weak[2];
    const float h = positive(n[0] * half[0] + n[1] * half[1] + n[2] * half[2]);
    const float h8 = h * h * h * h * h * h * h * h, glint = 0.13f * h8 * h8 * h8;
    const float s = 0.44f + 0.52f * positive(d) + 0.14f * positive(w);
    for (int c = 0; c < 3; c++) out[c] = byte_of(colour[c] * s + glint);
}

/* ---- Surfaces ---- */

/* What one triangle needs: corners in samples, normals seen from the viewer, values. */
typedef struct corners {
    float x[3][3], n[3][3], value[3];
} corners;

static void take_corners(const raster_view *view, const raster_surface *s, const uint32_t *f,
                         const float *projected, corners *t)
{
    for (int k = 0; k < 3; k++) {
        const double *n = s->N + 3 * (size_t)f[k];
        memcpy(t->x[k], projected + 3 * (size_t)f[k], sizeof t->x[k]);
        t->n[k][0] = (float)vec3_dot(view->right, n);
        t->n[k][1] = (float)vec3_dot(view->up, n);
        t->n[k][2] = (float)vec3_dot(view->to, n);
        t->value[k] = s->value ? (float)s->value[f[k]] : 0;
    }
}

static float mix(const float w[3], float a, float b, float c)
{
    return w[0] * a + w[1] * b + w[2] * c;
}

static void shade_sample(const raster_surface *s, const corners *t, const float w[3], float side,
                         unsigned char *out)
{
    float n[3], length = 0, colour[3] = { s->base[0], s->base[1], s->base[2] };
    for (int c = 0; c < 3; c++) {
        n[c] = side * mix(w, t->n[0][c], t->n[1][c], t->n[2][c]);
        length += n[c] * n[c];
    }
    length = length > 0 ? 1 / sqrtf(length) : 0;
    for (int c = 0; c < 3; c++) n[c] *= length;
    if (s->value) colours_signed(mix(w, t->value[0], t->value[1], t->value[2]), colour);
    shade(n, colour, out);
}

/* First and last sample whose centre may lie in lo..hi, within 0..n-1; false if there is none. */
static int samples_between(float lo, float hi, size_t n, size_t *first, size_t *last)
{
    const float a = ceilf(lo - 0.5f), b = floorf(hi - 0.5f);
    if (!(b >= 0) || !(a <= (float)(n - 1)) || a > b) return 0;
    *first = a > 0 ? (size_t)a : 0;
    *last = b < (float)(n - 1) ? (size_t)b : n - 1;
    return 1;
}

static float least3(float a, float b, float c)
{
    return fminf(a, fminf(b, c));
}
static float most3(float a, float b, float c)
{
    return fmaxf(a, fmaxf(b, c));
}

/* Twice the signed area of triangle a, b, p; the y axis points down. */
static float edge(const float a[3], const float b[3], float x, float y)
{
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
}

static void draw_triangle(raster *r, const raster_surface *s, const corners *t)
{
    size_t x0, x1, y0, y1;
    const float *a = t->x[0], *b = t->x[1], *c = t->x[2];
    const float area = edge(a, b, c[0], c[1]);
    if (!(fabsf(area) > 0) ||
        !samples_between(least3(a[0], b[0], c[0]), most3(a[0], b[0], c[0]), r->width, &x0, &x1) ||
        !samples_between(least3(a[1], b[1], c[1]), most3(a[1], b[1], c[1]), r->height, &y0, &y1))
        return;
    const float side = area < 0 ? 1 : -1; /* a face seen from inside is lit from inside */
    for (size_t y = y0; y <= y1; y++)
        for (size_t x = x0; x <= x1; x++) {
            const float px = (float)x + 0.5f, py = (float)y + 0.5f;
            const float w[3] = { edge(b, c, px, py) / area, edge(c, a, px, py) / area,
                                 edge(a, b, px, py) / area };
            const size_t k = y * r->width + x;
            if (w[0] < 0 || w[1] < 0 || w[2] < 0) continue;
            const float z = mix(w, a[2], b[2], c[2]);
            if (!(z > r->depth[k])) continue;
            r->depth[k] = z;
            shade_sample(s, t, w, side, r->rgb + 3 * k);
        }
}

void raster_draw_surface(raster *r, const raster_view *view, const raster_surface *s,
                         float *scratch)
{
    corners t;
    for (size_t v = 0; v < s->nv; v++) project(r, view, s->V + 3 * v, scratch + 3 * v);
    for (size_t f = 0; f < s->nf; f++) {
        take_corners(view, s, s->F + 3 * f, scratch, &t);
        draw_triangle(r, s, &t);
    }
}

/* ---- Balls ---- */

void raster_draw_ball(raster *r, const raster_view *view, const double centre[3], double radius,
                      const unsigned char colour[3])
{
    float c[3];
    size_t x0, x1, y0, y1;
    const float R = (float)(radius * view->scale);
    const float base[3] = { (float)colour[0] / 255, (float)colour[1] / 255,
                            (float)colour[2] / 255 };
    project(r, view, centre, c);
    if (!samples_between(c[0] - R, c[0] + R, r->width, &x0, &x1) ||
        !samples_between(c[1] - R, c[1] + R, r->height, &y0, &y1))
        return;
    for (size_t y = y0; y <= y1; y++)
        for (size_t x = x0; x <= x1; x++) {
            const float dx = ((float)x + 0.5f - c[0]) / R, dy = ((float)y + 0.5f - c[1]) / R;
            const float rest = 1 - dx * dx - dy * dy;
            if (rest < 0) continue;
            const float n[3] = { dx, -dy, sqrtf(rest) }, z = c[2] + R * n[2];
            const size_t k = y * r->width + x;
            if (!(z > r->depth[k])) continue;
            r->depth[k] = z;
            shade(n, base, r->rgb + 3 * k);
        }
}

/* ---- Samples to pixels ---- */

enum { SAMPLES2 = RASTER_SAMPLES * RASTER_SAMPLES };

/* Mean depth in pixels of what is in pixel (x, y), and how many samples that is. */
static int pixel_depth(const raster *r, size_t x, size_t y, float *depth)
{
    int n = 0;
    float sum = 0;
    for (size_t k = 0; k < SAMPLES2; k++) {
        const size_t row = RASTER_SAMPLES * y + k / RASTER_SAMPLES;
        const float z = r->depth[row * r->width + RASTER_SAMPLES * x + k % RASTER_SAMPLES];
        if (z > -INFINITY) sum += z, n++;
    }
    *depth = n ? sum / (float)n / RASTER_SAMPLES : 0;
    return n;
}

/* Means over 2 R + 1 neighbours, n of them `step` apart; from and to differ. */
static void blur_line(size_t n, size_t step, size_t R, const float *from, float *to)
{
    double sum = 0;
    for (size_t k = 0; k < n + R; k++) {
        if (k < n) sum += from[k * step];
        if (k >= 2 * R + 1) sum -= from[(k - 2 * R - 1) * step];
        if (k >= R) to[(k - R) * step] = (float)(sum / (double)(2 * R + 1));
    }
}

/* Two passes along each axis: near enough to a bell. */
static void blur(size_t w, size_t h, size_t R, float *image, float *scratch)
{
    for (int pass = 0; pass < 2; pass++) {
        for (size_t y = 0; y < h; y++) blur_line(w, 1, R, image + y * w, scratch + y * w);
        for (size_t x = 0; x < w; x++) blur_line(h, w, R, scratch + x, image + x);
    }
}

/* shadow <- share of the light that hollows of about R pixels lose. */
static void add_hollows(const raster *r, size_t w, size_t h, size_t R, float *shadow, float *sum,
                        float *weight, float *scratch)
{
    float z;
    for (size_t k = 0; k < w * h; k++) {
        weight[k] = pixel_depth(r, k % w, k / w, &z) > 0;
        sum[k] = z * weight[k];
    }
    blur(w, h, R, sum, scratch);
    blur(w, h, R, weight, scratch);
    for (size_t k = 0; k < w * h; k++) {
        if (!pixel_depth(r, k % w, k / w, &z)) continue;
        const float behind = (sum[k] / weight[k] - z) / (float)(2 * R);
        shadow[k] += fminf(0.17f, 0.4f * positive(behind));
    }
}

static void resolve_pixel(const raster *r, size_t x, size_t y, float light, unsigned char rgb[3])
{
    float sum[3] = { 0 };
    for (size_t k = 0; k < SAMPLES2; k++) {
        const size_t row = RASTER_SAMPLES * y + k / RASTER_SAMPLES;
        const size_t at = row * r->width + RASTER_SAMPLES * x + k % RASTER_SAMPLES;
        const int there = r->depth[at] > -INFINITY;
        for (int c = 0; c < 3; c++)
            sum[c] += there ? light * (float)r->rgb[3 * at + (size_t)c] : (float)rgb[c];
    }
    for (int c = 0; c < 3; c++) rgb[c] = (unsigned char)(sum[c] / SAMPLES2 + 0.5f);
}

void raster_resolve(const raster *r, unsigned char *rgb, size_t stride, float *scratch)
{
    const size_t w = r->width / RASTER_SAMPLES, h = r->height / RASTER_SAMPLES, n = w * h;
    float *shadow = scratch;
    memset(shadow, 0, n * sizeof *shadow);
    const size_t wide = (w + h) / 2;
    add_hollows(r, w, h, wide / 60 + 1, shadow, scratch + n, scratch + 2 * n, scratch + 3 * n);
    add_hollows(r, w, h, wide / 20 + 1, shadow, scratch + n, scratch + 2 * n, scratch + 3 * n);
    for (size_t y = 0; y < h; y++)
        for (size_t x = 0; x < w; x++)
            resolve_pixel(r, x, y, 1 - shadow[y * w + x], rgb + y * stride + 3 * x);
}
