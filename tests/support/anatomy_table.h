/* anatomy_table.h -- anatomies written down as data: a solid is a list of parts that are joined,
 * carved or cut one after the other, its family of maps a list of bends.  Lengths in mm. */
#ifndef APSM_TEST_ANATOMY_TABLE_H
#define APSM_TEST_ANATOMY_TABLE_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#include "solids_implicit.h"

/* ---- solids ---- */

typedef enum part_form {
    PART_END,
    BALL,  /* add: centre, half-axes */
    HOLE,  /* carve: the same */
    ROD,   /* add: from, to, radius at either end */
    BORE,  /* carve: the same */
    BELOW, /* keep what is below a plane: normal, height along it */
    PLATE, /* add: (x, y) from, (x, y) to, z from, to, half the thickness at either end */
    PAIR_BALL,
    PAIR_ROD, /* the same, and its mirror image in x */
    PAIR_BELOW
} part_form;

typedef struct anatomy_part {
    part_form form;
    double blend, p[8];
} anatomy_part;

/* A rod across z, as high as a plate. */
static inline double anatomy_plate(const double p[8], const double x[3])
{
    const double flat[3] = { x[0], x[1], 0 };
    return solid_round_max(solid_rod(flat, p[0], p[1], 0, p[2], p[3], 0, p[6], p[7]),
                           fabs(x[2] - 0.5 * (p[4] + p[5])) - 0.5 * (p[5] - p[4]), 2);
}

static inline double anatomy_join_part(const anatomy_part *part, const double x[3], double d)
{
    const double *p = part->p, r = fmax(part->blend, 1e-6);
    const double y[3] = { part->form >= PAIR_BALL ? fabs(x[0]) : x[0], x[1], x[2] };
    switch (part->form) {
    case BALL:
    case PAIR_BALL:
        return solid_join(d, solid_ball(y, p[0], p[1], p[2], p[3], p[4], p[5]), r);
    case HOLE:
        return solid_carve(d, solid_ball(y, p[0], p[1], p[2], p[3], p[4], p[5]), r);
    case ROD:
    case PAIR_ROD:
        return solid_join(d, solid_rod(y, p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]), r);
    case BORE:
        return solid_carve(d, solid_rod(y, p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]), r);
    case PLATE:
        return solid_join(d, anatomy_plate(p, y), r);
    case BELOW:
    case PAIR_BELOW:
        return solid_round_max(d, p[0] * y[0] + p[1] * y[1] + p[2] * y[2] - p[3], r);
    default:
        return d;
    }
}

static inline double anatomy_parts_field(const anatomy_part *part, const double x[3])
{
    double d = 1e3; /* far outside, and small enough for sums with blends */
    for (; part->form != PART_END; part++) d = anatomy_join_part(part, x, d);
    return d;
}

/* ---- maps ---- */

typedef enum bend_form {
    BEND_END,
    PULL,    /* along a direction from a base, more and more between two distances: direction, base,
                from, to, and near and far, the distances from the line between which it fades */
    INFLATE, /* away from the z axis, by exp: from, to along z with ramps of a given length */
    TWIST,   /* about the z axis: from, to */
    WALL,    /* thickness of a shell about an ellipsoid at the origin, by exp: half-axes */
    CURVE /* the z axis becomes a curve: from, to, curvature towards x and y, and which of the two
             varies (0, 1, relative to itself; 2: y varies by the amount absolutely) */
} bend_form;

/* The amount of a bend is sd times the shape's own normal number `own`. */
typedef struct anatomy_bend {
    bend_form form;
    int own;
    double sd, p[10];
} anatomy_bend;

static inline double anatomy_ramp(double x, double from, double to)
{
    const double t = fmin(fmax((x - from) / (to - from), 0), 1);
    return t * t * (3 - 2 * t);
}

static inline void anatomy_turn_in_plane(double angle, double *a, double *b)
{
    const double x = *a, y = *b;
    *a = cos(angle) * x - sin(angle) * y;
    *b = sin(angle) * x + cos(angle) * y;
}

static inline void bend_pull(const double p[10], double amount, double x[3])
{
    double norm = 0, along = 0, off = 0;
    for (int c = 0; c < 3; c++) norm += p[c] * p[c];
    for (int c = 0; c < 3; c++) along += (x[c] - p[3 + c]) * p[c] / sqrt(norm);
    for (int c = 0; c < 3; c++) off += pow(x[c] - p[3 + c] - along * p[c] / sqrt(norm), 2);
    const double fade = p[9] > 0 ? anatomy_ramp(-sqrt(off), -p[9], -p[8]) : 1;
    for (int c = 0; c < 3; c++)
        x[c] += amount * fade * anatomy_ramp(along, p[6], p[7]) * p[c] / sqrt(norm);
}

static inline void bend_inflate(const double p[10], double amount, double x[3])
{
    const double in =
        anatomy_ramp(x[2], p[0] - p[2], p[0]) * anatomy_ramp(-x[2], -p[1] - p[2], -p[1]);
    x[0] *= exp(amount * in);
    x[1] *= exp(amount * in);
}

static inline void bend_wall(const double p[10], double amount, double x[3])
{
    double rho = 0;
    for (int c = 0; c < 3; c++) rho += x[c] * x[c] / (p[c] * p[c]);
    rho = sqrt(rho);
    /* Away from the wall the map tends to the identity. */
    const double off = rho - 1, to = 1 + off * exp(amount * exp(-off * off / 0.08));
    for (int c = 0; c < 3 && rho > 0; c++) x[c] *= to / rho;
}

static inline void bend_curvature(const anatomy_bend *bend, const double own[8], double s,
                                  double curvature[2])
{
    curvature[0] = curvature[1] = 0;
    for (const anatomy_bend *e = bend; e->form != BEND_END; e++) {
        if (e->form != CURVE || s < e->p[0] || s >= e->p[1]) continue;
        const double amount = e->sd * own[e->own];
        curvature[0] += e->p[2] * (e->p[4] == 0 ? exp(amount) : 1);
        curvature[1] += e->p[3] * (e->p[4] == 1 ? exp(amount) : 1) + (e->p[4] == 2 ? amount : 0);
    }
}

/* All CURVE entries together: the frame moves along the axis, on the same steps for every point. */
static inline void bend_curve(const anatomy_bend *bend, const double own[8], double x[3])
{
    const double step = 2, a = x[0], b = x[1];
    double at[3] = { 0 }, frame[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    for (double s = 0; s < x[2]; s += step) {
        const double ds = fmin(step, x[2] - s);
        double curvature[2];
        bend_curvature(bend, own, s + 0.5 * step, curvature);
        for (int d = 0; d < 2; d++)
            for (int c = 0; c < 3; c++)
                anatomy_turn_in_plane(-0.5 * curvature[d] * ds, &frame[2][c], &frame[d][c]);
        for (int c = 0; c < 3; c++) at[c] += ds * frame[2][c];
        for (int d = 1; d >= 0; d--)
            for (int c = 0; c < 3; c++)
                anatomy_turn_in_plane(-0.5 * curvature[d] * ds, &frame[2][c], &frame[d][c]);
    }
    const double z = fmin(x[2], 0);
    for (int c = 0; c < 3; c++) x[c] = at[c] + a * frame[0][c] + b * frame[1][c] + z * (c == 2);
}

static inline void anatomy_bend_table(const anatomy_bend *bend, const double own[8], double x[3])
{
    bool curved = false;
    for (const anatomy_bend *e = bend; e->form != BEND_END; e++) {
        const double amount = e->sd * own[e->own];
        if (e->form == PULL) bend_pull(e->p, amount, x);
        if (e->form == INFLATE) bend_inflate(e->p, amount, x);
        if (e->form == WALL) bend_wall(e->p, amount, x);
        if (e->form == TWIST)
            anatomy_turn_in_plane(amount * anatomy_ramp(x[2], e->p[0], e->p[1]), &x[0], &x[1]);
        curved |= e->form == CURVE;
    }
    if (curved) bend_curve(bend, own, x);
}

/* ---- the kinds ---- */

typedef struct anatomy_table {
    const char *name;
    double lo[3], hi[3], grid, strength, length; /* as anatomy_extent */
    anatomy_part part[40];
    anatomy_bend bend[12];
} anatomy_table;

static const anatomy_table anatomy_tables[] = {
    { "myocardium", /* left ventricle: a cup, its wall 8 to 12 mm */
      { -42, -42, -62 },
      { 42, 42, 28 },
      1.6,
      3,
      35,
      { { BALL, 0, { 0, 0, 0, 36, 36, 56 } },
        { HOLE, 1, { 0, 0, 0, 26, 26, 46 } },
        { BALL, 3, { 0, 33, -5, 7, 8, 30 } }, /* where the right ventricle joins */
        { BELOW, 2, { 0, 0, 1, 22 } } },
      { { WALL, 0, 0.15, { 31, 31, 51 } },
        { INFLATE, 1, 0.12, { -70, 40, 5 } },
        { PULL, 2, 6, { 0, 0, 1, 0, 0, 0, -50, 20 } } } },
    { "rib", /* 280 mm along, 7 by 12 mm across */
      { -12, -12, -12 },
      { 16, 12, 292 },
      1.1,
      3,
      60,
      { { ROD, 0, { 0, 0, 0, 0, 0, 280, 6, 6 } },
        { BELOW, 2, { 1, 0, 0, 3.4 } },
        { BELOW, 2, { -1, 0, 0, 3.4 } },
        { BALL, 3, { 0, 0, -2, 6, 7, 6 } },
        { BALL, 3, { -3, 0, 28, 6, 5, 7 } } },
      { { CURVE, 0, 0.15, { 20, 70, 1 / 40.0, 0, 0 } },
        { CURVE, 1, 0.12, { 70, 290, 1 / 105.0, 0, 0 } },
        { CURVE, 2, 0.0012, { 0, 290, 0, 0, 2 } },
        { PULL, 3, 20, { 0, 0, 1, 0, 0, 0, 60, 280 } },
        { TWIST, 4, 0.25, { 60, 280 } },
        { INFLATE, 5, 0.12, { -20, 300, 5 } } } },
    { "aorta", /* an arch with three branches, all ends cut flat */
      { -50, -18, -3 },
      { 18, 18, 233 },
      1.7,
      2.5,
      45,
      { { ROD, 0, { 0, 0, -20, 0, 0, 80, 15, 13 } },
        { ROD, 3, { 0, 0, 70, 0, 0, 250, 13, 10 } },
        { ROD, 4, { 0, 0, 82, -60, 0, 80, 6, 5.5 } },
        { ROD, 3, { 0, 2, 99, -60, 6, 100, 3.8, 3.5 } },
        { ROD, 3, { 0, -1, 114, -60, -4, 122, 4.6, 4.2 } },
        { BELOW, 1, { 0, 0, -1, 0 } },
        { BELOW, 1, { 0, 0, 1, 230 } },
        { BELOW, 1, { -1, 0, 0, 46 } } },
      { { PULL, 0, 8, { 0, 0, 1, 0, 0, 0, 0, 75 } },
        { PULL, 1, 3, { 0, 0, 1, 0, 0, 0, 84, 98 } },
        { PULL, 2, 3, { 0, 0, 1, 0, 0, 0, 100, 114 } },
        { PULL, 3, 15, { 0, 0, 1, 0, 0, 0, 140, 230 } },
        { PULL, 4, 5, { -1, 0, 0, 0, 0, 0, 18, 46 } },
        { INFLATE, 5, 0.14, { -10, 60, 40 } },
        { INFLATE, 6, 0.10, { 130, 250, 40 } },
        { CURVE, 7, 0.10, { 45, 150, 1 / 36.0, 0, 0 } },
        { CURVE, 5, 0.0015, { 30, 240, 0, 0.001, 2 } } } },
    { "mandible", /* U-shaped body, rami, condyles, thin coronoid processes, teeth */
      { -66, -58, -20 },
      { 66, 58, 66 },
      1.4,
      3.5,
      40,
      { { PAIR_ROD, 0, { 0, 44, -7, 20, 36, -7, 7.5, 7 } },
        { PAIR_ROD, 4, { 20, 36, -7, 44, -22, -5, 7, 6.5 } },
        { PAIR_ROD, 6, { 0, 44, 6, 20, 36, 6, 5.5, 5.5 } },
        { PAIR_ROD, 6, { 20, 36, 5, 43, -16, 6, 6, 5.5 } },
        { PAIR_BALL, 4, { 0, 47, -10, 7, 5, 6 } }, /* chin */
        { PAIR_ROD, 5, { 46, -36, 0, 49, -42, 44, 5, 4 } },
        { PAIR_ROD, 6, { 43, -14, 8, 47, -26, 30, 4, 3.5 } },
        { PAIR_ROD, 8, { 45, -25, 0, 48, -33, 28, 4.5, 4 } },
        { PAIR_ROD, 6, { 46, -31, 14, 47, -30, 26, 5, 4 } },
        { PAIR_ROD, 4, { 47, -22, 24, 46, -14, 54, 4, 1.6 } }, /* coronoid process */
        { PAIR_BALL, 3, { 51, -43, 54, 10, 5, 5 } },           /* condyle */
        { PAIR_ROD, 4, { 49, -42, 40, 51, -43, 54, 4, 4 } },
        { PAIR_BALL, 1.5, { 4, 44, 14, 3, 3, 7 } }, /* teeth */
        { PAIR_BALL, 1.5, { 11, 41, 14, 3, 3, 7 } },
        { PAIR_BALL, 1.5, { 18, 37, 14, 3.5, 3.5, 8 } },
        { PAIR_BALL, 1.5, { 24, 28, 14, 3.8, 3.8, 7 } },
        { PAIR_BALL, 1.5, { 28, 19, 14, 4, 4, 7 } },
        { PAIR_BALL, 1.5, { 33, 8, 14, 5, 5.5, 6.5 } },
        { PAIR_BALL, 1.5, { 37, -3, 14, 5, 5.5, 6.5 } } },
      { { PULL, 0, 5, { 0, 0, 1, 0, 0, 0, 12, 48 } },
        { PULL, 1, 4, { 0, 1, 0, 0, 0, 0, -30, 40 } },
        { PULL, 2, 4, { 0, 0, 1, 46, -14, 0, 34, 54, 7, 15 } },
        { PULL, 3, 4, { 0, 0, 1, -46, -14, 0, 34, 54, 7, 15 } },
        { PULL, 4, 2, { 0, 0, 1, 0, 30, 0, 8, 20, 45, 60 } } } }, /* worn teeth */
    { "fibula", /* 350 mm, a shaft with sharp crests */
      { -16, -16, -22 },
      { 16, 16, 368 },
      1.5,
      3,
      60,
      { { ROD, 0, { 0, 0, 0, 0, 0, 350, 10, 10 } },
        { BELOW, 0.6, { 1, 0, 0, 3.6 } },
        { BELOW, 0.6, { -0.5, 0.866, 0, 3.6 } },
        { BELOW, 0.6, { -0.5, -0.866, 0, 3.6 } },
        { BALL, 4, { 0, 0, 346, 11, 10, 12 } },
        { ROD, 3, { -4, 3, 350, -6, 5, 362, 4, 2.5 } }, /* apex of the head */
        { BALL, 6, { 2, 0, 8, 7, 11, 20 } },
        { HOLE, 2, { 10, 4, -6, 5, 5, 8 } } }, /* malleolar fossa */
      { { TWIST, 0, 0.3, { 30, 320 } },
        { PULL, 1, 20, { 0, 0, 1, 0, 0, 0, 40, 310 } },
        { INFLATE, 2, 0.12, { 60, 290, 40 } },
        { CURVE, 3, 0.0004, { 30, 330, 0.0005, 0, 2 } } } },
    { "atrium", /* left atrium: four veins and the valve cut off flat */
      { -54, -26, -32 },
      { 54, 36, 32 },
      1.4,
      3,
      25,
      { { BALL, 0, { 0, 0, 0, 31, 25, 25 } },
        { ROD, 5, { 14, 6, 9, 46.5, 18, 17.5, 8.5, 7 } },
        { ROD, 5, { 14, 6, -9, 46.5, 18, -17.5, 8, 6.5 } },
        { ROD, 5, { -14, 6, 9, -46.5, 18, 17.5, 8, 6.5 } },
        { ROD, 5, { -14, 6, -9, -46.5, 18, -17.5, 7.5, 6 } },
        { BALL, 4, { 20, -16, 12, 12, 7, 6 } }, /* appendage */
        { BELOW, 0.8, { 0.88, 0.33, 0.33, 43 } },
        { BELOW, 0.8, { 0.88, 0.33, -0.33, 43 } },
        { BELOW, 0.8, { -0.88, 0.33, 0.33, 43 } },
        { BELOW, 0.8, { -0.88, 0.33, -0.33, 43 } },
        { BELOW, 1, { 0, -1, 0, 19 } } },
      { { PULL, 0, 4.5, { 0.88, 0.33, 0.33, 0, 0, 0, 24, 43, 9, 15 } },
        { PULL, 1, 4.5, { 0.88, 0.33, -0.33, 0, 0, 0, 24, 43, 9, 15 } },
        { PULL, 2, 4.5, { -0.88, 0.33, 0.33, 0, 0, 0, 24, 43, 9, 15 } },
        { PULL, 3, 4.5, { -0.88, 0.33, -0.33, 0, 0, 0, 24, 43, 9, 15 } },
        { PULL, 4, 4, { 0, 1, 0, 0, 0, 0, -20, 20 } } } },
    { "kidney",
      { -36, -28, -8 },
      { 34, 28, 116 },
      1.8,
      3.5,
      28,
      { { BALL, 0, { 0, 0, 54, 27, 20, 54 } },
        { BALL, 8, { 8, 0, 30, 20, 18, 22 } },
        { HOLE, 4, { -30, 2, 54, 16, 10, 17 } } },
      { { CURVE, 0, 0.2, { 10, 100, -1 / 90.0, 0, 0 } },
        { PULL, 1, 6, { 0, 0, 1, 0, 0, 0, 10, 100 } },
        { PULL, 2, 2.5, { 0, 1, 0, 0, 0, 0, -18, 18 } } } },
    { "skullcap", /* a shell of 6 mm over 180 mm */
      { -80, -96, -4 },
      { 80, 96, 76 },
      2.4,
      4,
      60,
      { { BALL, 0, { 0, 0, 0, 74, 90, 70 } },
        { HOLE, 1, { 0, 0, 0, 68, 84, 64 } },
        { BELOW, 1.5, { 0, 0, -1, 0 } } },
      { { WALL, 0, 0.2, { 71, 87, 67 } }, { PULL, 1, 5, { 0, 0, 1, 0, 0, 0, 0, 70 } } } },
    { "horn", /* lateral ventricle of the brain: thin horns, volumes that differ by a factor of 4 */
      { -14, -40, -6 },
      { 14, 14, 128 },
      0.8,
      2,
      25,
      { { ROD, 0, { 0, 0, 0, 0, 0, 18, 2, 6.5 } },
        { ROD, 2, { 0, 0, 18, 0, 0, 50, 6.5, 4.5 } },
        { ROD, 3, { 0, 0, 50, 0, 0, 68, 4.5, 7.5 } },
        { ROD, 3, { 0, 0, 68, 0, 0, 122, 5.5, 1.8 } },
        { ROD, 2, { 0, -4, 66, 0, -34, 62, 4, 1.4 } } }, /* occipital horn */
      { { INFLATE, 0, 0.25, { -20, 140, 5 } },
        { INFLATE, 1, 0.15, { -20, 40, 20 } },
        { INFLATE, 2, 0.15, { 70, 140, 20 } },
        { PULL, 3, 4, { 0, -1, 0, 0, 0, 0, 12, 36 } },
        { PULL, 4, 5, { 0, 0, 1, 0, 0, 0, 80, 120 } },
        { CURVE, 5, 0.1, { 0, 48, 0, 1 / 70.0, 1 } },
        { CURVE, 6, 0.1, { 48, 96, 0, 1 / 21.0, 1 } },
        { CURVE, 7, 0.004, { 20, 130, 0.004, 0, 0 } } } },
    { "lung", /* hollow base with a sharp rim */
      { -64, -82, -112 },
      { 62, 82, 122 },
      3.6,
      8,
      70,
      { { BALL, 0, { 0, 0, 0, 58, 76, 118 } },
        { BELOW, 6, { -1, 0, 0, 34 } },
        { HOLE, 5, { -52, 30, -35, 42, 42, 55 } }, /* heart */
        { HOLE, 2, { 8, 0, -140, 70, 88, 82 } },   /* diaphragm */
        { HOLE, 4, { -40, -10, 12, 14, 16, 22 } } },
      { { PULL, 0, 15, { 0, 0, 1, 0, 0, 0, -90, 80 } },
        { PULL, 1, 7, { 1, 0, 0, 0, 0, 0, -40, 40 } } } },
    { "growth", /* a bone that grows at two plates 10 mm high, which nothing on its shaft shows */
      { -24, -22, -20 },
      { 24, 22, 172 },
      1.5,
      1.5,
      45,
      { { ROD, 0, { 0, 0, 10, 0, 0, 140, 10, 8 } },
        { BALL, 5, { 0, 0, 4, 18, 14, 16 } },
        { BALL, 5, { 3, 2, 148, 16, 14, 18 } },
        { ROD, 3, { 3, 2, 150, -14, 4, 158, 6, 4 } }, /* a process */
        { ROD, 2, { 6, -4, 60, 11, -6, 72, 4, 3 } } },
      { { PULL, 0, 7, { 0, 0, 1, 0, 0, 0, 34, 44 } },
        { PULL, 1, 7, { 0, 0, 1, 0, 0, 0, 110, 120 } },
        { PULL, 2, 3, { -1, 0, 0, 3, 2, 158, 8, 12 } } } },
    { "slide", /* a knob that sits at another place on every shape and drags its skin along */
      { -40, -32, -48 },
      { 44, 32, 48 },
      1.6,
      1.5,
      40,
      { { BALL, 0, { 0, 0, 0, 27, 22, 38 } },
        { BALL, 5, { -20, 0, 24, 12, 10, 12 } }, /* ends and sides differ */
        { BALL, 4, { 0, 14, -26, 9, 12, 9 } },
        { BALL, 3, { 30, 0, 0, 8, 8, 8 } } }, /* the knob */
      { { PULL, 0, 6, { 0, 0, 1, 32, 0, 0, -300, -200, 7, 18 } },
        { PULL, 1, 4, { 0, 1, 0, 32, 0, 0, -300, -200, 7, 18 } } } },
    { "lobes", /* knobs of varying height, some of them absent */
      { -46, -42, -52 },
      { 46, 42, 52 },
      1.7,
      1,
      40,
      { { BALL, 0, { 0, 0, 0, 30, 24, 40 } },
        { BALL, 4, { 30, 0, 8, 9, 8, 8 } },
        { BALL, 4, { -29, 2, -12, 9, 8, 9 } },
        { BALL, 4, { 4, 24, -14, 8, 9, 8 } },
        { BALL, 4, { -4, 23, 18, 8, 8, 8 } },
        { BALL, 4, { 2, -24, 4, 9, 8, 9 } },
        { BALL, 4, { 10, 0, 40, 8, 8, 7 } } },
      { { PULL, 0, 4, { 1, 0, 0, 20, 0, 8, -2, 18, 8, 14 } },
        { PULL, 1, 4, { -1, 0, 0, -19, 2, -12, -2, 18, 8, 14 } },
        { PULL, 2, 4, { 0, 1, 0, 4, 15, -14, -2, 18, 8, 14 } },
        { PULL, 3, 4, { 0, 1, 0, -4, 14, 18, -2, 18, 8, 14 } },
        { PULL, 4, 4, { 0, -1, 0, 2, -15, 4, -2, 18, 8, 14 } },
        { PULL, 5, 4, { 0, 0, 1, 10, 0, 30, -2, 18, 8, 14 } } } },
    { "sinus", /* a kidney whose sinus goes deep and branches */
      { -36, -28, -8 },
      { 34, 28, 116 },
      1.8,
      3.5,
      28,
      { { BALL, 0, { 0, 0, 54, 27, 20, 54 } },
        { BALL, 8, { 8, 0, 30, 20, 18, 22 } },
        { HOLE, 4, { -30, 2, 54, 16, 10, 17 } },
        { BORE, 2, { -20, 2, 54, 4, 1, 54, 6, 4 } },
        { BORE, 2, { -14, 2, 54, 0, 3, 80, 5, 3 } },
        { BORE, 2, { -14, 2, 54, 2, 0, 28, 5, 3 } },
        { BORE, 2, { -12, 2, 54, -2, 9, 64, 4, 2.5 } },
        { BORE, 2, { -12, 2, 54, 4, -8, 44, 4, 2.5 } } },
      { { CURVE, 0, 0.2, { 10, 100, -1 / 90.0, 0, 0 } },
        { PULL, 1, 6, { 0, 0, 1, 0, 0, 0, 10, 100 } },
        { PULL, 2, 2.5, { 0, 1, 0, 0, 0, 0, -18, 18 } } } },
    { "adrenal", /* a Y of thin sheets, 45 mm high: body, and two limbs of unlike length */
      { -18, -18, -5 },
      { 20, 16, 50 },
      0.6,
      1.3,
      18,
      { { PLATE, 1, { 0, 0, 0, 9, 3, 40, 2.6, 1.8 } },
        { PLATE, 2, { 0, 0, -12, -13, -2, 28, 2.4, 1.3 } },
        { PLATE, 2, { 0, 0, 10, -5, 12, 46, 2, 1.4 } } },
      { { CURVE, 0, 0.008, { 5, 42, 0, 0.004, 2 } },
        { TWIST, 1, 0.2, { 5, 42 } },
        { PULL, 2, 2.5, { -0.6, -0.8, 0, 0, 0, 0, 3, 14 } },
        { PULL, 3, 2.5, { 0.8, -0.6, 0, 0, 0, 0, 3, 14 } },
        { PULL, 4, 4, { 0, 0, 1, 0, 0, 0, 10, 40 } } } },
};

enum { ANATOMY_TABLES = sizeof anatomy_tables / sizeof *anatomy_tables };

#endif
