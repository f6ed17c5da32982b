/* Headers whose voxels are in another file: MetaImage's ElementDataFile, NRRD's data file, the
 * image of a NIfTI pair. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "files/io.h"
#include "input/input.h"

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

/* *data <- name in the folder of path; nothing if there is none. */
static apsm_status beside(const char *path, const char *name, char **data)
{
    if (!name || !*name || strcmp(name, "LOCAL") == 0 || strncmp(name, "LIST", 4) == 0 ||
        strchr(name, '%'))
        return APSM_OK;
    char *const folder = apsm_path_folder(path);
    *data = folder ? apsm_path_join(folder, name) : NULL;
    free(folder);
    return *data ? APSM_OK : APSM_ERR_MEMORY;
}

/* "x.hdr" has its voxels in "x.img" or "x.img.gz". */
static apsm_status image_of(const char *path, char **data)
{
    const size_t stem = strlen(path) - 4;
    *data = malloc(stem + sizeof ".img.gz");
    if (!*data) return APSM_ERR_MEMORY;
    memcpy(*data, path, stem);
    strcpy(*data + stem, ".img");
    if (!apsm_file_exists(*data)) strcpy(*data + stem, ".img.gz");
    return APSM_OK;
}

apsm_status apsm_input_data_file(const char *path, char **data)
{
    const bool meta = ends_in(path, ".mhd") || ends_in(path, ".mha");
    char line[LINE];
    *data = NULL;
    if (ends_in(path, ".hdr")) return image_of(path, data);
    if (!meta && !ends_in(path, ".nhdr") && !ends_in(path, ".nrrd")) return APSM_OK;
    int fd;
    FILE *file = NULL;
    if (apsm_open_regular(NULL, path, &fd) == APSM_OK && !(file = fdopen(fd, "rb"))) close(fd);
    if (!file) return APSM_OK; /* whoever reads it will say so */
    const apsm_status status = beside(path, find_name(file, meta, line), data);
    fclose(file);
    return status;
}
