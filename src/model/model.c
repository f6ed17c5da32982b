/* The public face of the shape model: the same struct on the heap, its fields as functions. */
#include "apsm/model.h"

#include <stdlib.h>

#include "model/shape_model.h"

apsm_status apsm_model_make(apsm_context *ctx, size_t I, size_t J, const double *P,
                            apsm_shape_model **model)
{
    if (!ctx || !model || !P)
        return apsm_fail(ctx, APSM_ERR_ARG, "apsm_model_make: an argument is NULL");
    *model = calloc(1, sizeof **model);
    if (!*model) return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory");
    const apsm_status status = apsm_shape_model_fit(ctx, I, J, P, *model);
    if (status == APSM_OK) return APSM_OK;
    free(*model);
    *model = NULL;
    return status;
}

void apsm_model_free(apsm_shape_model *model)
{
    if (model) apsm_shape_model_free(model);
    free(model);
}

size_t apsm_model_shapes(const apsm_shape_model *model)
{
    return model->I;
}

size_t apsm_model_particles(const apsm_shape_model *model)
{
    return model->J;
}

size_t apsm_model_modes(const apsm_shape_model *model)
{
    return model->modes;
}

const double *apsm_model_mean(const apsm_shape_model *model)
{
    return model->mean;
}

const double *apsm_model_mode(const apsm_shape_model *model)
{
    return model->mode;
}

const double *apsm_model_variance(const apsm_shape_model *model)
{
    return model->variance;
}

const double *apsm_model_score(const apsm_shape_model *model)
{
    return model->score;
}

void apsm_model_project(const apsm_shape_model *model, const double *p, double *b)
{
    apsm_shape_model_scores(model, p, b);
}

void apsm_model_synthesize(const apsm_shape_model *model, size_t m, const double *b, double *p)
{
    apsm_shape_model_synthesize(model, m < model->modes ? m : model->modes, b, p);
}
