/* Plants what goes wrong with segmentations into one shape, for benchmarks/trust/inputs:
 *
 *   plant_fault FAULT SIZE SEED VOXELS IN.ply OUT.nrrd [OTHER.ply]
 *
 * OUT.nrrd is the mask of IN.ply, VOXELS along the longest side of its box, with the FAULT; lengths
 * SIZE are shares of the box's diagonal, "there" is a vertex that SEED draws, a tip the farthest in
 * a drawn direction.  none; cut (that share of the longest axis is missing at one end); gap (that
 * share of it, in the middle); tip (a ball about a tip is missing), bite (about there), spur (a
 * ball there is added), leak (a chain of them, from there outwards), rod (a pin that sticks out of
 * a tip by SIZE); bone (OTHER, beside it, has grown together with it), pair (OTHER, SIZE away, is
 * in the same mask); units (all lengths times SIZE), slices (the spacing of slices is wrong by that
 * factor), stairs (the upper half of the slices is shifted); smooth (blurred over that length),
 * drill (a hole through, of that radius), shell (only a wall of that thickness, open at a tip),
 * swollen (grown by SIZE all round), wrong (mirrored, and turned by SIZE degrees), stretch (by SIZE
 * along the longest axis, thinner across: of another kind). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/context.h"
#include "apsm/formats.h"
#include "core/random.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "mesh_mask.h"

typedef struct plant {
    double size, diagonal;
    apsm_random rng;
    apsm_mesh mesh, other;
    double middle[3], axis[9]; /* principal axes, a column each */
    double voxel;
    apsm_volume mask;
    double there[3], out[3]; /* a vertex and which way is out; or the tip and its direction */
} plant;

static void look(plant *p)
{
    const apsm_mesh *m = &p->mesh;
    double lo[3], hi[3], C[9] = { 0 }, s[3], V[9];
    apsm_mesh_bounds(m, lo, hi);
    p->diagonal = sqrt(vec3_distance2(lo, hi));
    memset(p->middle, 0, sizeof p->middle);
    for (size_t k = 0; k < 3 * m->nv; k++) p->middle[k % 3] += m->V[k] / (double)m->nv;
    for (size_t k = 0; k < m->nv; k++)
        for (size_t a = 0; a < 9; a++)
            C[a] +=
                (m->V[3 * k + a / 3] - p->middle[a / 3]) * (m->V[3 * k + a % 3] - p->middle[a % 3]);
    apsm_svd3(C, p->axis, s, V);
}

static double along(const plant *p, const double *x, size_t axis)
{
    double sum = 0;
    for (size_t c = 0; c < 3; c++) sum += (x[c] - p->middle[c]) * p->axis[3 * c + axis];
    return sum;
}

static void draw_there(plant *p)
{
    memcpy(p->there, p->mesh.V + 3 * apsm_random_below(&p->rng, p->mesh.nv), sizeof p->there);
    for (int c = 0; c < 3; c++) p->out[c] = p->there[c] - p->middle[c];
    vec3_normalise(p->out);
}

static void draw_tip(plant *p)
{
    double most = -INFINITY;
    for (int c = 0; c < 3; c++) p->out[c] = apsm_random_normal(&p->rng);
    vec3_normalise(p->out);
    for (size_t v = 0; v < p->mesh.nv; v++) {
        const double far = vec3_dot(p->out, p->mesh.V + 3 * v);
        if (far > most) memcpy(p->there, p->mesh.V + 3 * v, sizeof p->there), most = far;
    }
}

/* ---- masks ---- */

static size_t voxels(const apsm_volume *v)
{
    return v->n[0] * v->n[1] * v->n[2];
}

static void place(const apsm_volume *v, size_t at, double x[3])
{
    const size_t k[3] = { at % v->n[0], at / v->n[0] % v->n[1], at / v->n[0] / v->n[1] };
    for (int c = 0; c < 3; c++) x[c] = v->origin[c] + v->spacing[c] * (double)k[c];
}

static void widen(apsm_volume *v, size_t by)
{
    const size_t old[3] = { v->n[0], v->n[1], v->n[2] };
    int32_t *label = v->label;
    for (int c = 0; c < 3; c++) {
        v->n[c] += 2 * by;
        v->origin[c] -= v->spacing[c] * (double)by;
    }
    v->label = calloc(voxels(v), sizeof *v->label);
    if (!v->label) exit(1);
    for (size_t k = 0; k < old[2]; k++)
        for (size_t j = 0; j < old[1]; j++)
            memcpy(v->label + by + v->n[0] * (j + by + v->n[1] * (k + by)),
                   label + old[0] * (j + old[1] * k), old[0] * sizeof *label);
    free(label);
}

static void make_mask(plant *p)
{
    const double spacing[3] = { p->voxel, p->voxel, p->voxel };
    p->mask = mesh_mask(&p->mesh, spacing);
}

/* label <- whether the mean over a box of r voxels to either side, taken three times, is above. */
static void blur(apsm_volume *v, size_t r, double above)
{
    const size_t n = voxels(v), step[3] = { 1, v->n[0], v->n[0] * v->n[1] };
    float *x = calloc(2 * n, sizeof *x), *y = x + n;
    if (!x) exit(1);
    for (size_t a = 0; a < n; a++) x[a] = (float)v->label[a];
    for (int pass = 0; pass < 9; pass++) {
        const size_t c = (size_t)pass % 3;
        for (size_t a = 0; a < n; a++) {
            const size_t at = a / step[c] % v->n[c];
            double sum = 0;
            for (size_t k = at > r ? at - r : 0; k <= at + r && k < v->n[c]; k++)
                sum += x[a + step[c] * k - step[c] * at];
            y[a] = (float)(sum / (double)(2 * r + 1));
        }
        memcpy(x, y, n * sizeof *x);
    }
    for (size_t a = 0; a < n; a++) v->label[a] = x[a] > above;
    free(x);
}

static void add_other(plant *p, double gap)
{
    const apsm_mesh *m = &p->other;
    double step[3], most = -INFINITY, least = INFINITY;
    for (size_t c = 0; c < 3; c++) step[c] = p->axis[3 * c + 2];
    for (size_t v = 0; v < p->mesh.nv; v++) most = fmax(most, vec3_dot(step, p->mesh.V + 3 * v));
    for (size_t v = 0; v < m->nv; v++) least = fmin(least, vec3_dot(step, m->V + 3 * v));
    for (size_t v = 0; v < m->nv; v++) vec3_add_scaled(m->V + 3 * v, most - least + gap, step);
    const double spacing[3] = { p->voxel, p->voxel, p->voxel };
    apsm_volume other = mesh_mask(m, spacing);
    for (size_t a = 0; a < voxels(&other); a++) {
        double x[3];
        size_t at[3];
        bool in = other.label[a];
        place(&other, a, x);
        for (int c = 0; c < 3; c++) {
            const double k = (x[c] - p->mask.origin[c]) / p->voxel;
            in = in && k >= 0 && k < (double)p->mask.n[c] - 1;
            at[c] = in ? (size_t)(k + 0.5) : 0;
        }
        if (in) p->mask.label[at[0] + p->mask.n[0] * (at[1] + p->mask.n[1] * at[2])] = 1;
    }
    apsm_volume_free(&other);
}

/* ---- faults ---- */

static void plant_cut(plant *p, bool middle)
{
    double lo = INFINITY, hi = -INFINITY;
    for (size_t v = 0; v < p->mesh.nv; v++) {
        const double s = along(p, p->mesh.V + 3 * v, 0);
        lo = fmin(lo, s);
        hi = fmax(hi, s);
    }
    const bool low = apsm_random_below(&p->rng, 2) == 0;
    const double from = middle ? 0.5 * (1 - p->size) : low ? 0 : 1 - p->size;
    for (size_t a = 0; a < voxels(&p->mask); a++) {
        double x[3];
        place(&p->mask, a, x);
        const double s = (along(p, x, 0) - lo) / (hi - lo);
        if (s >= from && s <= from + p->size) p->mask.label[a] = 0;
    }
}

static void plant_ball(plant *p, int32_t label)
{
    mask_blob(&p->mask, p->there, p->size * p->diagonal, label);
}

static void plant_leak(plant *p)
{
    double x[3], way[3];
    memcpy(x, p->there, sizeof x);
    for (int k = 0; k < 8; k++) {
        const double radius = p->size * p->diagonal * (0.3 + 0.3 * apsm_random_uniform(&p->rng));
        mask_blob(&p->mask, x, radius, 1);
        for (int c = 0; c < 3; c++) way[c] = p->out[c] + 0.7 * apsm_random_normal(&p->rng);
        vec3_normalise(way);
        vec3_add_scaled(x, 0.8 * radius, way);
    }
}

static void plant_rod(plant *p, double radius, double from, double to, int32_t label)
{
    for (size_t a = 0; a < voxels(&p->mask); a++) {
        double x[3], d[3];
        place(&p->mask, a, x);
        for (int c = 0; c < 3; c++) d[c] = x[c] - p->there[c];
        const double s = vec3_dot(d, p->out) / p->diagonal;
        if (s < from || s > to) continue;
        vec3_add_scaled(d, -s * p->diagonal, p->out);
        if (vec3_norm(d) <= radius * p->diagonal) p->mask.label[a] = label;
    }
}

static void plant_stairs(plant *p)
{
    apsm_volume *v = &p->mask;
    const size_t by = (size_t)(p->size * p->diagonal / p->voxel + 0.5);
    for (size_t row = v->n[1] * (v->n[2] / 2); row < v->n[1] * v->n[2]; row++) {
        int32_t *x = v->label + v->n[0] * row;
        memmove(x + by, x, (v->n[0] - by) * sizeof *x);
        memset(x, 0, by * sizeof *x);
    }
}

static size_t in_voxels(const plant *p)
{
    const double r = p->size * p->diagonal / p->voxel;
    return r > 1 ? (size_t)(r + 0.5) : 1;
}

static void plant_shell(plant *p)
{
    apsm_volume inner;
    apsm_context *ctx = apsm_context_new();
    if (!ctx || apsm_volume_copy(&p->mask, &inner) != APSM_OK) exit(1);
    blur(&inner, in_voxels(p), 0.95);
    for (size_t a = 0; a < voxels(&p->mask); a++) p->mask.label[a] -= inner.label[a];
    plant_rod(p, 0.06, -0.3, 0.5, 0);
    apsm_volume_free(&inner);
    apsm_context_free(ctx);
}

static void plant_in_mesh(plant *p, const char *fault)
{
    apsm_mesh *m = &p->mesh;
    const bool stretch = strcmp(fault, "stretch") == 0, wrong = strcmp(fault, "wrong") == 0;
    for (size_t v = 0; v < m->nv && stretch; v++) {
        double *x = m->V + 3 * v, s[3];
        for (size_t a = 0; a < 3; a++) s[a] = along(p, x, a) / (a ? sqrt(p->size) : 1 / p->size);
        memcpy(x, p->middle, 3 * sizeof *x);
        for (size_t c = 0; c < 9; c++) x[c / 3] += p->axis[c] * s[c % 3];
    }
    const double half = p->size * M_PI / 360, n = sin(half) / sqrt(14);
    const double q[4] = { cos(half), n, 2 * n, 3 * n };
    for (size_t v = 0; v < m->nv && wrong; v++) {
        double *x = m->V + 3 * v, u[3] = { q[1], q[2], q[3] }, a[3], b[3];
        x[0] = -x[0];
        vec3_cross(u, x, a);
        vec3_cross(u, a, b);
        for (int c = 0; c < 3; c++) x[c] += 2 * (q[0] * a[c] + b[c]);
    }
}

static bool plant_in_mask(plant *p, const char *fault)
{
    const bool tip = strstr("tip rod shell", fault) != NULL;
    tip ? draw_tip(p) : draw_there(p);
    if (strcmp(fault, "cut") == 0 || strcmp(fault, "gap") == 0)
        plant_cut(p, *fault == 'g');
    else if (strcmp(fault, "tip") == 0 || strcmp(fault, "bite") == 0)
        plant_ball(p, 0);
    else if (strcmp(fault, "spur") == 0)
        plant_ball(p, 1);
    else if (strcmp(fault, "leak") == 0)
        plant_leak(p);
    else if (strcmp(fault, "rod") == 0)
        plant_rod(p, 0.03, -0.2, p->size, 1);
    else if (strcmp(fault, "drill") == 0)
        plant_rod(p, p->size, -2, 2, 0);
    else if (strcmp(fault, "bone") == 0 || strcmp(fault, "pair") == 0)
        add_other(p, *fault == 'b' ? -p->size * p->diagonal : p->size * p->diagonal);
    else if (strcmp(fault, "stairs") == 0)
        plant_stairs(p);
    else if (strcmp(fault, "smooth") == 0)
        blur(&p->mask, in_voxels(p), 0.5);
    else if (strcmp(fault, "swollen") == 0)
        blur(&p->mask, in_voxels(p), 0.1);
    else if (strcmp(fault, "shell") == 0)
        plant_shell(p);
    else if (strcmp(fault, "units") == 0)
        for (int c = 0; c < 3; c++) p->mask.spacing[c] *= p->size, p->mask.origin[c] *= p->size;
    else if (strcmp(fault, "slices") == 0)
        p->mask.spacing[2] *= p->size;
    else
        return strstr("none stretch wrong", fault) != NULL;
    return true;
}

static apsm_status run(apsm_context *ctx, int argc, char **argv)
{
    plant p = { .size = strtod(argv[2], NULL) };
    double lo[3], hi[3];
    APSM_TRY(apsm_read_mesh(ctx, argv[5], &p.mesh));
    if (argc > 7) APSM_TRY(apsm_read_mesh(ctx, argv[7], &p.other));
    p.rng = apsm_random_stream(strtoull(argv[3], NULL, 10), APSM_STREAM_TEST, 77, 0);
    look(&p);
    apsm_mesh_bounds(&p.mesh, lo, hi);
    p.voxel = fmax(hi[0] - lo[0], fmax(hi[1] - lo[1], hi[2] - lo[2])) / strtod(argv[4], NULL);
    plant_in_mesh(&p, argv[1]);
    make_mask(&p);
    const bool room = strstr("none cut gap tip bite drill", argv[1]) == NULL;
    if (room) widen(&p.mask, (size_t)(0.6 * p.diagonal / p.voxel));
    apsm_status status = plant_in_mask(&p, argv[1]) ? APSM_OK : APSM_ERR_ARG;
    if (status == APSM_OK) status = apsm_write_volume(ctx, argv[6], &p.mask);
    apsm_volume_free(&p.mask);
    apsm_mesh_free(&p.mesh);
    apsm_mesh_free(&p.other);
    return status;
}

int main(int argc, char **argv)
{
    apsm_context *ctx = argc < 7 ? NULL : apsm_context_new();
    if (!ctx) {
        fprintf(stderr, "usage: plant_fault FAULT SIZE SEED VOXELS IN.ply OUT.nrrd [OTHER.ply]\n");
        return 2;
    }
    const apsm_status status = run(ctx, argc, argv);
    if (status != APSM_OK) fprintf(stderr, "plant_fault: %s\n", apsm_error_text(ctx));
    apsm_context_free(ctx);
    return status != APSM_OK;
}
