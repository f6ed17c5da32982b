/* random_inline.h -- apsm/random.h for loops that a call a number would slow down.
 * xoshiro256** 1.0 and splitmix64 (Blackman & Vigna, "Scrambled linear pseudorandom number
 * generators", ACM TOMS 47, 2021). */
#ifndef APSM_CORE_RANDOM_INLINE_H
#define APSM_CORE_RANDOM_INLINE_H

#include "core/random.h"

static inline uint64_t random_splitmix(uint64_t *x)
{
    uint64_t z = (*x += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static inline uint64_t random_rotl(uint64_t x, int k)
{
    return (x << k) | (x >> (64 - k));
}

/* The four names are mixed one after the other, each through a full splitmix round, so that
 * neighbouring indices give unrelated streams. */
static inline apsm_random random_stream(uint64_t seed, apsm_stream stream, uint64_t index,
                                        uint64_t sub)
{
    apsm_random rng;
    uint64_t x = seed;
    x = random_splitmix(&x) ^ (uint64_t)stream;
    x = random_splitmix(&x) ^ index;
    x = random_splitmix(&x) ^ sub;
    for (int k = 0; k < 4; k++) rng.s[k] = random_splitmix(&x);
    return rng;
}

static inline uint64_t random_next(apsm_random *rng)
{
    uint64_t *s = rng->s;
    const uint64_t result = random_rotl(s[1] * 5, 7) * 9, t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = random_rotl(s[3], 45);
    return result;
}

static inline double random_uniform(apsm_random *rng)
{
    return (double)(random_next(rng) >> 11) * 0x1p-53;
}

#endif
