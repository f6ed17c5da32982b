#include "plain.h"

#include <stdbool.h>
#include <stddef.h>

/* Bytes of the character that begins at s, and what it is; 0: they are no UTF-8. */
static size_t decode(const unsigned char *s, unsigned long *character)
{
    static const unsigned long least[] = { 0, 0, 0x80, 0x800, 0x10000 };
    const size_t n = s[0] < 0x80 ? 1 : s[0] < 0xC2 ? 0 : s[0] < 0xE0 ? 2 : s[0] < 0xF0 ? 3 : 4;
    if (n == 0 || s[0] > 0xF4) return 0;
    unsigned long c = n == 1 ? s[0] : s[0] & (0x7FU >> n);
    for (size_t k = 1; k < n; k++) {
        if ((s[k] & 0xC0) != 0x80) return 0; /* the final zero ends here, too */
        c = c << 6 | (s[k] & 0x3FU);
    }
    *character = c;
    return c >= least[n] && c <= 0x10FFFF && (c < 0xD800 || c > 0xDFFF) ? n : 0;
}

static bool is_plain(unsigned long c)
{
    const bool control = c < 0x20 || (c >= 0x7F && c < 0xA0);
    const bool turns = (c >= 0x202A && c <= 0x202E) || (c >= 0x2066 && c <= 0x2069) ||
                       c == 0x200E || c == 0x200F || c == 0x061C;
    return !control && !turns && c != 0x2028 && c != 0x2029;
}

void cli_put_plain(FILE *out, const char *prefix, const char *text)
{
    fputs(prefix, out);
    for (const unsigned char *s = (const unsigned char *)text; *s;) {
        unsigned long c = 0;
        const size_t n = decode(s, &c);
        if (n > 0 && is_plain(c))
            fwrite(s, 1, n, out);
        else
            fputc(c == '\t' ? ' ' : '?', out);
        s += n > 0 ? n : 1;
    }
    fputc('\n', out);
}
