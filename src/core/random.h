/* random.h -- the project's own random numbers: the same on every machine.
 *
 * A stream is a counter-seeded xoshiro256** generator (Blackman & Vigna).  Streams are named by
 * (seed, stream, index): one for each purpose and shape, so that the number of threads and the
 * order of work cannot change what a shape draws. */
#ifndef APSM_RANDOM_H
#define APSM_RANDOM_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_random {
    uint64_t s[4];
} apsm_random;

/* What a stream is for.  The values are part of the promise of equal bytes: append only. */
typedef enum apsm_stream {
    APSM_STREAM_BAND = 1,   /* near-surface points of a shape in an epoch */
    APSM_STREAM_BATCH = 2,  /* order of shapes in an epoch */
    APSM_STREAM_ALIGN = 3,  /* surface points for alignment */
    APSM_STREAM_MEDOID = 4, /* candidates for the template */
    APSM_STREAM_SPECIFICITY = 5,
    APSM_STREAM_PERMUTATION = 6, /* orders of the rows of a design */
    APSM_STREAM_BOOTSTRAP = 7,   /* subjects drawn again */
    APSM_STREAM_TEST = 99
} apsm_stream;

/* index and sub: for instance shape and epoch. */
apsm_random apsm_random_stream(uint64_t seed, apsm_stream stream, uint64_t index, uint64_t sub);
uint64_t apsm_random_next(apsm_random *rng);
double apsm_random_uniform(apsm_random *rng);             /* [0, 1), 53 bits */
uint64_t apsm_random_below(apsm_random *rng, uint64_t n); /* 0..n-1, unbiased, n >= 1 */
double apsm_random_normal(apsm_random *rng);              /* mean 0, variance 1 */

#ifdef __cplusplus
}
#endif
#endif
