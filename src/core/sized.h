/* sized.h -- structs of a program that was built with other versions of our headers: fields are
 * only ever added at the end, and 0 stands for what was before. */
#ifndef APSM_CORE_SIZED_H
#define APSM_CORE_SIZED_H

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

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

#endif
