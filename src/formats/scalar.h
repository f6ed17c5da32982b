/* scalar.h -- the number types that files of meshes and images hold, in either order of bytes. */
#ifndef APSM_FORMATS_SCALAR_H
#define APSM_FORMATS_SCALAR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef enum scalar {
    SCALAR_I8,
    SCALAR_U8,
    SCALAR_I16,
    SCALAR_U16,
    SCALAR_I32,
    SCALAR_U32,
    SCALAR_I64,
    SCALAR_U64,
    SCALAR_F32,
    SCALAR_F64
} scalar;

static inline size_t scalar_size(scalar type)
{
    static const unsigned char size[] = { 1, 1, 2, 2, 4, 4, 8, 8, 4, 8 };
    return size[type];
}

static inline bool scalar_is_real(scalar type)
{
    return type >= SCALAR_F32;
}

/* size bytes (1, 2, 4 or 8) as an unsigned number. */
static inline uint64_t scalar_bits(const unsigned char *p, size_t size, bool big_endian)
{
    uint64_t bits = 0;
    for (size_t b = 0; b < size; b++) bits = bits << 8 | p[big_endian ? b : size - 1 - b];
    return bits;
}

static inline double scalar_real32(uint64_t bits)
{
    const uint32_t low = (uint32_t)bits;
    float value;
    memcpy(&value, &low, sizeof value);
    return (double)value;
}

static inline double scalar_real64(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Of an integer type; what is above INT64_MAX counts as that. */
static inline int64_t scalar_integer(scalar type, const unsigned char *p, bool big_endian)
{
    const uint64_t bits = scalar_bits(p, scalar_size(type), big_endian);
    switch (type) {
    case SCALAR_I8:
        return (int8_t)bits;
    case SCALAR_I16:
        return (int16_t)bits;
    case SCALAR_I32:
        return (int32_t)bits;
    case SCALAR_I64:
        return (int64_t)bits;
    default:
        return bits > INT64_MAX ? INT64_MAX : (int64_t)bits;
    }
}

static inline double scalar_real(scalar type, const unsigned char *p, bool big_endian)
{
    if (type == SCALAR_F32) return scalar_real32(scalar_bits(p, 4, big_endian));
    if (type == SCALAR_F64) return scalar_real64(scalar_bits(p, 8, big_endian));
    if (type == SCALAR_U64) return (double)scalar_bits(p, 8, big_endian);
    return (double)scalar_integer(type, p, big_endian);
}

#endif
