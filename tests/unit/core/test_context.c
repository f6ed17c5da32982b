/* Messages, failures and loops are the same for any number of threads; nothing needs a context. */
#include "cmocka_all.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/context.h"
#include "apsm/version.h"
#include "core/deal.h"
#include "core/sized.h"

enum { N = 40 };

typedef struct heard {
    size_t lines;
    char text[N + 1][64];
    size_t told, last_done;
} heard;

static void hear(void *user, apsm_log_level level, const char *text)
{
    heard *h = user;
    (void)level;
    if (h->lines <= N) snprintf(h->text[h->lines], sizeof h->text[0], "%s", text);
    h->lines++;
}

static void watch(void *user, const apsm_progress *progress)
{
    heard *h = user;
    h->told++;
    assert_true(progress->done >= h->last_done && progress->total == N);
    h->last_done = progress->done;
}

/* Tasks 7 and 23 fail. */
static apsm_status task(apsm_context *ctx, size_t i, int worker, void *user)
{
    int *done = user;
    assert_true(worker >= 0 && worker < 3);
    apsm_log(ctx, APSM_LOG_INFO, "task %zu", i);
    done[i]++;
    if (i == 7) return apsm_fail(ctx, APSM_ERR_GEOMETRY, "seven");
    return i == 23 ? apsm_fail(ctx, APSM_ERR_IO, "twenty-three") : APSM_OK;
}

static void loops_tell_the_same_for_any_number_of_threads(void **state)
{
    (void)state;
    for (int threads = 1; threads <= 3; threads++) {
        heard h = { 0 };
        int done[N] = { 0 };
        apsm_context *ctx = apsm_context_new();
        apsm_context_set_threads(ctx, threads);
        apsm_context_set_log(ctx, hear, &h);
        apsm_context_set_progress(ctx, watch, &h);
        assert_int_equal(apsm_parallel_for(ctx, N, task, done, "tasks"), APSM_ERR_GEOMETRY);
        assert_string_equal(apsm_error_text(ctx), "seven");
        assert_int_equal(h.lines, N);
        assert_int_equal(h.last_done, N);
        for (int i = 0; i < N; i++) {
            char line[64];
            snprintf(line, sizeof line, "task %d", i);
            assert_string_equal(h.text[i], line);
            assert_int_equal(done[i], 1);
        }
        apsm_context_free(ctx);
    }
}

static void a_raised_flag_skips_what_has_not_begun(void **state)
{
    (void)state;
    const volatile int flag = 1;
    int done[N] = { 0 };
    apsm_context *ctx = apsm_context_new();
    apsm_context_set_interrupt(ctx, &flag);
    assert_true(apsm_interrupted(ctx));
    assert_int_equal(apsm_parallel_for(ctx, N, task, done, NULL), APSM_ERR_INTERRUPTED);
    for (int i = 0; i < N; i++) assert_int_equal(done[i], 0);
    apsm_context_free(ctx);
}

static void a_failure_may_quote_the_one_before(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    assert_string_equal(apsm_error_text(ctx), "");
    assert_int_equal(apsm_fail(ctx, APSM_ERR_IO, "a.ply: %s", "missing"), APSM_ERR_IO);
    assert_int_equal(apsm_fail(ctx, APSM_ERR_ARG, "b: %s", apsm_error_text(ctx)), APSM_ERR_ARG);
    assert_string_equal(apsm_error_text(ctx), "b: a.ply: missing");
    apsm_context_free(ctx);
}

static void nothing_needs_a_context_to_fail(void **state)
{
    (void)state;
    assert_int_equal(apsm_fail(NULL, APSM_ERR_MEMORY, "%s", "x"), APSM_ERR_MEMORY);
    assert_string_equal(apsm_error_text(NULL), "");
    apsm_log(NULL, APSM_LOG_WARNING, "nobody hears");
    apsm_context_free(NULL);
}

static void odd_numbers_of_threads_are_one(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    assert_int_equal(apsm_context_threads(ctx), 1);
    apsm_context_set_threads(ctx, -3);
    assert_int_equal(apsm_context_threads(ctx), 1);
    apsm_context_set_threads(ctx, 0);
    assert_int_equal(apsm_context_threads(ctx), 1);
    apsm_context_free(ctx);
}

static void every_status_has_a_text(void **state)
{
    (void)state;
    for (int s = 0; s < APSM_STATUS_COUNT; s++)
        assert_true(strlen(apsm_status_text((apsm_status)s)) > 0);
    assert_non_null(apsm_status_text((apsm_status)APSM_STATUS_COUNT));
    assert_non_null(apsm_status_text((apsm_status)-1));
    assert_string_equal(apsm_version(), APSM_VERSION);
}

/* A struct of an earlier program is filled up with zeroes; what a later one asks for and we do not
 * know is refused, unless it is zero. */
static void structs_of_other_versions_are_taken_as_far_as_they_are_known(void **state)
{
    (void)state;
    const unsigned char given[6] = { 1, 2, 3, 4, 0, 0 }, later[6] = { 1, 2, 3, 4, 0, 9 };
    unsigned char known[4] = { 0 };
    assert_true(apsm_take_sized(given, 2, known, 4));
    assert_memory_equal(known, ((unsigned char[]){ 1, 2, 0, 0 }), 4);
    assert_true(apsm_take_sized(given, 6, known, 4));
    assert_memory_equal(known, given, 4);
    assert_false(apsm_take_sized(later, 6, known, 4));
    assert_false(apsm_take_sized(NULL, 6, known, 4));
}

/* ---- dealing ---- */

enum { DEALT = 11 };
typedef struct dealt {
    int order[DEALT]; /* when each task ran, from 1; 0: never */
    int n, met;       /* tasks so far; when the meeting was */
    apsm_status word; /* of the meeting */
} dealt;

static apsm_status note_order(apsm_context *ctx, size_t i, int worker, void *user)
{
    dealt *d = user;
    (void)ctx, (void)worker;
    assert_int_equal(d->order[i], 0);
    d->order[i] = ++d->n;
    return APSM_OK;
}

static apsm_status meet(apsm_context *ctx, void *user)
{
    dealt *d = user;
    (void)ctx;
    d->met = d->n;
    return d->word;
}

/* Whoever deals with whom: own tasks first, then the meeting, then each of the others once; none
 * of the others if the meeting says no. */
static void own_tasks_come_before_the_others(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    assert_non_null(ctx);
    for (size_t size = 1; size <= DEALT + 2; size++)
        for (size_t rank = 0; rank < size; rank++)
            for (int refuses = 0; refuses < 2; refuses++) {
                dealt d = { .word = refuses ? APSM_ERR_INTERRUPTED : APSM_OK };
                const apsm_deal deal = { rank, size, &d, meet, NULL };
                apsm_context_set_deal(ctx, &deal);
                assert_int_equal(apsm_dealt_for(ctx, DEALT, note_order, &d, NULL), d.word);
                for (size_t i = 0; i < DEALT; i++) {
                    const bool own = i % size == rank;
                    assert_int_equal(d.order[i] > 0, own || !refuses);
                    if (d.order[i] > 0) assert_int_equal(d.order[i] <= d.met, own);
                }
            }
    apsm_context_free(ctx);
}

/* ---- gathering ---- */

/* Processes of which one is tested; the others' results are known. */
typedef struct fake {
    size_t size, rank, n, bytes;
    const size_t *element;
    unsigned char *array; /* n x bytes */
    size_t given[DEALT];  /* elements that each process has given so far */
} fake;

/* What a task makes of element e. */
static unsigned char result_of(size_t e)
{
    return (unsigned char)(3 * e + 1);
}

static apsm_status make_element(apsm_context *ctx, size_t k, int worker, void *user)
{
    const fake *f = user;
    const size_t e = f->element ? f->element[k] : k;
    (void)worker;
    assert_true(apsm_is_own(ctx, e) && e % f->size == f->rank);
    assert_int_equal(f->array[e * f->bytes], 0);
    f->array[e * f->bytes] = f->array[(e + 1) * f->bytes - 1] = result_of(e);
    return APSM_OK;
}

static void fake_gather(void *user, size_t bytes, const void *own, void *all)
{
    fake *f = user;
    const size_t room = bytes / f->bytes;
    unsigned char *to = all;
    memset(to, 0xee, f->size * bytes);
    for (size_t q = 0; q < f->size; q++) {
        size_t number = 0, here = 0;
        for (size_t k = 0; k < f->n; k++) {
            const size_t e = f->element ? f->element[k] : k;
            if (e % f->size != q || number++ < f->given[q] || here == room) continue;
            unsigned char *x = to + (q * room + here) * f->bytes;
            x[0] = x[f->bytes - 1] = result_of(e);
            if (q == f->rank)
                assert_int_equal(((const unsigned char *)own)[here * f->bytes], result_of(e));
            here++;
        }
        f->given[q] += here;
    }
}

static void gather_once(size_t size, size_t rank, size_t n, size_t bytes, const size_t *element)
{
    fake f = { .size = size, .rank = rank, .n = n, .bytes = bytes, .element = element };
    const apsm_deal deal = { rank, size, &f, NULL, fake_gather };
    apsm_context *ctx = apsm_context_new();
    assert_non_null(ctx);
    f.array = calloc(n, bytes);
    assert_non_null(f.array);
    apsm_context_set_deal(ctx, &deal);
    assert_int_equal(apsm_own_for(ctx, n, element, make_element, &f, NULL), APSM_OK);
    assert_int_equal(apsm_gather(ctx, n, element, bytes, f.array), APSM_OK);
    for (size_t e = 0; e < n; e++) {
        assert_int_equal(f.array[e * bytes], result_of(e));
        assert_int_equal(f.array[(e + 1) * bytes - 1], result_of(e));
    }
    free(f.array);
    apsm_context_free(ctx);
}

/* Each process does its own and has them all in the end, in whatever order tasks come, and where
 * they go round in several turns. */
static void what_others_did_is_gathered(void **state)
{
    static const size_t order[DEALT] = { 4, 0, 10, 7, 2, 9, 1, 3, 8, 6, 5 };
    (void)state;
    for (size_t size = 1; size <= DEALT; size++)
        for (size_t rank = 0; rank < size; rank++) {
            gather_once(size, rank, DEALT, 24, NULL);
            gather_once(size, rank, DEALT, 2, order);
        }
    gather_once(2, 0, 5, (1 << 24) - 8, NULL);
    gather_once(2, 1, 5, 1 << 23, NULL);
}

/* ---- shared loops ---- */

/* A journal in memory, and a loop that makes two arrays. */
typedef struct sharing {
    bool kept[DEALT];
    uint16_t piece[DEALT]; /* both results of a task, in the order of the arrays */
    unsigned char one[DEALT], two[DEALT];
    bool made[DEALT];
    size_t meetings;
} sharing;

static bool recall_piece(void *user, const char *kind, size_t i, size_t size, void *data)
{
    const sharing *s = user;
    assert_string_equal(kind, "loop");
    assert_int_equal(size, sizeof s->piece[i]);
    if (s->kept[i]) memcpy(data, &s->piece[i], size);
    return s->kept[i];
}

static apsm_status keep_piece(apsm_context *ctx, void *user, const char *kind, size_t i,
                              size_t size, const void *data)
{
    sharing *s = user;
    (void)ctx;
    assert_string_equal(kind, "loop");
    assert_int_equal(size, sizeof s->piece[i]);
    assert_false(s->kept[i]);
    memcpy(&s->piece[i], data, size);
    s->kept[i] = true;
    return APSM_OK;
}

static apsm_status make_two(apsm_context *ctx, size_t i, int worker, void *user)
{
    sharing *s = user;
    (void)ctx, (void)worker;
    assert_false(s->made[i]);
    s->made[i] = true;
    s->one[i] = result_of(i);
    s->two[i] = (unsigned char)~result_of(i);
    return APSM_OK;
}

static apsm_status count_meeting(apsm_context *ctx, void *user)
{
    (void)ctx;
    ((sharing *)user)->meetings++;
    return APSM_OK;
}

/* The loop by one process that finds what is kept in s; size 0: no share. */
static apsm_status share_loop(sharing *s, size_t rank, size_t size, bool decides)
{
    apsm_context *ctx = apsm_context_new();
    assert_non_null(ctx);
    const apsm_keeper keeper = { s, recall_piece, keep_piece };
    const apsm_deal deal = { rank, size, s, count_meeting, NULL };
    const apsm_shared_loop loop = { .kind = "loop",
                                    .n = DEALT,
                                    .fn = make_two,
                                    .user = s,
                                    .decides = decides,
                                    .made = { { s->one, 1 }, { s->two, 1 } } };
    apsm_context_set_keeper(ctx, &keeper);
    if (size > 0) apsm_context_set_deal(ctx, &deal);
    assert_int_equal(apsm_is_share(ctx), size > 0);
    memset(s->one, 0xee, sizeof s->one);
    memset(s->two, 0xee, sizeof s->two);
    memset(s->made, 0, sizeof s->made);
    const apsm_status status = apsm_shared_for(ctx, &loop);
    apsm_context_free(ctx);
    return status;
}

static bool has_both(const sharing *s, size_t i)
{
    return s->one[i] == result_of(i) && s->two[i] == (unsigned char)~result_of(i);
}

/* A share makes its own, once; of the others it has nothing, or, where they decide, what they have
 * kept or an end; who gathers makes what is missing alone. */
static void what_shares_kept_is_found(void **state)
{
    (void)state;
    for (size_t size = 1; size <= DEALT + 1; size++) {
        sharing s = { .meetings = 0 };
        for (size_t rank = 0; rank < size; rank += 2) {
            assert_int_equal(share_loop(&s, rank, size, false), APSM_OK);
            for (size_t i = 0; i < DEALT; i++) {
                assert_int_equal(s.made[i], i % size == rank);
                assert_true(s.made[i] ? has_both(&s, i) : s.one[i] == 0 && s.two[i] == 0);
            }
        }
        assert_int_equal(s.meetings, 0);
        const bool whole = size == 1;
        assert_int_equal(share_loop(&s, 0, size, true), whole ? APSM_OK : APSM_ERR_INTERRUPTED);
        assert_int_equal(share_loop(&s, 0, 0, false), APSM_OK);
        for (size_t i = 0; i < DEALT; i++) {
            assert_int_equal(s.made[i], i % size % 2 != 0);
            assert_true(has_both(&s, i));
        }
        assert_int_equal(share_loop(&s, 0, size, true), APSM_OK);
        for (size_t i = 0; i < DEALT; i++) assert_true(!s.made[i] && has_both(&s, i));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(loops_tell_the_same_for_any_number_of_threads),
        cmocka_unit_test(a_raised_flag_skips_what_has_not_begun),
        cmocka_unit_test(a_failure_may_quote_the_one_before),
        cmocka_unit_test(nothing_needs_a_context_to_fail),
        cmocka_unit_test(odd_numbers_of_threads_are_one),
        cmocka_unit_test(every_status_has_a_text),
        cmocka_unit_test(structs_of_other_versions_are_taken_as_far_as_they_are_known),
        cmocka_unit_test(own_tasks_come_before_the_others),
        cmocka_unit_test(what_others_did_is_gathered),
        cmocka_unit_test(what_shares_kept_is_found),
    };
    return cmocka_run_group_tests_name("context", tests, NULL, NULL);
}
