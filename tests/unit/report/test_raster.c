/* The rasteriser against areas and colours that are known. */
#include "cmocka_all.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "report/colours.h"
#include "report/raster.h"
#include "shapes.h"

enum { W = 200, H = 160, SW = W * RASTER_SAMPLES, SH = H * RASTER_SAMPLES };

typedef struct canvas {
    raster r;
    raster_view view;
    unsigned char pixels[H][W][3];
    float *scratch;
} canvas;

/* Seen from in front (-y), z up, one unit being `scale` pixels. */
static canvas *canvas_new(double scale)
{
    canvas *c = calloc(1, sizeof *c);
    assert_non_null(c);
    c->r = (raster){ SW, SH, malloc(SW * SH * sizeof(float)), malloc(3 * SW * SH) };
    c->scratch = malloc(4 * W * H * sizeof(float));
    assert_true(c->r.depth && c->r.rgb && c->scratch);
    c->view = (raster_view){
        .right = { 1, 0, 0 }, .up = { 0, 0, 1 }, .to = { 0, -1, 0 }, .scale = scale * RASTER_SAMPLES
    };
    memset(c->pixels, 255, sizeof c->pixels);
    raster_clear(&c->r);
    return c;
}

static void canvas_free(canvas *c)
{
    free(c->r.depth);
    free(c->r.rgb);
    free(c->scratch);
    free(c);
}

static void draw(canvas *c, const apsm_mesh *mesh, const double *value)
{
    double *N = malloc(3 * mesh->nv * sizeof *N);
    float *scratch = malloc(3 * mesh->nv * sizeof *scratch);
    assert_true(N && scratch);
    apsm_mesh_vertex_normals(mesh, N);
    const raster_surface s = {
        mesh->nv, mesh->nf, mesh->V, N, mesh->F, value, { 0.8f, 0.8f, 0.8f }
    };
    raster_draw_surface(&c->r, &c->view, &s, scratch);
    free(N);
    free(scratch);
}

static void resolve(canvas *c)
{
    raster_resolve(&c->r, c->pixels[0][0], 3 * W, c->scratch);
}

/* In square pixels. */
static double area(const canvas *c)
{
    size_t n = 0;
    for (size_t k = 0; k < SW * SH; k++) n += c->r.depth[k] > -INFINITY;
    return (double)n / (RASTER_SAMPLES * RASTER_SAMPLES);
}

static bool is_white(const unsigned char rgb[3])
{
    return rgb[0] == 255 && rgb[1] == 255 && rgb[2] == 255;
}

static int brightness(const unsigned char rgb[3])
{
    return rgb[0] + rgb[1] + rgb[2];
}

/* The silhouette of a ball of radius R is a disc; counting samples errs by less than a sample along
 * its rim. */
static void test_ball(void **state)
{
    (void)state;
    static const unsigned char blue[3] = { 0, 0, 200 };
    const double R = 60;
    canvas *c = canvas_new(10);
    raster_draw_ball(&c->r, &c->view, (const double[3]){ 0, 0, 0 }, R / 10, blue);
    assert_true(fabs(area(c) - M_PI * R * R) < 2 * M_PI * R / RASTER_SAMPLES * 0.2);
    resolve(c);
    for (size_t y = 0; y < H; y++)
        for (size_t x = 0; x < W; x++) {
            const double d = hypot((double)x + 0.5 - W / 2.0, (double)y + 0.5 - H / 2.0);
            const unsigned char *p = c->pixels[y][x];
            if (d > R + 1) assert_true(is_white(p));
            if (d < R - 1) assert_true(p[2] > p[0] + 40 && p[0] == p[1]);
        }
    /* The light is at the upper left. */
    assert_true(brightness(c->pixels[H / 2 - 25][W / 2 - 25]) >
                brightness(c->pixels[H / 2 + 25][W / 2 + 25]) + 60);
    canvas_free(c);
}

/* A fine icosphere's silhouette lies within the sphere's, and nearly fills it. */
static void test_sphere(void **state)
{
    (void)state;
    apsm_mesh sphere = shape_sphere(4, 7.0);
    canvas *c = canvas_new(10);
    draw(c, &sphere, NULL);
    const double disc = M_PI * 70 * 70;
    assert_true(area(c) < disc + 5 && area(c) > 0.995 * disc);
    canvas_free(c);
    apsm_mesh_free(&sphere);
}

/* No seams: every sample inside the silhouette is covered, from any side. */
static void test_no_holes(void **state)
{
    (void)state;
    apsm_mesh sphere = shape_sphere(3, 7.0);
    canvas *c = canvas_new(10);
    for (int k = 0; k < 12; k++) {
        const double a = 0.37 * k;
        memcpy(c->view.right, (double[3]){ cos(a), sin(a), 0 }, sizeof c->view.right);
        memcpy(c->view.to, (double[3]){ sin(a), -cos(a), 0 }, sizeof c->view.to);
        raster_clear(&c->r);
        draw(c, &sphere, NULL);
        for (size_t y = 0; y < SH; y++)
            for (size_t x = 0; x < SW; x++)
                if (hypot((double)x - SW / 2.0, (double)y - SH / 2.0) < 68 * RASTER_SAMPLES)
                    assert_true(c->r.depth[y * SW + x] > 0);
    }
    canvas_free(c);
    apsm_mesh_free(&sphere);
}

/* What is nearer hides what is farther, whichever is drawn first. */
static void test_depth(void **state)
{
    (void)state;
    static const unsigned char red[3] = { 220, 0, 0 }, green[3] = { 0, 220, 0 };
    const double near[3] = { 0, -5, 0 }, far[3] = { 0, 5, 0 };
    for (int first = 0; first < 2; first++) {
        canvas *c = canvas_new(10);
        if (first) raster_draw_ball(&c->r, &c->view, near, 3, red);
        raster_draw_ball(&c->r, &c->view, far, 6, green);
        if (!first) raster_draw_ball(&c->r, &c->view, near, 3, red);
        resolve(c);
        const unsigned char *middle = c->pixels[H / 2][W / 2], *rim = c->pixels[H / 2][W / 2 + 45];
        assert_true(middle[0] > middle[1] + 60 && rim[1] > rim[0] + 60);
        canvas_free(c);
    }
}

static void test_values(void **state)
{
    (void)state;
    apsm_mesh sphere = shape_sphere(3, 7.0);
    double *value = malloc(sphere.nv * sizeof *value);
    for (int sign = -1; sign <= 1; sign++) {
        canvas *c = canvas_new(10);
        for (size_t v = 0; v < sphere.nv; v++) value[v] = sign;
        draw(c, &sphere, value);
        resolve(c);
        const unsigned char *p = c->pixels[H / 2 - 30][W / 2 - 30];
        const int warm = p[0] - p[2]; /* orange outward, blue inward */
        assert_true(sign == 0 ? abs(warm) < 30 : sign * warm > 50);
        canvas_free(c);
    }
    free(value);
    apsm_mesh_free(&sphere);
}

/* The floor of a pit is darker than the same floor in the open; all face the viewer. */
static void test_hollow(void **state)
{
    (void)state;
    int floor[2];
    for (int pit = 0; pit < 2; pit++) {
        canvas *c = canvas_new(10);
        for (size_t k = 0; k < SW * SH; k++) {
            const double x = (double)(k % SW) - SW / 2.0, y = (double)(k / SW) - SH / 2.0;
            c->r.depth[k] = pit && hypot(x, y) > 12 * RASTER_SAMPLES ? 20 * RASTER_SAMPLES : 0;
            memset(c->r.rgb + 3 * k, 180, 3);
        }
        resolve(c);
        floor[pit] = c->pixels[H / 2][W / 2][0];
        canvas_free(c);
    }
    assert_int_equal(floor[0], 180);
    assert_true(floor[1] < 165 && floor[1] > 90);
}

/* Bodies that reach beyond the picture are cut off at its edge, in memory too. */
static void test_cut_off(void **state)
{
    (void)state;
    static const unsigned char grey[3] = { 128, 128, 128 };
    apsm_mesh sphere = shape_sphere(2, 30.0);
    const double corner[3] = { 10, 0, 8 }, away[3] = { 1e6, 0, -1e9 };
    canvas *c = canvas_new(10);
    draw(c, &sphere, NULL);
    assert_true(area(c) == W * H);
    raster_clear(&c->r);
    raster_draw_ball(&c->r, &c->view, corner, 2, grey);
    raster_draw_ball(&c->r, &c->view, away, 2, grey);
    assert_true(fabs(area(c) - M_PI * 400 / 4) < 10);
    canvas_free(c);
    apsm_mesh_free(&sphere);
}

/* Neighbours of a grid differ in colour, all colours are used, and the choice depends on places
 * alone. */
static void test_particle_colours(void **state)
{
    (void)state;
    enum { N = 12 };
    double P[3 * N * N], Q[3 * N * N];
    uint32_t colour[N * N], moved[N * N];
    size_t used[COLOURS_PARTICLE] = { 0 };
    for (size_t j = 0; j < N * N; j++) {
        P[3 * j] = (double)(j % N) + 0.01 * sin((double)j);
        P[3 * j + 1] = (double)(j / N) + 0.01 * cos(3 * (double)j);
        P[3 * j + 2] = 0;
        for (size_t k = 0; k < 3; k++) Q[3 * j + k] = 4 * P[3 * j + k];
    }
    colours_choose(N * N, P, colour);
    colours_choose(N * N, Q, moved);
    assert_memory_equal(colour, moved, sizeof colour);
    for (size_t j = 0; j < N * N; j++) {
        used[colour[j]]++;
        if (j % N + 1 < N) assert_int_not_equal(colour[j], colour[j + 1]);
        if (j / N + 1 < N) assert_int_not_equal(colour[j], colour[j + N]);
    }
    for (size_t c = 0; c < COLOURS_PARTICLE; c++) assert_true(used[c] > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ball),     cmocka_unit_test(test_sphere),
        cmocka_unit_test(test_no_holes), cmocka_unit_test(test_depth),
        cmocka_unit_test(test_values),   cmocka_unit_test(test_hollow),
        cmocka_unit_test(test_cut_off),  cmocka_unit_test(test_particle_colours),
    };
    return cmocka_run_group_tests_name("raster", tests, NULL, NULL);
}
