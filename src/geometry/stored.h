/* stored.h -- lists the arrays of what this room makes (core/arrays.h). */
#ifndef APSM_GEOMETRY_STORED_H
#define APSM_GEOMETRY_STORED_H

#include "core/arrays.h"
#include "geometry/bvh.h"
#include "geometry/distance_field.h"
#include "geometry/geodesic.h"

void mesh_arrays(apsm_mesh *mesh, array_list *list);
void topology_arrays(apsm_topology *topology, array_list *list);
void bvh_arrays(apsm_bvh *bvh, array_list *list);
void field_arrays(apsm_field *field, array_list *list);
void geodesic_arrays(apsm_geodesic *g, array_list *list);

#endif
