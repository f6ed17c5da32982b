/* sized.h -- structs of a program that was built with other versions of our headers: fields are
 * only ever added at the end, and 0 stands for what was before. */
#ifndef APSM_CORE_SIZED_H
#define APSM_CORE_SIZED_H

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "apsm/context.h"

/* known (known_size bytes, zeroed by the caller) <- given.  False if given is NULL or says more
 * than we know. */
static inline bool apsm_take_sized(const void *given, size_t size, void *known, size_t known_size)
{
    if (!given) return false;
    for (size_t k = known_size; k < size; k++)
        if (((const unsigned char *)given)[k]) return false;
    memcpy(known, given, size < known_size ? size : known_size);
    return true;
}

/* The other way: out (size bytes) <- known; what we do not know of becomes 0. */
static inline void apsm_give_sized(const void *known, size_t known_size, void *out, size_t size)
{
    memcpy(out, known, size < known_size ? size : known_size);
    if (size > known_size) memset((char *)out + known_size, 0, size - known_size);
}

/* As apsm_take_sized, with a line for the door that was knocked at. */
static inline apsm_status apsm_take_settings(apsm_context *ctx, const char *door, const void *given,
                                             size_t size, void *known, size_t known_size)
{
    if (apsm_take_sized(given, size, known, known_size)) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG, "%s: no settings, or some that this version does not know",
                     door);
}

/* The door of a step whose settings alone may grow: door_sized hands them to step. */
#define APSM_BY_SIZE(door, type, step)                                                             \
    apsm_status door##_sized(apsm_context *ctx, const type *given, size_t size)                    \
    {                                                                                              \
        type known = { 0 };                                                                        \
        APSM_TRY(apsm_take_settings(ctx, #door, given, size, &known, sizeof known));               \
        return step(ctx, &known);                                                                  \
    }

#endif
