#include "formats/labels_of.h"

#include <float.h>
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

static bool is_stored_as_meant(const image *m)
{
    return m->slope >= 1.0 && m->slope <= 1.0 && m->intercept >= 0.0 && m->intercept <= 0.0;
}

/* What is meant by a stored value.  Files hold slope and intercept as floats: many write the labels
 * 0 and 1 as 0 and 32767 with a slope of 1 / 32767, which is not quite that.  What is whole but for
 * such rounding is whole. */
static double meant_by(const image *m, double stored)
{
    const double scaled = m->slope * stored, x = scaled + m->intercept, whole = floor(x + 0.5);
    return fabs(x - whole) <= FLT_EPSILON * (fabs(scaled) + fabs(m->intercept)) ? whole : x;
}

static size_t real_row(const image *m, const unsigned char *p, size_t n, int32_t *label)
{
    const size_t size = scalar_size(m->type);
    const bool scaled = !is_stored_as_meant(m);
    for (size_t i = 0; i < n; i++) {
        const double stored = scalar_real(m->type, p + i * m->stride[0] * size, m->big_endian);
        const double x = scaled ? meant_by(m, stored) : stored;
        if (!fits(x)) return i;
        label[i] = (int32_t)x;
    }
    return n;
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

/* The voxel at[] is no label. */
static apsm_status not_a_label(apsm_context *ctx, const char *path, const image *m,
                               apsm_volume *volume, const size_t at[3])
{
    const double x = value_at(m, place_of(m, at[1], at[2], 0) + at[0] * m->stride[0]);
    free(volume->label);
    volume->label = NULL;
    if (m->layers == 1 && fabs(x) < 1e38 && floor(x) != x) return values_of(ctx, path, m, volume);
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: voxel (%zu, %zu, %zu) holds %g, which is not a label; give a "
                     "segmentation with integer values",
                     path, at[0], at[1], at[2], x);
}

/* ---- what is around the labels ---- */

/* lo, hi (inclusive, in and out) <- what reaches to the bytes of a row that are not 0. */
static void grow_along(const unsigned char *row, size_t n, size_t size, size_t *lo, size_t *hi)
{
    size_t from = 0, to = n * size;
    if (row[0] == 0 && memcmp(row, row + 1, to - 1) == 0) return;
    while (!row[from]) from++;
    while (!row[to - 1]) to--;
    if (from / size < *lo) *lo = from / size;
    if ((to - 1) / size > *hi) *hi = (to - 1) / size;
}

/* The box of voxels that are not 0, with one more on every side where there is one; false if there
 * are none. */
static bool find_box(const image *m, size_t lo[3], size_t hi[3])
{
    const size_t size = scalar_size(m->type);
    bool any = false;
    for (int c = 0; c < 3; c++) lo[c] = SIZE_MAX, hi[c] = 0;
    for (size_t k = 0; k < m->n[2]; k++)
        for (size_t j = 0; j < m->n[1]; j++) {
            size_t from = SIZE_MAX, to = 0;
            grow_along(m->data + size * place_of(m, j, k, 0), m->n[0], size, &from, &to);
            if (from == SIZE_MAX) continue;
            const size_t first[3] = { from, j, k }, last[3] = { to, j, k };
            for (int c = 0; c < 3; c++) {
                if (first[c] < lo[c]) lo[c] = first[c];
                if (last[c] > hi[c]) hi[c] = last[c];
            }
            any = true;
        }
    for (int c = 0; c < 3 && any; c++) {
        lo[c] -= lo[c] > 0;
        hi[c] += hi[c] + 1 < m->n[c];
    }
    return any;
}

/* The part of the image that is held in volume, as an image by itself. */
static image part_of(const image *m, apsm_volume *volume)
{
    image part = *m;
    size_t lo[3], hi[3];
    if (!m->foreground || m->layers != 1 || m->stride[0] != 1 || !is_stored_as_meant(m) ||
        !find_box(m, lo, hi))
        return part;
    part.data += scalar_size(m->type) * (place_of(m, lo[1], lo[2], 0) + lo[0]);
    for (int c = 0; c < 3; c++) {
        part.n[c] = volume->n[c] = hi[c] - lo[c] + 1;
        volume->first[c] = lo[c];
        volume->whole[c] = m->n[c];
    }
    return part;
}

/* Back to all of it. */
static void hold_whole(const image *m, apsm_volume *volume)
{
    for (int c = 0; c < 3; c++) {
        volume->n[c] = m->n[c];
        volume->first[c] = volume->whole[c] = 0;
    }
}

/* The bytes of the file are the labels. */
static apsm_status copy_small(apsm_context *ctx, const char *path, const image *part,
                              apsm_volume *volume)
{
    const size_t *const n = part->n;
    unsigned char *const small = malloc(n[0] * n[1] * n[2]);
    if (!small) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    for (size_t k = 0; k < n[2]; k++)
        for (size_t j = 0; j < n[1]; j++)
            memcpy(small + n[0] * (j + n[1] * k), part->data + place_of(part, j, k, 0), n[0]);
    volume->small = small;
    volume->layers = 1;
    return APSM_OK;
}

apsm_status labels_of(apsm_context *ctx, const char *path, const image *m, apsm_volume *volume)
{
    const image part = part_of(m, volume);
    if (m->foreground && m->type == SCALAR_U8 && m->layers == 1 && m->stride[0] == 1 &&
        is_stored_as_meant(m))
        return copy_small(ctx, path, &part, volume);
    const size_t *const n = part.n, voxels = n[0] * n[1] * n[2], size = scalar_size(m->type);
    int32_t *const label = malloc(m->layers * voxels * sizeof *label);
    if (!label) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    volume->label = label;
    volume->layers = m->layers;
    for (size_t l = 0; l < m->layers; l++)
        for (size_t k = 0; k < n[2]; k++)
            for (size_t j = 0; j < n[1]; j++) {
                int32_t *const row = label + l * voxels + n[0] * (j + n[1] * k);
                const size_t good = label_row(&part, part.data + size * place_of(m, j, k, l), row);
                if (good == n[0]) continue;
                const size_t at[3] = { volume->first[0] + good, volume->first[1] + j,
                                       volume->first[2] + k };
                hold_whole(m, volume);
                return not_a_label(ctx, path, m, volume, at);
            }
    return APSM_OK;
}
