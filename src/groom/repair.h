/* repair.h -- the steps of apsm_repair, in their order.  Each takes a mesh it may edit (it owns
 * its arrays) and adds what it did to the report. */
#ifndef APSM_GROOM_REPAIR_H
#define APSM_GROOM_REPAIR_H

#include "geometry/face.h"
#include "geometry/topology.h"
#include "groom/groom.h"

typedef struct repair {
    apsm_context *ctx;
    const char *name; /* of the shape, for messages */
    const apsm_groom_options *opt;
    apsm_groom_report *report;
    apsm_mesh mesh;
} repair;

/* Vertices closer than opt->merge diagonals become one (the one with the smallest number). */
apsm_status repair_weld(repair *r) APSM_NODISCARD;
/* Removes faces with a repeated corner and faces that occur twice. */
apsm_status repair_faces(repair *r) APSM_NODISCARD;
/* Resolves edges with more than two faces and vertices where fans only touch; afterwards every
 * edge has one or two faces and every vertex one fan. */
apsm_status repair_stitch(repair *r) APSM_NODISCARD;
/* Turns faces so that neighbours agree. */
apsm_status repair_orient(repair *r) APSM_NODISCARD;
/* Keeps the largest part. */
apsm_status repair_parts(repair *r) APSM_NODISCARD;
/* Closes openings. */
apsm_status repair_holes(repair *r) APSM_NODISCARD;
/* Gives the caps, which are the faces from `first` on, vertices of their own. */
apsm_status repair_caps(repair *r, size_t first) APSM_NODISCARD;
/* Edits away faces without area. */
apsm_status repair_slivers(repair *r) APSM_NODISCARD;

/* Removes the faces with drop[f] != 0 (their order is kept) and vertices without a face. */
apsm_status repair_drop(apsm_mesh *mesh, const unsigned char *drop) APSM_NODISCARD;

/* As apsm_groom_mesh; the report, which must be there, is added to. */
apsm_status groom_surface(apsm_context *ctx, const char *name, const apsm_mesh *mesh,
                          const apsm_groom_options *opt, apsm_mesh *mesh_out,
                          apsm_groom_report *report) APSM_NODISCARD;

/* Remeshes a closed surface in place. */
apsm_status groom_remesh(apsm_context *ctx, const char *name, apsm_mesh *mesh,
                         const apsm_remesh_options *opt, apsm_remesh_report *report) APSM_NODISCARD;

/* Disjoint sets over 0..n-1; the root of a set is its smallest member. */
void sets_init(uint32_t *parent, size_t n);
uint32_t sets_root(uint32_t *parent, uint32_t i);
void sets_join(uint32_t *parent, uint32_t i, uint32_t j);

#endif
