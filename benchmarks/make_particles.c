/* Writes a cohort of particle files whose statistics are known, for timing what only looks at
 * particles: make_particles FOLDER SHAPES PARTICLES [EXPONENT].  Particles lie on an ellipsoid and
 * vary in as many modes as there are shapes, with standard deviations that fall as k^-EXPONENT:
 * 1 (the default) is like organs, 0 (all alike) the worst case of a search for the nearest. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "apsm/context.h"
#include "bench.h"
#include "files/particles_file.h"

/* J places on an ellipsoid, spread by the golden angle. */
static void place(size_t J, double *x)
{
    const double half[3] = { 45, 30, 20 };
    for (size_t j = 0; j < J; j++) {
        const double z = 1 - (2 * (double)j + 1) / (double)J, r = sqrt(1 - z * z);
        const double angle = (double)j * 2.399963229728653;
        x[3 * j] = half[0] * r * cos(angle);
        x[3 * j + 1] = half[1] * r * sin(angle);
        x[3 * j + 2] = half[2] * z;
    }
}

static apsm_status write_all(apsm_context *ctx, const char *folder, size_t I, size_t J,
                             const double *P)
{
    for (size_t i = 0; i < I; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/s%05zu.particles", folder, i);
        APSM_TRY(apsm_particles_write(ctx, path, J, P + i * J * 3));
    }
    return APSM_OK;
}

int main(int argc, char **argv)
{
    const size_t I = argc > 2 ? strtoul(argv[2], NULL, 10) : 0;
    const size_t J = argc > 3 ? strtoul(argv[3], NULL, 10) : 0;
    if (I == 0 || J == 0) {
        fprintf(stderr, "usage: make_particles FOLDER SHAPES PARTICLES [EXPONENT]\n");
        return 2;
    }
    apsm_context *ctx = apsm_context_new();
    double *P = malloc(I * J * 3 * sizeof *P), *mode = malloc(J * 3 * sizeof *mode);
    if (!ctx || !P || !mode) return 1;
    for (size_t i = 0; i < I; i++) place(J, P + i * J * 3);
    bench_add_modes(I, J * 3, argc > 4 ? strtod(argv[4], NULL) : 1.0, P, mode);
    const apsm_status status = write_all(ctx, argv[1], I, J, P);
    if (status != APSM_OK) fprintf(stderr, "make_particles: %s\n", apsm_error_text(ctx));
    free(P);
    free(mode);
    apsm_context_free(ctx);
    return status != APSM_OK;
}
