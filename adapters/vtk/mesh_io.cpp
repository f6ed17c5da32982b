/* Surface meshes from and to files, by extension. */
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

std::string encode(const std::string &extension, const triangles &t)
{
    for (size_t i = 0; i < 3 * t.nv; i++)
        if (!std::isfinite(t.V[i]))
            throw failure{ APSM_ERR_NONFINITE, "point " + std::to_string(i / 3) +
                                                   " is not finite; nothing is written" };
    if (extension == ".ply") return ply_bytes(t);
    if (extension == ".stl") return stl_bytes(t);
    if (extension == ".obj") return obj_bytes(t);
    if (extension == ".vtk") return legacy_vtk_bytes(t);
    if (extension == ".vtp") return vtp_bytes(t);
    unknown(extension);
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
        const std::string extension = extension_of(path);
        const std::string bytes = encode(extension, { mesh->nv, mesh->nf, mesh->V, mesh->F });
        apsm_writer *writer;
        check(apsm_writer_open(ctx, path, &writer));
        apsm_writer_write(writer, bytes.data(), bytes.size());
        check(apsm_writer_commit(writer));
    });
}
