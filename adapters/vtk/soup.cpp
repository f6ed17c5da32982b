#include "soup.h"

#include <cmath>
#include <cstring>
#include <unordered_map>

#include <vtkIdList.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolygon.h>

#include "polydata.h"

namespace apsm
{
namespace
{

struct place {
    uint64_t bits[3];
    bool operator==(const place &o) const { return !std::memcmp(bits, o.bits, sizeof bits); }
};

place place_of(const double x[3])
{
    place p;
    for (int k = 0; k < 3; k++) {
        const double value = x[k] + 0.0; /* -0 is 0 */
        std::memcpy(&p.bits[k], &value, sizeof value);
    }
    return p;
}

struct place_hash {
    size_t operator()(const place &p) const
    {
        uint64_t h = 0;
        for (const uint64_t b : p.bits) {
            h = (h ^ b) * 0x9e3779b97f4a7c15u;
            h ^= h >> 32;
        }
        return static_cast<size_t>(h);
    }
};

/* Polygon p of s in triangles, appended to corner: ear clipping, or a fan where that gives up
 * (a polygon without area). */
void cut_polygon(const soup &s, size_t p, std::vector<uint32_t> *corner)
{
    const uint32_t *const ids = s.corner.data() + s.start[p];
    const size_t n = s.start[p + 1] - s.start[p];
    vtkNew<vtkPolygon> polygon;
    polygon->GetPoints()->SetDataTypeToDouble();
    polygon->GetPoints()->SetNumberOfPoints(static_cast<vtkIdType>(n));
    polygon->GetPointIds()->SetNumberOfIds(static_cast<vtkIdType>(n));
    for (size_t k = 0; k < n; k++) {
        polygon->GetPoints()->SetPoint(static_cast<vtkIdType>(k), s.point.data() + 3 * ids[k]);
        polygon->GetPointIds()->SetId(static_cast<vtkIdType>(k), static_cast<vtkIdType>(k));
    }
    vtkNew<vtkIdList> cut;
    if (polygon->Triangulate(cut) && cut->GetNumberOfIds() == static_cast<vtkIdType>(3 * (n - 2))) {
        for (vtkIdType k = 0; k < cut->GetNumberOfIds(); k++) corner->push_back(ids[cut->GetId(k)]);
        return;
    }
    for (size_t k = 1; k + 1 < n; k++)
        corner->insert(corner->end(), { ids[0], ids[k], ids[k + 1] });
}

} // namespace

void merge_points(soup *s)
{
    std::unordered_map<place, uint32_t, place_hash> seen;
    std::vector<uint32_t> now(s->points());
    size_t kept = 0;
    for (size_t v = 0; v < s->points(); v++) {
        const auto found = seen.emplace(place_of(&s->point[3 * v]), static_cast<uint32_t>(kept));
        now[v] = found.first->second;
        if (!found.second) continue;
        std::memmove(&s->point[3 * kept], &s->point[3 * v], 3 * sizeof(double));
        kept++;
    }
    s->point.resize(3 * kept);
    for (uint32_t &c : s->corner) c = now[c];
}

void triangulate(soup *s)
{
    if (s->corner.size() == 3 * s->polygons()) return; /* each has at least three corners */
    silence_vtk();
    std::vector<uint32_t> corner;
    for (size_t p = 0; p < s->polygons(); p++) {
        const size_t a = s->start[p];
        if (s->start[p + 1] - a == 3)
            corner.insert(corner.end(), &s->corner[a], &s->corner[a] + 3);
        else
            cut_polygon(*s, p, &corner);
    }
    s->corner.swap(corner);
    s->start.resize(1);
    for (size_t at = 3; at <= s->corner.size(); at += 3) s->start.push_back(at);
}

} // namespace apsm
