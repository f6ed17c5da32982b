/* colours.h -- the colours of the report and of pictures. */
#ifndef APSM_REPORT_COLOURS_H
#define APSM_REPORT_COLOURS_H

#include <stddef.h>
#include <stdint.h>

enum { COLOURS_PARTICLE = 10 };

/* Red, green, blue of 0..255 of particle colour c (0..COLOURS_PARTICLE - 1). */
extern const unsigned char colours_particle[COLOURS_PARTICLE][3];

/* chosen[j] <- the colour of particle j of P (J x 3), the same on all shapes: the one whose nearest
 * bearer among the particles before is farthest away, so that neighbours differ and a swap shows.
 * O(J^2). */
void colours_choose(size_t J, const double *P, uint32_t *chosen);

/* rgb (0..1) of displacement t in -1..1: blue inward, orange outward, pale at 0. */
void colours_signed(double t, float rgb[3]);

#endif
