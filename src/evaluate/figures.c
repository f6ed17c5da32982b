#include "evaluate/figures.h"

#include <stdlib.h>
#include <string.h>

apsm_status figures_take(apsm_evaluation *evaluation, apsm_figures *f)
{
    *f = (apsm_figures){ .evaluation = *evaluation };
    *evaluation = (apsm_evaluation){ 0 };
    const size_t I = f->evaluation.shapes;
    if (!f->evaluation.surface) return APSM_OK;
    f->surface = malloc(3 * I * sizeof *f->surface);
    if (!f->surface) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < I; i++) {
        const apsm_distance_summary *d = &f->evaluation.surface[i].two_way;
        f->surface[i] = d->mean;
        f->surface[I + i] = d->p95;
        f->surface[2 * I + i] = d->max;
    }
    return APSM_OK;
}

void figures_clear(apsm_figures *f)
{
    apsm_evaluation_free(&f->evaluation);
    free(f->surface);
    *f = (apsm_figures){ 0 };
}

void apsm_figures_free(apsm_figures *figures)
{
    if (figures) figures_clear(figures);
    free(figures);
}

typedef struct named {
    const char *name;
    size_t n;
    const double *x;
} named;

const double *apsm_figures_get(const apsm_figures *f, const char *name, size_t *n)
{
    *n = 0;
    if (!f || !name) return NULL;
    const apsm_evaluation *e = &f->evaluation;
    const size_t I = f->surface ? e->shapes : 0;
    const named list[] = {
        { "variances", e->modes, e->variance },
        { "compactness", e->n_compactness, e->compactness },
        { "generalization", e->n_generalization, e->generalization },
        { "generalization_standard_error", e->n_generalization, e->generalization_error },
        { "specificity", e->n_specificity, e->specificity },
        { "specificity_standard_error", e->n_specificity, e->specificity_error },
        { "surface_mean", I, f->surface },
        { "surface_p95", I, I ? f->surface + I : NULL },
        { "surface_max", I, I ? f->surface + 2 * I : NULL },
    };
    for (size_t k = 0; k < sizeof list / sizeof *list; k++)
        if (strcmp(list[k].name, name) == 0) return *n = list[k].n, list[k].x;
    return NULL;
}

static apsm_status find_definition(apsm_context *ctx, const char *name, apsm_definition *d)
{
    static const apsm_definition all[] = { APSM_DEFINITION_STANDARD, APSM_DEFINITION_PAPER,
                                           APSM_DEFINITION_SHAPEWORKS };
    *d = APSM_DEFINITION_STANDARD;
    for (size_t k = 0; k < sizeof all / sizeof *all; k++)
        if (!name || strcmp(apsm_definition_name(all[k]), name) == 0) return *d = all[k], APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "definition '%s': give standard, paper or shapeworks-compat", name);
}

apsm_status apsm_evaluate_particles(apsm_context *ctx, size_t I, size_t J, const double *P,
                                    const apsm_mesh *meshes, size_t template_index,
                                    const char *definition, apsm_figures **figures)
{
    if (!figures) return apsm_fail(ctx, APSM_ERR_ARG, "apsm_evaluate_particles: no place for them");
    *figures = NULL;
    if (!ctx || !P || I < 3 || J < 1 || (meshes && template_index >= I))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "apsm_evaluate_particles: needs a context, particles of 3 shapes, and one "
                         "of them as template");
    const apsm_mesh_source source = apsm_mesh_source_array(meshes);
    apsm_evaluate_input input = { .I = I,
                                  .J = J,
                                  .P = P,
                                  .shape = meshes ? &source : NULL,
                                  .template_mesh = meshes ? &meshes[template_index] : NULL,
                                  .template_index = template_index };
    apsm_evaluation evaluation = { 0 };
    apsm_definition d = APSM_DEFINITION_STANDARD;
    APSM_TRY(find_definition(ctx, definition, &d));
    input.options.definition = (int)d;
    APSM_TRY(apsm_evaluate(ctx, &input, &evaluation));
    *figures = malloc(sizeof **figures);
    if (!*figures) apsm_evaluation_free(&evaluation);
    apsm_status status = *figures ? figures_take(&evaluation, *figures) : APSM_ERR_MEMORY;
    if (status == APSM_OK) return APSM_OK;
    apsm_figures_free(*figures);
    *figures = NULL;
    return apsm_fail(ctx, status, "out of memory");
}
