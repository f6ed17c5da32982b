/* A picture is a sheet of tiles, all seen from the same side at the same scale, with words around
 * them.  Tiles are drawn in parallel; what is in them comes from the model folder, at the
 * resolution of the groomed meshes. */
#include "apsm/render.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/number.h"
#include "core/sized.h"
#include "folder/model_folder.h"
#include "geometry/vec3.h"
#include "report/colours.h"
#include "report/picture.h"
#include "report/raster.h"
#include "report/template_surface.h"

static const float bone[3] = { 0.86f, 0.83f, 0.77f };
static const unsigned char ink[3] = { 0x1b, 0x1f, 0x24 }, soft[3] = { 0x4a, 0x52, 0x60 },
                           bad[3] = { 0x8a, 0x3a, 0x00 };

enum { MODES_SHOWN = 3, COLUMNS_OF_MODES = 3 };
static const double sds[COLUMNS_OF_MODES] = { -2, 0, 2 };

typedef struct box {
    double lo[3], hi[3]; /* right, up, towards the viewer */
} box;

typedef struct sheet {
    const apsm_render_options *options;
    const model_folder *m;
    raster_view view;
    uint32_t *colour; /* J */
    double ball;      /* radius of a particle */
    /* Of the mean and the modes: the template's mesh, warped. */
    apsm_mesh mesh;
    double *mean, *mean_normals; /* nv x 3 */
    double *mode;                /* modes shown x nv x 3, at one standard deviation */
    size_t modes;
    box *bounds, all; /* of the shapes shown, of everything */
    double reach;     /* largest displacement along the normal that is shown */
    /* Tiles: n of width x height pixels in columns, below top, each above `below` pixels of words.
     */
    size_t n, columns, width, height, left, top, below;
    size_t letters; /* height of words */
    size_t shape;   /* of APSM_PICTURE_SHAPE */
    picture *picture;
} sheet;

static const char *const names[] = { "mean", "modes", "shape", "cohort" };

const char *apsm_picture_name(apsm_picture what)
{
    return names[what];
}

/* ---- What is shown ---- */

/* Largest displacement of the modes along the mean's normals, at the ends. */
static double reach_of(const sheet *s)
{
    const size_t n = s->mesh.nv;
    double most = 0;
    for (size_t k = 0; k < s->modes; k++)
        for (size_t v = 0; v < n; v++) {
            const double *d = s->mode + (k * n + v) * 3, *u = s->mean_normals + 3 * v;
            most = fmax(most, fabs(sds[0] * (d[0] * u[0] + d[1] * u[1] + d[2] * u[2])));
        }
    return most > 0 ? most : 1;
}

static apsm_status warp_modes(const template_surface *surface, sheet *s)
{
    const model_folder *m = s->m;
    const size_t n = 3 * s->mesh.nv;
    s->modes = m->model.modes < MODES_SHOWN ? m->model.modes : MODES_SHOWN;
    s->mean = malloc((n + 1) * sizeof *s->mean);
    s->mean_normals = malloc((n + 1) * sizeof *s->mean_normals);
    s->mode = malloc((s->modes * n + 1) * sizeof *s->mode);
    if (!s->mean || !s->mean_normals || !s->mode) return APSM_ERR_MEMORY;
    template_surface_warp(surface, m->model.mean, s->mean);
    for (size_t k = 0; k < s->modes; k++) {
        template_surface_warp(surface, m->model.mode + k * m->J * 3, s->mode + k * n);
        for (size_t x = 0; x < n; x++) s->mode[k * n + x] *= sqrt(m->model.variance[k]);
    }
    memcpy(s->mesh.V, s->mean, n * sizeof *s->mean);
    apsm_mesh_vertex_normals(&s->mesh, s->mean_normals);
    s->reach = reach_of(s);
    return APSM_OK;
}

static apsm_status make_mean(apsm_context *ctx, sheet *s)
{
    template_surface surface = { 0 };
    apsm_status status = template_surface_make(ctx, s->m, 0, &surface);
    if (status == APSM_OK) status = template_surface_mesh(&surface, &s->mesh);
    if (status == APSM_OK) status = warp_modes(&surface, s);
    template_surface_free(&surface);
    return status;
}

/* ---- Where it is looked from ---- */

/* As the report at first: a little from above, across the longest direction in the plane x, y (half
 * the angle of the second moments). */
static void choose_direction(const model_folder *m, double to[3])
{
    double c[2] = { 0 }, xx = 0, xy = 0, yy = 0;
    for (size_t j = 0; j < m->J; j++)
        for (int k = 0; k < 2; k++) c[k] += m->model.mean[3 * j + (size_t)k] / (double)m->J;
    for (size_t j = 0; j < m->J; j++) {
        const double x = m->model.mean[3 * j] - c[0], y = m->model.mean[3 * j + 1] - c[1];
        xx += x * x, xy += x * y, yy += y * y;
    }
    const double angle = 0.5 * atan2(2 * xy, xx - yy), pitch = 0.35;
    const double yaw = angle + (angle < -atan(1) ? 4 * atan(1) : 0) + 0.25;
    to[0] = sin(yaw) * cos(pitch);
    to[1] = -cos(yaw) * cos(pitch);
    to[2] = sin(pitch);
}

static void choose_view(sheet *s)
{
    double *to = s->view.to, up[3] = { 0, 0, 1 };
    memcpy(to, s->options->view, 3 * sizeof *to);
    if (to[0] == 0 && to[1] == 0 && to[2] == 0) choose_direction(s->m, to);
    vec3_normalise(to);
    if (fabs(to[2]) > 0.999) up[1] = to[2] > 0 ? 1 : -1, up[2] = 0; /* from above: y is up */
    vec3_cross(up, to, s->view.right);
    vec3_normalise(s->view.right);
    vec3_cross(to, s->view.right, s->view.up);
}

static void widen(const raster_view *view, box *b, const double p[3])
{
    const double *axes[3] = { view->right, view->up, view->to };
    for (int k = 0; k < 3; k++) {
        const double x = axes[k][0] * p[0] + axes[k][1] * p[1] + axes[k][2] * p[2];
        b->lo[k] = fmin(b->lo[k], x);
        b->hi[k] = fmax(b->hi[k], x);
    }
}

static box nothing(void)
{
    return (box){ { INFINITY, INFINITY, INFINITY }, { -INFINITY, -INFINITY, -INFINITY } };
}

/* The mean and, if they are shown, the ends of the modes. */
static box bounds_of_modes(const sheet *s)
{
    box b = nothing();
    const size_t nv = s->mesh.nv, modes = s->options->what == APSM_PICTURE_MODES ? s->modes : 0;
    for (size_t v = 0; v < nv; v++) {
        widen(&s->view, &b, s->mean + 3 * v);
        for (size_t k = 0; k < modes * COLUMNS_OF_MODES; k++) {
            double p[3];
            for (size_t c = 0; c < 3; c++)
                p[c] = s->mean[3 * v + c] +
                       sds[k % COLUMNS_OF_MODES] * s->mode[(k / COLUMNS_OF_MODES * nv + v) * 3 + c];
            widen(&s->view, &b, p);
        }
    }
    return b;
}

/* Of shape i, its particles being balls. */
static apsm_status bound_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    sheet *s = user;
    apsm_mesh mesh = { 0 };
    const bool one = s->options->what == APSM_PICTURE_SHAPE;
    APSM_TRY(model_folder_mesh(ctx, s->m, one ? s->shape : i, &mesh));
    s->bounds[i] = nothing();
    for (size_t v = 0; v < mesh.nv; v++) widen(&s->view, &s->bounds[i], mesh.V + 3 * v);
    for (int k = 0; k < 3; k++) {
        s->bounds[i].lo[k] -= s->ball;
        s->bounds[i].hi[k] += s->ball;
    }
    apsm_mesh_free(&mesh);
    return APSM_OK;
}

/* Of everything that any tile shows: no picture cuts anything off. */
static apsm_status find_bounds(apsm_context *ctx, sheet *s)
{
    if (s->mesh.nv > 0) {
        s->all = bounds_of_modes(s);
        return APSM_OK;
    }
    s->bounds = malloc((s->n + 1) * sizeof *s->bounds);
    if (!s->bounds) return APSM_ERR_MEMORY;
    APSM_TRY(apsm_parallel_for(ctx, s->n, bound_shape, s, NULL));
    s->all = nothing();
    for (size_t i = 0; i < s->n; i++)
        for (int k = 0; k < 3; k++) {
            s->all.lo[k] = fmin(s->all.lo[k], s->bounds[i].lo[k]);
            s->all.hi[k] = fmax(s->all.hi[k], s->bounds[i].hi[k]);
        }
    return APSM_OK;
}

/* Scale and height of the tiles, whose width is set. */
static void fit(sheet *s)
{
    const box b = s->all;
    const double w = fmax(b.hi[0] - b.lo[0], 1e-300), h = fmax(b.hi[1] - b.lo[1], 1e-300);
    const double aspect = fmin(fmax(h / w, 0.45), 1.4), use = 0.92;
    const double width = (double)s->width, height = floor(aspect * width + 0.5);
    s->height = height > 1 ? (size_t)height : 1;
    s->view.scale = RASTER_SAMPLES * use * fmin(width / w, height / h);
    for (size_t k = 0; k < 3; k++) {
        s->view.middle[k] = 0;
        for (int c = 0; c < 3; c++) {
            const double *axis = c == 0 ? s->view.right : c == 1 ? s->view.up : s->view.to;
            s->view.middle[k] += axis[k] * (b.lo[c] + b.hi[c]) / 2;
        }
    }
}

/* ---- Tiles ---- */

typedef struct tile {
    raster raster;
    float *scratch;
    double *normals, *value;
} tile;

static apsm_status tile_make(const sheet *s, size_t nv, tile *t)
{
    const size_t w = s->width * RASTER_SAMPLES, h = s->height * RASTER_SAMPLES;
    const size_t floats = 4 * s->width * s->height > 3 * nv ? 4 * s->width * s->height : 3 * nv;
    *t = (tile){ .raster = { .width = w,
                             .height = h,
                             .depth = malloc(w * h * sizeof(float)),
                             .rgb = malloc(3 * w * h) },
                 .scratch = malloc(floats * sizeof(float)),
                 .normals = malloc((3 * nv + 1) * sizeof(double)),
                 .value = malloc((nv + 1) * sizeof(double)) };
    if (!t->raster.depth || !t->raster.rgb || !t->scratch || !t->normals || !t->value)
        return APSM_ERR_MEMORY;
    raster_clear(&t->raster);
    return APSM_OK;
}

static void tile_free(tile *t)
{
    free(t->raster.depth);
    free(t->raster.rgb);
    free(t->scratch);
    free(t->normals);
    free(t->value);
}

static void draw_mesh(const sheet *s, tile *t, const apsm_mesh *mesh, const double *value)
{
    apsm_mesh_vertex_normals(mesh, t->normals);
    const raster_surface surface = { .nv = mesh->nv,
                                     .nf = mesh->nf,
                                     .V = mesh->V,
                                     .N = t->normals,
                                     .F = mesh->F,
                                     .value = value,
                                     .base = { bone[0], bone[1], bone[2] } };
    raster_draw_surface(&t->raster, &s->view, &surface, t->scratch);
}

/* The mean, moved along mode k to b standard deviations. */
static apsm_status draw_mode(const sheet *s, tile *t, size_t k, double b, bool coloured)
{
    const size_t nv = s->mesh.nv;
    apsm_mesh moved = { 0 };
    APSM_TRY(apsm_mesh_copy(&s->mesh, &moved));
    for (size_t v = 0; v < nv; v++) {
        double along = 0;
        for (size_t c = 0; b != 0 && c < 3; c++) {
            const double d = b * s->mode[(k * nv + v) * 3 + c];
            moved.V[3 * v + c] += d;
            along += d * s->mean_normals[3 * v + c];
        }
        t->value[v] = along / s->reach;
    }
    draw_mesh(s, t, &moved, coloured ? t->value : NULL);
    apsm_mesh_free(&moved);
    return APSM_OK;
}

static void draw_shape(const sheet *s, tile *t, size_t i, const apsm_mesh *mesh)
{
    const model_folder *m = s->m;
    draw_mesh(s, t, mesh, NULL);
    for (size_t j = 0; j < m->J; j++)
        raster_draw_ball(&t->raster, &s->view, m->P + (i * m->J + j) * 3, s->ball,
                         colours_particle[s->colour[j]]);
}

static size_t tile_x(const sheet *s, size_t i)
{
    return s->left + i % s->columns * s->width;
}
static size_t tile_y(const sheet *s, size_t i)
{
    return s->top + i / s->columns * (s->height + s->below);
}

static void put_tile(const sheet *s, const tile *t, size_t i)
{
    picture *p = s->picture;
    unsigned char *rgb = p->rgb + 3 * (tile_y(s, i) * p->width + tile_x(s, i));
    raster_resolve(&t->raster, rgb, 3 * p->width, t->scratch);
}

/* One shape: tile i of the cohort, or the only one. */
static apsm_status shape_tile(apsm_context *ctx, const sheet *s, size_t i, size_t shape)
{
    tile t = { 0 };
    apsm_mesh mesh = { 0 };
    apsm_status status = model_folder_mesh(ctx, s->m, shape, &mesh);
    if (status == APSM_OK) status = tile_make(s, mesh.nv, &t);
    if (status == APSM_OK) {
        draw_shape(s, &t, shape, &mesh);
        put_tile(s, &t, i);
    }
    apsm_mesh_free(&mesh);
    tile_free(&t);
    return status;
}

/* Column and row of the modes, or the mean alone. */
static apsm_status mode_tile(const sheet *s, size_t i)
{
    tile t = { 0 };
    const bool modes = s->options->what == APSM_PICTURE_MODES;
    apsm_status status = tile_make(s, s->mesh.nv, &t);
    if (status == APSM_OK)
        status = draw_mode(s, &t, modes ? i / COLUMNS_OF_MODES : 0,
                           modes ? sds[i % COLUMNS_OF_MODES] : 0, modes);
    if (status == APSM_OK) put_tile(s, &t, i);
    tile_free(&t);
    return status;
}

static apsm_status draw_tile(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const sheet *s = user;
    if (s->options->what == APSM_PICTURE_SHAPE) return shape_tile(ctx, s, i, s->shape);
    if (s->options->what == APSM_PICTURE_COHORT) return shape_tile(ctx, s, i, i);
    return mode_tile(s, i);
}

/* ---- Words ---- */

static size_t choose_letters(const sheet *s, size_t width)
{
    const size_t size = s->options->what == APSM_PICTURE_COHORT ? s->width / 10 : width / 60;
    return size < 9 ? 9 : size > 22 ? 22 : size;
}

/* Names below the shapes; those that need review stand out and say so. */
static apsm_status name_shapes(apsm_context *ctx, const sheet *s)
{
    const size_t pixels = s->letters;
    for (size_t i = 0; i < s->n; i++) {
        const size_t shape = s->options->what == APSM_PICTURE_SHAPE ? s->shape : i;
        const char *name = s->m->project.subjects[shape].name;
        const bool fine = model_folder_is_certified(s->m, shape);
        picture_style style = { .pixels = pixels, .bold = !fine, .align = PICTURE_CENTRE };
        memcpy(style.colour, fine ? ink : bad, 3);
        APSM_TRY(picture_text(ctx, s->picture, tile_x(s, i) + s->width / 2,
                              tile_y(s, i) + s->height, s->width - s->width / 20, &style, name));
        style.bold = false;
        if (!fine)
            APSM_TRY(picture_text(ctx, s->picture, tile_x(s, i) + s->width / 2,
                                  tile_y(s, i) + s->height + pixels + pixels / 4,
                                  s->width - s->width / 20, &style, "needs review"));
    }
    return APSM_OK;
}

static void put_scale(picture *p, size_t x, size_t y, size_t width, size_t height)
{
    for (size_t u = 0; u < width; u++) {
        float rgb[3];
        colours_signed(2.0 * (double)u / (double)(width - 1) - 1, rgb);
        for (size_t v = 0; v < height; v++)
            for (size_t c = 0; c < 3; c++)
                p->rgb[3 * ((y + v) * p->width + x + u) + c] = (unsigned char)(255 * rgb[c] + 0.5f);
    }
}

static apsm_status name_modes(apsm_context *ctx, const sheet *s)
{
    const size_t pixels = s->letters;
    picture *p = s->picture;
    char text[128];
    double total = 0;
    for (size_t k = 0; k < s->m->model.modes; k++) total += s->m->model.variance[k];
    picture_style style = { .pixels = pixels, .align = PICTURE_CENTRE };
    memcpy(style.colour, soft, 3);
    for (size_t k = 0; k < COLUMNS_OF_MODES; k++) {
        apsm_print(text, sizeof text, sds[k] == 0 ? "mean" : "%+.0f sd", sds[k]);
        APSM_TRY(
            picture_text(ctx, p, tile_x(s, k) + s->width / 2, pixels / 2, s->width, &style, text));
    }
    style.align = PICTURE_LEFT;
    memcpy(style.colour, ink, 3);
    for (size_t k = 0; k < s->modes; k++) {
        apsm_print(text, sizeof text, "Mode %zu, %.3g %% of the variance", k + 1,
                   total > 0 ? 100 * s->m->model.variance[k] / total : 0);
        APSM_TRY(
            picture_text(ctx, p, pixels, tile_y(s, COLUMNS_OF_MODES * k), s->width, &style, text));
    }
    const size_t wide = p->width / 3, y = p->height - 2 * pixels - pixels / 2;
    put_scale(p, wide, y - pixels, wide, pixels / 2 + 2);
    memcpy(style.colour, soft, 3);
    apsm_print(text, sizeof text, "%.3g inward", -s->reach);
    APSM_TRY(picture_text(ctx, p, wide, y, wide, &style, text));
    style.align = PICTURE_RIGHT;
    apsm_print(text, sizeof text, "+%.3g outward", s->reach);
    return picture_text(ctx, p, 2 * wide, y, wide, &style, text);
}

/* ---- The sheet ---- */

static size_t columns_of_cohort(size_t I, double aspect)
{
    const size_t columns = (size_t)ceil(sqrt(1.3 * aspect * (double)I));
    return columns < 1 ? 1 : columns > I ? I : columns;
}

/* Default widths: what a screen or a page shows well. */
static size_t width_of(const sheet *s)
{
    const apsm_picture what = s->options->what;
    if (s->options->width) return s->options->width;
    if (what == APSM_PICTURE_MODES) return 1200;
    if (what != APSM_PICTURE_COHORT) return 800;
    const size_t width = 110 * s->columns;
    return width < 1200 ? 1200 : width > APSM_RENDER_MOST ? APSM_RENDER_MOST : width;
}

/* Sets the numbers of tiles and their sizes, and makes the white picture. */
static apsm_status lay_out(apsm_context *ctx, sheet *s)
{
    const apsm_picture what = s->options->what;
    const bool modes = what == APSM_PICTURE_MODES;
    s->n = modes ? COLUMNS_OF_MODES * s->modes : what == APSM_PICTURE_COHORT ? s->m->I : 1;
    s->columns = modes ? COLUMNS_OF_MODES : 1;
    APSM_TRY(find_bounds(ctx, s));
    if (what == APSM_PICTURE_COHORT) {
        s->width = 1000; /* for the aspect alone */
        fit(s);
        s->columns = columns_of_cohort(s->m->I, (double)s->height / 1000 + 0.2);
    }
    const size_t width = width_of(s);
    s->width = width / s->columns;
    s->left = (width - s->width * s->columns) / 2;
    fit(s);
    s->letters = choose_letters(s, width);
    const size_t pixels = s->letters, rows = (s->n + s->columns - 1) / s->columns;
    const bool named = what == APSM_PICTURE_COHORT || what == APSM_PICTURE_SHAPE;
    s->top = modes ? 2 * pixels : 0;
    s->below = named ? 3 * pixels : modes ? pixels / 2 : 0;
    const size_t foot = modes ? 4 * pixels : 0;
    return picture_make(ctx, width, s->top + rows * (s->height + s->below) + foot, s->picture);
}

static apsm_status find_shape(apsm_context *ctx, sheet *s)
{
    const char *name = s->options->shape;
    s->shape = name ? apsm_project_find(&s->m->project, name) : s->m->template_index;
    if (s->shape < s->m->I) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "%s: has no shape '%s'; scores.csv lists the names, the first is "
                     "'%s'",
                     s->m->path, name, s->m->project.subjects[0].name);
}

static apsm_status prepare(apsm_context *ctx, sheet *s)
{
    const apsm_picture what = s->options->what;
    const double h = json_number_value(json_object_get(s->m->certificate, "h"));
    if (what == APSM_PICTURE_MODES && s->m->model.modes == 0)
        return apsm_fail(ctx, APSM_ERR_STATE,
                         "%s: the shapes do not vary: there are no modes to draw", s->m->path);
    s->colour = malloc((s->m->J + 1) * sizeof *s->colour);
    if (!s->colour) return APSM_ERR_MEMORY;
    colours_choose(s->m->J, s->m->model.mean, s->colour);
    s->ball = (what == APSM_PICTURE_COHORT ? 0.21 : 0.16) * h;
    if (what == APSM_PICTURE_SHAPE) APSM_TRY(find_shape(ctx, s));
    choose_view(s);
    if (what == APSM_PICTURE_MEAN || what == APSM_PICTURE_MODES) APSM_TRY(make_mean(ctx, s));
    return lay_out(ctx, s);
}

static apsm_status draw(apsm_context *ctx, sheet *s)
{
    const apsm_picture what = s->options->what;
    APSM_TRY(apsm_parallel_for(ctx, s->n, draw_tile, s, NULL));
    if (what == APSM_PICTURE_MODES) return name_modes(ctx, s);
    if (what != APSM_PICTURE_MEAN) return name_shapes(ctx, s);
    return APSM_OK;
}

static apsm_status check_options(apsm_context *ctx, const apsm_render_options *o)
{
    const double length = fabs(o->view[0]) + fabs(o->view[1]) + fabs(o->view[2]);
    if (o->width != 0 && (o->width < APSM_RENDER_LEAST || o->width > APSM_RENDER_MOST))
        return apsm_fail(ctx, APSM_ERR_ARG, "a width of %zu pixels; give %d to %d", o->width,
                         APSM_RENDER_LEAST, APSM_RENDER_MOST);
    if (!isfinite(length) || (int)o->what < 0 || o->what >= APSM_PICTURE_COUNT)
        return apsm_fail(ctx, APSM_ERR_ARG, "no such picture or view");
    return APSM_OK;
}

enum { SHOWN_PARTS = FOLDER_PARTICLES | FOLDER_EVALUATED | FOLDER_CERTIFIED | FOLDER_MANIFESTED };

apsm_status apsm_render_sized(apsm_context *ctx, const char *folder,
                              const apsm_render_options *given, size_t size, const char *path)
{
    apsm_render_options known = { 0 }, *const options = &known;
    if (!folder || !path || !apsm_take_sized(given, size, &known, sizeof known))
        return apsm_fail(
            ctx, APSM_ERR_ARG,
            "apsm_render: an argument is NULL, or options are unknown to this version");
    model_folder m = { 0 };
    picture p = { 0 };
    sheet s = { .options = options, .m = &m, .picture = &p };
    APSM_TRY(check_options(ctx, options));
    apsm_status status = model_folder_read(ctx, folder, SHOWN_PARTS, &m);
    if (status == APSM_OK) status = prepare(ctx, &s);
    if (status == APSM_OK) status = draw(ctx, &s);
    if (status == APSM_OK) status = picture_write(ctx, &p, path);
    picture_free(&p);
    apsm_mesh_free(&s.mesh);
    free(s.colour);
    free(s.mean);
    free(s.mean_normals);
    free(s.mode);
    free(s.bounds);
    model_folder_free(&m);
    return status;
}
