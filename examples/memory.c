/* A shape model without any file: bars of different lengths and widths, as arrays, through the
 * whole method, and what comes out as arrays.
 *
 *   cc memory.c $(pkg-config --cflags --libs apsm) -lm
 *
 * Prints the variances of the modes and a line for every shape. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <apsm.h>

enum { SHAPES = 6, N = 12 }; /* faces of a bar have N x N squares */

typedef struct bar {
    size_t nv, nf;
    double *V;
    uint32_t *F;
} bar;

static double fraction(size_t k)
{
    return 2.0 * (double)k / N - 1;
}

/* Side s of the cube [-1, 1]^3 is a grid of its own; the library joins what coincides. */
static void add_side(bar *b, int s)
{
    const int axis = s / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
    const size_t first = b->nv;
    for (size_t i = 0; i <= N; i++)
        for (size_t j = 0; j <= N; j++) {
            double *x = b->V + 3 * b->nv++;
            x[axis] = s % 2 ? 1 : -1;
            x[u] = fraction(i);
            x[v] = fraction(j);
        }
    for (size_t i = 0; i < N; i++)
        for (size_t j = 0; j < N; j++) {
            const uint32_t a = (uint32_t)(first + i * (N + 1) + j), d = a + N + 1;
            const uint32_t quad[6] = { a, d, d + 1, a, d + 1, a + 1 };
            for (int k = 0; k < 6; k++) b->F[3 * b->nf + (size_t)k] = quad[s % 2 ? k : 5 - k];
            b->nf += 2;
        }
}

/* The cube, rounded, then drawn out to a bar. */
static int make_bar(bar *b, double length, double width)
{
    b->nv = b->nf = 0;
    b->V = (double *)malloc(6 * (N + 1) * (N + 1) * 3 * sizeof *b->V);
    b->F = (uint32_t *)malloc(6 * N * N * 2 * 3 * sizeof *b->F);
    if (!b->V || !b->F) return 0;
    for (int s = 0; s < 6; s++) add_side(b, s);
    for (size_t v = 0; v < b->nv; v++) {
        double *x = b->V + 3 * v;
        const double r = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]), round = 0.5 + 0.5 / r;
        x[0] *= round * length;
        x[1] *= round * width;
        x[2] *= round * 10;
    }
    return 1;
}

static void on_progress(void *user, const apsm_progress *progress)
{
    (void)user;
    fprintf(stderr, "%s %zu/%zu\n", progress->stage, progress->done, progress->total);
}

static apsm_status add_bars(apsm_run *run)
{
    for (int i = 0; i < SHAPES; i++) {
        bar b;
        char name[16];
        apsm_status status = APSM_ERR_MEMORY;
        snprintf(name, sizeof name, "bar%d", i);
        if (make_bar(&b, 20 + 2 * i, 12 + (i * i) % 5))
            status = apsm_run_add_mesh(run, name, false, b.nv, b.V, b.nf, b.F);
        free(b.V); /* the library has copied them */
        free(b.F);
        if (status != APSM_OK) return status;
    }
    return APSM_OK;
}

static void show(const apsm_run *run)
{
    size_t J, n;
    const double *P = apsm_run_particles(run, &J);
    const apsm_shape_model *model = apsm_run_model(run);
    const double *variance = apsm_model_variance(model);
    const double *distance = apsm_figures_get(apsm_run_figures(run), "surface_mean", &n);
    printf("%zu shapes, %zu particles, variances", apsm_run_shapes(run), J);
    for (size_t k = 0; k < apsm_model_modes(model); k++) printf(" %.3g", variance[k]);
    printf("\n");
    for (size_t i = 0; i < apsm_run_shapes(run); i++) {
        const double *p = P + i * J * 3; /* its first particle corresponds to all others' first */
        const char *why = apsm_run_review(run, i, 0);
        printf("%s: %s, surface distance %.3g, first particle at %.2f %.2f %.2f\n",
               apsm_run_shape_name(run, i), why ? why : "certified", i < n ? distance[i] : 0, p[0],
               p[1], p[2]);
    }
}

int main(void)
{
    const char *const set[][2] = { { "particles", "64" }, { "faces", "1500" }, { "seed", "1" } };
    apsm_run_settings settings;
    apsm_context *ctx = apsm_context_new();
    apsm_run *run = NULL;
    if (!ctx) return EXIT_FAILURE;
    apsm_context_set_threads(ctx, 2);
    apsm_context_set_progress(ctx, on_progress, NULL);
    memset(&settings, 0, sizeof settings); /* no folder: everything stays in memory */
    settings.n_set = sizeof set / sizeof set[0];
    settings.set = set;
    apsm_status status = apsm_run_open(ctx, &settings, &run);
    if (status == APSM_OK) status = add_bars(run);
    if (status == APSM_OK) status = apsm_run_all(run);
    if (status == APSM_OK)
        show(run);
    else
        fprintf(stderr, "memory: %s\n", apsm_error_text(ctx));
    apsm_run_close(run);
    apsm_context_free(ctx);
    return status == APSM_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}
