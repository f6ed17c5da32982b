/* sampling_loss.h -- spreads the particles of one shape: each near-surface point pulls the
 * particles that are softly nearest to it, the harder the worse the RBF-shape fits there.
 * docs/method.md, (3)-(7).  Lengths in any one unit. */
#ifndef APSM_SAMPLING_LOSS_H
#define APSM_SAMPLING_LOSS_H

#include <stdbool.h>
#include <stddef.h>

#include "core/option.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What (6) and (7) are multiplied by: sampling_scale. */
enum {
    APSM_SAMPLING_VORONOI, /* J^2: the gradient is a mean unit vector, independent of J and R */
    APSM_SAMPLING_MEAN,    /* 1: mean over points and particles, the paper read literally */
    APSM_SAMPLING_SUM      /* J: sum over particles, mean over points */
};
enum { APSM_PRECISION_SINGLE, APSM_PRECISION_DOUBLE }; /* single: relative error 1e-5 */
enum { APSM_ERROR_RELATIVE, APSM_ERROR_RAW };
enum { APSM_ERROR_CONSTANT, APSM_ERROR_THROUGH_W };
#define APSM_SAMPLING_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                     \
    ENUM(S, precision, "single|double",                                                            \
         "of the RBF-shape's fit where E is a constant weight and the kernel biharmonic; else "    \
         "double")                                                                                 \
    REAL(S, tau, 0.125, 1e-6, 1e6, "softmin temperature (3), in h")                                \
    REAL(S, tau_absolute, 0, 0, 1e300,                                                             \
         "softmin temperature in the input's unit; 0: use tau (paper: 1 mm)")                      \
    ENUM(S, sampling_scale, "voronoi|mean|sum",                                                    \
         "normalisation of (7): J^2 times the mean, the mean (paper), or sum over particles")      \
    ENUM(S, error_scale, "relative|raw",                                                           \
         "E in (5): divided by its mean on the shape, or as it is (paper)")                        \
    ENUM(S, error_gradient, "constant|through-w",                                                  \
         "E in (7): a constant weight, or differentiated too")                                     \
    FIXED(S, double, cut_single, 15.0,                                                             \
          "a particle farther than so many tau beyond a nearest point of it is left out, in "      \
          "single precision; at most 87")                                                          \
    FIXED(S, double, cut_double, 25.0, "the same in double precision; at most 700")
typedef struct apsm_sampling_options {
    APSM_OPTION_FIELDS(APSM_SAMPLING_OPTIONS)
    double h; /* unit of tau; not used with tau_absolute */
} apsm_sampling_options;
apsm_sampling_options apsm_sampling_defaults(void); /* h 0: must be set */
double apsm_sampling_factor(int norm, size_t J);    /* 1, J or J^2 */

/* (4), (5): E_r = (f_r - D_r)^2 (R, out), g_r = c E_r / mean(E) + 1 - c (R, out; may be E), or
 * c E_r + 1 - c if not relative (lengths then count in the paper's mm).  Returns the factor by
 * which E was multiplied in g: c / mean(E) or c.  If all E are 0, g = 1. */
double apsm_sampling_weights(size_t R, const double *f, const double *D, double c, bool relative,
                             double *E, double *g);

/* Particles and the near-surface points that pull them; borrowed. */
typedef struct apsm_sampling_points {
    size_t J, R;     /* >= 1 */
    const double *P; /* J x 3: particles */
    const double *B; /* R x 3: points */
    const double *g; /* R: their weights; NULL: all 1 */
} apsm_sampling_points;

/* What is wanted, in arrays of the caller's; each may be NULL. */
typedef struct apsm_sampling_result {
    double *loss; /* 1: (6) */
    double *grad; /* J x 3: (7), E constant; overwritten */
    double *kbar; /* R: soft distance of each point */
    double *mass; /* J: sum_r w_rj g_r */
} apsm_sampling_result;

/* Loss (6) and gradient (7).  work: apsm_sampling_work_size(J, R) doubles.
 * Points are taken along a space-filling curve, in groups that meet the particles within reach:
 * O(R + pairs within reach).  Deterministic.  APSM_ERR_ARG leaves outputs untouched;
 * APSM_ERR_NONFINITE if anything is not finite. */
size_t apsm_sampling_work_size(size_t J, size_t R);
apsm_status apsm_sampling_loss(const apsm_sampling_points *points, const apsm_sampling_options *opt,
                               const apsm_sampling_result *result, double *work) APSM_NODISCARD;

/* dL/df (R, out) of the loss through E, for apsm_rbf_adjoint: E's mean is a constant.
 * e_factor is what apsm_sampling_weights returned, kbar comes from apsm_sampling_loss. */
void apsm_sampling_dL_df(size_t J, size_t R, const double *f, const double *D, const double *kbar,
                         double e_factor, int norm, double *dL_df);

#ifdef __cplusplus
}
#endif
#endif
