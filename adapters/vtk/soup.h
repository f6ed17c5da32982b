/* soup.h -- polygons as mesh files hold them, before they become a mesh, and their readers.
 *
 * VTK's own readers of these formats trust counts and indices, and a damaged file makes them
 * crash, hang or ask for all memory.  These check every byte they use: memory asked for is bounded
 * by the size of the file, and whatever is wrong is thrown as a failure with its line or byte. They
 * read numbers without the locale, and to double. */
#ifndef APSM_ADAPTERS_VTK_SOUP_H
#define APSM_ADAPTERS_VTK_SOUP_H

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace apsm
{

struct soup {
    std::vector<double> point;      /* 3 per point, finite */
    std::vector<uint32_t> corner;   /* of all polygons, each a point */
    std::vector<size_t> start{ 0 }; /* polygon p has corner[start[p]] to corner[start[p+1]-1] */

    size_t points() const { return point.size() / 3; }
    size_t polygons() const { return start.size() - 1; }
    void close_polygon() { start.push_back(corner.size()); }
};

soup read_ply(std::string_view bytes);
soup read_stl(std::string_view bytes); /* three points for each triangle; see merge_points */
soup read_obj(std::string_view bytes);
soup read_legacy_vtk(std::string_view bytes); /* DATASET POLYDATA: polygons and strips */
soup read_vtp(const std::string &path, std::string_view bytes);

/* Makes points at exactly the same place one, in order of first appearance. */
void merge_points(soup *s);

/* Polygons of more than three corners into triangles. */
void triangulate(soup *s);

/* Bytes of a file with these triangles, for each extension.  PLY, STL: float32. */
struct triangles {
    size_t nv, nf;
    const double *V;
    const uint32_t *F;
};
std::string ply_bytes(const triangles &t);
std::string stl_bytes(const triangles &t);
std::string obj_bytes(const triangles &t);
std::string legacy_vtk_bytes(const triangles &t);
std::string vtp_bytes(const triangles &t);

/* The same of n points P (n x 3), each with a vertex cell. */
std::string legacy_vtk_points_bytes(size_t n, const double *P);
std::string vtp_points_bytes(size_t n, const double *P);

} // namespace apsm
#endif
