/* Surface meshes from and to files, by extension. */
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "../replace_file.h"
#include "apsm/adapters.h"
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

std::string bytes_of(const std::string &path)
{
    const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        throw failure{ APSM_ERR_IO, std::string(std::strerror(errno)) +
                                        "; check the name and your right to read it" };
    struct stat info;
    std::string bytes;
    ssize_t n = -1;
    if (!fstat(fd, &info) && S_ISREG(info.st_mode)) {
        try {
            bytes.resize(static_cast<size_t>(info.st_size));
        } catch (...) {
            close(fd);
            throw;
        }
        size_t done = 0;
        while (done < bytes.size() && (n = read(fd, &bytes[done], bytes.size() - done)) > 0)
            done += static_cast<size_t>(n);
        if (done == bytes.size()) n = 0;
    }
    close(fd);
    if (n) throw failure{ APSM_ERR_IO, "is not a file, or cannot be read to its end" };
    if (bytes.empty()) damaged("is empty; copy or export it again");
    return bytes;
}

soup read_soup(const std::string &path)
{
    const std::string extension = extension_of(path);
    const std::string bytes = bytes_of(path);
    if (extension == ".ply") return read_ply(bytes);
    if (extension == ".obj") return read_obj(bytes);
    if (extension == ".vtk") return read_legacy_vtk(bytes);
    if (extension == ".vtp") return read_vtp(path, bytes);
    if (extension != ".stl") unknown(extension);
    soup s = read_stl(bytes);
    merge_points(&s);
    return s;
}

void read_mesh(const std::string &path, apsm_mesh *mesh)
{
    soup s = read_soup(path);
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
    return guarded(ctx, path, [&] { read_mesh(path, mesh); });
}

extern "C" apsm_status apsm_vtk_write_mesh(apsm_context *ctx, const char *path,
                                           const apsm_mesh *mesh)
{
    return guarded(ctx, path, [&] {
        const std::string extension = extension_of(path);
        const std::string bytes = encode(extension, { mesh->nv, mesh->nf, mesh->V, mesh->F });
        replacement file(path, extension);
        file.write(bytes);
        file.commit();
    });
}
