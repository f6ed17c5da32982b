/* VTP, VTK's XML format, by VTK's reader and writer.  The reader believes the sizes in the
 * file, so they are compared with the size of the file first; attributes are not read; and what
 * comes out is checked array by array before use. */
#include <vtkCellArray.h>
#include <vtkCommand.h>
#include <vtkDataArray.h>
#include <vtkDataArraySelection.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLPolyDataWriter.h>

#include "cursor.h"
#include "polydata.h"
#include "soup.h"

namespace apsm
{
namespace
{

/* Every NumberOf...="n" of the file: compressed data grow at most 1032 times. */
void check_counts(std::string_view bytes)
{
    const std::string_view key = "NumberOf";
    for (size_t at = bytes.find(key); at != std::string_view::npos; at = bytes.find(key, at + 1)) {
        const size_t open = bytes.find_first_of("\"'<>", at);
        if (open == std::string_view::npos || bytes[open] == '<' || bytes[open] == '>') continue;
        const size_t close = bytes.find(bytes[open], open + 1);
        if (close == std::string_view::npos) continue;
        long long n = -1;
        std::string_view value = bytes.substr(open + 1, close - open - 1);
        while (!value.empty() && cursor::blank(value.front())) value.remove_prefix(1);
        while (!value.empty() && cursor::blank(value.back())) value.remove_suffix(1);
        if (!cursor::parse(value, &n) || n < 0 ||
            static_cast<double>(n) > 1032.0 * static_cast<double>(bytes.size()))
            damaged(one_line(std::string(bytes.substr(at, std::min<size_t>(open - at, 40)))) +
                    "\"" + one_line(std::string(value.substr(0, 40))) +
                    "\" cannot be; it is damaged: copy or export it again");
    }
}

/* Offsets and corners of cells; VTK itself does not look at them when reading. */
void add_polygons(vtkCellArray *cells, bool strips, soup *s)
{
    vtkDataArray *const start = cells->GetOffsetsArray(), *const corner =
                                                              cells->GetConnectivityArray();
    const vtkIdType n = start ? start->GetNumberOfTuples() : 0;
    if (n > 1 &&
        (!corner || corner->GetNumberOfComponents() != 1 || start->GetNumberOfComponents() != 1))
        damaged("cells have no list of corners; export the mesh again");
    for (vtkIdType k = 0; k + 1 < n; k++) {
        const double a = start->GetComponent(k, 0), b = start->GetComponent(k + 1, 0);
        if (!(a >= 0.0) || !(b >= a + 3.0) || b > static_cast<double>(corner->GetNumberOfTuples()))
            damaged("polygon " + std::to_string(k) +
                    " has no proper corners; export the mesh again");
        std::vector<uint32_t> ids;
        for (auto j = static_cast<vtkIdType>(a); j < static_cast<vtkIdType>(b); j++) {
            const double id = corner->GetComponent(j, 0);
            if (!(id >= 0.0) || id >= static_cast<double>(s->points()))
                damaged("polygon " + std::to_string(k) +
                        " refers to a point that does not exist; export the mesh again");
            ids.push_back(static_cast<uint32_t>(id));
        }
        if (!strips) {
            s->corner.insert(s->corner.end(), ids.begin(), ids.end());
            s->close_polygon();
        }
        for (size_t j = 0; strips && j + 2 < ids.size(); j++) {
            s->corner.insert(s->corner.end(), { ids[j + j % 2], ids[j + 1 - j % 2], ids[j + 2] });
            s->close_polygon();
        }
    }
}

/* The file of data's cells with the points P (n x 3). */
std::string encoded(vtkPolyData *data, size_t n, const double *P)
{
    silence_vtk();
    vtkNew<vtkDoubleArray> coordinates;
    coordinates->SetNumberOfComponents(3);
    coordinates->SetNumberOfTuples(static_cast<vtkIdType>(n));
    for (size_t i = 0; i < 3 * n; i++) coordinates->SetValue(static_cast<vtkIdType>(i), P[i]);
    vtkNew<vtkPoints> points;
    points->SetData(coordinates);
    data->SetPoints(points);
    vtkNew<vtkXMLPolyDataWriter> writer;
    writer->SetInputData(data);
    writer->WriteToOutputStringOn();
    if (!writer->Write()) throw failure{ APSM_ERR_IO, "cannot be encoded as VTP" };
    return writer->GetOutputString();
}

} // namespace

soup read_vtp(const std::string &path, std::string_view bytes)
{
    silence_vtk();
    check_counts(bytes);
    vtkNew<vtkXMLPolyDataReader> reader;
    if (!reader->CanReadFile(path.c_str()))
        damaged("is not a VTP file, whatever its name says; export it as poly data");
    reader->SetFileName(path.c_str());
    reader->UpdateInformation();
    reader->GetPointDataArraySelection()->DisableAllArrays();
    reader->GetCellDataArraySelection()->DisableAllArrays();
    reader->Update();
    vtkPolyData *const data = reader->GetOutput();
    if (reader->GetErrorCode() || !data || !data->GetPoints())
        damaged("its XML or data cannot be decoded; copy or export it again");
    soup s;
    vtkDataArray *const points = data->GetPoints()->GetData();
    if (points->GetNumberOfComponents() != 3) damaged("points are not 3-D; export it again");
    s.point.resize(3 * static_cast<size_t>(points->GetNumberOfTuples()));
    for (size_t v = 0; v < s.points(); v++)
        for (size_t k = 0; k < 3; k++) {
            const double x = points->GetComponent(static_cast<vtkIdType>(v), static_cast<int>(k));
            if (!std::isfinite(x))
                damaged("a coordinate of point " + std::to_string(v) +
                        " is not finite; export the mesh again");
            s.point[3 * v + k] = x;
        }
    add_polygons(data->GetPolys(), false, &s);
    add_polygons(data->GetStrips(), true, &s);
    return s;
}

std::string vtp_bytes(const triangles &t)
{
    vtkNew<vtkCellArray> cells;
    for (size_t f = 0; f < t.nf; f++) {
        const vtkIdType ids[3] = { t.F[3 * f], t.F[3 * f + 1], t.F[3 * f + 2] };
        cells->InsertNextCell(3, ids);
    }
    vtkNew<vtkPolyData> data;
    data->SetPolys(cells);
    return encoded(data, t.nv, t.V);
}

std::string vtp_points_bytes(size_t n, const double *P)
{
    vtkNew<vtkCellArray> cells;
    for (size_t j = 0; j < n; j++) {
        const auto id = static_cast<vtkIdType>(j);
        cells->InsertNextCell(1, &id);
    }
    vtkNew<vtkPolyData> data;
    data->SetVerts(cells);
    return encoded(data, n, P);
}

} // namespace apsm
