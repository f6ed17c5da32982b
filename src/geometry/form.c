/* Form agreement.
 *
 *   u_js = sum_f A_f (c_f - p_j) . n_j / (r_s sum_f A_f),  over faces with |c_f - p_j| < r_s and
 *          n_f . n_j > 0                                                            (J1)
 *   a_i  = mean over s of artanh corr_j(u_ijs, median over i' != i of u_i'js)       (J2)
 */
#include "geometry/form.h"

#include <math.h>

#include "core/kernel.h"
#include "core/robust.h"
#include "geometry/vec3.h"

const double apsm_form_radius[APSM_FORM_SCALES] = { 1.2, 2.4, 4.8 };
/* Beyond, two shapes are alike but for rounding. */
static const double most_correlation = 0.995;
/* Fewer faces than this tell nothing of a scale. */
enum { LEAST_FACES = 3 };

/* Faces come in blocks of LANES near ones, which one look leaves out if they are too far away. */
enum { LANES = 8, CELL_BITS = 4, CELLS = 1 << 3 * CELL_BITS };

typedef struct block {
    double centre[3][LANES], normal[3][LANES], area[LANES];
    double middle[3], radius; /* of a ball around the centres */
} block;

static size_t blocks_of(size_t nf)
{
    return (nf + LANES - 1) / LANES;
}

size_t apsm_form_size(size_t nf)
{
    return blocks_of(nf) * (sizeof(block) / sizeof(double));
}

static void face_centre(const apsm_mesh *mesh, size_t f, double centre[3])
{
    const uint32_t *F = mesh->F + 3 * f;
    const double *a = mesh->V + 3 * F[0], *b = mesh->V + 3 * F[1], *c = mesh->V + 3 * F[2];
    for (size_t k = 0; k < 3; k++) centre[k] = (a[k] + b[k] + c[k]) / 3.0;
}

/* Number of the face's cell among 16^3 in the box, along Morton's curve. */
static size_t cell_of(const apsm_mesh *mesh, size_t f, const double lo[3], const double hi[3])
{
    double centre[3];
    size_t cell = 0;
    face_centre(mesh, f, centre);
    for (size_t k = 0; k < 3; k++) {
        const double share = hi[k] > lo[k] ? (centre[k] - lo[k]) / (hi[k] - lo[k]) : 0.0;
        const double at = fmin(fmax(share, 0.0) * (1 << CELL_BITS), (1 << CELL_BITS) - 1);
        for (size_t bit = 0; bit < CELL_BITS; bit++)
            cell |= ((size_t)at >> bit & 1) << (3 * bit + k);
    }
    return cell;
}

static void put_face(const apsm_mesh *mesh, size_t f, block *b, size_t lane)
{
    const uint32_t *F = mesh->F + 3 * f;
    double u[3], v[3], normal[3], centre[3];
    vec3_sub(mesh->V + 3 * F[1], mesh->V + 3 * F[0], u);
    vec3_sub(mesh->V + 3 * F[2], mesh->V + 3 * F[0], v);
    vec3_cross(u, v, normal);
    b->area[lane] = 0.5 * vec3_normalise(normal);
    face_centre(mesh, f, centre);
    for (size_t k = 0; k < 3; k++) {
        b->centre[k][lane] = centre[k];
        b->normal[k][lane] = normal[k];
    }
}

/* The ball around the first n centres of a block; other lanes get faces that look nowhere. */
static void close_block(block *b, size_t n)
{
    b->radius = 0.0;
    for (size_t l = n; l < LANES; l++) {
        b->area[l] = 0.0;
        for (size_t k = 0; k < 3; k++) b->centre[k][l] = b->centre[k][0], b->normal[k][l] = 0.0;
    }
    for (size_t k = 0; k < 3; k++) {
        double lo = b->centre[k][0], hi = lo;
        for (size_t l = 1; l < n; l++) {
            lo = fmin(lo, b->centre[k][l]);
            hi = fmax(hi, b->centre[k][l]);
        }
        b->middle[k] = 0.5 * (lo + hi);
    }
    for (size_t l = 0; l < n; l++) {
        const double c[3] = { b->centre[0][l], b->centre[1][l], b->centre[2][l] };
        b->radius = fmax(b->radius, sqrt(vec3_distance2(c, b->middle)));
    }
}

void apsm_form_faces(const apsm_mesh *mesh, double *faces)
{
    block *b = (block *)(void *)faces;
    uint32_t start[CELLS + 1] = { 0 };
    double lo[3], hi[3];
    if (mesh->nf == 0) return;
    apsm_mesh_bounds(mesh, lo, hi);
    for (size_t f = 0; f < mesh->nf; f++) start[cell_of(mesh, f, lo, hi) + 1]++;
    for (size_t c = 0; c < CELLS; c++) start[c + 1] += start[c];
    for (size_t f = 0; f < mesh->nf; f++) {
        const size_t at = start[cell_of(mesh, f, lo, hi)]++;
        put_face(mesh, f, b + at / LANES, at % LANES);
    }
    for (size_t k = 0; k < blocks_of(mesh->nf); k++)
        close_block(b + k, k + 1 < blocks_of(mesh->nf) ? LANES : mesh->nf - LANES * k);
}

/* Sums around one point, by scale and lane. */
typedef struct height_sums {
    double height[APSM_FORM_SCALES][LANES], area[APSM_FORM_SCALES][LANES];
    double count[APSM_FORM_SCALES][LANES];
} height_sums;

/* Adds a block's faces that look the same way as n, within the radii (squares in r2) of p. */
KERNEL_INLINE void add_block(const block *restrict b, const double p[3], const double n[3],
                             const double r2[APSM_FORM_SCALES], height_sums *restrict s)
{
#pragma omp simd
    for (size_t l = 0; l < LANES; l++) {
        const double x = b->centre[0][l] - p[0], y = b->centre[1][l] - p[1],
                     z = b->centre[2][l] - p[2];
        const double d2 = x * x + y * y + z * z, up = x * n[0] + y * n[1] + z * n[2];
        const double facing =
            b->normal[0][l] * n[0] + b->normal[1][l] * n[1] + b->normal[2][l] * n[2];
        const double same = facing > 0.0 ? 1.0 : 0.0, area = same * b->area[l];
        for (size_t k = 0; k < APSM_FORM_SCALES; k++) {
            s->height[k][l] += d2 < r2[k] ? area * up : 0.0;
            s->area[k][l] += d2 < r2[k] ? area : 0.0;
            s->count[k][l] += d2 < r2[k] ? same : 0.0;
        }
    }
}

/* The sums around p over the blocks that reach near enough. */
APSM_KERNEL static void sum_around(size_t blocks, const block *b, const double p[3],
                                   const double n[3], const double r2[APSM_FORM_SCALES],
                                   double farthest, height_sums *s)
{
    for (size_t k = 0; k < blocks; k++) {
        const double reach = farthest + b[k].radius;
        const double x = b[k].middle[0] - p[0], y = b[k].middle[1] - p[1],
                     z = b[k].middle[2] - p[2];
        if (x * x + y * y + z * z < reach * reach) add_block(b + k, p, n, r2, s);
    }
}

static double add_lanes(const double lane[LANES])
{
    double sum = 0.0;
    for (size_t l = 0; l < LANES; l++) sum += lane[l];
    return sum;
}

/* The heights around one point. */
static void heights_at(size_t nf, const double *faces, const double p[3], const double n[3],
                       double h, double *height)
{
    height_sums sums = { 0 };
    double r[APSM_FORM_SCALES], r2[APSM_FORM_SCALES];
    for (size_t k = 0; k < APSM_FORM_SCALES; k++) {
        r[k] = apsm_form_radius[k] * h;
        r2[k] = r[k] * r[k];
    }
    const double slack = 1.0 + 1e-12; /* so that rounding leaves no block out */
    sum_around(blocks_of(nf), (const block *)(const void *)faces, p, n, r2,
               slack * r[APSM_FORM_SCALES - 1], &sums);
    for (size_t k = 0; k < APSM_FORM_SCALES; k++) {
        const double area = add_lanes(sums.area[k]), count = add_lanes(sums.count[k]);
        height[k] =
            count >= LEAST_FACES && area > 0.0 ? add_lanes(sums.height[k]) / (area * r[k]) : 0.0;
    }
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
