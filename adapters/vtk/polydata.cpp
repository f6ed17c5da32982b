#include "polydata.h"

#include <cmath>

#include <vtkCellArray.h>
#include <vtkCellArrayIterator.h>
#include <vtkObject.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>

namespace apsm
{

void silence_vtk()
{
    vtkObject::SetGlobalWarningDisplay(0);
}

void mesh_of_polydata(vtkPolyData *data, apsm_mesh *mesh)
{
    const vtkIdType nv = data->GetNumberOfPoints(), nf = data->GetNumberOfPolys();
    apsm_mesh m{};
    if (apsm_mesh_alloc(&m, static_cast<size_t>(nv), static_cast<size_t>(nf)) != APSM_OK)
        throw std::bad_alloc();
    for (vtkIdType v = 0; v < nv; v++) data->GetPoint(v, m.V + 3 * v);
    const auto polygons = vtk::TakeSmartPointer(data->GetPolys()->NewIterator());
    size_t f = 0;
    for (polygons->GoToFirstCell(); !polygons->IsDoneWithTraversal(); polygons->GoToNextCell()) {
        vtkIdType corners;
        const vtkIdType *ids;
        polygons->GetCurrentCell(corners, ids);
        for (vtkIdType c = 0; c < 3; c++) {
            if (corners != 3 || ids[c] < 0 || ids[c] >= nv) {
                apsm_mesh_free(&m);
                damaged("cell " + std::to_string(f) + " is not a triangle of its points");
            }
            m.F[3 * f + static_cast<size_t>(c)] = static_cast<uint32_t>(ids[c]);
        }
        f++;
    }
    *mesh = m;
}

} // namespace apsm
