/* A shape model of files, in a model folder, as `apsm run INPUT... -o FOLDER` makes it; then the
 * finished model is opened again and its mean is drawn.
 *
 *   cc folder.c $(pkg-config --cflags --libs apsm)
 *   ./a.out FOLDER INPUT...
 *
 * Ctrl-C ends it soon; started again with the same words, it goes on. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <apsm.h>

static volatile int interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

static void on_line(void *user, apsm_log_level level, const char *text)
{
    (void)user;
    fprintf(stderr, "%s%s\n", level == APSM_LOG_WARNING ? "warning: " : "", text);
}

static apsm_status make_model(apsm_context *ctx, const char *folder, size_t n,
                              const char *const *inputs)
{
    const char *const set[][2] = { { "particles", "64" }, { "faces", "2000" } };
    apsm_run_settings settings;
    apsm_run *run = NULL;
    memset(&settings, 0, sizeof settings);
    settings.folder = folder;
    settings.n_inputs = n;
    settings.inputs = inputs;
    settings.n_set = sizeof set / sizeof set[0];
    settings.set = set;
    settings.resume = true; /* nothing there yet: begins anew */
    apsm_status status = apsm_run_open(ctx, &settings, &run);
    if (status == APSM_OK) status = apsm_run_all(run);
    apsm_run_close(run);
    return status;
}

static apsm_status show_model(apsm_context *ctx, const char *folder, const char *picture)
{
    apsm_shape_model *model = NULL;
    apsm_render_options options = { APSM_PICTURE_MEAN, NULL, { 0, 0, 0 }, 600 };
    apsm_status status = apsm_model_open(ctx, folder, &model);
    if (status != APSM_OK) return status;
    printf("%zu shapes, %zu particles, %zu modes\n", apsm_model_shapes(model),
           apsm_model_particles(model), apsm_model_modes(model));
    apsm_model_free(model);
    return apsm_render(ctx, folder, &options, picture);
}

int main(int argc, char **argv)
{
    if (argc < 3) {
        fprintf(stderr, "usage: %s FOLDER INPUT...\n", argv[0]);
        return EXIT_FAILURE;
    }
    apsm_context *ctx = apsm_context_new();
    if (!ctx) return EXIT_FAILURE;
    signal(SIGINT, on_signal);
    apsm_context_set_interrupt(ctx, &interrupted);
    apsm_context_set_log(ctx, on_line, NULL);
    apsm_status status = make_model(ctx, argv[1], (size_t)argc - 2, (const char *const *)argv + 2);
    if (status == APSM_OK) status = show_model(ctx, argv[1], "mean.png");
    if (status != APSM_OK) fprintf(stderr, "folder: %s\n", apsm_error_text(ctx));
    apsm_context_free(ctx);
    return status == APSM_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}
