#include "cmocka_all.h"
#include "folder.h"
#include "folder/model_json.h"

/* Two modes of four shapes; names that a CSV has to quote are among them. */
enum { I = 4, J = 5, M = 2 };
static const char *const names[I] = { "a", "b,c", "d \"e\"", "f" };

typedef struct sample {
    double mean[J * 3], mode[M * J * 3], variance[M], score[I * M];
    apsm_shape_model model;
} sample;

static void make(sample *s)
{
    for (size_t k = 0; k < J * 3; k++) s->mean[k] = 1.0 / (double)(k + 3);
    for (size_t k = 0; k < M * J * 3; k++) s->mode[k] = -0.1 * (double)k;
    for (size_t k = 0; k < I * M; k++) s->score[k] = 1e-7 * (double)k - 3.0 / 7;
    s->variance[0] = 2.0 / 3;
    s->variance[1] = 1e-300;
    s->model = (apsm_shape_model){ I, J, M, s->mean, s->mode, s->variance, s->score };
}

static void what_is_written_is_read_to_the_last_bit(void **state)
{
    sample s;
    char path[TEST_PATH];
    apsm_shape_model got;
    make(&s);
    folder_path(state, "model.json", path);
    assert_int_equal(model_json_write(NULL, path, &s.model), APSM_OK);
    assert_int_equal(model_json_read(NULL, path, &got), APSM_OK);
    assert_int_equal(got.I, I);
    assert_int_equal(got.J, J);
    assert_int_equal(got.modes, M);
    assert_memory_equal(got.mean, s.mean, sizeof s.mean);
    assert_memory_equal(got.mode, s.mode, sizeof s.mode);
    assert_memory_equal(got.variance, s.variance, sizeof s.variance);
    folder_path(state, "scores.csv", path);
    assert_int_equal(scores_csv_write(NULL, path, names, "mode", &s.model), APSM_OK);
    assert_int_equal(scores_csv_read(NULL, path, names, &got), APSM_OK);
    assert_memory_equal(got.score, s.score, sizeof s.score);
    apsm_shape_model_free(&got);
}

static void refuse_scores(void **state, const char *text, const char *where)
{
    sample s;
    char path[TEST_PATH], line[TEST_PATH + 8];
    apsm_context *ctx = apsm_context_new();
    make(&s);
    s.model.score = NULL;
    folder_put(state, "scores.csv", text, strlen(text));
    folder_path(state, "scores.csv", path);
    assert_int_equal(scores_csv_read(ctx, path, names, &s.model), APSM_ERR_FORMAT);
    snprintf(line, sizeof line, "%s:%s:", path, where);
    assert_non_null(strstr(apsm_error_text(ctx), line));
    free(s.model.score);
    apsm_context_free(ctx);
}

static void scores_of_other_shapes_or_modes_are_refused(void **state)
{
    refuse_scores(state, "", "1");
    refuse_scores(state, "name,mode_1\na,1\n", "1");
    refuse_scores(state, "name,mode_1,mode_2\nb,1,2\n", "2");
    refuse_scores(state, "name,mode_1,mode_2\na,1,2\nb,1,2\n", "3");
    refuse_scores(state, "name,mode_1,mode_2\na,1,2\n\"b,c\",1,2\n\"d \"\"e\"\"\",1\n", "4");
    refuse_scores(state, "name,mode_1,mode_2\na,1,2\n\"b,c\",1,2\n\"d \"\"e\"\"\",1,nan\n", "4");
    refuse_scores(
        state, "name,mode_1,mode_2\na,1,2\n\"b,c\",1,2\n\"d \"\"e\"\"\",1,2\nf,1,2\ng,1,2\n", "6");
}

static void refuse_model(void **state, const char *text)
{
    char path[TEST_PATH];
    apsm_shape_model got;
    folder_put(state, "model.json", text, strlen(text));
    assert_int_equal(model_json_read(NULL, folder_path(state, "model.json", path), &got),
                     APSM_ERR_FORMAT);
    assert_null(got.mean);
}

#define HEAD "{\"format\":\"apsm-model\",\"version\":1,"
static void parts_that_do_not_fit_are_refused(void **state)
{
    refuse_model(state, HEAD "\"shapes\":2,\"particles\":1}");
    refuse_model(state,
                 HEAD "\"shapes\":2,\"particles\":1,\"mean\":[[0,0,0]],\"modes\":[[[1,0,0]]],"
                      "\"variances\":[]}");
    refuse_model(state,
                 HEAD "\"shapes\":2,\"particles\":1,\"mean\":[[0,0,0]],\"modes\":[[[1,0,0]]],"
                      "\"variances\":[-1]}");
    refuse_model(state,
                 HEAD "\"shapes\":1,\"particles\":1,\"mean\":[[0,0,0]],\"modes\":[[[1,0,0]]],"
                      "\"variances\":[1]}");
    refuse_model(state, HEAD "\"shapes\":2,\"particles\":4611686018427387904,\"mean\":[[0,0,0]],"
                             "\"modes\":[],\"variances\":[]}");
    refuse_model(state, "{\"format\":\"apsm-model\",\"version\":2,\"shapes\":2,\"particles\":1,"
                        "\"mean\":[[0,0,0]],\"modes\":[],\"variances\":[]}");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_is_written_is_read_to_the_last_bit, folder_set_up,
                                        folder_tear_down),
        cmocka_unit_test_setup_teardown(scores_of_other_shapes_or_modes_are_refused, folder_set_up,
                                        folder_tear_down),
        cmocka_unit_test_setup_teardown(parts_that_do_not_fit_are_refused, folder_set_up,
                                        folder_tear_down)
    };
    return cmocka_run_group_tests_name("model_json", tests, NULL, NULL);
}
