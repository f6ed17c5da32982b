/* Headers whose voxels are in another file: MetaImage's ElementDataFile, NRRD's data file. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "apsm/files.h"
#include "apsm/input.h"

enum { LINE = 4096, MOST_LINES = 1000 };

/* The text after `key` and one of the signs, without blanks around it; NULL if the line has
 * another key.  Ends line where the text ends. */
static char *value_of(char *line, const char *key, const char *signs)
{
    const size_t length = strlen(key);
    if (strncasecmp(line, key, length) != 0) return NULL;
    char *value = line + length;
    while (*value == ' ' || *value == '\t') value++;
    if (!*value || !strchr(signs, *value)) return NULL;
    value += 1 + strspn(value + 1, " \t=");
    size_t end = strlen(value);
    while (end > 0 && strchr(" \t\r\n", value[end - 1])) value[--end] = '\0';
    return value;
}

/* The header's word for the file, in line, or NULL. */
static char *find_name(FILE *file, bool meta, char line[LINE])
{
    for (int n = 0; n < MOST_LINES && fgets(line, LINE, file); n++) {
        if (!meta && (line[0] == '\n' || line[0] == '\r')) return NULL; /* the voxels follow */
        char *value =
            meta ? value_of(line, "ElementDataFile", "=:") : value_of(line, "data file", ":");
        if (!value && !meta) value = value_of(line, "datafile", ":");
        if (value) return value;
    }
    return NULL;
}

static bool ends_in(const char *path, const char *extension)
{
    const size_t n = strlen(path), end = strlen(extension);
    return n > end && strcasecmp(path + n - end, extension) == 0;
}

apsm_status apsm_input_data_file(const char *path, char **data)
{
    const bool meta = ends_in(path, ".mhd") || ends_in(path, ".mha");
    char line[LINE];
    *data = NULL;
    if (!meta && !ends_in(path, ".nhdr") && !ends_in(path, ".nrrd")) return APSM_OK;
    FILE *file = fopen(path, "rb");
    if (!file) return APSM_OK; /* whoever reads it will say so */
    const char *name = find_name(file, meta, line);
    fclose(file);
    if (!name || !*name || strcmp(name, "LOCAL") == 0 || strncmp(name, "LIST", 4) == 0 ||
        strchr(name, '%'))
        return APSM_OK;
    char *folder = apsm_path_folder(path);
    *data = folder ? apsm_path_join(folder, name) : NULL;
    free(folder);
    return *data ? APSM_OK : APSM_ERR_MEMORY;
}
