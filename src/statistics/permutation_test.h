/* permutation_test.h -- does a term of a linear model explain anything?  By dealing out the rows of
 * the design again (Freedman & Lane, J. Bus. Econ. Stat. 1, 1983; Winkler et al., NeuroImage 92,
 * 2014). */
#ifndef APSM_STATISTICS_PERMUTATION_TEST_H
#define APSM_STATISTICS_PERMUTATION_TEST_H

#include "apsm/context.h"
#include "statistics/design.h"

/* What is tested: V variables (particles, modes, one size) of w numbers each (3 or 1). */
typedef struct apsm_permutation_input {
    const apsm_design *design; /* N rows */
    const double *Y;           /* N x V x w */
    size_t V, w;
    const size_t *block;  /* N: rows change places within a block only; NULL: all may */
    size_t permutations;  /* at most; all orders that differ, if they are not more */
    size_t neighbours;    /* width of `near`; 0: no cluster enhancement */
    const uint32_t *near; /* V x neighbours: the variables' graph, as of apsm_neighbours6 */
    /* Random orders end early once it is known on which side of `level` every p and q lies, at most
     * with this probability of one being wrong; 0: never. */
    double stop_risk, level;
    bool unequal; /* errors are symmetric but may vary by different amounts: signs are drawn, not
                     orders, and block counts for nothing */
} apsm_permutation_input;

/* Owns its arrays; zero-initialise with {0}, apsm_permutation_result_free leaves it so. */
typedef struct apsm_permutation_result {
    size_t V, permutations; /* orders gone through */
    bool exact;             /* they were all there are */
    bool stopped;           /* there were to be more: stop_risk */
    /* Of every variable: Lawley-Hotelling trace(H E^-1), H what the tested term explains and E what
     * is left (w x w sums of squares and products); for w = 1 this is F times a constant. */
    double *statistic;
    double *p;                     /* uncorrected */
    double *p_familywise;          /* by the largest statistic over all variables */
    double *q;                     /* false discovery rate (Benjamini & Hochberg 1995) */
    double *enhanced, *p_enhanced; /* TFCE of the statistic's root, familywise; or NULL */
    double *share;                 /* tr H / tr (H + E): of what is left by the reduced model */
    /* Of all variables together: (SS_reduced - SS_full) / SS_full over sums of squares. */
    double ratio, p_ratio;
    double p_error; /* standard error of p_ratio for want of more orders; 0 if exact */
} apsm_permutation_result;

/* p = share of the orders, the given one included, whose statistic is not below the given one's (to
 * 1e-9 of it).  APSM_ERR_ARG: too few rows for w (N - q < w); APSM_ERR_GEOMETRY: a variable does
 * not vary beyond the design.  Same result for any number of threads.
 * O(permutations N q V w), by matrix products. */
apsm_status apsm_permutation_test(apsm_context *ctx, const apsm_permutation_input *input,
                                  apsm_permutation_result *result) APSM_NODISCARD;
void apsm_permutation_result_free(apsm_permutation_result *result);

/* q (n, out) of p (n): Benjamini & Hochberg.  O(n log n). */
apsm_status apsm_false_discovery(size_t n, const double *p, double *q) APSM_NODISCARD;

#endif
