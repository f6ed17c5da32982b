/* Iso-surfaces by VTK's flying edges (Schroeder, Maynard & Geveci 2015).
 *
 * The filter turns its triangles towards smaller values, so they are turned over here.  A node
 * whose value is the level, or nearly, makes triangles without area, as the surface cuts all edges
 * at that node in one place.  So each value is kept away from the level by a thousandth of its
 * largest step to a neighbour: the surface moves by at most a thousandth of a voxel, and values
 * do not change sides (the level itself counts as inside). */
#include <algorithm>
#include <cmath>

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

/* The largest step from node i = (x[0], x[1], x[2]) to one of its six neighbours. */
float largest_step(const size_t n[3], const float *values, size_t i, const size_t x[3])
{
    float step = 0.0f;
    size_t stride = 1;
    for (int c = 0; c < 3; stride *= n[c++]) {
        if (x[c] > 0) step = std::max(step, std::fabs(values[i] - values[i - stride]));
        if (x[c] + 1 < n[c]) step = std::max(step, std::fabs(values[i] - values[i + stride]));
    }
    return step;
}

/* Values minus the level, none of them nearly 0. */
void set_scalars(const size_t n[3], const float *values, float level, vtkFloatArray *scalars)
{
    scalars->SetNumberOfValues(static_cast<vtkIdType>(n[0] * n[1] * n[2]));
    size_t i = 0, x[3];
    for (x[2] = 0; x[2] < n[2]; x[2]++)
        for (x[1] = 0; x[1] < n[1]; x[1]++)
            for (x[0] = 0; x[0] < n[0]; x[0]++, i++) {
                if (!std::isfinite(values[i]))
                    throw failure{ APSM_ERR_NONFINITE, "a value of the grid is not finite" };
                const float least = 1e-3f * largest_step(n, values, i, x);
                const float d = values[i] - level;
                const float kept = std::max(std::fabs(d), least);
                scalars->SetValue(static_cast<vtkIdType>(i), d > 0.0f ? kept : -kept);
            }
}

void isosurface(const size_t n[3], const float *values, double level, apsm_mesh *mesh)
{
    for (int c = 0; c < 3; c++)
        if (n[c] < 2 || n[c] > 1u << 20)
            throw failure{ APSM_ERR_ARG, "a grid needs 2 to 2^20 nodes along each axis" };
    silence_vtk();
    vtkNew<vtkFloatArray> scalars;
    set_scalars(n, values, static_cast<float>(level), scalars);
    vtkNew<vtkImageData> image;
    image->SetDimensions(static_cast<int>(n[0]), static_cast<int>(n[1]), static_cast<int>(n[2]));
    image->GetPointData()->SetScalars(scalars);
    vtkNew<vtkFlyingEdges3D> edges;
    edges->SetInputData(image);
    edges->ComputeNormalsOff();
    edges->ComputeGradientsOff();
    edges->ComputeScalarsOff();
    edges->SetValue(0, 0.0);
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
