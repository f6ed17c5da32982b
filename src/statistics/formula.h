/* formula.h -- "~ group + age + sex + group:age" and the design that it makes of a table. */
#ifndef APSM_STATISTICS_FORMULA_H
#define APSM_STATISTICS_FORMULA_H

#include "statistics/design.h"
#include "statistics/table.h"

enum { APSM_FACTORS_MOST = 4, APSM_TERMS_MOST = 32 };

/* A product of columns (borrowed from the table). */
typedef struct apsm_term {
    size_t factors;
    const apsm_column *factor[APSM_FACTORS_MOST];
} apsm_term;

typedef struct apsm_formula {
    size_t n;
    apsm_term term[APSM_TERMS_MOST];
    size_t of; /* the term that is tested */
} apsm_formula;

/* Terms are joined by +, factors by :, and a*b stands for a + b + a:b.  An intercept is always
 * there. of: one of the terms; NULL or "": the first.  APSM_ERR_ARG, with a line: a column that the
 * table does not have (the nearest is named), a term twice, `of` not among them. */
apsm_status apsm_formula_parse(apsm_context *ctx, const char *text, const char *of,
                               const apsm_table *table, apsm_formula *formula) APSM_NODISCARD;

/* Rows of the table for which all columns of the formula, and `within` if it is not NULL, are
 * known: their indices (malloc'ed) and number. */
apsm_status apsm_formula_rows(const apsm_formula *formula, const apsm_column *within,
                              const apsm_table *table, size_t **row, size_t *N) APSM_NODISCARD;

/* The design of those rows.  Numbers are centred; a category with L levels that occur has L - 1
 * columns, the k-th 1 where it has level k and -1 where it has the last: so a main effect is that
 * at the mean of all else, and interactions vanish there.  within adds the subjects' own levels to
 * what is allowed for. */
apsm_status apsm_formula_design(apsm_context *ctx, const apsm_formula *formula,
                                const apsm_column *within, size_t N, const size_t *row,
                                apsm_design *design) APSM_NODISCARD;

/* Columns of a term over these rows. */
size_t apsm_term_columns(const apsm_term *term, size_t N, const size_t *row);
/* "group:age" */
void apsm_term_name(const apsm_term *term, size_t size, char *name);

#endif
