/* Segmentations: labels on an oriented grid. */
#include "apsm/volume.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/number.h"

apsm_status apsm_volume_note(apsm_context *ctx, const char *path, apsm_volume *volume,
                             const char *format, ...)
{
    enum { LONGEST = 512 };
    char text[LONGEST];
    va_list args;
    va_start(args, format);
    apsm_vprint(text, sizeof text, format, args);
    va_end(args);
    apsm_log(ctx, APSM_LOG_WARNING, "%s: %s", path, text);
    const size_t before = volume->notes ? strlen(volume->notes) : 0;
    char *const longer = realloc(volume->notes, before + strlen(text) + 2);
    if (!longer) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    volume->notes = longer;
    sprintf(longer + before, "%s%s", before ? "\n" : "", text);
    return APSM_OK;
}

void apsm_volume_free(apsm_volume *volume)
{
    for (size_t k = 0; k < volume->segments; k++) free(volume->segment[k].name);
    free(volume->segment);
    free(volume->value);
    free(volume->notes);
    free(volume->picked);
    free(volume->label);
    free(volume->small);
    *volume = (apsm_volume){ 0 };
}

static bool copy_bytes(const void *from, size_t bytes, void **to)
{
    *to = NULL;
    if (!from) return true;
    *to = malloc(bytes ? bytes : 1);
    if (*to) memcpy(*to, from, bytes);
    return *to != NULL;
}

static bool copy_text(const char *from, char **to)
{
    void *copy;
    const bool copied = copy_bytes(from, from ? strlen(from) + 1 : 0, &copy);
    *to = copy;
    return copied;
}

static bool copy_segments(const apsm_volume *from, apsm_volume *to)
{
    if (from->segments == 0) return true;
    to->segment = calloc(from->segments, sizeof *to->segment);
    if (!to->segment) return false;
    for (; to->segments < from->segments; to->segments++) {
        to->segment[to->segments] = from->segment[to->segments];
        if (!copy_text(from->segment[to->segments].name, &to->segment[to->segments].name))
            return false;
    }
    return true;
}

apsm_status apsm_volume_copy(const apsm_volume *from, apsm_volume *to)
{
    const size_t voxels = from->n[0] * from->n[1] * from->n[2];
    void *label, *value, *small;
    *to = *from;
    to->segment = NULL;
    to->segments = 0;
    const bool arrays =
        copy_bytes(from->label, voxels * (from->layers ? from->layers : 1) * sizeof *from->label,
                   &label) &
        copy_bytes(from->value, voxels * sizeof *from->value, &value) &
        copy_bytes(from->small, voxels, &small) & copy_text(from->notes, &to->notes) &
        copy_text(from->picked, &to->picked);
    to->label = label;
    to->value = value;
    to->small = small;
    if (arrays && copy_segments(from, to)) return APSM_OK;
    apsm_volume_free(to);
    return APSM_ERR_MEMORY;
}

void apsm_volume_index_to_lps(const apsm_volume *volume, double M[16])
{
    memset(M, 0, 16 * sizeof *M);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            M[4 * r + c] = volume->direction[3 * r + c] * volume->spacing[c];
        M[4 * r + 3] = volume->origin[r];
    }
    M[15] = 1.0;
}
