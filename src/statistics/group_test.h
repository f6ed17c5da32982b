/* group_test.h -- one test from model folder to results, step by step: what `apsm test` does, and
 * `apsm asymmetry` twice. */
#ifndef APSM_STATISTICS_GROUP_TEST_H
#define APSM_STATISTICS_GROUP_TEST_H

#include "apsm/statistics.h"
#include "folder/model_folder.h"
#include "statistics/classify.h"
#include "statistics/effect.h"
#include "statistics/formula.h"
#include "statistics/permutation_test.h"

typedef enum test_on { ON_FORM, ON_SHAPE, ON_SIZE, ON_MODES, ON_COLUMN, ON_COUNT } test_on;

/* An effect that is told: a name and a contrast of the tested coefficients. */
typedef struct told_effect {
    char name[160];
    double *contrast;
    apsm_effect effect;
} told_effect;

/* Zero-initialise but for ctx and s (borrowed); group_test_free frees what the steps made. */
typedef struct group_test {
    apsm_context *ctx;
    const apsm_test_settings *s;
    const char *title; /* heading in the results; NULL: none */
    const char *stem;  /* files are STEM_ON; NULL: OF_ON */
    bool is_magnitude; /* the tested coefficients are no effects that can be told one by one */
    test_on on;
    model_folder m;
    apsm_table table;
    apsm_formula formula;
    const apsm_column *within, *response; /* of --on COLUMN; NULL else */
    bool *used;                           /* m.I */
    size_t N, *row; /* what is tested: a shape each, or the first of some that were averaged */
    size_t *block, *stratum;
    apsm_design design;
    size_t V, w;
    double *size;      /* m.I */
    double *Y;         /* N x V x w */
    double *P;         /* N x J x 3: form or shape, for the classification */
    double *direction; /* J x 3 */
    uint32_t *near;
    apsm_permutation_result result;
    double spread; /* largest variance of a tested group over the smallest; 0: no groups */
    size_t effects;
    told_effect *effect;
    apsm_classification classification;
    bool classified;
} group_test;

/* Folder, table and formula. */
apsm_status group_test_read(group_test *t) APSM_NODISCARD;
/* Whether the results may be written. */
apsm_status group_test_claim(const group_test *t) APSM_NODISCARD;
/* used, row, N: shapes of which all is known. */
apsm_status group_test_rows(group_test *t) APSM_NODISCARD;
/* P and Y of the rows. */
apsm_status group_test_variables(group_test *t) APSM_NODISCARD;
/* The design of the rows, with blocks and strata. */
apsm_status group_test_design(group_test *t) APSM_NODISCARD;
/* Tests, effects, and how well groups are told apart. */
apsm_status group_test_judge(group_test *t) APSM_NODISCARD;
/* Results into their folder, and the table of --subjects into the model folder. */
apsm_status group_test_write(const group_test *t) APSM_NODISCARD;
/* SHA-256 of the model that the results are about. */
apsm_status group_test_hash(const group_test *t, char hex[65]) APSM_NODISCARD;
void group_test_tell(const group_test *t);
void group_test_free(group_test *t);

/* The tested term, if it is one column of categories; NULL: it is not. */
const apsm_column *group_test_category(const group_test *t);
/* What was tested, in one word. */
const char *group_test_on_word(const group_test *t);

/* number (N, out) <- the column's levels among the rows, counted from 0 in the order they occur. */
void number_rows(const apsm_column *c, size_t N, const size_t *row, size_t *number);

#endif
