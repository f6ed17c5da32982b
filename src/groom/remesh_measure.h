/* remesh_measure.h -- what remeshing did to a surface. */
#ifndef APSM_GROOM_REMESH_MEASURE_H
#define APSM_GROOM_REMESH_MEASURE_H

#include "groom/remesh.h"

/* Fills all of report but edge. */
apsm_status remesh_measure(const apsm_mesh *before, const apsm_bvh *original,
                           const apsm_mesh *after, apsm_remesh_report *report) APSM_NODISCARD;

#endif
