/* rbf_shape.h -- the surface that the particles of one shape describe: the zero level of an
 * interpolant through dipoles.  docs/method.md, "RBF-shape".
 *   centres q = [P, P + s N, P - s N], values [0, +s, -s]: f is about the signed distance.
 * Lengths in the unit of P. */
#ifndef APSM_RBF_SHAPE_H
#define APSM_RBF_SHAPE_H

#include "core/option.h"
#include "linalg/polyharmonic.h"

#ifdef __cplusplus
extern "C" {
#endif

#define APSM_RBF_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                          \
    ENUM(S, kernel, "biharmonic|triharmonic", "phi of the RBF-shape (1)")                          \
    REAL(S, dipole, 0.25, 0.001, 10,                                                               \
         "s: distance of the dipoles, in h; at most half the local half-thickness")                \
    REAL(S, band, 1, 0.001, 1, "half width of the band of near-surface points, in s")              \
    REAL(S, points, 16, 1, 1000, "R/J: near-surface points per particle")                          \
    BOOL(S, resample, true, "draw the near-surface points anew every epoch")
typedef struct apsm_rbf_options {
    APSM_OPTION_FIELDS(APSM_RBF_OPTIONS)
} apsm_rbf_options;

/* A fitted RBF-shape with n = 3J centres.  Arrays are the caller's (apsm_rbf_bind). */
typedef struct apsm_rbf_shape {
    apsm_phi phi;
    size_t J;
    double s;
    double *Q;   /* 3J x 3 centres, ordered P, P + s N, P - s N */
    double *w;   /* 3J weights */
    double c[4]; /* c0, cx, cy, cz */
} apsm_rbf_shape;

/* Doubles that a shape holds beside the struct; apsm_rbf_bind lays its arrays into store. */
size_t apsm_rbf_store_size(size_t J);
void apsm_rbf_bind(apsm_rbf_shape *shape, size_t J, double *store);

/* Particles with the sides of the surface told by dipoles. */
typedef struct apsm_dipoles {
    const double *P, *N; /* J x 3: particles, unit normals */
    double s;            /* distance from the particle, > 0 */
} apsm_dipoles;

/* Centres Q (9J) and values (3J) of the dipoles. */
void apsm_rbf_centres(size_t J, const apsm_dipoles *d, double *Q, double *values);

/* Fits shape (bound, its J set) to the dipoles.
 * factor and its factor_store (apsm_polyharmonic_store_size(3J, single)) are out, for adjoints
 * and later refits; factor->ridge > 0 reports that particles (nearly) coincide.
 * single: factor in single precision, error of f about 1e-5 of the shape's size.
 * work: apsm_rbf_work_size(J).  Errors as apsm_polyharmonic_factor_robust.  O(9 J^3). */
size_t apsm_rbf_work_size(size_t J);
apsm_status apsm_rbf_fit(apsm_phi phi, const apsm_dipoles *d, bool single, double *factor_store,
                         apsm_polyharmonic *factor, apsm_rbf_shape *shape,
                         double *work) APSM_NODISCARD;

/* Residual of refits, relative to s, that does for the weights E (4). */
#define APSM_RBF_TOLERANCE 1e-2

/* As above, after small moves, with the factor of an earlier fit as preconditioner: a third (J =
 * 128) to a quarter (J = 1024) of the time; single, with floats alone, a tenth.  *iterations:
 * conjugate gradient steps taken.  Errors as apsm_polyharmonic_resolve: fit anew then. */
apsm_status apsm_rbf_refit(const apsm_polyharmonic *stale, const apsm_dipoles *d,
                           const apsm_resolve_options *options, apsm_rbf_shape *shape,
                           size_t *iterations, double *work) APSM_NODISCARD;

/* f (R) and grad f (R x 3; NULL: not wanted) at X (R x 3).  O(R J); no scratch.  At a centre
 * the kernel's share of the gradient is taken as 0. */
void apsm_rbf_eval(const apsm_rbf_shape *shape, size_t R, const double *X, double *f,
                   double *grad_f);
/* f alone with the kernel sum in single precision, three times faster; phi = r only.
 * Error about 1e-6 of the shape's size times sum |w| (1e-3 of s at J = 128).
 * work: apsm_rbf_eval_f32_work_size(J) doubles. */
size_t apsm_rbf_eval_f32_work_size(size_t J);
void apsm_rbf_eval_f32(const apsm_rbf_shape *shape, size_t R, const double *X, double *f,
                       double *work);

/* Gradient of a scalar L(f(x_1), .., f(x_R)) in the particles when the fit is differentiated too
 * (centres, kernel matrix, weights; N and s constant): adds to grad (J x 3), given
 * dL_df (R) = dL / df(x_r).  factor: of this very fit.  work: apsm_rbf_work_size(J).
 * O(R J + J^2). */
void apsm_rbf_adjoint(const apsm_rbf_shape *shape, const apsm_polyharmonic *factor, size_t R,
                      const double *X, const double *dL_df, double *grad, double *work);

#ifdef __cplusplus
}
#endif
#endif
