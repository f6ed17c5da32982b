/* classify.h -- can shape tell two groups apart?  Cross-validated: every step is made anew without
 * the shapes that are judged. */
#ifndef APSM_STATISTICS_CLASSIFY_H
#define APSM_STATISTICS_CLASSIFY_H

#include "apsm/context.h"

typedef struct apsm_classification {
    size_t folds;
    double accuracy;          /* balanced: the mean of both groups' shares of right answers */
    double auc;               /* area under the ROC curve */
    double auc_low, auc_high; /* 95 % (DeLong et al., Biometrics 44, 1988), cut to [0, 1] */
} apsm_classification;

/* Particles P (N x J x 3) of shapes that are in group 0 or 1.  In each of at most `folds` folds,
 * dealt out by group in the order of the rows, a model is made of the other shapes: PCA, as many
 * modes as hold 90 % of the variance but a third of their number at most, and Fisher's discriminant
 * in them. score (N, out): larger means group 1.  APSM_ERR_ARG: fewer than 4 shapes in a group. */
apsm_status apsm_classify(apsm_context *ctx, size_t N, size_t J, const double *P,
                          const size_t *group, size_t folds, double *score,
                          apsm_classification *result) APSM_NODISCARD;

/* Accuracy, AUC and its interval of scores (N) that were made without the shapes they are of; those
 * above the threshold are said to be of group 1.  O(N^2). */
void apsm_judge_scores(size_t N, const size_t *group, const double *score, double threshold,
                       apsm_classification *result);

#endif
