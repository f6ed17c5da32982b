/* arrays.h -- the malloc'ed arrays of an object, listed so that they can be moved elsewhere. */
#ifndef APSM_CORE_ARRAYS_H
#define APSM_CORE_ARRAYS_H

#include <stddef.h>
#include <string.h>

enum { ARRAYS_MOST = 24 };

typedef struct array_list {
    size_t n;
    struct {
        void *pointer; /* the address of the pointer to the array, whatever its type */
        size_t bytes;
    } at[ARRAYS_MOST];
} array_list;

static inline void arrays_add(array_list *list, void *pointer, size_t bytes)
{
    list->at[list->n].pointer = pointer;
    list->at[list->n++].bytes = bytes;
}

static inline void *arrays_get(const array_list *list, size_t k)
{
    void *array;
    memcpy(&array, list->at[k].pointer, sizeof array);
    return array;
}

static inline void arrays_set(const array_list *list, size_t k, void *array)
{
    memcpy(list->at[k].pointer, &array, sizeof array);
}

/* The object no longer owns its arrays: to free it frees what is left. */
static inline void arrays_forget(const array_list *list)
{
    for (size_t k = 0; k < list->n; k++) arrays_set(list, k, NULL);
}

#endif
