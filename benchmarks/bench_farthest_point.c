/* Farthest-point sampling of a surface: bench_farthest_point [J ...].  Limit: one search over the
 * whole surface, which the first sample takes. */
#include "surface_scene.h"

int main(int argc, char **argv)
{
    size_t sizes[16] = { 128, 512, 1024 };
    const size_t n = bench_sizes(argc, argv, sizes, 3);
    for (size_t i = 0; i < n; i++) {
        surface_scene s;
        surface_scene_init(&s, sizes[i]);
        const double whole = bench_median(surface_scene_search, &s);
        bench_report("farthest points", s.size, bench_median(surface_scene_spread, &s), (double)s.J,
                     "sample", "one search over the whole surface", whole);
        surface_scene_free(&s);
    }
    return 0;
}
