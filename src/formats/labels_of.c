#include "formats/labels_of.h"

#include <math.h>
#include <stdlib.h>

static size_t place_of(const image *m, size_t j, size_t k, size_t layer)
{
    return j * m->stride[1] + k * m->stride[2] + layer * m->layer_stride;
}

static bool fits(double x)
{
    return x >= -2147483648.0 && x < 2147483648.0 && floor(x) == x;
}

/* Rows of n values `stride` apart.  Called with a constant type, so that the compiler makes a loop
 * for each; the number of values that are labels before the first that is not. */
static inline size_t integer_row(scalar type, const unsigned char *p, bool big_endian, size_t n,
                                 size_t stride, int32_t *label)
{
    const size_t size = scalar_size(type);
    for (size_t i = 0; i < n; i++) {
        const int64_t x = scalar_integer(type, p + i * stride * size, big_endian);
        if (x < INT32_MIN || x > INT32_MAX) return i;
        label[i] = (int32_t)x;
    }
    return n;
}

static size_t real_row(const image *m, const unsigned char *p, size_t n, int32_t *label)
{
    const size_t size = scalar_size(m->type);
    for (size_t i = 0; i < n; i++) {
        const double x =
            m->slope * scalar_real(m->type, p + i * m->stride[0] * size, m->big_endian) +
            m->intercept;
        if (!fits(x)) return i;
        label[i] = (int32_t)x;
    }
    return n;
}

static bool is_stored_as_meant(const image *m)
{
    return m->slope >= 1.0 && m->slope <= 1.0 && m->intercept >= 0.0 && m->intercept <= 0.0;
}

static size_t label_row(const image *m, const unsigned char *p, int32_t *label)
{
    const size_t n = m->n[0], stride = m->stride[0];
    const bool big = m->big_endian;
    if (!is_stored_as_meant(m)) return real_row(m, p, n, label);
    switch (m->type) {
    case SCALAR_I8:
        return integer_row(SCALAR_I8, p, big, n, stride, label);
    case SCALAR_U8:
        return integer_row(SCALAR_U8, p, big, n, stride, label);
    case SCALAR_I16:
        return integer_row(SCALAR_I16, p, big, n, stride, label);
    case SCALAR_U16:
        return integer_row(SCALAR_U16, p, big, n, stride, label);
    case SCALAR_I32:
    case SCALAR_U32:
    case SCALAR_I64:
    case SCALAR_U64:
        return integer_row(m->type, p, big, n, stride, label);
    default:
        return real_row(m, p, n, label);
    }
}

static double value_at(const image *m, size_t at)
{
    return m->slope * scalar_real(m->type, m->data + at * scalar_size(m->type), m->big_endian) +
           m->intercept;
}

static apsm_status values_of(apsm_context *ctx, const char *path, const image *m,
                             apsm_volume *volume)
{
    float *out = volume->value = malloc(m->n[0] * m->n[1] * m->n[2] * sizeof *out);
    if (!out) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    for (size_t k = 0; k < m->n[2]; k++)
        for (size_t j = 0; j < m->n[1]; j++)
            for (size_t i = 0; i < m->n[0]; i++) {
                const double x = value_at(m, place_of(m, j, k, 0) + i * m->stride[0]);
                if (!(fabs(x) < 1e38))
                    return apsm_fail(ctx, APSM_ERR_FORMAT,
                                     "%s: voxel (%zu, %zu, %zu) holds %g, which is not a label; "
                                     "give a segmentation with integer values",
                                     path, i, j, k, x);
                *out++ = (float)x;
            }
    return APSM_OK;
}

/* The voxel (i, j, k) is no label. */
static apsm_status not_a_label(apsm_context *ctx, const char *path, const image *m,
                               apsm_volume *volume, size_t i, size_t j, size_t k)
{
    const double x = value_at(m, place_of(m, j, k, 0) + i * m->stride[0]);
    free(volume->label);
    volume->label = NULL;
    if (m->layers == 1 && fabs(x) < 1e38 && floor(x) != x) return values_of(ctx, path, m, volume);
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: voxel (%zu, %zu, %zu) holds %g, which is not a label; give a "
                     "segmentation with integer values",
                     path, i, j, k, x);
}

apsm_status labels_of(apsm_context *ctx, const char *path, const image *m, apsm_volume *volume)
{
    const size_t voxels = m->n[0] * m->n[1] * m->n[2], size = scalar_size(m->type);
    int32_t *const label = malloc(m->layers * voxels * sizeof *label);
    if (!label) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    volume->label = label;
    volume->layers = m->layers;
    for (size_t l = 0; l < m->layers; l++)
        for (size_t k = 0; k < m->n[2]; k++)
            for (size_t j = 0; j < m->n[1]; j++) {
                int32_t *const row = label + l * voxels + m->n[0] * (j + m->n[1] * k);
                const size_t good = label_row(m, m->data + size * place_of(m, j, k, l), row);
                if (good < m->n[0]) return not_a_label(ctx, path, m, volume, good, j, k);
            }
    return APSM_OK;
}
