#include "report/colours.h"

#include <math.h>

/* Okabe and Ito's colours without black, and darker or lighter kin of the same hues. */
const unsigned char colours_particle[COLOURS_PARTICLE][3] = {
    { 0xe6, 0x9f, 0x00 }, { 0x56, 0xb4, 0xe9 }, { 0x00, 0x9e, 0x73 }, { 0xf0, 0xe4, 0x42 },
    { 0x00, 0x72, 0xb2 }, { 0xd5, 0x5e, 0x00 }, { 0xcc, 0x79, 0xa7 }, { 0x5b, 0x3a, 0x8c },
    { 0x7a, 0x1f, 0x1f }, { 0xbf, 0xe8, 0xa0 },
};

static double distance2(const double *a, const double *b)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) sum += (a[k] - b[k]) * (a[k] - b[k]);
    return sum;
}

void colours_choose(size_t J, const double *P, uint32_t *chosen)
{
    for (size_t j = 0; j < J; j++) {
        double nearest[COLOURS_PARTICLE];
        uint32_t best = 0;
        for (int c = 0; c < COLOURS_PARTICLE; c++) nearest[c] = INFINITY;
        for (size_t k = 0; k < j; k++)
            nearest[chosen[k]] = fmin(nearest[chosen[k]], distance2(P + 3 * j, P + 3 * k));
        for (uint32_t c = 1; c < COLOURS_PARTICLE; c++)
            if (nearest[c] > nearest[best]) best = c;
        chosen[j] = best;
    }
}

/* The same stops as in the viewer (report/viewer/src/colors.js): lightness falls to both ends. */
void colours_signed(double t, float rgb[3])
{
    enum { STOPS = 7 };
    static const unsigned char stops[STOPS][3] = {
        { 0x0b, 0x3c, 0x6e }, { 0x2a, 0x78, 0xb5 }, { 0x8f, 0xbf, 0xdf }, { 0xee, 0xea, 0xe2 },
        { 0xf0, 0xb2, 0x7a }, { 0xc9, 0x6a, 0x1b }, { 0x7a, 0x33, 0x00 },
    };
    const double at = fmin(fmax((t + 1) / 2, 0), 1) * (STOPS - 1);
    const int k = at < STOPS - 2 ? (int)at : STOPS - 2;
    for (int c = 0; c < 3; c++)
        rgb[c] = (float)((stops[k][c] + (at - k) * (stops[k + 1][c] - (double)stops[k][c])) / 255);
}
