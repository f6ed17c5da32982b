/* Is the level of the tests kept, and what do they find?  bench_statistics MODEL_DIR [SETS
 * PERMUTATIONS].
 *
 * Null: groups drawn at random from the shapes of a model; how many of the sets have an alarm at 5
 * %. Planted: one group is moved outward by `sd` standard deviations over a particle and its
 * neighbours; share of those particles that are found, and false alarms a set elsewhere.  Beside
 * our tests stand Bonferroni's correction of the parametric T^2, and what peers do (as described:
 * for every particle the mean over 100 draws of equal groups of Benjamini-Hochberg's values over
 * the draws): JSON lines. */
#include "bench.h"
#include "fit/tail.h"
#include "folder/model_folder.h"
#include "optimize/correspondence_loss.h"
#include "statistics/permutation_test.h"

enum { DRAWS = 100, RULES = 7 };
static const double level = 0.05;
static const char *const rules[RULES] = { "all together", "family-wise",   "clusters", "q",
                                          "uncorrected",  "Bonferroni T2", "peers" };

typedef struct scene {
    apsm_context *ctx;
    size_t N, J, permutations;
    const double *P;                /* N x J x 3 */
    double *Y;                      /* with an effect */
    double *p_parametric, *p_peers; /* J */
    uint32_t *near;
    double *sd; /* J */
} scene;

/* Parametric p of T^2 for groups of these rows; J of them. */
static void parametric(const scene *s, size_t n, const size_t *row, const double *group, double *p)
{
    double *Z = bench_doubles(n), *T = bench_doubles(n), *Y = bench_doubles(n * s->J * 3);
    apsm_design design = { 0 };
    apsm_permutation_result r = { 0 };
    for (size_t i = 0; i < n; i++) {
        Z[i] = 1;
        T[i] = group[row[i]];
        memcpy(Y + i * s->J * 3, s->Y + row[i] * s->J * 3, s->J * 3 * sizeof *Y);
    }
    bench_must(apsm_design_make(s->ctx, n, 1, Z, 1, T, &design));
    const apsm_permutation_input in = { &design, Y, s->J, 3, NULL, 1, 0, NULL, 0, 0, false };
    bench_must(apsm_permutation_test(s->ctx, &in, &r));
    for (size_t j = 0; j < s->J; j++) /* F = T^2 (n - 4) / (3 (n - 2)) with 3 and n - 4 */
        p[j] = fit_tail_f(r.statistic[j] * ((double)n - 4) / 3, 3, (double)n - 4);
    apsm_permutation_result_free(&r);
    apsm_design_free(&design);
    free(Z), free(T), free(Y);
}

/* Rows of equal groups, drawn from both. */
static size_t draw_equal(const scene *s, const double *group, apsm_random *rng, size_t *row)
{
    size_t n[2] = { 0, 0 }, list[2][1024], m = 0;
    for (size_t i = 0; i < s->N; i++) list[group[i] > 0][n[group[i] > 0]++] = i;
    const size_t least = n[0] < n[1] ? n[0] : n[1];
    for (int g = 0; g < 2; g++)
        for (size_t k = 0; k < least; k++) {
            const size_t with = k + apsm_random_below(rng, n[g] - k), x = list[g][k];
            row[m++] = list[g][with];
            list[g][with] = x;
        }
    return m;
}

static void as_peers(const scene *s, const double *group, uint64_t set, double *p)
{
    apsm_random rng = apsm_random_stream(9, APSM_STREAM_TEST, set, 0);
    double *all = bench_doubles(DRAWS * s->J), one[DRAWS], q[DRAWS];
    size_t *row = bench_alloc(s->N * sizeof *row);
    for (size_t k = 0; k < DRAWS; k++)
        parametric(s, draw_equal(s, group, &rng, row), row, group, all + k * s->J);
    for (size_t j = 0; j < s->J; j++) {
        p[j] = 0;
        for (size_t k = 0; k < DRAWS; k++) one[k] = all[k * s->J + j];
        bench_must(apsm_false_discovery(DRAWS, one, q));
        for (size_t k = 0; k < DRAWS; k++) p[j] += q[k] / DRAWS;
    }
    free(all), free(row);
}

/* Whether rule k raises an alarm at particle j. */
static bool alarm(const scene *s, const apsm_permutation_result *r, int k, size_t j)
{
    const double p[RULES] = { r->p_ratio,       r->p_familywise[j],
                              r->p_enhanced[j], r->q[j],
                              r->p[j],          s->p_parametric[j] * (double)s->J,
                              s->p_peers[j] };
    return p[k] <= level;
}

/* Columns of the design: the intercept, and with a covariate the shape's centroid size. */
static void covariate(const scene *s, double *x)
{
    for (size_t i = 0; i < s->N; i++) {
        double c[3] = { 0 };
        x[i] = 0;
        for (size_t k = 0; k < 3 * s->J; k++) c[k % 3] += s->P[i * s->J * 3 + k] / (double)s->J;
        for (size_t k = 0; k < 3 * s->J; k++)
            x[i] += (s->P[i * s->J * 3 + k] - c[k % 3]) * (s->P[i * s->J * 3 + k] - c[k % 3]);
    }
}

/* How a set is tested. */
typedef struct test_kind {
    bool with_covariate, unequal, peers;
} test_kind;

static void test_set(const scene *s, const double *group, test_kind kind, uint64_t set,
                     apsm_permutation_result *r)
{
    const size_t N = s->N, width = kind.with_covariate ? 2 : 1;
    double *Z = bench_doubles(2 * N), *x = bench_doubles(N);
    size_t *row = bench_alloc(N * sizeof *row);
    apsm_design design = { 0 };
    covariate(s, x);
    for (size_t i = 0; i < N; i++) {
        row[i] = i;
        Z[i * width] = 1;
        if (kind.with_covariate) Z[i * width + 1] = x[i];
    }
    bench_must(apsm_design_make(s->ctx, N, width, Z, 1, group, &design));
    const apsm_permutation_input in = { &design, s->Y,    s->J, 3, NULL,        s->permutations,
                                        6,       s->near, 0,    0, kind.unequal };
    apsm_context_set_seed(s->ctx, set);
    bench_must(apsm_permutation_test(s->ctx, &in, r));
    parametric(s, N, row, group, s->p_parametric);
    for (size_t j = 0; j < s->J; j++) s->p_peers[j] = 1;
    if (kind.peers) as_peers(s, group, set, s->p_peers);
    apsm_design_free(&design);
    free(Z), free(x), free(row);
}

static void draw_groups(const scene *s, size_t n1, uint64_t set, double *group)
{
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, set, 0);
    for (size_t i = 0; i < s->N; i++) group[i] = i < n1 ? 1 : -1;
    for (size_t i = s->N; i-- > 1;) {
        const size_t with = apsm_random_below(&rng, i + 1);
        const double x = group[i];
        group[i] = group[with];
        group[with] = x;
    }
}

/* A way of making sets without an effect. */
typedef struct null_kind {
    const char *name;
    double share;        /* of the shapes in the first group */
    double spread;       /* what deviations of that group from the mean are multiplied with */
    bool with_covariate; /* size is allowed for */
    bool unequal;        /* the test allows for it */
} null_kind;

static const null_kind null_kinds[] = {
    { "half and half", 0.5, 1, false, false },
    { "30 % against 70 %", 0.3, 1, false, false },
    { "half and half, size allowed for", 0.5, 1, true, false },
    { "30 % against 70 %, size allowed for", 0.3, 1, true, false },
    { "half and half, one group spread 1.5 times", 0.5, 1.5, false, false },
    { "30 % spread 1.5 times", 0.3, 1.5, false, false },
    { "70 % spread 1.5 times", 0.7, 1.5, false, false },
    { "30 % spread 1.5 times, size allowed for", 0.3, 1.5, true, false },
    { "half and half", 0.5, 1, false, true },
    { "30 % against 70 %", 0.3, 1, false, true },
    { "half and half, one group spread 1.5 times", 0.5, 1.5, false, true },
    { "30 % spread 1.5 times", 0.3, 1.5, false, true },
    { "70 % spread 1.5 times", 0.7, 1.5, false, true },
    { "30 % spread 1.5 times, size allowed for", 0.3, 1.5, true, true },
};
enum { NULL_KINDS = sizeof null_kinds / sizeof *null_kinds };

/* Y <- the shapes, those of the first group with wider deviations from the mean of all. */
static void spread_group(scene *s, const double *group, double spread)
{
    const size_t width = s->J * 3;
    double *mean = bench_doubles(width);
    for (size_t k = 0; k < width; k++) mean[k] = 0;
    for (size_t i = 0; i < s->N * width; i++) mean[i % width] += s->P[i] / (double)s->N;
    for (size_t i = 0; i < s->N * width; i++)
        s->Y[i] =
            group[i / width] > 0 ? mean[i % width] + spread * (s->P[i] - mean[i % width]) : s->P[i];
    free(mean);
}

static void null_sets(scene *s, const null_kind *kind, size_t sets, bool peers)
{
    double *group = bench_doubles(s->N), alarms[RULES] = { 0 };
    for (size_t set = 0; set < sets; set++) {
        apsm_permutation_result r = { 0 };
        draw_groups(s, (size_t)(kind->share * (double)s->N), set, group);
        spread_group(s, group, kind->spread);
        test_set(s, group, (test_kind){ kind->with_covariate, kind->unequal, peers }, set, &r);
        for (int k = 0; k < RULES; k++) {
            bool any = false;
            for (size_t j = 0; j < s->J; j++) any = any || alarm(s, &r, k, j);
            alarms[k] += any;
        }
        apsm_permutation_result_free(&r);
    }
    for (int k = 0; k < RULES - !peers; k++)
        printf(
            "{\"null\": \"%s\", \"unequal\": %d, \"shapes\": %zu, \"sets\": %zu, \"rule\": \"%s\", "
            "\"sets_with_an_alarm\": %.4f}\n",
            kind->name, kind->unequal, s->N, sets, rules[k], alarms[k] / (double)sets);
    fflush(stdout);
    free(group);
}

/* The particle and those around it. */
static void choose_patch(const scene *s, uint64_t set, bool *planted)
{
    apsm_random rng = apsm_random_stream(4, APSM_STREAM_TEST, set, 0);
    const size_t j = apsm_random_below(&rng, s->J);
    memset(planted, 0, s->J * sizeof *planted);
    planted[j] = true;
    for (size_t k = 0; k < 6; k++) planted[s->near[6 * j + k]] = true;
}

static void plant(scene *s, const double *group, const bool *planted, double shift)
{
    memcpy(s->Y, s->P, s->N * s->J * 3 * sizeof *s->Y);
    for (size_t i = 0; i < s->N; i++)
        for (size_t j = 0; j < s->J; j++)
            if (group[i] > 0 && planted[j]) s->Y[(i * s->J + j) * 3] += shift * s->sd[j];
}

static void planted_sets(scene *s, size_t sets, double shift, bool unequal)
{
    double *group = bench_doubles(s->N), found[RULES] = { 0 }, wrong[RULES] = { 0 }, all = 0;
    bool *planted = bench_alloc(s->J * sizeof *planted);
    for (size_t set = 0; set < sets; set++) {
        apsm_permutation_result r = { 0 };
        draw_groups(s, s->N / 2, set, group);
        choose_patch(s, set, planted);
        plant(s, group, planted, shift);
        test_set(s, group, (test_kind){ false, unequal, !unequal }, set, &r);
        for (size_t j = 0; j < s->J; j++) {
            all += planted[j];
            for (int k = 0; k < RULES; k++)
                *(planted[j] ? &found[k] : &wrong[k]) += alarm(s, &r, k, j);
        }
        apsm_permutation_result_free(&r);
    }
    for (int k = 0; k < RULES; k++)
        printf("{\"planted\": \"%.1f sd\", \"unequal\": %d, \"shapes\": %zu, \"sets\": %zu, "
               "\"rule\": \"%s\", "
               "\"found\": %.3f, \"false_particles_a_set\": %.2f}\n",
               shift, unequal, s->N, sets, rules[k], found[k] / all, wrong[k] / (double)sets);
    free(group), free(planted);
}

static void deviations(scene *s)
{
    for (size_t j = 0; j < s->J; j++) {
        double mean = 0, sum = 0;
        for (size_t i = 0; i < s->N; i++) mean += s->P[(i * s->J + j) * 3] / (double)s->N;
        for (size_t i = 0; i < s->N; i++)
            sum += (s->P[(i * s->J + j) * 3] - mean) * (s->P[(i * s->J + j) * 3] - mean);
        s->sd[j] = sqrt(sum / (double)(s->N - 1));
    }
}

/* 10,000 orders of 100 shapes with 1,024 particles and a covariate: noise, and a planted shift. */
static void time_orders(apsm_context *ctx, double shift, double risk)
{
    enum { N = 100, J = 1024 };
    double *Y = bench_doubles(N * J * 3), Z[2 * N], T[N];
    uint32_t *near = bench_alloc(J * 6 * sizeof *near);
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    for (size_t k = 0; k < N * J * 3; k++) Y[k] = apsm_random_normal(&rng);
    for (uint32_t k = 0; k < J * 6; k++) near[k] = (k / 6 + k % 6 + 1) % J;
    for (size_t i = 0; i < N; i++) {
        Z[2 * i] = 1;
        Z[2 * i + 1] = apsm_random_normal(&rng);
        T[i] = i < N / 2;
        for (size_t k = 0; k < 3 * 40 && i < N / 2; k += 3) Y[i * J * 3 + k] += shift;
    }
    apsm_design design = { 0 };
    apsm_permutation_result r = { 0 };
    bench_must(apsm_design_make(ctx, N, 2, Z, 1, T, &design));
    const apsm_permutation_input in = {
        &design, Y, J, 3, NULL, 10000, 6, near, risk, level, false
    };
    const double start = bench_now();
    bench_must(apsm_permutation_test(ctx, &in, &r));
    printf("{\"time\": \"%g sd over 40 particles\", \"stop_risk\": %g, \"orders\": %zu, "
           "\"cpu_seconds\": %.2f}\n",
           shift, risk, r.permutations, bench_now() - start);
    apsm_permutation_result_free(&r);
    apsm_design_free(&design);
    free(Y), free(near);
}

int main(int argc, char **argv)
{
    const size_t sets = argc > 2 ? strtoul(argv[2], NULL, 10) : 200;
    model_folder m = { 0 };
    scene s = { .ctx = apsm_context_new(),
                .permutations = argc > 3 ? strtoul(argv[3], NULL, 10) : 499 };
    if (argc < 2 || !s.ctx) {
        fprintf(stderr, "usage: bench_statistics MODEL_DIR [SETS PERMUTATIONS [FIRST]], or time\n");
        return 2;
    }
    for (int k = 0; k < 4 && strcmp(argv[1], "time") == 0; k++)
        time_orders(s.ctx, k < 2 ? 0 : 2, k % 2 ? 0.001 : 0);
    if (strcmp(argv[1], "time") == 0) return 0;
    if (model_folder_read(s.ctx, argv[1], FOLDER_PARTICLES | FOLDER_EVALUATED, &m) != APSM_OK) {
        fprintf(stderr, "bench_statistics: %s\n", apsm_error_text(s.ctx));
        return 1;
    }
    s.N = m.I < 1024 ? m.I : 1024;
    s.J = m.J;
    s.P = m.P;
    s.Y = bench_doubles(s.N * s.J * 3);
    s.p_parametric = bench_doubles(s.J);
    s.p_peers = bench_doubles(s.J);
    s.sd = bench_doubles(s.J);
    s.near = bench_alloc(s.J * 6 * sizeof *s.near);
    bench_must(apsm_neighbours6(s.J, m.model.mean, s.near));
    deviations(&s);
    const size_t first = argc > 4 ? strtoul(argv[4], NULL, 10) : 0;
    for (size_t k = first; k < NULL_KINDS; k++) null_sets(&s, &null_kinds[k], sets, false);
    null_sets(&s, &null_kinds[0], sets / 10 + 1, true);
    for (int unequal = 0; unequal < 2; unequal++) {
        planted_sets(&s, sets / 10 + 1, 1.0, unequal);
        planted_sets(&s, sets / 10 + 1, 1.5, unequal);
    }
    model_folder_free(&m);
    return 0;
}
