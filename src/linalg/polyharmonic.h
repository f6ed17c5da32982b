/* polyharmonic.h -- smooth interpolation of scattered values in space:
 *   f(x) = sum_k w_k phi(|x - q_k|) + c0 + c.x      phi(r) = r or r^3                  (1)
 *   [A Q; Q^T 0] [w; c] = [values; 0]               A_kl = phi(|q_k - q_l|), Q = [1 x y z]  (2)
 * for n >= 5 centres q_k that do not lie in a plane, and any number of right-hand sides.
 * The system is factored once, by Cholesky on the null space of Q^T, in coordinates centred and
 * scaled to the unit box; weights are handed out in the units of the input. */
#ifndef APSM_LINALG_POLYHARMONIC_H
#define APSM_LINALG_POLYHARMONIC_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum apsm_phi {
    APSM_PHI_R = 1, /* biharmonic */
    APSM_PHI_R3 = 3 /* triharmonic; double precision only */
} apsm_phi;

/* A factored system.  The arrays lie in the caller's store; plain data, may be moved with it. */
typedef struct apsm_polyharmonic {
    size_t n;
    apsm_phi phi;
    double centre[3], scale; /* internal coordinates are (x - centre) * scale, scale = 2^k */
    double ridge;            /* added to the diagonal, relative to its mean; 0 unless needed */
    double R[16];            /* 4 x 4 upper triangle: Q = H [R; 0], H = I - V T V^T */
    double T[16];            /* 4 x 4 upper triangle */
    double A11[16];          /* 4 x 4: A on the range of Q */
    double *V;               /* n x 4 Householder vectors */
    double *C;               /* (n-4) x 4: the block Z^T A (range of Q) */
    double *L;               /* (n-4) x (n-4) Cholesky factor of +-Z^T A Z, or NULL */
    float *L32;              /* the same in single precision, or NULL */
} apsm_polyharmonic;

/* Sizes in doubles, aligned for doubles: what a factor keeps, and scratch to make it or solve
 * with it for m right-hand sides (any of m right-hand sides may share it; m >= 1). */
size_t apsm_polyharmonic_store_size(size_t n, bool single);
size_t apsm_polyharmonic_factor_work_size(size_t n);
size_t apsm_polyharmonic_solve_work_size(size_t n, size_t m);

/* Factors (2) for centres X (n x 3).  single: keep the factor in single precision (half the
 * time and memory; phi = r only, else APSM_ERR_ARG).  ridge >= 0 is added to the diagonal relative
 * to its mean (0: exact interpolation).  f and store (out) hold the result, work is scratch.
 * O(n^3 / 3).  APSM_ERR_SINGULAR: centres that (nearly) coincide, or all in a plane;
 * APSM_ERR_NONFINITE: X is not finite. */
apsm_status apsm_polyharmonic_factor(apsm_phi phi, size_t n, const double *X, bool single,
                                     double ridge, double *store, double *work,
                                     apsm_polyharmonic *f) APSM_NODISCARD;
/* As above without ridge; if that is singular, again with ridges 1e-8, 1e-6, 1e-4 until one
 * works: f->ridge tells which.  Centres in a plane stay APSM_ERR_SINGULAR. */
apsm_status apsm_polyharmonic_factor_robust(apsm_phi phi, size_t n, const double *X, bool single,
                                            double *store, double *work,
                                            apsm_polyharmonic *f) APSM_NODISCARD;

/* Weights w (n x m) and polynomials c (4 x m: rows c0, cx, cy, cz) for the values (n x m).
 * w may be values.  d (4 x m) is the lower half of the right-hand side of (2) in input units
 * (NULL: 0): with it this is the product with the inverse of the whole symmetric matrix, which
 * adjoint computations need.  O(m n^2). */
void apsm_polyharmonic_solve(const apsm_polyharmonic *f, size_t m, const double *values,
                             const double *d, double *w, double *c, double *work);

/* m interpolants (1) of the same centres; all borrowed. */
typedef struct apsm_interpolants {
    apsm_phi phi;
    size_t n, m;
    const double *X; /* n x 3 */
    const double *w; /* n x m */
    const double *c; /* 4 x m */
} apsm_interpolants;

/* out (ny x m) = the interpolants at Y (ny x 3).  O(ny n m). */
void apsm_polyharmonic_eval(const apsm_interpolants *f, size_t ny, const double *Y, double *out);

/* The same with many interpolants, in 64s of Y: phi is taken once for all m.  work: 64 n. */
void apsm_polyharmonic_eval_many(const apsm_interpolants *f, size_t ny, const double *Y,
                                 double *work, double *out);

/* The interpolant as a linear map of its values: W (ny x n, out) with f(Y) = W values.  X must
 * be the centres of f.  Rows sum to 1, and W X = Y.  O(ny n^2).  work: of size
 * apsm_polyharmonic_solve_work_size(n, APSM_POLYHARMONIC_BLOCK). */
#define APSM_POLYHARMONIC_BLOCK 64
void apsm_polyharmonic_map(const apsm_polyharmonic *f, const double *X, size_t ny, const double *Y,
                           double *W, double *work);

/* How far conjugate gradients go. */
typedef struct apsm_resolve_options {
    bool single;      /* the matrix in single precision: several times faster, phi = r only */
    double tolerance; /* of the residual, in the right-hand side; single is good to 1e-4 */
    size_t most;      /* iterations */
} apsm_resolve_options;

/* Solves (2) at new centres X (n x 3) for one right-hand side by conjugate gradients on the
 * projected system, with the factor of earlier, nearby centres as preconditioner (and the single
 * precision factor serves as well).  *iterations (out) is the count.  APSM_ERR_NONFINITE if the
 * most do not suffice or the system is no longer definite: factor anew.  work:
 * apsm_polyharmonic_resolve_work_size(n).  O(n^2) an iteration. */
size_t apsm_polyharmonic_resolve_work_size(size_t n);
apsm_status apsm_polyharmonic_resolve(const apsm_polyharmonic *stale, const double *X,
                                      const double *values, const apsm_resolve_options *options,
                                      double *w, double c[4], size_t *iterations,
                                      double *work) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
