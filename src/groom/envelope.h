/* envelope.h -- squared distances along one line of nodes, the step of a distance transform. */
#ifndef APSM_GROOM_ENVELOPE_H
#define APSM_GROOM_ENVELOPE_H

#include <stddef.h>

#include "apsm/status.h"

/* Scratch of a line of up to n nodes; f holds the line. */
typedef struct envelope {
    double *f, *z;
    size_t *v;
} envelope;

apsm_status envelope_new(size_t n, envelope *e) APSM_NODISCARD;
void envelope_free(envelope *e);
/* e->f (n) <- min over q of f(q) + h^2 (p - q)^2; all INFINITY stays so.  O(n). */
void envelope_line(size_t n, double h, const envelope *e);

#endif
