/* SHA-256.  National Institute of Standards and Technology, "Secure Hash Standard", FIPS PUB
 * 180-4, 2015, sections 4.1.2, 5.1.1 and 6.2; letters as there. */
#include "files/io.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

/* Section 4.2.2: the first 32 bits of the fractional parts of the cube roots of the first 64
 * primes. */
static const uint32_t K[64] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2
};

static uint32_t rotr(uint32_t x, int n)
{
    return x >> n | x << (32 - n);
}

static uint32_t load_be(const unsigned char *p)
{
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

static void store_be(uint32_t x, unsigned char *p)
{
    for (int i = 0; i < 4; i++) p[i] = (unsigned char)(x >> (24 - 8 * i));
}

/* The message schedule W of one block, section 6.2.2 step 1. */
static void schedule(const unsigned char block[64], uint32_t W[64])
{
    for (int t = 0; t < 16; t++) W[t] = load_be(block + 4 * t);
    for (int t = 16; t < 64; t++) {
        const uint32_t x = W[t - 15], y = W[t - 2];
        const uint32_t s0 = rotr(x, 7) ^ rotr(x, 18) ^ x >> 3;
        const uint32_t s1 = rotr(y, 17) ^ rotr(y, 19) ^ y >> 10;
        W[t] = s1 + W[t - 7] + s0 + W[t - 16];
    }
}

/* Steps 2 to 4. */
static void compress(uint32_t H[8], const unsigned char block[64])
{
    uint32_t W[64];
    uint32_t a = H[0], b = H[1], c = H[2], d = H[3], e = H[4], f = H[5], g = H[6], h = H[7];
    schedule(block, W);
    for (int t = 0; t < 64; t++) {
        const uint32_t T1 =
            h + (rotr(e, 6) ^ rotr(e, 11) ^ rotr(e, 25)) + ((e & f) ^ (~e & g)) + K[t] + W[t];
        const uint32_t T2 =
            (rotr(a, 2) ^ rotr(a, 13) ^ rotr(a, 22)) + ((a & b) ^ (a & c) ^ (b & c));
        h = g, g = f, f = e, e = d + T1;
        d = c, c = b, b = a, a = T1 + T2;
    }
    H[0] += a, H[1] += b, H[2] += c, H[3] += d;
    H[4] += e, H[5] += f, H[6] += g, H[7] += h;
}

void apsm_sha256_begin(apsm_sha256 *sha)
{
    /* Section 5.3.3: square roots of the first eight primes. */
    static const uint32_t H0[8] = { 0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                    0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19 };
    memcpy(sha->h, H0, sizeof H0);
    sha->length = 0;
}

void apsm_sha256_add(apsm_sha256 *sha, const void *data, size_t size)
{
    const unsigned char *p = data;
    while (size > 0) {
        const size_t used = sha->length % 64;
        const size_t n = size < 64 - used ? size : 64 - used;
        if (n == 64) {
            compress(sha->h, p);
        } else {
            memcpy(sha->block + used, p, n);
            if (used + n == 64) compress(sha->h, sha->block);
        }
        sha->length += n;
        p += n;
        size -= n;
    }
}

void apsm_sha256_add_text(apsm_sha256 *sha, const char *text)
{
    apsm_sha256_add(sha, text, strlen(text) + 1);
}

/* Section 5.1.1: a one bit, zeros up to 8 bytes before the end of a block, the length in bits. */
void apsm_sha256_end(apsm_sha256 *sha, unsigned char digest[32])
{
    const uint64_t bits = 8 * sha->length;
    static const unsigned char padding[64] = { 0x80 };
    unsigned char length[8];
    store_be((uint32_t)(bits >> 32), length);
    store_be((uint32_t)bits, length + 4);
    apsm_sha256_add(sha, padding, 1 + (119 - sha->length % 64) % 64);
    apsm_sha256_add(sha, length, sizeof length);
    for (int i = 0; i < 8; i++) store_be(sha->h[i], digest + 4 * i);
}

void apsm_sha256_hex(const unsigned char digest[32], char hex[65])
{
    for (int i = 0; i < 32; i++) {
        hex[2 * i] = "0123456789abcdef"[digest[i] >> 4];
        hex[2 * i + 1] = "0123456789abcdef"[digest[i] & 15];
    }
    hex[64] = '\0';
}

static apsm_status add_file(apsm_context *ctx, const char *path, apsm_sha256 *sha)
{
    unsigned char piece[1 << 16];
    int fd;
    APSM_TRY(apsm_open_regular(ctx, path, &fd));
    int error = 0;
    for (ssize_t n = 1; n != 0 && !error;) {
        n = read(fd, piece, sizeof piece);
        if (n > 0)
            apsm_sha256_add(sha, piece, (size_t)n);
        else if (n < 0 && errno != EINTR)
            error = errno;
    }
    close(fd);
    return error ? apsm_fail_errno(ctx, path, "cannot be read", error) : APSM_OK;
}

apsm_status apsm_sha256_files(apsm_context *ctx, size_t n, const char *const *paths, char hex[65])
{
    unsigned char digest[32];
    apsm_sha256 sha;
    hex[0] = '\0';
    apsm_sha256_begin(&sha);
    for (size_t i = 0; i < n; i++) APSM_TRY(add_file(ctx, paths[i], &sha));
    apsm_sha256_end(&sha, digest);
    apsm_sha256_hex(digest, hex);
    return APSM_OK;
}

apsm_status apsm_sha256_file(apsm_context *ctx, const char *path, char hex[65])
{
    return apsm_sha256_files(ctx, 1, &path, hex);
}
