/* options.h -- every option of the method in one table: the struct, the defaults, `--set`, the
 * configuration file and the documentation are all made from it. */
#ifndef APSM_OPTIONS_H
#define APSM_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* INT(name, default, least, most, doc)       long
 * REAL(name, default, least, most, doc)      double
 * BOOL(name, default, doc)                   bool
 * ENUM(name, "first|second|...", doc)        int, index of the word; the first is the default
 *
 * h is the template's mean neighbour distance (docs/method.md, "Notation"): lengths given in h make
 * the result independent of the unit.  Numbers in brackets are equations of docs/method.md. */
#define APSM_OPTIONS(INT, REAL, BOOL, ENUM)                                                        \
    ENUM(method, "adaptive|xu2023|psm",                                                            \
         "the engine's own method, or one to compare it with: xu2023 is a set of options of it "   \
         "(see apsm_options_set), psm the entropy-based particles of ShapeWorks")                  \
    /* model */                                                                                    \
    INT(particles, 128, 4, 100000, "J: particles on every shape, or auto (see particles_auto)")    \
    BOOL(particles_auto, false,                                                                    \
         "search the smallest number of particles that meets `error`, from `particles` upward; "   \
         "particles = auto sets this and begins with 32")                                          \
    REAL(error, 0, 0, 1e300,                                                                       \
         "mean two-way surface distance that particles_auto has to meet on shapes left out, in "   \
         "the input's unit; a number may end in mm if that is the unit")                           \
    REAL(adaptivity, 0.5, 0, 1,                                                                    \
         "c in (5): 0 spreads particles evenly, 1 follows the surface error")                      \
    REAL(alpha, 5, 0, 1e6, "weight of the sampling loss in stage 1")                               \
    REAL(stage2_alpha_factor, 1, 0, 1e6, "alpha of stage 2 relative to alpha")                     \
    REAL(beta, 0, 0, 1e6,                                                                          \
         "weight of the eigenshape loss; 0.05 without the fidelity stage, whose prior takes its "  \
         "place")                                                                                  \
    REAL(gamma, 0.5, 0, 1e6, "weight of the correspondence loss")                                  \
    INT(stage1_epochs, 3, 0, 1000000, "most epochs of stage 1 (even spread, c = 0)")               \
    INT(stage2_epochs, 6, 0, 1000000, "epochs of stage 2 (adaptive)")                              \
    INT(settle_epochs, 50, 0, 1000000,                                                             \
        "most epochs before stage 1, with weights that move particles far, if the first "          \
        "particles "                                                                               \
        "are that badly matched")                                                                  \
    REAL(settle_mismatched, 0.1, 0, 1,                                                             \
         "share of them mismatched, on average, from which there are such epochs")                 \
    /* groom */                                                                                    \
    INT(faces, 10000, 100, 10000000, "faces of a groomed mesh, about; more where needed")          \
    BOOL(remesh, true, "make groomed meshes near-isotropic with about `faces` faces")              \
    BOOL(fill_holes, true, "fill cavities of segmentations and holes of meshes")                   \
    BOOL(open, false,                                                                              \
         "meshes may be open surfaces: openings stay that take a lid of more than 1 % of the "     \
         "area (with no-fill-holes: all)")                                                         \
    BOOL(fill, false,                                                                              \
         "close openings of any size; else one that takes a lid of more than 10 % of the area is " \
         "a question")                                                                             \
    REAL(closing, -1, -1, 1,                                                                       \
         "radius by which masks are closed, as a share of the cube root of their volume: tunnels " \
         "and gaps narrower than twice that are filled; 0: none; -1: where the surface has "       \
         "handles, the least up to 0.12 that leaves fewest")                                       \
    REAL(smooth, 1, 0, 4, "smoothing of masks; less keeps nearer to the voxels, 0: none")          \
    BOOL(largest_component, true, "keep only the largest component of every shape")                \
    ENUM(align, "rigid|similarity|none", "pose (and size) removed before the model is made")       \
    ENUM(align_by, "surfaces|landmarks|both",                                                      \
         "what shapes are aligned by: surfaces, landmarks (generalised Procrustes analysis), or "  \
         "both, either with half of the weight")                                                   \
    ENUM(landmarks_use, "auto|judge|align|anchor|hold",                                            \
         "what landmarks are for: judge (they measure the correspondence and have no part in "     \
         "it), align (by them alone), anchor (the correspondence is drawn to them), hold (a "      \
         "particle sits on each); auto: judge, or anchor if a project has use_landmarks")          \
    REAL(landmark_weight, 1, 0, 1e6, "of landmarks that are anchors")                              \
    ENUM(mirror_check, "warn|fix|off", "what to do with inputs that look mirrored")                \
    ENUM(cuts, "auto|crop|keep",                                                                   \
         "where shapes were cut off at different places, by the edge of an image: crop all to "    \
         "what all of them hold, keep them as they are, or (auto) crop if at least a fifth of "    \
         "them, and two, were cut")                                                                \
    REAL(field_voxel, 0.125, 0.01, 1, "node spacing of the distance fields, in h")                 \
    /* initialize */                                                                               \
    ENUM(initialize, "registration|projection|fps",                                                \
         "take the template's particles to every shape by non-rigid registration, project them "   \
         "as they are, or sample every shape by farthest points and match them (paper)")           \
    /* sampling loss */                                                                            \
    ENUM(kernel, "biharmonic|triharmonic", "phi of the RBF-shape (1)")                             \
    ENUM(precision, "single|double",                                                               \
         "of the RBF-shape's fit where E is a constant weight and the kernel biharmonic; else "    \
         "double")                                                                                 \
    REAL(dipole, 0.25, 0.001, 10,                                                                  \
         "s: distance of the dipoles, in h; at most half the local half-thickness")                \
    REAL(band, 1, 0.001, 1, "half width of the band of near-surface points, in s")                 \
    REAL(points, 16, 1, 1000, "R/J: near-surface points per particle")                             \
    BOOL(resample, true, "draw the near-surface points anew every epoch")                          \
    REAL(tau, 0.125, 1e-6, 1e6, "softmin temperature (3), in h")                                   \
    REAL(tau_absolute, 0, 0, 1e300,                                                                \
         "softmin temperature in the input's unit; 0: use tau (paper: 1 mm)")                      \
    ENUM(sampling_scale, "voronoi|mean|sum",                                                       \
         "normalisation of (7): J^2 times the mean, the mean (paper), or sum over particles")      \
    ENUM(error_scale, "relative|raw",                                                              \
         "E in (5): divided by its mean on the shape, or as it is (paper)")                        \
    ENUM(error_gradient, "constant|through-w",                                                     \
         "E in (7): a constant weight, or differentiated too")                                     \
    /* correspondence and eigenshape losses */                                                     \
    ENUM(correspondence, "neighbourhood|frobenius|frobenius-squared",                              \
         "the correspondence loss: (8), or the earlier papers' distance to the mean")              \
    ENUM(rotation, "transport|axis|none|procrustes", "R_ij in (8); axis is the paper's")           \
    ENUM(neighbour_norm, "norm|huber|squared", "the distance in (8)")                              \
    ENUM(neighbour_scale, "template|none", "factor of (8): h_tj / 6, or 1 (paper)")                \
    BOOL(template_gradient, false,                                                                 \
         "let the template follow the gradient of its own targets (paper)")                        \
    REAL(eigen_reg, 0.02, 0, 1e6, "reg in (9), relative to trace(G)/K")                            \
    REAL(eigen_reg_absolute, 0, 0, 1e300, "reg in (9) in squared input units; 0: use eigen_reg")   \
    REAL(eigen_share, 0.2, 0, 1e6,                                                                 \
         "largest share of a deviation that the eigenshape loss removes in an epoch (bounds reg "  \
         "from below); 0: no bound")                                                               \
    ENUM(eigen_scale, "full|none", "factor of (10): 3JK, or 1 (paper)")                            \
    /* step and schedule */                                                                        \
    ENUM(step, "scaled|literal",                                                                   \
         "(11) in units of h, or plain descent with learning_rate (paper)")                        \
    REAL(learning_rate, 1, 0, 1e6, "of the literal step")                                          \
    REAL(step_clip, 0.25, 0, 1e6, "longest step of an epoch, in h; 0: no limit")                   \
    REAL(decay1_at, 0.6, 0, 1, "share of a stage after which alpha and gamma fall first")          \
    REAL(decay2_at, 0.85, 0, 1, "share of a stage after which they fall again")                    \
    REAL(alpha_decay, 0.5, 0, 1, "what alpha is multiplied with at each decay")                    \
    REAL(beta_decay, 0.5, 0, 1, "what beta is multiplied with at each decay")                      \
    REAL(gamma_decay1, 0.3, 0, 1, "what gamma is multiplied with at the first decay")              \
    REAL(gamma_decay2, 0.5, 0, 1, "what gamma is multiplied with at the second decay")             \
    INT(burn_in, 1, 0, 1000, "epochs of the run without correspondence and eigenshape losses")     \
    ENUM(snap, "closest|field|none",                                                               \
         "return to the surface after a step: closest point, p - D n (paper), not at all")         \
    INT(snaps, 1, 1, 10, "how often p - D n is applied when snap is field")                        \
    INT(batch, 0, 0, 1000000, "K: shapes a minibatch; 0: all up to 256 shapes, else 64")           \
    /* Algorithm 1 */                                                                              \
    BOOL(geodesic_correspondence, true, "run Algorithm 1 in stage 1")                              \
    INT(geodesic_interval, 25, 1, 1000000,                                                         \
        "epochs between its passes (at most half of the stage)")                                   \
    REAL(geodesic_factor, 2, 1, 10,                                                                \
         "F: a neighbour farther than F times the closest is mismatched (paper: 1.5)")             \
    ENUM(geodesic_target, "mean|farthest",                                                         \
         "where a particle walks: mean of the targets, or the farthest missing neighbour (paper)") \
    REAL(geodesic_walk, 1, 0.01, 1, "share of the walk that is made")                              \
    BOOL(geodesic_guard, true, "keep a move only if it does not make matters worse")               \
    REAL(stop_mismatched, 0.02, 0, 1,                                                              \
         "stage 1 ends early when no shape has a larger share of mismatched particles")            \
    /* fidelity stage */                                                                           \
    REAL(fidelity, 0.5, 0, 1,                                                                      \
         "F: after stage 2 particles fit the warped template to the surfaces (12); the model of "  \
         "the other shapes weighs (1 - F)/F times what is measured to suit; 0: no such stage")     \
    INT(fidelity_rounds, 12, 1, 1000, "rounds of the fidelity stage")                              \
    INT(fidelity_modes, -1, -1, 100000,                                                            \
        "modes of the prior in (12); -1: as many as predict left-out shapes best")                 \
    INT(fidelity_points, 1000, 100, 10000000,                                                      \
        "vertices of either surface, about, that (12) sums over")                                  \
    /* method psm: names and defaults of ShapeWorks, lengths in psm_unit */                        \
    REAL(psm_initial_relative_weighting, 0.05, 0, 1e6,                                             \
         "weight of the correspondence term while particles are split")                            \
    REAL(psm_relative_weighting, 1, 0, 1e6, "weight of the correspondence term afterwards")        \
    REAL(psm_starting_regularization, 1000, 1e-9, 1e12, "of the entropy, at the start")            \
    REAL(psm_ending_regularization, 10, 1e-9, 1e12, "of the entropy, at the end")                  \
    REAL(psm_starting_share, 0, 0, 1,                                                              \
         "starting regularization as a share of the largest eigenvalue, ending at a tenth of "     \
         "that; 0: the two absolute values; 0.05 is ShapeWorks' advice")                           \
    INT(psm_iterations_per_split, 1000, 0, 1000000, "iterations after each split")                 \
    INT(psm_optimization_iterations, 1000, 0, 1000000, "iterations when all particles are there")  \
    BOOL(psm_shape_statistics_in_init, false,                                                      \
         "the entropy during splitting too, not the distance from the mean (part of ShapeWorks' "  \
         "multiscale)")                                                                            \
    BOOL(psm_procrustes, false, "register the shapes anew as the optimisation goes on")            \
    INT(psm_procrustes_interval, 10, 1, 1000000, "iterations between two registrations")           \
    BOOL(psm_procrustes_scaling, false, "registrations remove size")                               \
    BOOL(psm_procrustes_rotation_translation, true, "registrations remove pose")                   \
    BOOL(psm_sampling_scale, false,                                                                \
         "sampling gradients times a shape's area over 12,250 psm_unit^2: sizes balance alike")    \
    REAL(psm_unit, 1, 1e-9, 1e9, "length that stands for ShapeWorks' mm, in the input's unit")     \
    /* evaluate */                                                                                 \
    ENUM(definition, "standard|paper|shapeworks-compat", "definition of specificity")              \
    INT(specificity_samples, 0, 0, 10000000, "samples; 0: the definition's own number")            \
    INT(specificity_modes, 0, 0, 1000000,                                                          \
        "most modes that specificity is measured for; 0: the definition's own number (paper: 20, " \
        "else all)")                                                                               \
    BOOL(surface_distance, true, "measure two-way surface distances (needs meshes)")               \
    INT(other_templates, 3, 0, 1000,                                                               \
        "shapes that take the template's place in turn for further surface distances, which no "   \
        "fit knew of; 0: none")                                                                    \
    /* run */                                                                                      \
    BOOL(original_frame, false,                                                                    \
         "also write particles in the frame of the input files, with mirrored shapes mirrored "    \
         "back")                                                                                   \
    REAL(checkpoint_seconds, 10, 0, 1e9,                                                           \
         "seconds between two checkpoints, more if writing one takes long; 0: after every epoch")

#define APSM_FIELD_INT(name, dflt, lo, hi, doc)  long name;
#define APSM_FIELD_REAL(name, dflt, lo, hi, doc) double name;
#define APSM_FIELD_BOOL(name, dflt, doc)         bool name;
#define APSM_FIELD_ENUM(name, words, doc)        int name;
typedef struct apsm_options {
    APSM_OPTIONS(APSM_FIELD_INT, APSM_FIELD_REAL, APSM_FIELD_BOOL, APSM_FIELD_ENUM)
} apsm_options;
#undef APSM_FIELD_INT
#undef APSM_FIELD_REAL
#undef APSM_FIELD_BOOL
#undef APSM_FIELD_ENUM

/* Indices of the words above, in their order. */
enum { APSM_METHOD_ADAPTIVE, APSM_METHOD_XU2023, APSM_METHOD_PSM };
enum { APSM_ALIGN_RIGID, APSM_ALIGN_SIMILARITY, APSM_ALIGN_NONE };
enum { APSM_ALIGN_BY_SURFACES, APSM_ALIGN_BY_LANDMARKS, APSM_ALIGN_BY_BOTH };
enum {
    APSM_LANDMARKS_AUTO,
    APSM_LANDMARKS_JUDGE,
    APSM_LANDMARKS_ALIGN,
    APSM_LANDMARKS_ANCHOR,
    APSM_LANDMARKS_HOLD
};
enum { APSM_MIRROR_WARN, APSM_MIRROR_FIX, APSM_MIRROR_OFF };
enum { APSM_CUTS_AUTO, APSM_CUTS_CROP, APSM_CUTS_KEEP };
enum { APSM_INIT_REGISTRATION, APSM_INIT_PROJECTION, APSM_INIT_FPS };
/* sampling_scale, rotation, neighbour_norm, kernel: apsm/optimizer.h maps them to the kernels'
 * own names. */
enum { APSM_ERROR_RELATIVE, APSM_ERROR_RAW };
enum { APSM_ERROR_CONSTANT, APSM_ERROR_THROUGH_W };
enum { APSM_CORRES_NEIGHBOURHOOD, APSM_CORRES_FROBENIUS, APSM_CORRES_FROBENIUS_SQUARED };
enum { APSM_STEP_SCALED, APSM_STEP_LITERAL };
enum { APSM_SNAP_CLOSEST, APSM_SNAP_FIELD, APSM_SNAP_NONE };
enum { APSM_TARGET_MEAN, APSM_TARGET_FARTHEST };

/* How an option looks from outside. */
typedef enum apsm_option_kind {
    APSM_OPTION_INT,
    APSM_OPTION_REAL,
    APSM_OPTION_BOOL,
    APSM_OPTION_ENUM
} apsm_option_kind;
typedef struct apsm_option_info {
    const char *name;
    apsm_option_kind kind;
    const char *dflt;   /* as text; NULL for an ENUM: the first of its words */
    double least, most; /* INT and REAL */
    const char *words;  /* ENUM: "first|second" */
    const char *doc;
} apsm_option_info;

APSM_API apsm_options apsm_options_defaults(void);

/* The table; *n is its length. */
APSM_API const apsm_option_info *apsm_options_table(size_t *n);

/* Sets one option from text, as `--set key=value` does.  Unknown key (the nearest one is
 * named), a value that does not parse or is out of range: APSM_ERR_ARG with a line.
 * method = xu2023 also sets what makes the method of the earlier paper (docs/method.md, "Comparison
 * methods"): correspondence = frobenius-squared, gamma = 0.1 (a tenth of the way to the mean in
 * every epoch), snap = none, geodesic_correspondence = false, fidelity = 0, and the schedule of 50
 * + 50 epochs with its weights; another method then takes these back to their defaults. */
APSM_API apsm_status apsm_options_set(apsm_context *ctx, apsm_options *options, const char *key,
                                      const char *value) APSM_NODISCARD;
/* Value of an option as text that apsm_options_set reads back exactly; buffer of 64 bytes. */
APSM_API apsm_status apsm_options_get(const apsm_options *options, const char *key,
                                      char text[64]) APSM_NODISCARD;

/* Presets: "default", "paper-literal-femur", "paper-literal-liver", "paper-literal-hip": every
 * paper reading at once with that cohort's weights. */
APSM_API apsm_status apsm_options_preset(apsm_context *ctx, apsm_options *options,
                                         const char *name) APSM_NODISCARD;

/* Refuses contradictions between options. */
APSM_API apsm_status apsm_options_check(apsm_context *ctx,
                                        const apsm_options *options) APSM_NODISCARD;

/* Number of edits between two words, for "did you mean". */
APSM_API size_t apsm_edit_distance(const char *a, const char *b);

#ifdef __cplusplus
}
#endif
#endif
