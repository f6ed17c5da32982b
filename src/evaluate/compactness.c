/* Compactness: share of the variance that the first m modes have (ShapeWorks' and the paper's
 * definition agree). */
#include "evaluate/metrics.h"

void apsm_compactness(const apsm_shape_model *model, double *compactness)
{
    double total = 0.0, sum = 0.0;
    for (size_t k = 0; k < model->modes; k++) total += model->variance[k];
    for (size_t k = 0; k + 1 < model->I; k++) {
        if (k < model->modes) sum += model->variance[k];
        compactness[k] = k < model->modes ? sum / total : 1.0;
    }
}
