/* Tables, formulas and the designs that they make. */
#include "cmocka_all.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "statistics/formula.h"

enum { I = 6 };
static const char *const names[I] = { "a", "b", "c", "d", "e, f", "g" };

static apsm_status read_text(apsm_context *ctx, const char *text, apsm_table *table)
{
    char path[] = "/tmp/apsm_table_XXXXXX";
    const int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), (ssize_t)strlen(text));
    close(fd);
    const apsm_status status = apsm_table_read(ctx, path, I, names, table);
    unlink(path);
    return status;
}

static const char good[] = "\xef\xbb\xbfid,age,sex,site\r\n"
                           "a,31,m,x\r\n"
                           "\"e, f\",45.5,f,\"y \"\"1\"\"\"\r\n"
                           "b,NA,f,x\r\n\r\n"
                           "d,28,m,\"y \"\"1\"\"\"\r\n"
                           "c,60,,x\r\n"
                           "g,52,f,x";

static void columns_have_types(void **state)
{
    (void)state;
    apsm_table t = { .I = I };
    assert_ok(read_text(NULL, good, &t));
    const apsm_column *age = apsm_table_find(&t, "age"), *sex = apsm_table_find(&t, "sex"),
                      *site = apsm_table_find(&t, "site");
    assert_int_equal(t.n, 3);
    assert_false(age->category);
    assert_true(age->value[0] == 31 && isnan(age->value[1]) && age->value[4] == 45.5);
    assert_true(sex->category && sex->levels == 2);
    assert_string_equal(sex->level[0], "f");
    assert_true(sex->value[0] == 1 && sex->value[1] == 0 && isnan(sex->value[2]));
    assert_string_equal(site->level[1], "y \"1\"");
    assert_true(site->value[3] == 1 && site->value[4] == 1 && site->value[5] == 0);
    apsm_table_free(&t);
}

/* A column of six values by the name of v. */
static const apsm_column *column_of(const char *const value[I], apsm_table *t)
{
    char text[512] = "id,v\n";
    for (size_t i = 0; i < I; i++)
        snprintf(text + strlen(text), sizeof text - strlen(text), "\"%s\",%s\n", names[i],
                 value[i]);
    *t = (apsm_table){ .I = I };
    assert_ok(read_text(NULL, text, t));
    return apsm_table_find(t, "v");
}

/* Shapes count, not the texts that differ: one group may be called 1, and one age is many. */
static void what_most_shapes_have_is_meant(void **state)
{
    static const char *const groups[I] = { "1", "no", "no", "no", "no", "1" }, *const ages[I] = {
        "30", "30", "30", "30", "thirty", "old"
    };
    apsm_table t;
    (void)state;
    assert_null(apsm_column_spoilt_by(column_of(groups, &t)));
    apsm_table_free(&t);
    assert_non_null(apsm_column_spoilt_by(column_of(ages, &t)));
    apsm_table_free(&t);
}

/* What is written like a number, and is none, with the word that the refusal has for it. */
static void columns_like_numbers_are_refused(void **state)
{
    static const struct {
        const char *value[I], *words; /* words: NULL, groups */
    } tried[] = {
        { { "12 %", "13%", "9.5 %", "12 %", "40%", "NA" }, "percent" },
        { { "12", "13", "9.5", "12%", "40", "" }, "percent" },
        { { "2019-03-01", "2019-03-02", "1970-01-01", "", "2019-03-01", "2019-03-01" }, "a date" },
        { { "1.3.2019", "01.12.2019", "2.3.19", "3.4.19", "5.5.2020", "1.1.20" }, "a date" },
        { { "3/4/19", "3/4/19 12:30", "2019/3/4", "2020-01-02T10:00", "NA", "3/4/19" }, "a date" },
        { { "12 kg", "13 kg", "9.5 kg", "14 kg", "40 kg", "41 kg" }, "begins like one" },
        { { "1", "2", "-1e101", "4", "5", "6" }, "another unit" },
        { { "1", "2", "1e-101", "4", "5", "6" }, "another unit" },
        { { "0", "-0", "1e99", "-1e-99", "5", "6" }, NULL },
        { { "1.5T", "3T", "3T", "1.5T", "3T", "3T" }, NULL },
        { { "20-30", "30-40", "20-30", "30-40", "20-30", "30-40" }, NULL },
        { { "1.2.3.4", "1.2.3.4", "1.2.3.5", "1.2.3.5", "192-168-1", "192-168-1" }, NULL },
        { { "%", "%", "1-1-", "-1-1", "%", "1-1-1-1" }, NULL },
    };
    apsm_context *ctx = apsm_context_new();
    (void)state;
    for (size_t k = 0; k < sizeof tried / sizeof *tried; k++) {
        apsm_table t;
        const apsm_column *c = column_of(tried[k].value, &t);
        const bool taken = apsm_column_check(ctx, I, c) == APSM_OK;
        if (taken != !tried[k].words) fail_msg("%s: wrongly judged", tried[k].value[0]);
        if (!taken && !strstr(apsm_error_text(ctx), tried[k].words))
            fail_msg("'%s' does not say '%s'", apsm_error_text(ctx), tried[k].words);
        apsm_table_free(&t);
    }
    apsm_context_free(ctx);
}

/* Numbers that say who are told apart by their texts, where a double does not tell them. */
static void numbers_made_categories_are_texts(void **state)
{
    static const char *const who[I] = {
        "9007199254740993", "9007199254740992", "007", "7", "NA", "7"
    };
    apsm_table t;
    (void)state;
    const apsm_column *c = column_of(who, &t);
    assert_false(c->category);
    assert_ok(apsm_table_widen(&t, I + 2));
    assert_true(c->value[1] == 9007199254740992.0 && isnan(c->value[I]) && isnan(c->value[I + 1]));
    assert_ok(apsm_table_categorize(&t, "v"));
    assert_ok(apsm_table_categorize(&t, "v")); /* once is enough, twice is the same */
    assert_true(c->category && c->levels == 4 && isnan(c->value[4]));
    assert_true(c->value[0] != c->value[1] && c->value[2] != c->value[3]);
    assert_true(c->value[3] == c->value[5]);
    apsm_table_free(&t);
}

static void refused(const char *text, const char *words)
{
    apsm_context *ctx = apsm_context_new();
    apsm_table t = { .I = I };
    if (read_text(ctx, text, &t) == APSM_OK) fail_msg("taken: %s", text);
    if (!strstr(apsm_error_text(ctx), words))
        fail_msg("'%s' does not say '%s'", apsm_error_text(ctx), words);
    apsm_table_free(&t);
    apsm_context_free(ctx);
}

static void bad_tables(void **state)
{
    (void)state;
    refused("id,age\na,1\nA,2\n", ":3: 'A' is no shape of the model; the nearest is 'a'");
    refused("id,age\na,1\na,2\n", ":3: 'a' stands here a second time");
    refused("id,age\na,1,2\n", ":2: has 3 fields, the header 2");
    refused("id,age,age\na,1,2\n", "two columns are named 'age'");
    refused("id,\na,1\n", "column 2 has no name");
    refused("id\na\n", "two columns at least");
    refused("", "two columns at least");
}

static void parse(const char *text, const char *of, const apsm_table *t, apsm_formula *f)
{
    apsm_context *ctx = apsm_context_new();
    if (apsm_formula_parse(ctx, text, of, t, f) != APSM_OK) fail_msg("%s", apsm_error_text(ctx));
    apsm_context_free(ctx);
}

static void formulas(void **state)
{
    (void)state;
    apsm_table t = { .I = I };
    apsm_formula f;
    char name[100];
    assert_ok(read_text(NULL, good, &t));
    parse("~ 1 + sex*age + `site`", "age:sex", &t, &f);
    assert_int_equal(f.n, 4);
    apsm_term_name(&f.term[f.of], sizeof name, name);
    assert_string_equal(name, "sex:age");
    parse("sex + sex", NULL, &t, &f);
    assert_int_equal(f.n, 1);
    const char *const bad[] = { "",          "~",         "~ 1",    "~ nope",   "~ age +",
                                "~ age sex", "~ age:age", "~ `age", "~ age + 2" };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++)
        assert_int_equal(apsm_formula_parse(NULL, bad[k], NULL, &t, &f), APSM_ERR_ARG);
    assert_int_equal(apsm_formula_parse(NULL, "~ age", "sex", &t, &f), APSM_ERR_ARG);
    apsm_table_free(&t);
}

/* Effect coding: with equal groups the columns of a category and of a centred number are at right
 * angles to the intercept; rows with unknown values are left out. */
static void designs(void **state)
{
    (void)state;
    apsm_table t = { .I = I };
    apsm_formula f;
    apsm_design d = { 0 };
    size_t *row, N;
    assert_ok(read_text(NULL, good, &t));
    parse("~ sex + age", "sex", &t, &f);
    assert_ok(apsm_formula_rows(&f, NULL, &t, &row, &N));
    assert_int_equal(N, 4); /* b and c lack a value */
    assert_ok(apsm_formula_design(NULL, &f, NULL, N, row, &d));
    assert_int_equal(d.r, 2);
    assert_int_equal(d.q, 3);
    const double age[] = { 31, 28, 45.5, 52 }, sex[] = { -1, -1, 1, 1 };
    for (size_t i = 0; i < N; i++) {
        assert_near(d.X[3 * i], 1, 0);
        assert_near(d.X[3 * i + 1], age[i] - 39.125, 1e-12);
        assert_near(d.X[3 * i + 2], sex[i], 0);
    }
    apsm_design_free(&d);
    free(row);
    parse("~ sex + site + age", NULL, &t, &f); /* too many for so few */
    assert_ok(apsm_formula_rows(&f, NULL, &t, &row, &N));
    assert_int_equal(apsm_formula_design(NULL, &f, NULL, N, row, &d), APSM_ERR_ARG);
    free(row);
    apsm_table_free(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(columns_have_types),
                                        cmocka_unit_test(what_most_shapes_have_is_meant),
                                        cmocka_unit_test(columns_like_numbers_are_refused),
                                        cmocka_unit_test(numbers_made_categories_are_texts),
                                        cmocka_unit_test(bad_tables),
                                        cmocka_unit_test(formulas),
                                        cmocka_unit_test(designs) };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
