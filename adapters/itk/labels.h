/* labels.h -- from an ITK image's raw components to the labels of an apsm_volume.  Shared with
 * the DICOM plug-in, so it depends on nothing of libapsm. */
#ifndef APSM_ADAPTERS_ITK_LABELS_H
#define APSM_ADAPTERS_ITK_LABELS_H

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <sstream>
#include <string>

#include <itkImageIOBase.h>

#include "../guard.h"
#include "apsm/volume.h"

namespace apsm
{

struct free_deleter {
    void operator()(void *p) const { std::free(p); }
};
using label_array = std::unique_ptr<int32_t[], free_deleter>;

inline label_array allocate_labels(size_t n)
{
    label_array labels(static_cast<int32_t *>(std::malloc(n * sizeof(int32_t))));
    if (!labels) throw std::bad_alloc();
    return labels;
}

template <class T> bool is_label(T value)
{
    if constexpr (std::numeric_limits<T>::is_integer) {
        if constexpr (sizeof(T) < sizeof(int32_t)) return true;
        return value <= static_cast<T>(std::numeric_limits<int32_t>::max()) &&
               (!std::numeric_limits<T>::is_signed ||
                static_cast<int64_t>(value) >= std::numeric_limits<int32_t>::min());
    } else {
        return value >= T(-2147483648.0) && value < T(2147483648.0) && std::floor(value) == value;
    }
}

template <class T> void copy_labels(const void *raw, const size_t n[3], int32_t *labels)
{
    const T *value = static_cast<const T *>(raw);
    for (size_t v = 0; v < n[0] * n[1] * n[2]; v++) {
        if (!is_label(value[v])) {
            std::ostringstream text;
            text << "voxel (" << v % n[0] << ", " << v / n[0] % n[1] << ", " << v / n[0] / n[1]
                 << ") holds " << +value[v]
                 << ", which is not a label; give a segmentation with integer values";
            damaged(text.str());
        }
        labels[v] = static_cast<int32_t>(value[v]);
    }
}

inline void labels_of(itk::ImageIOBase::IOComponentEnum type, const void *raw, const size_t n[3],
                      int32_t *labels)
{
    using kind = itk::ImageIOBase::IOComponentEnum;
    switch (type) {
    case kind::UCHAR:
        return copy_labels<unsigned char>(raw, n, labels);
    case kind::CHAR:
        return copy_labels<signed char>(raw, n, labels);
    case kind::USHORT:
        return copy_labels<unsigned short>(raw, n, labels);
    case kind::SHORT:
        return copy_labels<short>(raw, n, labels);
    case kind::UINT:
        return copy_labels<unsigned int>(raw, n, labels);
    case kind::INT:
        return copy_labels<int>(raw, n, labels);
    case kind::ULONG:
        return copy_labels<unsigned long>(raw, n, labels);
    case kind::LONG:
        return copy_labels<long>(raw, n, labels);
    case kind::ULONGLONG:
        return copy_labels<unsigned long long>(raw, n, labels);
    case kind::LONGLONG:
        return copy_labels<long long>(raw, n, labels);
    case kind::FLOAT:
        return copy_labels<float>(raw, n, labels);
    case kind::DOUBLE:
        return copy_labels<double>(raw, n, labels);
    default:
        damaged("voxels are of an unknown type; save them as integers");
    }
}

/* Refuses a grid that no segmentation can have.  Columns of direction are made unit vectors. */
inline void check_grid(apsm_volume *volume)
{
    double *D = volume->direction;
    for (size_t c = 0; c < 3; c++) {
        const double s = volume->spacing[c], o = volume->origin[c];
        if (!(s > 0.0) || !std::isfinite(s))
            damaged("spacing " + std::to_string(s) + " along axis " + std::to_string(c) +
                    " is not a positive number; correct it in the file's header");
        if (!std::isfinite(o)) damaged("the origin is not finite; correct it in the file's header");
        const double length = std::hypot(D[c], D[3 + c], D[6 + c]);
        for (size_t r = 0; r < 3; r++) D[3 * r + c] /= length > 0.0 ? length : 1.0;
    }
    const double det = D[0] * (D[4] * D[8] - D[5] * D[7]) - D[1] * (D[3] * D[8] - D[5] * D[6]) +
                       D[2] * (D[3] * D[7] - D[4] * D[6]);
    if (!(std::fabs(det) > 1e-6))
        damaged("the grid's directions are not independent; correct them in the file's header");
}

/* Sizes, spacing, origin and directions of a file whose information has been read. */
inline void grid_of(const itk::ImageIOBase &io, apsm_volume *volume)
{
    const unsigned dimensions = io.GetNumberOfDimensions();
    for (unsigned d = 3; d < dimensions; d++)
        if (io.GetDimensions(d) != 1) damaged("is not 3-D; extract one volume of the series");
    if (dimensions < 3) damaged("is a flat image, not 3-D; give the whole stack of slices");
    if (io.GetNumberOfComponents() != 1)
        damaged("has " + std::to_string(io.GetNumberOfComponents()) +
                " components per voxel; save it with one label per voxel");
    for (unsigned c = 0; c < 3; c++) {
        volume->n[c] = io.GetDimensions(c);
        volume->spacing[c] = io.GetSpacing(c);
        volume->origin[c] = io.GetOrigin(c);
        const std::vector<double> column = io.GetDirection(c);
        for (unsigned r = 0; r < 3; r++) volume->direction[3 * r + c] = column.at(r);
    }
    check_grid(volume);
}

} // namespace apsm
#endif
