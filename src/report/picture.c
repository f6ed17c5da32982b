#include "report/picture.h"

#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "report/text.h"

apsm_status picture_make(apsm_context *ctx, size_t width, size_t height, picture *p)
{
    *p = (picture){ .width = width, .height = height, .rgb = malloc(3 * width * height + 1) };
    if (!p->rgb)
        return apsm_fail(ctx, APSM_ERR_MEMORY, "no memory for a picture of %zu x %zu pixels", width,
                         height);
    memset(p->rgb, 255, 3 * width * height);
    return APSM_OK;
}

void picture_free(picture *p)
{
    free(p->rgb);
    *p = (picture){ 0 };
}

/* ---- Text ---- */

typedef struct line {
    size_t width, height;
    unsigned char *coverage;
} line;

static apsm_status draw_line(apsm_context *ctx, const picture_style *style, const char *text,
                             line *l)
{
    return text_draw(ctx, text, style->pixels, style->bold, &l->width, &l->height, &l->coverage);
}

/* As much of the end of text as fits, behind two dots. */
static apsm_status draw_end(apsm_context *ctx, const picture_style *style, const char *text,
                            size_t widest, line *l)
{
    const size_t length = strlen(text);
    char *shorter = malloc(length + 3);
    if (!shorter) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    for (size_t from = 1; status == APSM_OK && l->width > widest && from < length; from++) {
        if (((unsigned char)text[from] & 0xc0) == 0x80) continue; /* within a letter */
        free(l->coverage);
        sprintf(shorter, "..%s", text + from);
        status = draw_line(ctx, style, shorter, l);
    }
    free(shorter);
    return status;
}

static void blend(picture *p, const line *l, ptrdiff_t x, size_t y, const unsigned char colour[3])
{
    for (size_t v = 0; v < l->height && y + v < p->height; v++)
        for (size_t u = 0; u < l->width; u++) {
            const ptrdiff_t at = x + (ptrdiff_t)u;
            if (at < 0 || at >= (ptrdiff_t)p->width) continue;
            unsigned char *out = p->rgb + 3 * ((y + v) * p->width + (size_t)at);
            const int a = l->coverage[v * l->width + u];
            for (int c = 0; c < 3; c++)
                out[c] = (unsigned char)((a * colour[c] + (255 - a) * out[c] + 127) / 255);
        }
}

apsm_status picture_text(apsm_context *ctx, picture *p, size_t x, size_t y, size_t widest,
                         const picture_style *style, const char *text)
{
    line l;
    APSM_TRY(draw_line(ctx, style, text, &l));
    const apsm_status status = l.width > widest ? draw_end(ctx, style, text, widest, &l) : APSM_OK;
    const ptrdiff_t shift[] = { 0, (ptrdiff_t)l.width / 2, (ptrdiff_t)l.width };
    if (status == APSM_OK && l.coverage)
        blend(p, &l, (ptrdiff_t)x - shift[style->align], y, style->colour);
    free(l.coverage);
    return status;
}

/* ---- PNG ---- */

apsm_status picture_write(apsm_context *ctx, const picture *p, const char *path)
{
    png_image image = { .version = PNG_IMAGE_VERSION,
                        .width = (png_uint_32)p->width,
                        .height = (png_uint_32)p->height,
                        .format = PNG_FORMAT_RGB };
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
    void *bytes = malloc(size);
    apsm_writer *writer;
    if (!bytes) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: no memory to compress it", path);
    if (!png_image_write_to_memory(&image, bytes, &size, 0, p->rgb, 0, NULL)) {
        free(bytes);
        return apsm_fail(ctx, APSM_ERR_IO, "%s: cannot be made into a PNG: %s", path,
                         image.message);
    }
    apsm_status status = apsm_writer_open(ctx, path, &writer);
    if (status == APSM_OK) {
        apsm_writer_write(writer, bytes, size);
        status = apsm_writer_commit(writer);
    }
    free(bytes);
    return status;
}
