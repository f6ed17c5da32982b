/* anatomy.h -- synthetic anatomies of kinds that are hard to model: long, lobed, thin, bent, with a
 * hole.  A kind is an implicit solid (its template, in mm) and a family of maps of space; shape i
 * of a cohort is the template's image under map i, so the same template point is the same place on
 * every shape.  Maps are smooth and one to one: flows of smooth velocity fields, and bends whose
 * radius exceeds the solid's.
 *
 * Solids are unions, smooth by a few mm, of balls, rods and plates; fields are negative inside and
 * only near the surface about a distance. */
#ifndef APSM_TEST_ANATOMY_H
#define APSM_TEST_ANATOMY_H

#include <math.h>
#include <string.h>

#include "anatomy_table.h"
#include "core/random.h"
#include "geometry/isosurface.h"
#include "solids_implicit.h"

typedef enum anatomy_kind {
    ANATOMY_FEMUR,     /* 10 : 1, head and neck at an angle that varies, condyles */
    ANATOMY_LIVER,     /* lobes, a thin edge */
    ANATOMY_SCAPULA,   /* a blade 3 mm thick over 100 mm, with a ridge and processes */
    ANATOMY_APPENDAGE, /* a tube that is bent at random, with lobes */
    ANATOMY_VERTEBRA,  /* a canal: genus 1 */
    ANATOMY_PELVIS,    /* a wing, a cup and a ring: genus 1 */
    ANATOMY_MENISCUS,  /* a wedge bent to a C, its inner edge thin */
    ANATOMY_TABLED,    /* from here on: anatomy_tables[kind - ANATOMY_TABLED] */
    ANATOMY_KINDS = ANATOMY_TABLED + ANATOMY_TABLES
} anatomy_kind;

static inline const char *anatomy_name(anatomy_kind kind)
{
    static const char *const name[ANATOMY_TABLED] = { "femur",    "liver",  "scapula", "appendage",
                                                      "vertebra", "pelvis", "meniscus" };
    return kind < ANATOMY_TABLED ? name[kind] : anatomy_tables[kind - ANATOMY_TABLED].name;
}

/* ANATOMY_KINDS if there is none of this name. */
static inline anatomy_kind anatomy_find(const char *name)
{
    anatomy_kind kind = 0;
    while (kind < ANATOMY_KINDS && strcmp(name, anatomy_name(kind)) != 0) kind++;
    return kind;
}

/* ---- the solids ---- */

static inline double anatomy_femur(const double x[3])
{
    double d = INFINITY;
    for (int k = 0; k < 8; k++) { /* the bow of the shaft */
        const double z0 = 40 + 42 * k, z1 = z0 + 42, y0 = 12 * (1 - pow((z0 - 208) / 168, 2)),
                     y1 = 12 * (1 - pow((z1 - 208) / 168, 2));
        d = solid_join(d, solid_rod(x, 0, y0, z0, 0, y1, z1, 13, 13), 3);
    }
    d = solid_join(d, solid_rod(x, 0, 0, 90, 0, -4, 30, 14, 29), 10);
    d = solid_join(d, solid_ball(x, -25, -14, 22, 17, 32, 24), 6);
    d = solid_join(d, solid_ball(x, 25, -12, 20, 18, 30, 22), 6);
    d = solid_carve(d, solid_rod(x, 0, -50, 2, 0, -20, 8, 9, 7), 4);
    d = solid_join(d, solid_rod(x, 0, 0, 370, -48, 4, 424, 15, 13), 8);
    d = solid_join(d, solid_ball(x, -50, 4, 426, 23, 23, 23), 4);
    d = solid_join(d, solid_ball(x, 10, -6, 388, 17, 20, 32), 8);
    return solid_join(d, solid_ball(x, -13, -14, 338, 9, 9, 12), 6);
}

static inline double anatomy_liver(const double x[3])
{
    double d = solid_ball(x, 30, 0, 0, 68, 62, 78);
    d = solid_join(d, solid_ball(x, -55, 18, 30, 72, 38, 30), 20);
    d = solid_join(d, solid_ball(x, -8, -32, 5, 17, 14, 26), 6);
    d = solid_carve(d, solid_ball(x, -30, -45, -62, 90, 52, 62), 8); /* the visceral side */
    return solid_carve(d, solid_rod(x, 5, 30, -45, 15, 62, -60, 10, 14), 5);
}

/* Twice the half thickness of a blade over the triangle a, b, c of the plane x z. */
static inline double anatomy_scapula(const double x[3])
{
    const double bend = x[1] - (0.0022 * x[0] * x[0] + 0.0010 * x[2] * x[2] - 6);
    const double p[2] = { x[0], x[2] };
    const double edge =
        solid_triangle(p, (double[2]){ -62, 42 }, (double[2]){ 26, 22 }, (double[2]){ -48, -100 });
    double d = solid_round_max(edge, fabs(bend) - 1.6, 1.5);
    d = solid_join(d, solid_rod(x, 24, -4, 10, -46, 5, -98, 6, 3), 4); /* lateral border */
    d = solid_join(d, solid_rod(x, -60, 4, 18, 10, -22, 34, 1.8, 4), 5);
    d = solid_join(d, solid_rod(x, -56, 3, 16, 6, -12, 28, 2.2, 3), 4); /* spine, to the blade */
    d = solid_join(d, solid_rod(x, -50, 2, 14, 4, -4, 22, 2.2, 3), 4);
    d = solid_join(d, solid_rod(x, 10, -22, 34, 44, -24, 44, 5, 6), 5); /* acromion */
    d = solid_join(d, solid_ball(x, 48, -18, 44, 12, 18, 5), 4);
    d = solid_join(d, solid_ball(x, 32, -2, 10, 9, 13, 19), 6); /* glenoid */
    d = solid_join(d, solid_rod(x, 18, 4, 28, 20, 18, 42, 7, 6), 4);
    return solid_join(d, solid_rod(x, 20, 18, 42, 40, 30, 34, 6, 5), 3); /* coracoid */
}

static inline double anatomy_appendage(const double x[3])
{
    double d = solid_rod(x, 0, 0, 2, 0, 0, 30, 11, 8);
    d = solid_join(d, solid_ball(x, 0, 0, 0, 14, 11, 6), 4);
    d = solid_join(d, solid_ball(x, 4, 0, 40, 9, 7, 13), 4);
    d = solid_join(d, solid_ball(x, -9, 3, 26, 8, 6, 7), 3);
    return solid_join(d, solid_ball(x, 8, -4, 18, 7, 6, 6), 3);
}

static inline double anatomy_vertebra(const double x[3])
{
    const double waist = 1 - 0.12 * exp(-x[2] * x[2] / 60);
    const double ring = (sqrt(pow(x[0] / 23, 2) + pow((x[1] - 20) / 16, 2)) - waist) * 16;
    double d = solid_round_max(ring, fabs(x[2]) - 13, 3);
    for (int s = -1; s <= 1; s += 2) {
        d = solid_join(d, solid_rod(x, s * 15, 10, 5, s * 16, -10, 3, 5, 5), 3);   /* pedicle */
        d = solid_join(d, solid_rod(x, s * 16, -10, 2, 0, -24, -4, 4, 4.5), 3);    /* lamina */
        d = solid_join(d, solid_rod(x, s * 16, -8, 3, s * 42, -14, 6, 5, 3), 3);   /* transverse */
        d = solid_join(d, solid_rod(x, s * 17, -11, 2, s * 17, -13, 20, 5, 4), 2); /* superior */
        d = solid_join(d, solid_rod(x, s * 12, -16, -2, s * 13, -18, -20, 5, 4), 2); /* inferior */
    }
    return solid_join(d, solid_rod(x, 0, -24, -4, 0, -56, -12, 4, 5), 3);
}

/* The iliac wing is a disc of radius 62, curved; the ring of the rami a torus below the cup. */
static inline double anatomy_pelvis(const double x[3])
{
    const double wing = x[1] - (0.004 * x[0] * x[0] + 0.002 * (x[2] - 70) * (x[2] - 70) - 6);
    const double disc = sqrt(x[0] * x[0] * 0.85 + (x[2] - 72) * (x[2] - 72)) - 62;
    double d = solid_round_max(disc, fabs(wing) - 2.2, 2);
    for (int k = 0; k < 6; k++) { /* the crest */
        const double a = (15 + 30 * k) * M_PI / 180, b = (15 + 30 * (k + 1)) * M_PI / 180;
        if (k == 5) break;
        const double p[2] = { 64 * cos(a), 72 + 60 * sin(a) },
                     q[2] = { 64 * cos(b), 72 + 60 * sin(b) };
        const double yp = 0.004 * p[0] * p[0] + 0.002 * (p[1] - 70) * (p[1] - 70) - 6,
                     yq = 0.004 * q[0] * q[0] + 0.002 * (q[1] - 70) * (q[1] - 70) - 6;
        d = solid_join(d, solid_rod(x, p[0], yp, p[1], q[0], yq, q[1], 4, 4), 3);
    }
    d = solid_join(d, solid_ball(x, -40, 4, 48, 20, 9, 18), 8); /* towards the sacrum */
    d = solid_join(d, solid_ball(x, 4, -6, 0, 31, 24, 31), 10);
    d = solid_carve(d, solid_ball(x, 4, -27, 0, 23, 23, 23), 3);        /* the cup */
    d = solid_join(d, solid_rod(x, 18, 2, -12, 62, 14, -34, 9, 8), 6);  /* upper ramus */
    d = solid_join(d, solid_rod(x, 62, 14, -34, 44, 10, -76, 8, 6), 5); /* symphysis, lower ramus */
    d = solid_join(d, solid_rod(x, 44, 10, -76, 2, 0, -78, 6, 11), 5);
    return solid_join(d, solid_rod(x, 2, 0, -78, -4, 0, -22, 13, 13), 6); /* ischium */
}

static inline double anatomy_meniscus(const double x[3])
{
    const double rho = hypot(x[0], x[1]), turn = atan2(x[1], x[0]);
    const double across = rho - 16; /* -6 the inner edge, +6 the outer */
    const double half = 0.6 + 3.0 * fmin(fmax((across + 6) / 12, 0), 1);
    const double section = solid_round_max(fabs(across) - 6, (fabs(x[2]) - half) * 0.97, 1);
    return solid_round_max(section, (fabs(turn) - 2.2) * fmax(rho, 6), 3);
}

static inline double anatomy_field(anatomy_kind kind, const double x[3])
{
    static double (*const field[ANATOMY_TABLED])(
        const double *) = { anatomy_femur,    anatomy_liver,  anatomy_scapula, anatomy_appendage,
                            anatomy_vertebra, anatomy_pelvis, anatomy_meniscus };
    return kind < ANATOMY_TABLED
               ? field[kind](x)
               : anatomy_parts_field(anatomy_tables[kind - ANATOMY_TABLED].part, x);
}

/* Where the solid is, and the grid that resolves its thinnest part. */
typedef struct anatomy_extent {
    double lo[3], hi[3], grid;
    double strength, length; /* of the smooth variation: its size and how far it reaches */
} anatomy_extent;

static inline anatomy_extent anatomy_extent_of(anatomy_kind kind)
{
    static const anatomy_extent extent[ANATOMY_TABLED] = {
        { { -80, -52, -12 }, { 52, 36, 460 }, 2.5, 3, 60 },
        { { -135, -75, -85 }, { 105, 75, 85 }, 3, 9, 60 },
        { { -72, -45, -108 }, { 68, 42, 56 }, 0.9, 4, 35 },
        { { -25, -20, -12 }, { 25, 20, 58 }, 0.8, 2.2, 14 },
        { { -50, -66, -28 }, { 50, 42, 28 }, 1, 2.5, 25 },
        { { -80, -40, -96 }, { 80, 40, 142 }, 1.4, 4, 50 },
        { { -26, -26, -7 }, { 26, 26, 7 }, 0.5, 1.2, 14 },
    };
    if (kind < ANATOMY_TABLED) return extent[kind];
    const anatomy_table *k = &anatomy_tables[kind - ANATOMY_TABLED];
    return (anatomy_extent){ .lo = { k->lo[0], k->lo[1], k->lo[2] },
                             .hi = { k->hi[0], k->hi[1], k->hi[2] },
                             .grid = k->grid,
                             .strength = k->strength,
                             .length = k->length };
}

/* ---- maps ---- */

enum { ANATOMY_WAVES = 12, ANATOMY_FIELDS = 10 };

/* A smooth vector field: a sum of waves with normal frequencies (a Gaussian process of this reach
 * in the limit of many), of about unit variance. */
typedef struct anatomy_waves {
    double k[ANATOMY_WAVES][3], phase[ANATOMY_WAVES], way[ANATOMY_WAVES][3];
} anatomy_waves;

typedef struct anatomy_map {
    anatomy_kind kind;
    anatomy_extent extent;
    anatomy_waves waves[ANATOMY_FIELDS + 1]; /* the cohort's, and one of the shape's own */
    double weight[ANATOMY_FIELDS + 1];
    anatomy_waves bumps; /* short ones, of the shape's own */
    double rough;        /* their size */
    double own[8];       /* standard normal: parameters of the kind, see anatomy_bend */
    double stretch[3], size;
    double pose[16]; /* det < 0: mirrored */
} anatomy_map;

static inline void anatomy_draw_waves(apsm_random *rng, double length, anatomy_waves *w)
{
    for (int a = 0; a < ANATOMY_WAVES; a++) {
        w->phase[a] = 2 * M_PI * apsm_random_uniform(rng);
        for (int c = 0; c < 3; c++) {
            w->k[a][c] = apsm_random_normal(rng) / length;
            w->way[a][c] = sqrt(2.0 / ANATOMY_WAVES) * apsm_random_normal(rng);
        }
    }
}

static inline void anatomy_waves_at(const anatomy_waves *w, const double x[3], double v[3])
{
    v[0] = v[1] = v[2] = 0;
    for (int a = 0; a < ANATOMY_WAVES; a++) {
        const double kx = w->k[a][0] * x[0] + w->k[a][1] * x[1] + w->k[a][2] * x[2];
        const double wave = cos(kx + w->phase[a]);
        for (int c = 0; c < 3; c++) v[c] += wave * w->way[a][c];
    }
}

/* How a cohort's shapes differ beyond its kind. */
typedef struct anatomy_spread {
    double strength; /* factor of the variation, 1: that of the kind */
    double rough;    /* size of bumps that no other shape has, relative to the kind's variation */
    double size;     /* standard deviation of log size */
    double turn;     /* largest turn of a pose in degrees */
    bool mirrored;
} anatomy_spread;

static inline void anatomy_draw_pose(apsm_random *rng, const anatomy_spread *s, double M[16])
{
    double u[3], norm = 0;
    for (int c = 0; c < 3; c++) u[c] = apsm_random_normal(rng), norm += u[c] * u[c];
    const double angle = s->turn * M_PI / 180 * (2 * apsm_random_uniform(rng) - 1);
    const double cosine = cos(angle), sine = sin(angle);
    memset(M, 0, 16 * sizeof *M);
    for (int a = 0; a < 3; a++) {
        u[a] /= sqrt(norm);
        M[4 * a + 3] = s->turn * (2 * apsm_random_uniform(rng) - 1);
    }
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            M[4 * a + b] = (1 - cosine) * u[a] * u[b] + (a == b ? cosine : 0) -
                           (a == b ? 0 : sine * u[3 - a - b] * ((b - a + 3) % 3 == 1 ? 1 : -1));
    M[15] = 1;
    for (int a = 0; s->mirrored && a < 3; a++) M[4 * a] = -M[4 * a];
}

static inline anatomy_map anatomy_draw(anatomy_kind kind, uint64_t seed, size_t i,
                                       const anatomy_spread *s)
{
    anatomy_map m = { .kind = kind, .extent = anatomy_extent_of(kind) };
    apsm_random cohort = apsm_random_stream(seed, APSM_STREAM_TEST, (uint64_t)kind, 0);
    apsm_random rng = apsm_random_stream(seed, APSM_STREAM_TEST, (uint64_t)kind, i + 1);
    double norm = 0;
    for (int f = 0; f < ANATOMY_FIELDS; f++) {
        anatomy_draw_waves(&cohort, m.extent.length * (f % 2 ? 0.6 : 1), &m.waves[f]);
        m.weight[f] = pow(0.8, f);
        norm += m.weight[f] * m.weight[f];
    }
    anatomy_draw_waves(&rng, 0.5 * m.extent.length, &m.waves[ANATOMY_FIELDS]);
    for (int f = 0; f < ANATOMY_FIELDS; f++)
        m.weight[f] *= s->strength * m.extent.strength * apsm_random_normal(&rng) / sqrt(norm);
    m.weight[ANATOMY_FIELDS] = 0.2 * s->strength * m.extent.strength;
    apsm_random own = apsm_random_stream(seed, APSM_STREAM_TEST, (uint64_t)kind, 100000 + i);
    anatomy_draw_waves(&own, 0.2 * m.extent.length, &m.bumps);
    m.rough = s->rough * m.extent.strength;
    for (int k = 0; k < 8; k++)
        m.own[k] = s->strength * fmin(fmax(apsm_random_normal(&rng), -2), 2);
    for (int c = 0; c < 3; c++) m.stretch[c] = exp(0.05 * s->strength * apsm_random_normal(&rng));
    m.size = exp(s->size * apsm_random_normal(&rng));
    anatomy_draw_pose(&rng, s, m.pose);
    return m;
}

/* x <- the flow of the shape's velocity field for unit time. */
static inline void anatomy_flow(const anatomy_map *m, double x[3])
{
    enum { STEPS = 5 };
    for (int step = 0; step < STEPS; step++) {
        double sum[3] = { 0 };
        for (int f = 0; f <= ANATOMY_FIELDS; f++) {
            double v[3];
            anatomy_waves_at(&m->waves[f], x, v);
            for (int c = 0; c < 3; c++) sum[c] += m->weight[f] * v[c];
        }
        for (int c = 0; c < 3; c++) x[c] += sum[c] / STEPS;
    }
}

static inline void anatomy_roughen(const anatomy_map *m, double x[3])
{
    double v[3];
    anatomy_waves_at(&m->bumps, x, v);
    for (int c = 0; c < 3; c++) x[c] += m->rough * v[c];
}

/* Neck angle (sd 5 degrees), anteversion (10), bow, length of the shaft (6 %). */
static inline void anatomy_bend_femur(const double p[8], double x[3])
{
    const double neck = anatomy_ramp(-x[0], 5, 35) * anatomy_ramp(x[2], 330, 380);
    double z = x[2] - 375;
    anatomy_turn_in_plane(5 * M_PI / 180 * p[0] * neck, &x[0], &z);
    x[2] = z + 375;
    anatomy_turn_in_plane(10 * M_PI / 180 * p[1] * anatomy_ramp(x[2], 80, 340), &x[0], &x[1]);
    const double along = anatomy_ramp(x[2], 40, 340);
    x[1] += 5 * p[2] * 4 * along * (1 - along);
    x[2] += 25 * p[3] * along;
}

/* The axis, z, becomes a curve of curvature up to 0.035 / mm in either plane that changes its
 * direction half way: turns of up to 90 degrees. */
static inline void anatomy_bend_appendage(const double p[8], double x[3])
{
    enum { STEPS = 40 };
    double at[3] = { 0 }, frame[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    const double ds = fmax(x[2], 0) / STEPS;
    for (int k = 0; k < STEPS; k++) {
        const double s = ds * (k + 0.5), late = anatomy_ramp(s, 12, 32);
        const double bend[2] = { 0.014 * ((1 - late) * p[0] + late * p[1]),
                                 0.014 * ((1 - late) * p[2] + late * p[3]) };
        for (int c = 0; c < 3; c++) at[c] += ds * frame[2][c];
        for (int b = 0; b < 2; b++)
            for (int c = 0; c < 3; c++)
                anatomy_turn_in_plane(-bend[b] * ds, &frame[2][c], &frame[b][c]);
    }
    const double z = fmin(x[2], 0), a = x[0], b = x[1];
    for (int c = 0; c < 3; c++) x[c] = at[c] + a * frame[0][c] + b * frame[1][c] + z * (c == 2);
}

static inline void anatomy_place(const anatomy_map *m, const double t[3], double x[3])
{
    double y[3] = { t[0], t[1], t[2] };
    if (m->kind == ANATOMY_FEMUR) anatomy_bend_femur(m->own, y);
    if (m->kind == ANATOMY_APPENDAGE) anatomy_bend_appendage(m->own, y);
    if (m->kind >= ANATOMY_TABLED)
        anatomy_bend_table(anatomy_tables[m->kind - ANATOMY_TABLED].bend, m->own, y);
    anatomy_flow(m, y);
    if (m->rough > 0) anatomy_roughen(m, y);
    for (int c = 0; c < 3; c++) y[c] *= m->stretch[c] * m->size;
    for (int r = 0; r < 3; r++)
        x[r] = m->pose[4 * r] * y[0] + m->pose[4 * r + 1] * y[1] + m->pose[4 * r + 2] * y[2] +
               m->pose[4 * r + 3];
}

/* ---- meshes ---- */

/* The template's surface, of a grid `coarser` times the kind's; what lies below the height `cut`
 * (-INFINITY: nothing) along z is cut off flat. */
static inline apsm_status anatomy_template(apsm_context *ctx, anatomy_kind kind, double coarser,
                                           double cut, apsm_mesh *mesh)
{
    const anatomy_extent e = anatomy_extent_of(kind);
    const double step = e.grid * coarser;
    size_t n[3], at = 0;
    for (int c = 0; c < 3; c++) n[c] = (size_t)((e.hi[c] - e.lo[c]) / step) + 2;
    float *values = malloc(n[0] * n[1] * n[2] * sizeof *values);
    if (!values) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < n[2]; k++)
        for (size_t j = 0; j < n[1]; j++)
            for (size_t i = 0; i < n[0]; i++) {
                const double x[3] = { e.lo[0] + step * (double)i, e.lo[1] + step * (double)j,
                                      e.lo[2] + step * (double)k };
                values[at++] = (float)fmax(anatomy_field(kind, x), cut - x[2]);
            }
    const apsm_status status = apsm_isosurface(ctx, n, values, 0, mesh);
    free(values);
    for (size_t v = 0; status == APSM_OK && v < mesh->nv; v++)
        for (int c = 0; c < 3; c++)
            mesh->V[3 * v + (size_t)c] = e.lo[c] + step * mesh->V[3 * v + (size_t)c];
    return status;
}

/* The template's mesh becomes the shape's. */
static inline void anatomy_apply(const anatomy_map *m, apsm_mesh *mesh)
{
    double det = 1;
    for (size_t v = 0; v < mesh->nv; v++) {
        const double t[3] = { mesh->V[3 * v], mesh->V[3 * v + 1], mesh->V[3 * v + 2] };
        anatomy_place(m, t, mesh->V + 3 * v);
    }
    const double *M = m->pose;
    det = M[0] * (M[5] * M[10] - M[6] * M[9]) - M[1] * (M[4] * M[10] - M[6] * M[8]) +
          M[2] * (M[4] * M[9] - M[5] * M[8]);
    for (size_t f = 0; det < 0 && f < mesh->nf; f++) {
        const uint32_t b = mesh->F[3 * f + 1];
        mesh->F[3 * f + 1] = mesh->F[3 * f + 2];
        mesh->F[3 * f + 2] = b;
    }
}

#endif
