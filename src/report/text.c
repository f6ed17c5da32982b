#include "report/text.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "report/glyphs.h"

/* In quarter units. */
static const double pen = 3.6, bold_pen = 6.0, space = 1.4, bold_space = 2.6;
static const double above = 36.0, below = 10.0; /* of the line's middle part, round the base line */
static const double capital = 28.0, small = 20.0;
enum { PIECES = 8 }; /* lines that a bend is made of */

typedef struct page {
    size_t width, height;
    unsigned char *coverage;
    double scale, radius; /* pixels a quarter unit; of the pen, in pixels */
} page;

typedef struct spot {
    double x, y; /* pixels, from the top left */
} spot;

/* Coverage of a line with round ends: by the distance of each pixel's middle from it. */
static void draw_line(page *p, spot a, spot b)
{
    const double reach = p->radius + 1.0, dx = b.x - a.x, dy = b.y - a.y;
    const double length2 = dx * dx + dy * dy;
    const double left = fmax(floor(fmin(a.x, b.x) - reach), 0.0),
                 top = fmax(floor(fmin(a.y, b.y) - reach), 0.0);
    for (size_t y = (size_t)top; y < p->height && (double)y < fmax(a.y, b.y) + reach; y++)
        for (size_t x = (size_t)left; x < p->width && (double)x < fmax(a.x, b.x) + reach; x++) {
            const double px = (double)x + 0.5 - a.x, py = (double)y + 0.5 - a.y;
            const double t = length2 > 0.0 ? (px * dx + py * dy) / length2 : 0.0;
            const double u = fmin(fmax(t, 0.0), 1.0);
            const double ex = px - u * dx, ey = py - u * dy;
            const double covered = p->radius + 0.5 - sqrt(ex * ex + ey * ey);
            const int value = (int)(255.0 * fmin(fmax(covered, 0.0), 1.0) + 0.5);
            unsigned char *const out = &p->coverage[y * p->width + x];
            if (value > *out) *out = (unsigned char)value;
        }
}

static spot middle(spot a, spot b)
{
    return (spot){ 0.5 * (a.x + b.x), 0.5 * (a.y + b.y) };
}

/* The parabola from a to c that leaves towards b and arrives from there. */
static void draw_bend(page *p, spot a, spot b, spot c)
{
    spot last = a;
    for (int k = 1; k <= PIECES; k++) {
        const double t = (double)k / PIECES, s = 1.0 - t;
        const spot next = { s * s * a.x + 2.0 * s * t * b.x + t * t * c.x,
                            s * s * a.y + 2.0 * s * t * b.y + t * t * c.y };
        draw_line(p, last, next);
        last = next;
    }
}

/* kind: see glyphs.h.  Smooth lines pass the middles of the sides between their points. */
static void draw_stroke(page *p, char kind, size_t n, const spot *at)
{
    for (size_t k = 0; kind == 'l' && k + 1 < n; k++) draw_line(p, at[k], at[k + 1]);
    for (size_t k = 1; kind == 's' && k + 1 < n; k++)
        draw_bend(p, k == 1 ? at[0] : middle(at[k - 1], at[k]), at[k],
                  k + 2 == n ? at[n - 1] : middle(at[k], at[k + 1]));
    for (size_t k = 0; kind == 'o' && k < n; k++)
        draw_bend(p, middle(at[(k + n - 1) % n], at[k]), at[k], middle(at[k], at[(k + 1) % n]));
}

/* x, y: where the glyph's origin lies, in quarter units from the top left. */
static void draw_strokes(page *p, const char *strokes, double x, double y)
{
    enum { MOST = 32 };
    spot at[MOST];
    while (*strokes) {
        const char kind = *strokes++;
        size_t n = 0;
        for (; *strokes && *strokes < 'a' && n < MOST; strokes += 2, n++) {
            at[n].x = p->scale * (x + (double)(strokes[0] - GLYPH_ZERO));
            at[n].y = p->scale * (y - (double)(strokes[1] - GLYPH_ZERO));
        }
        draw_stroke(p, kind, n, at);
    }
}

/* The next sign of UTF-8; 0 at the end.  What is no UTF-8 is passed over. */
static uint32_t next_sign(const char **text)
{
    const unsigned char *p = (const unsigned char *)*text;
    uint32_t sign = *p;
    if (!sign) return 0;
    p++;
    const int more = sign >= 0xf0 ? 3 : sign >= 0xe0 ? 2 : sign >= 0xc0 ? 1 : 0;
    if (more) sign &= 0x3fu >> more;
    for (int k = 0; k < more && (*p & 0xc0) == 0x80; k++) sign = sign << 6 | (*p++ & 0x3fu);
    *text = (const char *)p;
    return sign;
}

/* NULL if the font lacks the sign. */
static const glyph *glyph_of(uint32_t sign, char *accent)
{
    *accent = '.';
    if (sign >= 0xc0 && sign <= 0xff) {
        *accent = latin_accent[sign - 0xc0];
        sign = (unsigned char)latin_letter[sign - 0xc0];
        if (sign == '.') return NULL;
    }
    return sign >= GLYPH_FIRST && sign <= GLYPH_LAST ? &glyphs[sign - GLYPH_FIRST] : NULL;
}

/* Of the text in quarter units; drawn as well if p has coverage. */
static double lay_out(page *p, const char *text, bool bold)
{
    double x = bold ? 4.0 : 2.0;
    for (uint32_t sign; (sign = next_sign(&text)) != 0;) {
        char accent;
        const glyph *const g = glyph_of(sign, &accent);
        if (!g) continue;
        if (p->coverage) {
            const double top = sign < 0xe0 ? capital : small;
            draw_strokes(p, g->strokes, x, above);
            draw_strokes(p, accent_strokes(accent), x + 0.5 * g->advance, above - top);
        }
        x += (double)g->advance + (bold ? bold_space : space);
    }
    return x + 2.0;
}

apsm_status text_draw(apsm_context *ctx, const char *text, size_t pixels, bool bold, size_t *width,
                      size_t *height, unsigned char **coverage)
{
    page p = { .scale = (double)pixels / GLYPH_UNITS };
    *width = *height = 0;
    *coverage = NULL;
    if (!*text) return APSM_OK;
    p.radius = 0.5 * p.scale * (bold ? bold_pen : pen);
    p.width = (size_t)ceil(p.scale * lay_out(&p, text, bold));
    p.height = (size_t)ceil(p.scale * (above + below));
    p.coverage = calloc(p.width, p.height);
    if (!p.coverage) return apsm_fail(ctx, APSM_ERR_MEMORY, "no memory to draw '%s'", text);
    lay_out(&p, text, bold);
    *width = p.width;
    *height = p.height;
    *coverage = p.coverage;
    return APSM_OK;
}
