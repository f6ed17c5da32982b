/* Surface meshes and points from and to files, by extension. */
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "apsm/adapters.h"
#include "apsm/files.h"
#include "polydata.h"
#include "soup.h"

using namespace apsm;

namespace
{

/* Half-edges (3 per face) must be countable in 32 bits. */
constexpr size_t most = 1u << 30;

std::string extension_of(const std::string &path)
{
    const size_t dot = path.rfind('.'), slash = path.rfind('/');
    if (dot == std::string::npos || (slash != std::string::npos && dot < slash)) return "";
    std::string extension = path.substr(dot);
    for (char &c : extension)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return extension;
}

[[noreturn]] void unknown(const std::string &extension)
{
    throw failure{ APSM_ERR_UNSUPPORTED, "'" + extension +
                                             "' is not a mesh format known here; use .ply, "
                                             ".stl, .obj, .vtk or .vtp" };
}

/* A file's bytes, freed at the end. */
struct file_bytes {
    file_bytes(apsm_context *ctx, const std::string &path)
    {
        check(apsm_read_file(ctx, path.c_str(), SIZE_MAX / 2, &data, &size));
    }
    ~file_bytes() { std::free(data); }
    file_bytes(const file_bytes &) = delete;
    file_bytes &operator=(const file_bytes &) = delete;

    char *data = nullptr;
    size_t size = 0;
};

soup read_soup(apsm_context *ctx, const std::string &path)
{
    const std::string extension = extension_of(path);
    const file_bytes file(ctx, path);
    const std::string_view bytes(file.data, file.size);
    if (bytes.empty()) damaged("is empty; copy or export it again");
    if (extension == ".ply") return read_ply(bytes);
    if (extension == ".obj") return read_obj(bytes);
    if (extension == ".vtk") return read_legacy_vtk(bytes);
    if (extension == ".vtp") return read_vtp(path, bytes);
    if (extension != ".stl") unknown(extension);
    soup s = read_stl(bytes);
    merge_points(&s);
    return s;
}

void read_mesh(apsm_context *ctx, const std::string &path, apsm_mesh *mesh)
{
    soup s = read_soup(ctx, path);
    if (s.polygons() == 0) damaged("has no faces: a point cloud? export it as a surface");
    triangulate(&s);
    if (s.points() > most || s.polygons() > most)
        damaged("is larger than 2^30 points or faces; decimate it first");
    apsm_mesh m{};
    if (apsm_mesh_alloc(&m, s.points(), s.polygons()) != APSM_OK) throw std::bad_alloc();
    std::memcpy(m.V, s.point.data(), s.point.size() * sizeof *m.V);
    std::memcpy(m.F, s.corner.data(), s.corner.size() * sizeof *m.F);
    *mesh = m;
}

void check_finite(size_t n, const double *P)
{
    for (size_t i = 0; i < 3 * n; i++)
        if (!std::isfinite(P[i]))
            throw failure{ APSM_ERR_NONFINITE, "point " + std::to_string(i / 3) +
                                                   " is not finite; nothing is written" };
}

std::string encode(const std::string &extension, const triangles &t)
{
    check_finite(t.nv, t.V);
    if (extension == ".ply") return ply_bytes(t);
    if (extension == ".stl") return stl_bytes(t);
    if (extension == ".obj") return obj_bytes(t);
    if (extension == ".vtk") return legacy_vtk_bytes(t);
    if (extension == ".vtp") return vtp_bytes(t);
    unknown(extension);
}

void write_bytes(apsm_context *ctx, const char *path, const std::string &bytes)
{
    apsm_writer *writer;
    check(apsm_writer_open(ctx, path, &writer));
    apsm_writer_write(writer, bytes.data(), bytes.size());
    check(apsm_writer_commit(writer));
}

bool holds_points(const std::string &extension)
{
    return extension == ".vtk" || extension == ".vtp";
}

[[noreturn]] void no_points(const std::string &extension)
{
    throw failure{ APSM_ERR_UNSUPPORTED,
                   "'" + extension + "' does not hold points here; use .vtk or .vtp" };
}

void read_points(apsm_context *ctx, const std::string &path, size_t *n, double **P)
{
    if (!holds_points(extension_of(path))) no_points(extension_of(path));
    const soup s = read_soup(ctx, path);
    if (s.polygons() > 0)
        damaged("holds " + std::to_string(s.polygons()) +
                " polygons: a mesh, not particles; give a file of points");
    auto *const points = static_cast<double *>(std::malloc(s.point.size() * sizeof **P + 1));
    if (!points) throw std::bad_alloc();
    std::copy(s.point.begin(), s.point.end(), points);
    *n = s.points();
    *P = points;
}

std::string encode_points(const std::string &extension, size_t n, const double *P)
{
    if (!holds_points(extension)) no_points(extension);
    if (n > most) throw failure{ APSM_ERR_ARG, "is larger than 2^30 points; nothing is written" };
    check_finite(n, P);
    return extension == ".vtk" ? legacy_vtk_points_bytes(n, P) : vtp_points_bytes(n, P);
}

} // namespace

extern "C" apsm_status apsm_vtk_read_mesh(apsm_context *ctx, const char *path, apsm_mesh *mesh)
{
    return guarded(ctx, path, [&] { read_mesh(ctx, path, mesh); });
}

extern "C" apsm_status apsm_vtk_write_mesh(apsm_context *ctx, const char *path,
                                           const apsm_mesh *mesh)
{
    return guarded(ctx, path, [&] {
        const triangles t{ mesh->nv, mesh->nf, mesh->V, mesh->F };
        write_bytes(ctx, path, encode(extension_of(path), t));
    });
}

extern "C" apsm_status apsm_vtk_read_points(apsm_context *ctx, const char *path, size_t *n,
                                            double **P)
{
    *n = 0;
    *P = nullptr;
    return guarded(ctx, path, [&] { read_points(ctx, path, n, P); });
}

extern "C" apsm_status apsm_vtk_write_points(apsm_context *ctx, const char *path, size_t n,
                                             const double *P)
{
    return guarded(ctx, path,
                   [&] { write_bytes(ctx, path, encode_points(extension_of(path), n, P)); });
}
