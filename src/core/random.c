#include "core/random.h"

#include <math.h>

#include "core/random_inline.h"

apsm_random apsm_random_stream(uint64_t seed, apsm_stream stream, uint64_t index, uint64_t sub)
{
    return random_stream(seed, stream, index, sub);
}

uint64_t apsm_random_next(apsm_random *rng)
{
    return random_next(rng);
}

double apsm_random_uniform(apsm_random *rng)
{
    return random_uniform(rng);
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
