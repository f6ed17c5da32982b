/* Iso-surfaces by VTK's flying edges (Schroeder, Maynard & Geveci 2015).
 *
 * The filter turns its triangles towards smaller values, so they are turned over here.  A grid
 * value equal to the level makes triangles without area, as several cut points fall on that
 * node: such values are moved down to the next float, which no measure notices. */
#include <cmath>
#include <limits>

#include <vtkCellArray.h>
#include <vtkCellArrayIterator.h>
#include <vtkFloatArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>

#include "apsm/adapters.h"
#include "polydata.h"

using namespace apsm;

namespace
{

void isosurface(const size_t n[3], const float *values, double level, apsm_mesh *mesh)
{
    for (int c = 0; c < 3; c++)
        if (n[c] < 2 || n[c] > 1u << 20)
            throw failure{ APSM_ERR_ARG, "a grid needs 2 to 2^20 nodes along each axis" };
    const vtkIdType count = static_cast<vtkIdType>(n[0] * n[1] * n[2]);
    const float cut = static_cast<float>(level);
    silence_vtk();
    vtkNew<vtkFloatArray> scalars;
    scalars->SetNumberOfValues(count);
    const float below = std::nextafterf(cut, -std::numeric_limits<float>::infinity());
    for (vtkIdType i = 0; i < count; i++) {
        if (!std::isfinite(values[i]))
            throw failure{ APSM_ERR_NONFINITE, "a value of the grid is not finite" };
        scalars->SetValue(i, values[i] == cut ? below : values[i]);
    }
    vtkNew<vtkImageData> image;
    image->SetDimensions(static_cast<int>(n[0]), static_cast<int>(n[1]), static_cast<int>(n[2]));
    image->GetPointData()->SetScalars(scalars);
    vtkNew<vtkFlyingEdges3D> edges;
    edges->SetInputData(image);
    edges->ComputeNormalsOff();
    edges->ComputeGradientsOff();
    edges->ComputeScalarsOff();
    edges->SetValue(0, cut);
    edges->Update();
    if (edges->GetOutput()->GetNumberOfPolys() == 0)
        throw failure{ APSM_ERR_GEOMETRY, "no value lies on the other side of the level" };
    mesh_of_polydata(edges->GetOutput(), mesh);
    for (size_t f = 0; f < mesh->nf; f++) std::swap(mesh->F[3 * f + 1], mesh->F[3 * f + 2]);
}

} // namespace

extern "C" apsm_status apsm_vtk_isosurface(apsm_context *ctx, const size_t n[3],
                                           const float *values, double level, apsm_mesh *mesh)
{
    return guarded(ctx, "iso-surface", [&] { isosurface(n, values, level, mesh); });
}
