#include "statistics/formula.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/options.h"

typedef struct parsing {
    apsm_context *ctx;
    const char *text, *at;
    const apsm_table *table;
    apsm_formula *f;
} parsing;

static apsm_status refuse(const parsing *p, const char *why)
{
    return apsm_fail(p->ctx, APSM_ERR_ARG,
                     "--formula '%s': %s; write \"~ group + age + group:age\"", p->text, why);
}

static void skip_blanks(parsing *p)
{
    while (isspace((unsigned char)*p->at)) p->at++;
}

static apsm_status unknown_column(const parsing *p, const char *name)
{
    const apsm_table *t = p->table;
    char known[400] = "";
    for (size_t k = 0; k < t->n; k++)
        snprintf(known + strlen(known), sizeof known - strlen(known), "%s%.60s", k ? ", " : "",
                 t->column[k].name);
    return apsm_fail(p->ctx, APSM_ERR_ARG, "--formula '%s': there is no column '%s'; there %s%s",
                     p->text, name, t->n > 0 ? "are: " : "are no columns: give --subjects FILE.csv",
                     known);
}

/* A name, in backquotes if it has other characters. */
static apsm_status take_name(parsing *p, const apsm_column **column)
{
    char name[200];
    size_t n = 0;
    skip_blanks(p);
    const bool quoted = *p->at == '`';
    p->at += quoted;
    while (*p->at && n + 1 < sizeof name &&
           (quoted ? *p->at != '`'
                   : isalnum((unsigned char)*p->at) || strchr("_.", *p->at) != NULL ||
                         (unsigned char)*p->at >= 0x80))
        name[n++] = *p->at++;
    if (quoted && *p->at++ != '`') return refuse(p, "a backquote is not closed");
    name[n] = '\0';
    if (n == 0) return refuse(p, "a name is missing");
    *column = apsm_table_find(p->table, name);
    skip_blanks(p);
    return *column ? apsm_column_check(p->ctx, p->table->I, *column) : unknown_column(p, name);
}

static bool same_term(const apsm_term *a, const apsm_term *b)
{
    size_t found = 0;
    for (size_t k = 0; k < a->factors; k++)
        for (size_t m = 0; m < b->factors; m++) found += a->factor[k] == b->factor[m];
    return a->factors == b->factors && found == a->factors;
}

static apsm_status add_term(parsing *p, const apsm_term *term)
{
    for (size_t k = 0; k < p->f->n; k++)
        if (same_term(&p->f->term[k], term)) return APSM_OK;
    if (p->f->n == APSM_TERMS_MOST) return refuse(p, "more than 32 terms");
    p->f->term[p->f->n++] = *term;
    return APSM_OK;
}

/* a*b*c: all products of some of them. */
static apsm_status add_products(parsing *p, const apsm_term *all)
{
    for (unsigned size = 1; size <= all->factors; size++)
        for (unsigned set = 1; set < 1u << all->factors; set++) {
            apsm_term some = { 0 };
            for (unsigned k = 0; k < all->factors; k++)
                if (set & 1u << k) some.factor[some.factors++] = all->factor[k];
            if (some.factors == size) APSM_TRY(add_term(p, &some));
        }
    return APSM_OK;
}

static apsm_status take_term(parsing *p)
{
    apsm_term term = { 0 };
    bool star = false;
    do {
        if (term.factors == APSM_FACTORS_MOST) return refuse(p, "more than four factors in a term");
        if (term.factors > 0) star = star || *p->at == '*', p->at++;
        APSM_TRY(take_name(p, &term.factor[term.factors]));
        for (size_t k = 0; k < term.factors; k++)
            if (term.factor[k] == term.factor[term.factors])
                return refuse(p, "a column twice in a term");
        term.factors++;
    } while (*p->at == ':' || *p->at == '*');
    return star ? add_products(p, &term) : add_term(p, &term);
}

static apsm_status take_terms(parsing *p)
{
    skip_blanks(p);
    if (*p->at == '~') p->at++;
    for (;;) {
        skip_blanks(p);
        if (p->at[0] == '1' &&
            (p->at[1] == '\0' || isspace((unsigned char)p->at[1]) || p->at[1] == '+'))
            p->at++; /* the intercept, which is there anyway */
        else
            APSM_TRY(take_term(p));
        skip_blanks(p);
        if (!*p->at) break;
        if (*p->at++ != '+') return refuse(p, "terms are joined by +");
    }
    return p->f->n > 0 ? APSM_OK : refuse(p, "no terms");
}

static apsm_status find_tested(apsm_context *ctx, const char *of, const apsm_table *table,
                               apsm_formula *f)
{
    apsm_formula one = { 0 };
    if (!of || !*of) return APSM_OK;
    parsing p = { ctx, of, of, table, &one };
    APSM_TRY(take_term(&p));
    if (*p.at || one.n != 1) return apsm_fail(ctx, APSM_ERR_ARG, "--of '%s': is not one term", of);
    for (f->of = 0; f->of < f->n; f->of++)
        if (same_term(&f->term[f->of], &one.term[0])) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG, "--of '%s': is no term of the formula; add it there", of);
}

apsm_status apsm_formula_parse(apsm_context *ctx, const char *text, const char *of,
                               const apsm_table *table, apsm_formula *formula)
{
    *formula = (apsm_formula){ 0 };
    parsing p = { ctx, text, text, table, formula };
    APSM_TRY(take_terms(&p));
    return find_tested(ctx, of, table, formula);
}

void apsm_term_name(const apsm_term *term, size_t size, char *name)
{
    size_t used = 0;
    name[0] = '\0';
    for (size_t k = 0; k < term->factors && used < size; k++)
        used +=
            (size_t)snprintf(name + used, size - used, "%s%s", k ? ":" : "", term->factor[k]->name);
}

/* ---- rows ---- */

static bool is_known(const apsm_formula *f, const apsm_column *within, size_t i)
{
    if (within && !isfinite(within->value[i])) return false;
    for (size_t k = 0; k < f->n; k++)
        for (size_t m = 0; m < f->term[k].factors; m++)
            if (!isfinite(f->term[k].factor[m]->value[i])) return false;
    return true;
}

apsm_status apsm_formula_rows(const apsm_formula *formula, const apsm_column *within,
                              const apsm_table *table, size_t **row, size_t *N)
{
    *N = 0;
    *row = malloc((table->I + 1) * sizeof **row);
    if (!*row) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < table->I; i++)
        if (is_known(formula, within, i)) (*row)[(*N)++] = i;
    return APSM_OK;
}

/* ---- columns ---- */

/* The levels of a category that occur among the rows, renumbered: code (levels, out), or their
 * number if code is NULL. */
static size_t number_levels(const apsm_column *c, size_t N, const size_t *row, size_t *code)
{
    size_t n = 0;
    for (size_t k = 0; k < c->levels; k++) {
        bool occurs = false;
        for (size_t i = 0; i < N && !occurs; i++) occurs = c->value[row[i]] == (double)k;
        if (code) code[k] = n;
        n += occurs;
    }
    return n;
}

static size_t columns_of(const apsm_column *c, size_t N, const size_t *row)
{
    if (!c->category) return 1;
    const size_t levels = number_levels(c, N, row, NULL);
    return levels > 0 ? levels - 1 : 0;
}

size_t apsm_term_columns(const apsm_term *term, size_t N, const size_t *row)
{
    size_t n = 1;
    for (size_t k = 0; k < term->factors; k++) n *= columns_of(term->factor[k], N, row);
    return n;
}

/* x (N x columns, out) of one column of the table. */
static apsm_status code_column(const apsm_column *c, size_t N, const size_t *row, double *x)
{
    if (!c->category) {
        double mean = 0;
        for (size_t i = 0; i < N; i++) mean += c->value[row[i]] / (double)N;
        for (size_t i = 0; i < N; i++) x[i] = c->value[row[i]] - mean;
        return APSM_OK;
    }
    size_t *code = malloc((c->levels + 1) * sizeof *code);
    if (!code) return APSM_ERR_MEMORY;
    const size_t n = number_levels(c, N, row, code) - 1;
    for (size_t i = 0; i < N; i++) {
        const size_t level = code[(size_t)c->value[row[i]]];
        for (size_t k = 0; k < n; k++) x[i * n + k] = level == n ? -1 : level == k;
    }
    free(code);
    return APSM_OK;
}

/* out (N x na nb) <- all products of a column of a and one of b. */
static void multiply(size_t N, size_t na, const double *a, size_t nb, const double *b, double *out)
{
    for (size_t i = 0; i < N; i++)
        for (size_t k = 0; k < na * nb; k++)
            out[i * na * nb + k] = a[i * na + k / nb] * b[i * nb + k % nb];
}

static apsm_status code_term(const apsm_term *term, size_t N, const size_t *row, double *out)
{
    const size_t most = N * apsm_term_columns(term, N, row) + N * 64;
    double *so_far = malloc(most * sizeof *so_far), *one = malloc(most * sizeof *one);
    size_t n = 1;
    apsm_status status = so_far && one ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; status == APSM_OK && i < N; i++) out[i] = 1;
    for (size_t k = 0; k < term->factors && status == APSM_OK; k++) {
        const size_t columns = columns_of(term->factor[k], N, row);
        status = code_column(term->factor[k], N, row, one);
        memcpy(so_far, out, N * n * sizeof *out);
        if (status == APSM_OK) multiply(N, n, so_far, columns, one, out);
        n *= columns;
    }
    free(so_far);
    free(one);
    return status;
}

/* Copies columns x (N x n) to place `at` of Z (N x width). */
static void place(size_t N, size_t n, const double *x, size_t width, size_t at, double *Z)
{
    for (size_t i = 0; i < N; i++) memcpy(Z + i * width + at, x + i * n, n * sizeof *x);
}

typedef struct building {
    const apsm_formula *f;
    const apsm_column *within;
    size_t N, r, s;
    const size_t *row;
    double *Z, *T, *x;
} building;

static apsm_status build(building *b)
{
    size_t at = 1;
    for (size_t i = 0; i < b->N; i++) b->Z[i * b->r] = 1;
    if (b->within) {
        APSM_TRY(code_column(b->within, b->N, b->row, b->x));
        place(b->N, columns_of(b->within, b->N, b->row), b->x, b->r, at, b->Z);
        at += columns_of(b->within, b->N, b->row);
    }
    for (size_t k = 0; k < b->f->n; k++) {
        const apsm_term *term = &b->f->term[k];
        const size_t n = apsm_term_columns(term, b->N, b->row);
        if (k == b->f->of) {
            APSM_TRY(code_term(term, b->N, b->row, b->T));
            continue;
        }
        APSM_TRY(code_term(term, b->N, b->row, b->x));
        place(b->N, n, b->x, b->r, at, b->Z);
        at += n;
    }
    return APSM_OK;
}

static apsm_status check_terms(apsm_context *ctx, const apsm_formula *f, size_t N,
                               const size_t *row)
{
    for (size_t k = 0; k < f->n; k++)
        for (size_t m = 0; m < f->term[k].factors; m++) {
            const apsm_column *c = f->term[k].factor[m];
            bool varies = false;
            for (size_t i = 1; i < N; i++) varies = varies || c->value[row[i]] != c->value[row[0]];
            if (!varies)
                return apsm_fail(ctx, APSM_ERR_ARG,
                                 "column '%s' is the same for all %zu subjects that are used; "
                                 "leave it out of the formula",
                                 c->name, N);
        }
    return APSM_OK;
}

/* Names the category with most levels, which may have been meant as numbers. */
static apsm_status too_few(apsm_context *ctx, const apsm_formula *f, size_t N, const size_t *row,
                           size_t coefficients)
{
    const apsm_column *most = NULL;
    char why[160] = "";
    for (size_t k = 0; k < f->n; k++)
        for (size_t m = 0; m < f->term[k].factors; m++) {
            const apsm_column *c = f->term[k].factor[m];
            if (c->category && (!most || columns_of(c, N, row) > columns_of(most, N, row)))
                most = c;
        }
    if (most)
        snprintf(why, sizeof why, " ('%.40s' holds texts such as '%.40s', %zu groups)", most->name,
                 most->level[0], columns_of(most, N, row) + 1);
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "%zu subjects are too few for the formula's %zu coefficients%s", N,
                     coefficients, why);
}

apsm_status apsm_formula_design(apsm_context *ctx, const apsm_formula *formula,
                                const apsm_column *within, size_t N, const size_t *row,
                                apsm_design *design)
{
    building b = { .f = formula, .within = within, .N = N, .row = row, .r = 1 };
    *design = (apsm_design){ 0 };
    if (N == 0)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "no shape has a value in every column of the formula; fill the table");
    APSM_TRY(check_terms(ctx, formula, N, row));
    for (size_t k = 0; k < formula->n; k++)
        *(k == formula->of ? &b.s : &b.r) += apsm_term_columns(&formula->term[k], N, row);
    if (within) b.r += columns_of(within, N, row);
    if (b.r + b.s >= N) return too_few(ctx, formula, N, row, b.r + b.s);
    b.Z = malloc((N * b.r + 1) * sizeof *b.Z);
    b.T = malloc((N * b.s + 1) * sizeof *b.T);
    b.x = malloc((N * (b.r + b.s) + 1) * sizeof *b.x);
    apsm_status status = b.Z && b.T && b.x ? build(&b) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_design_make(ctx, N, b.r, b.Z, b.s, b.T, design);
    free(b.Z);
    free(b.T);
    free(b.x);
    return status;
}
