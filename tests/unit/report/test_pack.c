/* Packed arrays: read back by other code as the viewer does it, and meshes put in order. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "report/order.h"
#include "report/pack.h"

/* The viewer's unpack (report/viewer/src/data.js). */
static void unpack(const pack *p, const json_t *where, uint32_t *out)
{
    size_t entry[4];
    for (size_t k = 0; k < 4; k++) entry[k] = (size_t)json_integer_value(json_array_get(where, k));
    const size_t n = entry[1];
    for (size_t k = 0; k < n; k++) {
        uint32_t folded = 0;
        for (size_t b = entry[3]; b-- > 0;) folded = folded << 8 | p->data[entry[0] + b * n + k];
        const uint32_t difference = (folded >> 1) ^ (0 - (folded & 1));
        const uint32_t sum = difference + (k < entry[2] ? 0 : out[k - entry[2]]);
        out[k] = entry[3] == 4 ? sum : sum & ((1u << 8 * entry[3]) - 1);
    }
}

static void check_round_trip(int width, size_t stride, const uint32_t *x, size_t n)
{
    pack p = { 0 };
    uint32_t *back = calloc(n, sizeof *back);
    json_decref(pack_integers(&p, 3, 1, 1, (const uint32_t[]){ 1, 2, 3 })); /* something before */
    json_t *where = pack_integers(&p, n, stride, width, x);
    assert_non_null(where);
    unpack(&p, where, back);
    for (size_t k = 0; k < n; k++)
        if (back[k] != x[k]) fail_msg("width %d: entry %zu is %u, not %u", width, k, back[k], x[k]);
    json_decref(where);
    free(back);
    pack_free(&p);
}

static void integers_come_back(void **state)
{
    (void)state;
    const uint32_t bytes[] = { 0, 255, 0, 128, 127, 1, 254 };
    const uint32_t words[] = { 65535, 0, 32768, 32767, 1, 65534, 300, 0, 65535 };
    const uint32_t longs[] = { 0, UINT32_MAX, 1, 70000, 1u << 31, (1u << 31) - 1, 5 };
    for (size_t stride = 1; stride <= 3; stride += 2) {
        check_round_trip(1, stride, bytes, sizeof bytes / sizeof *bytes);
        check_round_trip(2, stride, words, sizeof words / sizeof *words);
        check_round_trip(4, stride, longs, sizeof longs / sizeof *longs);
    }
}

static void points_come_back_within_half_a_step(void **state)
{
    (void)state;
    enum { N = 50 };
    const double lo[3] = { -3, 10, 0.5 }, step = 0.01;
    double x[3 * N], base[3 * N];
    uint32_t direct[3 * N], relative[3 * N], of_base[3 * N];
    for (int k = 0; k < 3 * N; k++) {
        x[k] = lo[k % 3] + 2 + 2 * sin(k);
        base[k] = lo[k % 3] + 2 + 2 * cos(3 * k);
    }
    pack p = { 0 };
    json_t *a = pack_points(&p, N, lo, step, NULL, x), *b = pack_points(&p, N, lo, step, base, x),
           *c = pack_points(&p, N, lo, step, NULL, base);
    unpack(&p, a, direct);
    unpack(&p, b, relative);
    unpack(&p, c, of_base);
    for (int k = 0; k < 3 * N; k++) {
        if (fabs(lo[k % 3] + step * direct[k] - x[k]) > 0.501 * step) fail_msg("coordinate %d", k);
        if (((relative[k] + of_base[k]) & 0xffff) != direct[k]) fail_msg("relative %d", k);
    }
    json_decref(a);
    json_decref(b);
    json_decref(c);
    pack_free(&p);
}

static void distances_are_fine_where_they_are_small(void **state)
{
    (void)state;
    const double x[] = { 0, 1e-4, 0.01, 0.5, 3.9, 4 }, largest = 4;
    enum { N = sizeof x / sizeof *x };
    uint32_t q[N];
    pack p = { 0 };
    json_t *where = pack_distances(&p, N, largest, x);
    unpack(&p, where, q);
    for (int k = 0; k < N; k++) {
        const double t = q[k] / 255.0, back = largest * t * t;
        if (fabs(back - x[k]) > largest / 255 * (sqrt(x[k] / largest) + 1 / 510.0))
            fail_msg("%g comes back as %g", x[k], back);
    }
    assert_int_equal(q[0], 0);
    assert_int_equal(q[N - 1], 255);
    json_decref(where);
    pack_free(&p);
}

/* A number that is the same for the same oriented triangles in any order and numbering. */
static double fingerprint(const apsm_mesh *m)
{
    double sum = 0;
    for (size_t f = 0; f < m->nf; f++) {
        const double *a = m->V + 3 * m->F[3 * f], *b = m->V + 3 * m->F[3 * f + 1],
                     *c = m->V + 3 * m->F[3 * f + 2];
        const double volume = a[0] * (b[1] * c[2] - b[2] * c[1]) +
                              a[1] * (b[2] * c[0] - b[0] * c[2]) +
                              a[2] * (b[0] * c[1] - b[1] * c[0]);
        sum += volume * volume * volume + sin(volume);
    }
    return sum;
}

/* An octahedron, a tetrahedron apart from it, and a vertex that no face uses (number 0). */
static void order_keeps_the_mesh(void **state)
{
    (void)state;
    static const double V[] = { 9, 9, 9, 1,  0, 0, -1, 0, 0, 0, 1.5, 0, 0, -1.5, 0, 0,   0,
                                2, 0, 0, -2, 5, 0, 0,  6, 0, 0, 5,   1, 0, 5,    0, 1.25 };
    static const uint32_t F[] = { 1, 3, 5, 6, 4, 2,  3, 2, 5, 7, 9, 8, 2, 4, 5,  4, 1, 5,
                                  3, 1, 6, 7, 8, 10, 2, 3, 6, 1, 4, 6, 8, 9, 10, 9, 7, 10 };
    apsm_mesh m;
    assert_int_equal(apsm_mesh_alloc(&m, 11, 12), APSM_OK);
    memcpy(m.V, V, sizeof V);
    memcpy(m.F, F, sizeof F);
    const double before = fingerprint(&m), volume = apsm_mesh_volume(&m);
    uint32_t old[11];
    assert_int_equal(order_mesh(&m, old), APSM_OK);
    assert_int_equal(m.nv, 10);
    for (size_t v = 0; v < m.nv; v++)
        assert_memory_equal(m.V + 3 * v, V + 3 * old[v], 3 * sizeof *V);
    assert_int_equal(m.nf, 12);
    if (fabs(fingerprint(&m) - before) > 1e-12 || fabs(apsm_mesh_volume(&m) - volume) > 1e-12)
        fail_msg("another mesh: volume %g, not %g", apsm_mesh_volume(&m), volume);
    size_t met = 0; /* numbers turn up in their order */
    for (size_t k = 0; k < 3 * m.nf; k++) {
        if (m.F[k] > met) fail_msg("corner %zu is %u before %zu", k, m.F[k], met);
        met += m.F[k] == met;
    }
    apsm_mesh_free(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(integers_come_back),
        cmocka_unit_test(points_come_back_within_half_a_step),
        cmocka_unit_test(distances_are_fine_where_they_are_small),
        cmocka_unit_test(order_keeps_the_mesh),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
