#include "exchange/hdf5_json.h"

#include <jansson.h>
#include <string.h>

#include "files/files.h"

static const json_t *link_of(const json_t *group, const char *name, size_t length)
{
    const json_t *const links = json_object_get(group, "links");
    for (size_t k = 0; k < json_array_size(links); k++) {
        const json_t *const link = json_array_get(links, k);
        const char *const title = json_string_value(json_object_get(link, "title"));
        if (title && strlen(title) == length && memcmp(title, name, length) == 0) return link;
    }
    return NULL;
}

const json_t *hdf5_json_find(const json_t *file, const char *name)
{
    const json_t *at = NULL;
    const char *id = json_string_value(json_object_get(file, "root")), *collection = "groups";
    while (id) {
        at = json_object_get(json_object_get(file, collection), id);
        name += strspn(name, "/");
        const size_t length = strcspn(name, "/");
        if (length == 0) return json_object_get(at, "value");
        const json_t *const link = link_of(at, name, length);
        id = json_string_value(json_object_get(link, "id"));
        collection = json_string_value(json_object_get(link, "collection"));
        if (!collection) return NULL;
        name += length;
    }
    return NULL;
}

/* Every row has as many entries: their product is no more than what the file holds. */
static bool is_even(const json_t *matrix, size_t columns)
{
    for (size_t k = 0; k < json_array_size(matrix); k++)
        if (json_array_size(json_array_get(matrix, k)) != columns) return false;
    return true;
}

bool hdf5_json_size(const json_t *value, size_t *rows, size_t *columns)
{
    const json_t *const first = json_array_get(value, 0);
    *rows = json_is_array(value) ? json_array_size(value) : 1;
    *columns = json_array_size(first);
    return json_is_number(value) || json_is_number(first) ||
           (*columns > 0 && is_even(value, *columns));
}

bool hdf5_json_get(const json_t *value, size_t rows, size_t columns, double *x)
{
    if (!json_is_number(value)) return apsm_json_get_matrix(value, rows, columns, x);
    x[0] = json_number_value(value);
    return true;
}
