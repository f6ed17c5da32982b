/* compare: two models side by side. */
#include <math.h>
#include <stdio.h>

#include "apsm/compare.h"
#include "verbs.h"

static double degrees(double cosine)
{
    return acos(cosine) * 180 / 3.14159265358979323846;
}

static void say_spans(const apsm_comparison *c, cli_ui *ui)
{
    cli_say(ui,
            "variation: %.1f %% of A's variance lies in B's first %zu modes, %.1f %% of B's in A's",
            100 * c->explained_a, c->angles, 100 * c->explained_b);
    for (size_t k = 0; k < c->angles && k < 3; k++)
        cli_say(
            ui,
            "  mode %zu: %.1f %% of A's within B, %.1f %% of B's within A; angle %zu: %.1f degrees",
            k + 1, 100 * c->share_a[k], 100 * c->share_b[k], k + 1, degrees(c->cosine[k]));
}

static void say_shapes(const apsm_comparison *c, cli_ui *ui)
{
    if (c->counts == 0) {
        cli_say(ui,
                "shapes: %zu of the same name in both; which model describes shapes better was not "
                "asked",
                c->common);
        return;
    }
    cli_say(ui, "shapes: %zu in both, left out and rebuilt; mean distance of their surfaces",
            c->common);
    for (size_t q = 0; q < c->counts; q++)
        cli_say(ui, "  %zu mode%s: A %.4g, B %.4g (p = %.2g that they do equally well)",
                c->count[q], c->count[q] == 1 ? "" : "s", c->rebuilt[0][q], c->rebuilt[1][q],
                c->p[q]);
}

apsm_status apsm_cli_compare(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    apsm_comparison c;
    const apsm_compare_settings settings = { .a = args->inputs[0],
                                             .b = args->inputs[1],
                                             .folder = args->out_dir,
                                             .overwrite = args->overwrite };
    APSM_TRY(apsm_models_compare(ctx, &settings, &c));
    cli_say(ui, "A: %zu shapes, %zu particles; B: %zu shapes, %zu particles%s", c.shapes[0],
            c.particles[0], c.shapes[1], c.particles[1], c.mirrored ? ", of the other side" : "");
    cli_say(ui, "means: surfaces %.4g apart on average, %.4g at most; B is %.4g times as large",
            c.mean_mean, c.mean_max, c.size_ratio);
    cli_say(ui, "variance of a point: A %.4g, B %.4g", c.variance[0], c.variance[1]);
    say_spans(&c, ui);
    say_shapes(&c, ui);
    return APSM_OK;
}
