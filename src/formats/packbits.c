#include "formats/packbits.h"

bool packbits_unpack(const unsigned char *p, size_t size, unsigned char *out, size_t n, size_t step)
{
    size_t at = 0, have = 0;
    while (have < n && at < size) {
        const int head = (signed char)p[at++];
        const size_t run = head >= 0 ? (size_t)head + 1 : (size_t)(1 - head);
        if (head == -128) continue;
        for (size_t k = 0; k < run && have < n; k++, have++) {
            if (at + (head >= 0 ? k : 0) >= size) return false;
            out[have * step] = p[at + (head >= 0 ? k : 0)];
        }
        at += head >= 0 ? run : 1;
    }
    return have == n;
}
