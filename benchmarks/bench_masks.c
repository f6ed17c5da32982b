/* How near the surface of a coarse mask comes to the truth:
 *
 *   bench_masks X Y Z [COUNT [SEED [NOISE [KIND ...]]]]
 *
 * Shapes of synthetic kinds (anatomy.h) turned by up to 40 degrees are made into masks of voxels X
 * x Y x Z and groomed.  One line of JSON a kind: root mean square and largest two-way distance
 * from the true surface in units of the shortest voxel edge, relative errors of volume against the
 * truth and the mask, Dice with the mask, and CPU seconds a shape; means over COUNT shapes (4).
 * NOISE (0): as drawn by hand, see draw_by_hand. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "anatomy.h"
#include "geometry/bvh.h"
#include "geometry/face.h"
#include "groom/groom.h"
#include "mesh_mask.h"

typedef struct tally {
    double rms, most, volume, mask_volume, dice, seconds, genus;
} tally;

static void must(apsm_context *ctx, apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "bench_masks: %s: %s\n", apsm_status_text(status), apsm_error_text(ctx));
    exit(1);
}

/* Adds the squared distances of the middles of a's faces, weighted by area, from b. */
static void one_way(apsm_context *ctx, const apsm_mesh *a, const apsm_mesh *b, double sum[2],
                    double *most)
{
    apsm_bvh *tree = NULL;
    must(ctx, apsm_bvh_build_unsigned(b, &tree));
    for (size_t f = 0; f < a->nf; f++) {
        const apsm_surface_point p = { (uint32_t)f, { 1.0 / 3, 1.0 / 3, 1.0 / 3 } };
        apsm_closest c;
        double x[3];
        apsm_surface_position(a, &p, x);
        apsm_bvh_closest(tree, x, INFINITY, &c);
        const double area = face_area(a, f);
        sum[0] += area * c.distance2;
        sum[1] += area;
        *most = fmax(*most, sqrt(c.distance2));
    }
    apsm_bvh_free(tree);
}

/* A hand that draws slice by slice: in every slice the border wanders by `noise` (root mean
 * square), smoothly along it (over some ten units) and independently of the other slices. */
static void draw_by_hand(apsm_context *ctx, const apsm_mesh *truth, double noise, apsm_volume *v)
{
    enum { WAVES = 6 };
    const double unit = fmin(v->spacing[0], fmin(v->spacing[1], v->spacing[2]));
    apsm_bvh *tree = NULL;
    must(ctx, apsm_bvh_build(truth, &tree));
    size_t i = 0;
    for (size_t z = 0; z < v->n[2]; z++) {
        apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, z, 9);
        double k[WAVES][2], phase[WAVES];
        for (int w = 0; w < WAVES; w++) {
            k[w][0] = apsm_random_normal(&rng) / (3 * unit);
            k[w][1] = apsm_random_normal(&rng) / (3 * unit);
            phase[w] = 2 * M_PI * apsm_random_uniform(&rng);
        }
        for (size_t y = 0; y < v->n[1]; y++)
            for (size_t x = 0; x < v->n[0]; x++, i++) {
                const double p[3] = { v->origin[0] + v->spacing[0] * (double)x,
                                      v->origin[1] + v->spacing[1] * (double)y,
                                      v->origin[2] + v->spacing[2] * (double)z };
                apsm_closest c;
                double off = 0;
                apsm_bvh_closest(tree, p, 9 * noise * noise * unit * unit, &c);
                if (!(c.distance2 < 9 * noise * noise * unit * unit)) continue;
                for (int w = 0; w < WAVES; w++)
                    off += cos(k[w][0] * p[0] + k[w][1] * p[1] + phase[w]) * sqrt(2.0 / WAVES);
                v->label[i] = (v->label[i] ? -1 : 1) * sqrt(c.distance2) + noise * unit * off < 0.0;
            }
    }
    apsm_bvh_free(tree);
}

static void measure(apsm_context *ctx, const apsm_mesh *truth, const double spacing[3],
                    double noise, tally *t)
{
    const double unit = fmin(spacing[0], fmin(spacing[1], spacing[2]));
    apsm_groom_options opt = apsm_groom_defaults();
    apsm_groom_report r;
    apsm_mesh mesh;
    double sum[2] = { 0 }, most = 0;
    apsm_volume v = mesh_mask(truth, spacing);
    if (noise > 0) draw_by_hand(ctx, truth, noise, &v);
    const clock_t from = clock();
    must(ctx, apsm_groom_segmentation(ctx, "mask", &v, &opt, &mesh, &r));
    t->seconds += (double)(clock() - from) / CLOCKS_PER_SEC;
    one_way(ctx, &mesh, truth, sum, &most);
    one_way(ctx, truth, &mesh, sum, &most);
    t->rms += sqrt(sum[0] / sum[1]) / unit;
    t->most += most / unit;
    t->volume += fabs(apsm_mesh_volume(&mesh) / apsm_mesh_volume(truth) - 1);
    t->mask_volume += fabs(apsm_mesh_volume(&mesh) / r.mask_volume - 1);
    t->dice += r.dice;
    t->genus += (double)r.genus;
    apsm_mesh_free(&mesh);
    apsm_volume_free(&v);
}

static void bench_kind(apsm_context *ctx, anatomy_kind kind, const double spacing[3], double noise,
                       size_t n, uint64_t seed)
{
    const anatomy_spread spread = { .strength = 1, .turn = 40 };
    tally t = { 0 };
    apsm_mesh template_mesh, mesh;
    must(ctx, anatomy_template(ctx, kind, 0.6, -INFINITY, &template_mesh));
    for (size_t i = 0; i < n; i++) {
        const anatomy_map map = anatomy_draw(kind, seed, i, &spread);
        must(ctx, apsm_mesh_copy(&template_mesh, &mesh));
        anatomy_apply(&map, &mesh);
        measure(ctx, &mesh, spacing, noise, &t);
        apsm_mesh_free(&mesh);
    }
    const double m = (double)n;
    printf("{\"kind\":\"%s\",\"voxels\":[%g,%g,%g],\"rms\":%.4f,\"max\":%.3f,\"volume\":%.5f,"
           "\"mask_volume\":%.5f,\"dice\":%.4f,\"genus\":%.2f,\"cpu_s\":%.2f}\n",
           anatomy_name(kind), spacing[0], spacing[1], spacing[2], t.rms / m, t.most / m,
           t.volume / m, t.mask_volume / m, t.dice / m, t.genus / m, t.seconds / m);
    fflush(stdout);
    apsm_mesh_free(&template_mesh);
}

int main(int argc, char **argv)
{
    static const char *const usual[] = { "femur", "liver", "kidney", "vertebra", "fibula" };
    double spacing[3];
    if (argc < 4) return 2;
    apsm_context *ctx = apsm_context_new();
    if (!ctx) return 1;
    for (int c = 0; c < 3; c++) spacing[c] = atof(argv[1 + c]);
    const size_t n = argc > 4 ? (size_t)atoi(argv[4]) : 4;
    const uint64_t seed = argc > 5 ? (uint64_t)atoi(argv[5]) : 1;
    const double noise = argc > 6 ? atof(argv[6]) : 0;
    const int given = argc - 7, kinds = given > 0 ? given : (int)(sizeof usual / sizeof *usual);
    for (int k = 0; k < kinds; k++) {
        const anatomy_kind kind = anatomy_find(given > 0 ? argv[7 + k] : usual[k]);
        if (kind == ANATOMY_KINDS) return 2;
        bench_kind(ctx, kind, spacing, noise, n, seed);
    }
    apsm_context_free(ctx);
    return 0;
}
