/* raster.h -- triangles and balls to pixels: orthographic, with a depth buffer, several samples a
 * pixel.  Kernels over caller's arrays. */
#ifndef APSM_REPORT_RASTER_H
#define APSM_REPORT_RASTER_H

#include <stddef.h>
#include <stdint.h>

/* Samples along each side of a pixel. */
enum { RASTER_SAMPLES = 3 };

/* Where it is looked from: right, up and to (towards the viewer) are orthonormal; middle is seen at
 * the middle of the picture; scale: samples a unit of length. */
typedef struct raster_view {
    double right[3], up[3], to[3], middle[3], scale;
} raster_view;

/* width x height samples, rows from the top.  Arrays are caller's. */
typedef struct raster {
    size_t width, height;
    float *depth;       /* towards the viewer, in samples; -INFINITY: nothing */
    unsigned char *rgb; /* x 3, of samples with something */
} raster;

/* A surface: vertices V and unit normals N (nv x 3), faces F (nf x 3).  Of `base` colour, or by
 * value (nv, in -1..1, else NULL) in the colours of displacement. */
typedef struct raster_surface {
    size_t nv, nf;
    const double *V, *N;
    const uint32_t *F;
    const double *value;
    float base[3];
} raster_surface;

void raster_clear(raster *r);
/* scratch: 3 nv floats. */
void raster_draw_surface(raster *r, const raster_view *view, const raster_surface *s,
                         float *scratch);
void raster_draw_ball(raster *r, const raster_view *view, const double centre[3], double radius,
                      const unsigned char colour[3]);

/* Pixels rgb (stride bytes a row) <- means of the samples over what is there already (the ground),
 * with hollows darkened: where a pixel lies behind the mean depth around it.  width and height of r
 * are multiples of RASTER_SAMPLES.  scratch: 4 floats a pixel. */
void raster_resolve(const raster *r, unsigned char *rgb, size_t stride, float *scratch);

#endif
