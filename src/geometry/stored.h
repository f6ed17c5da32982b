/* stored.h -- lists the arrays of what this room makes (core/arrays.h). */
#ifndef APSM_GEOMETRY_STORED_H
#define APSM_GEOMETRY_STORED_H

#include "apsm/mesh.h"
#include "core/arrays.h"

struct apsm_topology;
struct apsm_bvh;
struct apsm_field;
struct apsm_geodesic;

void mesh_arrays(apsm_mesh *mesh, array_list *list);
void topology_arrays(struct apsm_topology *topology, array_list *list);
void bvh_arrays(struct apsm_bvh *bvh, array_list *list);
void field_arrays(struct apsm_field *field, array_list *list);
void geodesic_arrays(struct apsm_geodesic *g, array_list *list);

#endif
