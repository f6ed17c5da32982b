/* left_out.h -- where a shape's particles ought to be, by the modes of the other shapes. */
#ifndef APSM_JUDGE_LEFT_OUT_H
#define APSM_JUDGE_LEFT_OUT_H

#include <stddef.h>

#include "apsm/status.h"

enum { APSM_LEFT_OUT_MODES = 6, APSM_LEFT_OUT_SHAPES = 64, APSM_LEFT_OUT_DEGREES = 3 };

/* Scratch in doubles for particles J x 3. */
size_t apsm_left_out_work_size(size_t J);

/* r (J x 3, out): particles of shape i less what mean and first modes (at most 6, and half as many
 * as there are shapes) of the others (at most 64, taken evenly) make of them.  P: I x J x 3, in one
 * pose; I >= 3.  work: scratch. */
apsm_status apsm_left_out_residual(size_t I, size_t J, const double *P, size_t i, double *r,
                                   double *work) APSM_NODISCARD;

/* How many of the degrees below can be looked at: coordinates must be twice as many as what could
 * explain them.  0 with 7 to 10 particles, and with 11 and more than 5 shapes. */
size_t apsm_left_out_degrees(size_t I, size_t J);

/* rests (APSM_LEFT_OUT_DEGREES x J x 3, out): what neither the others (at most 64, and half as many
 * as there are particles) nor deformations by polynomials of the first, second, third degree
 * explain; 0 beyond apsm_left_out_degrees.  P, work: as above.  O(J (I + 60)^2). */
void apsm_left_out_rests(size_t I, size_t J, const double *P, size_t i, double *rests,
                         double *work);

#endif
