/* order.h -- the faces of a mesh in an order in which each is beside the one before. */
#ifndef APSM_REPORT_ORDER_H
#define APSM_REPORT_ORDER_H

#include "apsm/mesh.h"

/* Renumbers vertices by their first use and turns faces (keeping their side) so that numbers that
 * follow each other are near each other: the mesh stays the same, and packs to half the bytes.
 * Vertices without a face go.  old (nv; NULL: not wanted): what vertices were numbered.  O(nf). */
apsm_status order_mesh(apsm_mesh *mesh, uint32_t *old);

#endif
