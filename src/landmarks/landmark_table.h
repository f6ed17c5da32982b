/* landmark_table.h -- the landmarks of a cohort: which names there are, and where each is on every
 * shape that has it. */
#ifndef APSM_LANDMARKS_LANDMARK_TABLE_H
#define APSM_LANDMARKS_LANDMARK_TABLE_H

#include "core/option.h"
#include "landmarks/landmark_file.h"

enum { APSM_ALIGN_BY_SURFACES, APSM_ALIGN_BY_LANDMARKS, APSM_ALIGN_BY_BOTH };
enum {
    APSM_LANDMARKS_AUTO,
    APSM_LANDMARKS_JUDGE,
    APSM_LANDMARKS_ALIGN,
    APSM_LANDMARKS_ANCHOR,
    APSM_LANDMARKS_HOLD
};
#define APSM_LANDMARK_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                     \
    ENUM(S, align_by, "surfaces|landmarks|both",                                                   \
         "what shapes are aligned by: surfaces, landmarks (generalised Procrustes analysis), or "  \
         "both, either with half of the weight")                                                   \
    ENUM(S, landmarks_use, "auto|judge|align|anchor|hold",                                         \
         "what landmarks are for: judge (they measure the correspondence and have no part in "     \
         "it), align (by them alone), anchor (the correspondence is drawn to them), hold (a "      \
         "particle sits on each); auto: judge, or anchor if a project has use_landmarks")          \
    REAL(S, landmark_weight, 1, 0, 1e6, "of landmarks that are anchors")
typedef struct apsm_landmark_options {
    APSM_OPTION_FIELDS(APSM_LANDMARK_OPTIONS)
} apsm_landmark_options;

/* Owns its arrays; zero-initialise with {0}. */
typedef struct landmark_table {
    size_t I, L;
    char **name; /* L */
    bool *has;   /* I x L */
    double *x;   /* I x L x 3, 0 where there is none; in one frame a shape */
} landmark_table;

/* *t (overwritten) <- no landmarks of I shapes. */
void landmark_table_begin(size_t I, landmark_table *t);
void landmark_table_free(landmark_table *t);

/* Gives shape i the landmarks of a list; names that are new are added. */
apsm_status landmark_table_take(landmark_table *t, size_t i,
                                const landmark_list *list) APSM_NODISCARD;
/* Those of shape i, copied. */
apsm_status landmark_table_list(apsm_context *ctx, const landmark_table *t, size_t i,
                                landmark_list *list) APSM_NODISCARD;
/* Moves those of shape i. */
void landmark_table_move(landmark_table *t, size_t i, const double M[16]);

static inline const double *landmark_at(const landmark_table *t, size_t i, size_t l)
{
    return t->x + 3 * (i * t->L + l);
}
static inline bool landmark_is_there(const landmark_table *t, size_t i, size_t l)
{
    return t->has[i * t->L + l];
}

/* The file of a cohort (.csv: shape,name,x,y,z).  Shapes that are none of names (I) are left out,
 * and *others (may be NULL) counts their lines. */
apsm_status landmark_table_read(apsm_context *ctx, const char *path, size_t I,
                                const char *const *names, landmark_table *t,
                                size_t *others) APSM_NODISCARD;
apsm_status landmark_table_write(apsm_context *ctx, const char *path, const char *const *names,
                                 const landmark_table *t) APSM_NODISCARD;

/* From a folder with a file for every shape (NAME.mrk.json, NAME.fcsv, NAME.csv) or a file as
 * above.  APSM_ERR_ARG: neither, or nothing of these shapes is in it. */
apsm_status landmark_table_gather(apsm_context *ctx, const char *path, size_t I,
                                  const char *const *names, landmark_table *t) APSM_NODISCARD;

/* Logs how many there are, which are common to all, and what is missing where. */
void landmark_table_tell(apsm_context *ctx, const landmark_table *t, const char *const *names);

#endif
