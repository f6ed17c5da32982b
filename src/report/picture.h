/* picture.h -- an image of red, green and blue bytes that ends as a PNG file. */
#ifndef APSM_REPORT_PICTURE_H
#define APSM_REPORT_PICTURE_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

/* Owns rgb: height rows of width pixels, from the top.  Zero-initialise with {0}. */
typedef struct picture {
    size_t width, height;
    unsigned char *rgb;
} picture;

/* White. */
apsm_status picture_make(apsm_context *ctx, size_t width, size_t height, picture *p);
void picture_free(picture *p);

/* How a line of text looks and how it lies to its x. */
typedef enum picture_align { PICTURE_LEFT, PICTURE_CENTRE, PICTURE_RIGHT } picture_align;
typedef struct picture_style {
    size_t pixels;
    bool bold;
    picture_align align;
    unsigned char colour[3];
} picture_style;

/* Text with its upper edge at y.  Wider than `widest`, its beginning gives way to "..": the ends of
 * names tell them apart.  What lies outside the picture is cut off. */
apsm_status picture_text(apsm_context *ctx, picture *p, size_t x, size_t y, size_t widest,
                         const picture_style *style, const char *text);

apsm_status picture_write(apsm_context *ctx, const picture *p, const char *path);

#endif
