/* All metrics of a cohort in one call. */
#include <stdlib.h>

#include "evaluate/metrics.h"

void apsm_evaluation_free(apsm_evaluation *e)
{
    free(e->variance);
    free(e->trust);
    free(e->compactness);
    free(e->generalization);
    free(e->generalization_error);
    free(e->specificity);
    free(e->specificity_error);
    free(e->surface);
    *e = (apsm_evaluation){ 0 };
}

/* Room for n numbers, never NULL unless memory is short. */
static double *numbers(size_t n)
{
    return calloc(n ? n : 1, sizeof(double));
}

static apsm_status alloc(apsm_context *ctx, const apsm_evaluate_input *in, size_t modes,
                         apsm_evaluation *e)
{
    const apsm_evaluate_options *o = &in->options;
    const apsm_definition d = (apsm_definition)o->definition;
    const size_t I = in->I, asked = (size_t)o->specificity_modes;
    const size_t wanted = asked ? asked : apsm_definition_modes(d);
    const size_t samples = (size_t)o->specificity_samples;
    *e = (apsm_evaluation){ .shapes = I,
                            .particles = in->J,
                            .modes = modes,
                            .samples = samples ? samples : apsm_definition_samples(d),
                            .definition = d,
                            .left_out = apsm_generalization_shapes(I),
                            .n_compactness = I - 1,
                            .n_generalization = I > 2 ? I - 2 : 0,
                            .n_specificity = wanted < I - 1 ? wanted : I - 1 };
    e->variance = numbers(modes);
    e->trust = calloc(modes + 1, sizeof *e->trust);
    e->compactness = numbers(I);
    e->generalization = numbers(I);
    e->generalization_error = numbers(I);
    e->specificity = numbers(I);
    e->specificity_error = numbers(I);
    if (in->shape) e->surface = calloc(I, sizeof *e->surface);
    if (e->variance && e->trust && e->compactness && e->generalization && e->generalization_error &&
        e->specificity && e->specificity_error && (e->surface || !in->shape))
        return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for the metrics of %zu shapes", I);
}

static apsm_status measure_model(apsm_context *ctx, const apsm_shape_model *model,
                                 apsm_evaluation *e)
{
    for (size_t k = 0; k < model->modes; k++) e->variance[k] = model->variance[k];
    APSM_TRY(apsm_mode_trust_of(ctx, model, e->trust));
    apsm_compactness(model, e->compactness);
    APSM_TRY(apsm_generalization(ctx, model, e->generalization, e->generalization_error));
    return apsm_specificity(ctx, model, e->definition, e->samples, e->n_specificity, e->specificity,
                            e->specificity_error);
}

static apsm_status measure_surfaces(apsm_context *ctx, const apsm_evaluate_input *in,
                                    apsm_evaluation *e)
{
    const apsm_mesh *mesh = in->template_mesh;
    apsm_warp own = { 0 };
    if (!mesh || in->template_index >= in->I)
        return apsm_fail(ctx, APSM_ERR_ARG, "surface distances need the template's mesh and index");
    if (!in->warp)
        APSM_TRY(apsm_warp_build(ctx, APSM_PHI_R, mesh->nv, mesh->V, in->J,
                                 in->P + in->template_index * 3 * in->J, &own));
    const apsm_status status = apsm_surface_distances(ctx, in->warp ? in->warp : &own, mesh, in->I,
                                                      in->P, in->shape, e->surface);
    apsm_warp_free(&own);
    APSM_TRY(status);
    apsm_surface_summarize(in->I, e->surface, in->template_index, &e->surface_summary);
    e->others = (size_t)in->options.other_templates < in->I - 1
                    ? (size_t)in->options.other_templates
                    : in->I - 1;
    return apsm_other_templates(ctx, in->I, in->J, in->P, in->shape, in->template_index, e->others,
                                &e->other_templates);
}

apsm_status apsm_evaluate(apsm_context *ctx, const apsm_evaluate_input *input,
                          apsm_evaluation *evaluation)
{
    apsm_shape_model own = { 0 };
    *evaluation = (apsm_evaluation){ 0 };
    if (!input->model) APSM_TRY(apsm_shape_model_fit(ctx, input->I, input->J, input->P, &own));
    const apsm_shape_model *model = input->model ? input->model : &own;
    const char *warning = apsm_definition_warning((apsm_definition)input->options.definition);
    if (warning) apsm_log(ctx, APSM_LOG_WARNING, "%s", warning);
    apsm_status status = alloc(ctx, input, model->modes, evaluation);
    if (status == APSM_OK) status = measure_model(ctx, model, evaluation);
    if (status == APSM_OK && input->shape) status = measure_surfaces(ctx, input, evaluation);
    apsm_shape_model_free(&own);
    if (status != APSM_OK) apsm_evaluation_free(evaluation);
    return status;
}
