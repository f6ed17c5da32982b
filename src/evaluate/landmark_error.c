#include "evaluate/landmark_error.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"
#include "model/warp.h"

static double mean_of(size_t n, const double *x, size_t stride, size_t *counted)
{
    double sum = 0;
    *counted = 0;
    for (size_t k = 0; k < n; k++) {
        if (isnan(x[k * stride])) continue;
        sum += x[k * stride];
        ++*counted;
    }
    return *counted > 0 ? sum / (double)*counted : NAN;
}

static void find_means(landmark_errors *e)
{
    size_t n;
    double sum = 0;
    for (size_t i = 0; i < e->I; i++) {
        e->of_shape[i] = mean_of(e->L, e->error + i * e->L, 1, &n);
        if (n > 0) sum += e->of_shape[i] * (double)n;
        e->judged += n;
    }
    for (size_t l = 0; l < e->L; l++) e->of_landmark[l] = mean_of(e->I, e->error + l, e->L, &n);
    e->mean = e->judged > 0 ? sum / (double)e->judged : NAN;
}

/* Y: L x 3, scratch. */
static void measure_shape(const landmark_table *t, size_t m, size_t i, const double *Y,
                          landmark_errors *e)
{
    for (size_t l = 0; l < t->L; l++) {
        const bool both = landmark_is_there(t, i, l) && landmark_is_there(t, m, l);
        e->error[i * t->L + l] =
            both && i != m ? sqrt(vec3_distance2(Y + 3 * l, landmark_at(t, i, l))) : NAN;
    }
}

apsm_status landmark_errors_of(apsm_context *ctx, const landmark_table *t, size_t m, size_t J,
                               const double *P, landmark_errors *e)
{
    const size_t I = t->I, L = t->L;
    apsm_warp warp = { 0 };
    *e = (landmark_errors){ .I = I, .L = L, .mean = NAN };
    e->error = malloc((I * L + 1) * sizeof *e->error);
    e->of_shape = malloc((I + 1) * sizeof *e->of_shape);
    e->of_landmark = malloc((L + 1) * sizeof *e->of_landmark);
    double *Y = malloc((3 * L + 1) * sizeof *Y);
    apsm_status status = e->error && e->of_shape && e->of_landmark && Y ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK)
        status = apsm_warp_build(ctx, APSM_PHI_R, L, landmark_at(t, m, 0), J, P + 3 * m * J, &warp);
    for (size_t i = 0; i < I && status == APSM_OK; i++) {
        apsm_warp_apply(&warp, P + 3 * i * J, Y);
        measure_shape(t, m, i, Y, e);
    }
    if (status == APSM_OK)
        find_means(e);
    else
        landmark_errors_free(e);
    apsm_warp_free(&warp);
    free(Y);
    return status;
}

void landmark_errors_free(landmark_errors *e)
{
    free(e->error);
    free(e->of_shape);
    free(e->of_landmark);
    *e = (landmark_errors){ 0 };
}
