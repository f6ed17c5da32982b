/* Headers whose voxels are in other files: MetaImage's ElementDataFile, NRRD's data file, the image
 * of a NIfTI pair. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "files/io.h"
#include "formats/name_series.h"
#include "input/input.h"

enum { LINE = 4096, MOST_LINES = 1000, MOST_LISTED = 1 << 20 };

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

/* The next line, or as much of it as there is room for, without its end: LF, CR or both. */
static bool next_line(FILE *file, char line[LINE])
{
    size_t n = 0;
    int c;
    while ((c = getc(file)) != EOF && c != '\n' && c != '\r')
        if (n + 1 < LINE) line[n++] = (char)c;
    if (c == '\r' && (c = getc(file)) != '\n' && c != EOF) ungetc(c, file);
    line[n] = '\0';
    return n > 0 || c != EOF;
}

/* The header's word for the file, in line, or NULL. */
static char *find_name(FILE *file, bool meta, char line[LINE])
{
    for (int n = 0; n < MOST_LINES && next_line(file, line); n++) {
        if (!meta && !*line) return NULL; /* the voxels follow */
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

static apsm_status add(const char *path, const char *name, apsm_file_list *files)
{
    char *const folder = apsm_path_folder(path);
    char *const file = folder ? apsm_path_join(folder, name) : NULL;
    char **const larger = file ? realloc(files->path, (files->n + 1) * sizeof *larger) : NULL;
    free(folder);
    if (!larger) {
        free(file);
        return APSM_ERR_MEMORY;
    }
    files->path = larger;
    files->capacity = files->n + 1;
    larger[files->n++] = file;
    return APSM_OK;
}

/* The names that a pattern counts; none if it is no pattern. */
static apsm_status add_counted(const char *path, word pattern, apsm_file_list *files)
{
    name_series series;
    char name[LINE];
    if (!name_series_of_pattern(pattern, &series)) return APSM_OK;
    while (series.count > 0 && name_series_next(&series, name, sizeof name))
        APSM_TRY(add(path, name, files));
    return APSM_OK;
}

/* The names in the lines that follow. */
static apsm_status add_listed(const char *path, FILE *file, apsm_file_list *files)
{
    char line[LINE], name[LINE];
    for (size_t n = 0; n < MOST_LISTED && next_line(file, line); n++) {
        name_series series;
        name_series_of_lines((word){ line, strlen(line) }, &series);
        if (series.count > 0 && name_series_next(&series, name, sizeof name))
            APSM_TRY(add(path, name, files));
    }
    return APSM_OK;
}

/* Those that the header means by `name`, the rest of which is in file. */
static apsm_status add_named(const char *path, const char *name, FILE *file, apsm_file_list *files)
{
    const word w = { name, name ? strlen(name) : 0 };
    if (!name || !*name || strcmp(name, "LOCAL") == 0) return APSM_OK;
    if (!name_series_is(w)) return add(path, name, files);
    return name_series_is_pattern(w) ? add_counted(path, w, files) : add_listed(path, file, files);
}

/* "x.hdr" has its voxels in "x.img" or "x.img.gz". */
static apsm_status add_image_of(const char *path, apsm_file_list *files)
{
    const char *const base = apsm_path_last(path);
    const size_t stem = strlen(base) - 4;
    char *const name = malloc(stem + sizeof ".img.gz");
    if (!name) return APSM_ERR_MEMORY;
    memcpy(name, base, stem);
    strcpy(name + stem, ".img");
    apsm_status status = add(path, name, files);
    if (status == APSM_OK && !apsm_file_exists(files->path[0])) {
        strcpy(name + stem, ".img.gz");
        apsm_file_list_free(files);
        status = add(path, name, files);
    }
    free(name);
    return status;
}

apsm_status apsm_input_data_files(const char *path, apsm_file_list *files)
{
    const bool meta = ends_in(path, ".mhd") || ends_in(path, ".mha");
    char line[LINE];
    *files = (apsm_file_list){ 0 };
    if (ends_in(path, ".hdr")) return add_image_of(path, files);
    if (!meta && !ends_in(path, ".nhdr") && !ends_in(path, ".nrrd")) return APSM_OK;
    int fd;
    FILE *file = NULL;
    if (apsm_open_regular(NULL, path, &fd) == APSM_OK && !(file = fdopen(fd, "rb"))) close(fd);
    if (!file) return APSM_OK; /* whoever reads it will say so */
    const apsm_status status = add_named(path, find_name(file, meta, line), file, files);
    fclose(file);
    if (status != APSM_OK) apsm_file_list_free(files);
    return status;
}

apsm_status apsm_input_hash(apsm_context *ctx, const char *path, char hex[65])
{
    apsm_file_list data;
    if (apsm_is_folder(path)) return apsm_sha256_folder(ctx, path, hex);
    APSM_TRY(apsm_input_data_files(path, &data));
    const char **const all = malloc((data.n + 1) * sizeof *all);
    apsm_status status = all ? APSM_OK : apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    size_t n = 0;
    if (all) all[n++] = path;
    for (size_t k = 0; all && k < data.n; k++) /* what is not there, its reader will say */
        if (apsm_file_exists(data.path[k])) all[n++] = data.path[k];
    if (status == APSM_OK) status = apsm_sha256_files(ctx, n, all, hex);
    free(all);
    apsm_file_list_free(&data);
    return status;
}
