/* xoshiro256** 1.0 and splitmix64 (Blackman & Vigna, "Scrambled linear pseudorandom number
 * generators", ACM TOMS 47, 2021). */
#include "apsm/random.h"

#include <math.h>

static uint64_t splitmix(uint64_t *x)
{
    uint64_t z = (*x += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static uint64_t rotl(uint64_t x, int k)
{
    return (x << k) | (x >> (64 - k));
}

/* The four names are mixed one after the other, each through a full splitmix round, so that
 * neighbouring indices give unrelated streams. */
apsm_random apsm_random_stream(uint64_t seed, apsm_stream stream, uint64_t index, uint64_t sub)
{
    apsm_random rng;
    uint64_t x = seed;
    x = splitmix(&x) ^ (uint64_t)stream;
    x = splitmix(&x) ^ index;
    x = splitmix(&x) ^ sub;
    for (int k = 0; k < 4; k++) rng.s[k] = splitmix(&x);
    return rng;
}

uint64_t apsm_random_next(apsm_random *rng)
{
    uint64_t *s = rng->s;
    const uint64_t result = rotl(s[1] * 5, 7) * 9, t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotl(s[3], 45);
    return result;
}

double apsm_random_uniform(apsm_random *rng)
{
    return (double)(apsm_random_next(rng) >> 11) * 0x1p-53;
}

uint64_t apsm_random_below(apsm_random *rng, uint64_t n)
{
    /* Values below 2^64 mod n would be drawn once too often: reject them. */
    const uint64_t reject = (0 - n) % n;
    uint64_t x;
    do x = apsm_random_next(rng);
    while (x < reject);
    return x % n;
}

/* Polar method (Marsaglia): one value a call, no state beside the stream. */
double apsm_random_normal(apsm_random *rng)
{
    for (;;) {
        const double u = 2.0 * apsm_random_uniform(rng) - 1.0;
        const double v = 2.0 * apsm_random_uniform(rng) - 1.0;
        const double s = u * u + v * v;
        if (s > 0.0 && s < 1.0) return u * sqrt(-2.0 * log(s) / s);
    }
}
