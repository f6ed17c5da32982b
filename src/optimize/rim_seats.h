/* rim_seats.h -- the template's particles on the rim of an open surface. */
#ifndef APSM_OPTIMIZE_RIM_SEATS_H
#define APSM_OPTIMIZE_RIM_SEATS_H

#include "initialize/cohort.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Of particles T (J x 3, in and out), spread over an open shape: on every loop of the rim places as
 * far apart as particles are take the nearest particle each, and others that lie on the rim leave
 * it inwards.  A loop shorter than three spacings gets none.  O(J^2). */
apsm_status apsm_seat_rim(const apsm_shape *shape, size_t J, double *T) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
