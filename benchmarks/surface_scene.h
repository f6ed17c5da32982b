/* surface_scene.h -- J particles by farthest points on an ellipsoid of 10,000 faces or so, ready
 * for searches along the surface. */
#ifndef APSM_BENCHMARKS_SURFACE_SCENE_H
#define APSM_BENCHMARKS_SURFACE_SCENE_H

#include "bench.h"
#include "geometry/bvh.h"
#include "initialize/farthest_point.h"
#include "shapes.h"

typedef struct surface_scene {
    size_t J;
    apsm_mesh mesh;
    apsm_topology topology;
    apsm_bvh *bvh;
    apsm_geodesic *g;
    apsm_geodesic_work *w;
    uint32_t *vertex;           /* J: the particles' */
    apsm_surface_point *points; /* J */
    double *P, *nearest;        /* J x 3; nv */
    double *radius;             /* J */
    char size[64];              /* for bench_report */
} surface_scene;

static void surface_scene_spread(void *user)
{
    surface_scene *s = user;
    bench_must(apsm_farthest_vertices(s->g, s->w, 0, s->J, s->vertex, s->radius, s->nearest));
}

/* The scene must stay at its address. */
static inline void surface_scene_init(surface_scene *s, size_t J)
{
    *s = (surface_scene){ .J = J, .mesh = shape_torus(112, 45, 10.0, 3.0) };
    bench_must(apsm_topology_build(&s->mesh, &s->topology));
    bench_must(apsm_bvh_build(&s->mesh, &s->bvh));
    bench_must(apsm_geodesic_build(&s->mesh, &s->topology, &s->g));
    bench_must(apsm_geodesic_work_new(s->g, &s->w));
    s->vertex = bench_alloc(J * sizeof *s->vertex);
    s->points = bench_alloc(J * sizeof *s->points);
    s->P = bench_doubles(3 * J);
    s->nearest = bench_doubles(s->mesh.nv);
    s->radius = bench_doubles(J);
    snprintf(s->size, sizeof s->size, "\"J\": %zu, \"faces\": %zu", J, s->mesh.nf);
    surface_scene_spread(s);
    for (size_t j = 0; j < J; j++) {
        bench_must(apsm_surface_vertex(&s->topology, s->vertex[j], s->points + j));
        for (int k = 0; k < 3; k++) s->points[j].weight[k] = 0.1 + 0.7 * s->points[j].weight[k];
        apsm_surface_position(&s->mesh, s->points + j, s->P + 3 * j);
    }
}

static inline void surface_scene_free(surface_scene *s)
{
    free(s->vertex);
    free(s->points);
    free(s->P);
    free(s->nearest);
    free(s->radius);
    apsm_geodesic_work_free(s->w);
    apsm_geodesic_free(s->g);
    apsm_bvh_free(s->bvh);
    apsm_topology_free(&s->topology);
    apsm_mesh_free(&s->mesh);
}

/* A search over the whole surface. */
static void surface_scene_search(void *user)
{
    surface_scene *s = user;
    bench_must(apsm_geodesic_from(s->g, s->points, INFINITY, s->w));
}

#endif
