/* Meshes as the bytes of PLY, STL, OBJ and legacy VTK files; the same mesh gives the same bytes
 * everywhere. */
#include <cfloat>
#include <cmath>

#include "cursor.h"
#include "soup.h"

namespace apsm
{
namespace
{

template <class T> void put(std::string *out, T value, bool big_endian = false)
{
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    for (size_t b = 0; b < sizeof value; b++)
        out->push_back(raw[big_endian ? sizeof value - 1 - b : b]);
}

void put_float(std::string *out, double value)
{
    if (std::fabs(value) > static_cast<double>(FLT_MAX))
        throw failure{ APSM_ERR_NONFINITE, "a coordinate is too large for float32; use .vtp" };
    put(out, static_cast<float>(value));
}

/* The shortest text that reads back to the same double. */
void put_text(std::string *out, double value)
{
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, value).ptr;
    out->append(1, ' ').append(text, end);
}

std::string legacy_vtk_head(const char *title, size_t n, const double *P)
{
    std::string out = std::string("# vtk DataFile Version 3.0\n") + title +
                      "\nBINARY\nDATASET POLYDATA\nPOINTS " + std::to_string(n) + " double\n";
    for (size_t i = 0; i < 3 * n; i++) put(&out, P[i], true);
    return out;
}

} // namespace

std::string ply_bytes(const triangles &t)
{
    std::string out =
        "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(t.nv) +
        "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
        std::to_string(t.nf) + "\nproperty list uchar int vertex_indices\nend_header\n";
    out.reserve(out.size() + 12 * t.nv + 13 * t.nf);
    for (size_t i = 0; i < 3 * t.nv; i++) put_float(&out, t.V[i]);
    for (size_t f = 0; f < t.nf; f++) {
        out.push_back(3);
        for (size_t k = 0; k < 3; k++) put(&out, t.F[3 * f + k]);
    }
    return out;
}

std::string stl_bytes(const triangles &t)
{
    std::string out(80, ' ');
    out.reserve(84 + 50 * t.nf);
    put(&out, static_cast<uint32_t>(t.nf));
    for (size_t f = 0; f < t.nf; f++) {
        const double *const a = t.V + 3 * t.F[3 * f], *const b = t.V + 3 * t.F[3 * f + 1],
                            *const c = t.V + 3 * t.F[3 * f + 2];
        double n[3];
        for (int k = 0; k < 3; k++) {
            const int u = (k + 1) % 3, v = (k + 2) % 3;
            n[k] = (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u]);
        }
        const double length = std::hypot(n[0], n[1], n[2]);
        for (const double x : n)
            put_float(&out, length > 0.0 && std::isfinite(length) ? x / length : 0.0);
        for (const double *p : { a, b, c })
            for (int k = 0; k < 3; k++) put_float(&out, p[k]);
        put(&out, static_cast<uint16_t>(0));
    }
    return out;
}

std::string obj_bytes(const triangles &t)
{
    std::string out;
    for (size_t v = 0; v < t.nv; v++) {
        out.push_back('v');
        for (size_t k = 0; k < 3; k++) put_text(&out, t.V[3 * v + k]);
        out.push_back('\n');
    }
    for (size_t f = 0; f < t.nf; f++) {
        out.push_back('f');
        for (size_t k = 0; k < 3; k++)
            out.append(" ").append(std::to_string(t.F[3 * f + k] + 1ull));
        out.push_back('\n');
    }
    return out;
}

std::string legacy_vtk_points_bytes(size_t n, const double *P)
{
    std::string out = legacy_vtk_head("particles", n, P);
    out += "\nVERTICES " + std::to_string(n) + " " + std::to_string(2 * n) + "\n";
    for (size_t j = 0; j < n; j++) {
        put(&out, uint32_t{ 1 }, true);
        put(&out, static_cast<uint32_t>(j), true);
    }
    return out + "\n";
}

std::string legacy_vtk_bytes(const triangles &t)
{
    std::string out = legacy_vtk_head("mesh", t.nv, t.V);
    out += "\nPOLYGONS " + std::to_string(t.nf) + " " + std::to_string(4 * t.nf) + "\n";
    for (size_t f = 0; f < t.nf; f++) {
        put(&out, uint32_t{ 3 }, true);
        for (size_t k = 0; k < 3; k++) put(&out, t.F[3 * f + k], true);
    }
    return out + "\n";
}

} // namespace apsm
