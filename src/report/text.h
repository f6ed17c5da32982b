/* text.h -- one line of text as an image, in a font of our own: the same on every machine, and no
 * fonts need be installed. */
#ifndef APSM_REPORT_TEXT_H
#define APSM_REPORT_TEXT_H

#include <stdbool.h>

#include "apsm/context.h"

/* UTF-8 in a sans-serif font, `pixels` high; *coverage (height x width, rows from the top, 0..255)
 * is malloc'ed, NULL for an empty text.  All lines of a size are equally high; signs that the font
 * lacks are left out: it has ASCII and the accented letters of western Europe. */
apsm_status text_draw(apsm_context *ctx, const char *text, size_t pixels, bool bold, size_t *width,
                      size_t *height, unsigned char **coverage) APSM_NODISCARD;

#endif
