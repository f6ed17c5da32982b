/* polydata.h -- between VTK's poly data and apsm_mesh. */
#ifndef APSM_ADAPTERS_VTK_POLYDATA_H
#define APSM_ADAPTERS_VTK_POLYDATA_H

#include "../guard.h"
#include "apsm/mesh.h"

class vtkPolyData;

namespace apsm
{

/* VTK reports errors to a window of its own; ours come back as a line, so it is told to be
 * silent.  Called before any other use of VTK. */
void silence_vtk();

/* The polygons of data, which must all be triangles of existing points.  Throws failure. */
void mesh_of_polydata(vtkPolyData *data, apsm_mesh *mesh);

} // namespace apsm
#endif
