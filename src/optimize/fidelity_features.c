/* Features in the objective of the fidelity stage: lambda sum_j |f(p_j) - f_tj|^2 / 2, f_tj those
 * of the template's particles; lambda: as much as what the surfaces have to say at a particle. */
#include "optimize/fidelity_shape.h"

#include "geometry/vec3.h"
#include "initialize/features.h"

static double weight_of(const apsm_fidelity *f, const fidelity_state *s)
{
    return (double)s->n / (double)f->J;
}

void fidelity_value_features(const apsm_fidelity *f, size_t i, fidelity_state *s, fidelity_work *w)
{
    const size_t F = f->cohort->features.F;
    double sum = 0;
    for (size_t j = 0; j < f->J && F > 0; j++) {
        apsm_features_at(f->cohort, i, &s->S[j], w->feature, NULL);
        for (size_t k = 0; k < F; k++) {
            const double r = w->feature[k] - f->features[j * F + k];
            sum += r * r;
        }
    }
    s->value += 0.5 * weight_of(f, s) * sum;
}

void fidelity_add_features(const apsm_fidelity *f, size_t i, const fidelity_state *s,
                           fidelity_work *w)
{
    const size_t F = f->cohort->features.F, n = 2 * f->J;
    const double weight = weight_of(f, s);
    for (size_t j = 0; j < f->J && F > 0; j++) {
        double *slope = w->feature + F;
        apsm_features_at(f->cohort, i, &s->S[j], w->feature, slope);
        for (size_t k = 0; k < F; k++) {
            const double r = w->feature[k] - f->features[j * F + k];
            double row[2];
            for (size_t a = 0; a < 2; a++)
                row[a] = f->h * vec3_dot(slope + 3 * k, w->tangent + 6 * j + 3 * a);
            for (size_t a = 0; a < 2; a++) {
                w->g[2 * j + a] += weight * r * row[a];
                for (size_t b = 0; b <= a && !w->sparse; b++)
                    w->H[(2 * j + a) * n + 2 * j + b] += weight * row[a] * row[b];
            }
            if (!w->sparse) continue;
            const uint32_t particle = (uint32_t)j;
            const double scaled[2] = { sqrt(weight) * row[0], sqrt(weight) * row[1] };
            fidelity_system_put(f, 1, &particle, scaled, &w->system);
        }
    }
}
