/* Segmentations: labels on an oriented grid. */
#include "apsm/volume.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

apsm_status apsm_volume_note(apsm_context *ctx, const char *path, apsm_volume *volume,
                             const char *format, ...)
{
    enum { LONGEST = 512 };
    char text[LONGEST];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
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
    *volume = (apsm_volume){ 0 };
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
