/* Geodesic neighbourhoods of all particles (up to twice the closest) and a pass of Algorithm 1,
 * with every particle in its place and with one in 16 up to 2 h off: bench_neighbourhoods [J ...].
 * Limit: the vertices within those radii at the rate of one search over the whole surface. */
#include "correspond/geodesic_correspondence.h"
#include "surface_scene.h"

typedef struct bench {
    surface_scene s;
    apsm_neighbourhoods rows, reference;
    apsm_walk_options o;
    apsm_walk_work *work;
    apsm_surface_point *points; /* displaced */
    double *P;
    apsm_surface_point *start; /* where a pass begins */
    double *start_P;
} bench;

static void neighbourhoods(void *user)
{
    bench *b = user;
    bench_must(
        apsm_geodesic_neighbourhoods(b->s.g, b->s.w, b->s.J, b->s.points, b->s.P, 2.0, &b->rows));
}

static void pass(void *user)
{
    bench *b = user;
    apsm_walk_report report;
    memcpy(b->points, b->start, b->s.J * sizeof *b->points);
    memcpy(b->P, b->start_P, b->s.J * 3 * sizeof *b->P);
    const apsm_walk_ground ground = { b->s.g, b->s.w, b->s.bvh };
    bench_must(apsm_geodesic_correspondence(&ground, b->s.J, &b->reference, &b->o, b->points, b->P,
                                            b->work, &report));
}

/* Vertices within twice the closest of the particles, and an edge more. */
static double vertices_within(bench *b)
{
    double sum = 0.0;
    for (size_t j = 0; j < b->s.J; j++) {
        bench_must(apsm_geodesic_from(b->s.g, b->s.points + j, 2.0 * b->rows.closest[j], b->s.w));
        for (uint32_t v = 0; v < b->s.mesh.nv; v++)
            sum += apsm_geodesic_vertex_distance(b->s.w, v) <= 2.0 * b->rows.closest[j];
    }
    return sum;
}

static void in_place(bench *b)
{
    memcpy(b->start, b->s.points, b->s.J * sizeof *b->start);
    memcpy(b->start_P, b->s.P, b->s.J * 3 * sizeof *b->start_P);
}

static void displace(bench *b, double h)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    for (size_t j = 0; j < b->s.J; j += 16) {
        double x[3];
        apsm_closest c;
        for (size_t a = 0; a < 3; a++)
            x[a] = b->s.P[3 * j + a] + 2.0 * h * (2.0 * apsm_random_uniform(&rng) - 1.0);
        apsm_bvh_closest(b->s.bvh, x, INFINITY, &c);
        b->start[j] = c.on;
        memcpy(b->start_P + 3 * j, c.x, sizeof c.x);
    }
}

static void measure(size_t J)
{
    bench b = { 0 };
    surface_scene_init(&b.s, J);
    const double h = sqrt(2.0 * apsm_mesh_area(&b.s.mesh) / (sqrt(3.0) * (double)J));
    b.o = apsm_walk_defaults(h);
    b.o.strict = false;
    b.points = bench_alloc(J * sizeof *b.points);
    b.start = bench_alloc(J * sizeof *b.start);
    b.P = bench_doubles(3 * J);
    b.start_P = bench_doubles(3 * J);
    bench_must(apsm_walk_work_new(J, &b.work));
    bench_must(apsm_geodesic_neighbourhoods(b.s.g, b.s.w, J, b.s.points, b.s.P,
                                            APSM_REFERENCE_FACTOR, &b.reference));
    const double whole = bench_median(surface_scene_search, &b.s);
    const double all = bench_median(neighbourhoods, &b);
    const double limit = vertices_within(&b) / (double)b.s.mesh.nv * whole;
    const char *what = "their vertices at the rate of a whole search";
    bench_report("geodesic neighbourhoods", b.s.size, all, (double)J, "particle", what, limit);
    in_place(&b);
    bench_report("pass of Algorithm 1", b.s.size, bench_median(pass, &b), (double)J, "particle",
                 what, limit);
    displace(&b, h);
    bench_report("pass of Algorithm 1, 1 in 16 displaced", b.s.size, bench_median(pass, &b),
                 (double)J, "particle", what, limit);
    free(b.points);
    free(b.start);
    free(b.P);
    free(b.start_P);
    apsm_walk_work_free(b.work);
    apsm_neighbourhoods_free(&b.rows);
    apsm_neighbourhoods_free(&b.reference);
    surface_scene_free(&b.s);
}

int main(int argc, char **argv)
{
    size_t sizes[16] = { 128, 512, 1024 };
    const size_t n = bench_sizes(argc, argv, sizes, 3);
    for (size_t i = 0; i < n; i++) measure(sizes[i]);
    return 0;
}
