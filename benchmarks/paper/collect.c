/* collect.c -- the figures of finished runs as three tidy tables.
 *   paper_collect OUT_DIR COHORT/SETTING/SEED...
 * reads OUT_DIR/runs/COHORT/SETTING/SEED, model folders as `apsm evaluate` leaves them
 * (docs/formats.md), and writes OUT_DIR/results.csv (a line a run), shapes.csv (a line a shape of
 * a run) and modes.csv (a line a number of modes of a run).  Lengths in the unit of the input;
 * cpu_seconds and peak_mb are those of `optimize`. */
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct tables {
    FILE *results, *shapes, *modes;
} tables;

static void give_up(const char *path, const char *why)
{
    fprintf(stderr, "paper_collect: %s: %s\n", path, why);
    exit(1);
}

static json_t *load(const char *folder, const char *file)
{
    char path[8192];
    json_error_t error;
    snprintf(path, sizeof path, "%s/%s", folder, file);
    json_t *json = json_load_file(path, 0, &error);
    if (!json) give_up(path, error.text);
    return json;
}

static FILE *create(const char *folder, const char *file)
{
    char path[8192];
    snprintf(path, sizeof path, "%s/%s", folder, file);
    FILE *f = fopen(path, "w");
    if (!f) give_up(path, "cannot be written");
    return f;
}

static double number(const json_t *json, const char *key)
{
    return json_number_value(json_object_get(json, key));
}

static double entry(const json_t *json, const char *key, size_t m)
{
    return json_number_value(json_array_get(json_object_get(json, key), m));
}

static const char *option(const json_t *manifest, const char *key)
{
    const char *text =
        json_string_value(json_object_get(json_object_get(manifest, "options"), key));
    return text ? text : "";
}

/* run: "cohort,setting,seed", the first columns of all tables. */
static void write_result(FILE *f, const char *run, const json_t *manifest, const json_t *evaluation,
                         const json_t *certificate)
{
    const json_t *surface = json_object_get(evaluation, "surface_distance");
    const json_t *optimize = json_object_get(json_object_get(manifest, "stages"), "optimize");
    fprintf(f, "%s,%s,%s,%s,%g", run, option(manifest, "method"), option(manifest, "particles"),
            option(manifest, "adaptivity"), number(certificate, "shapes"));
    fprintf(f, ",%.4f,%.4f,%.4f", number(surface, "mean"), number(surface, "mean_max"),
            number(surface, "max"));
    fprintf(f, ",%.4f,%.4f,%.4f", entry(evaluation, "compactness", 0),
            entry(evaluation, "generalization", 0), entry(evaluation, "specificity", 0));
    fprintf(f, ",%g,%.5f,%.2f,%.1f", number(certificate, "certified"),
            number(certificate, "mean_mismatched_1.5_2.0"), number(optimize, "cpu_seconds"),
            number(optimize, "peak_memory_mb"));
    const json_t *others = json_object_get(surface, "other_templates");
    fprintf(f, ",%.4f,%.4f\n", number(others, "mean"), number(others, "mean_max"));
}

static void write_shapes(FILE *f, const char *run, const json_t *evaluation)
{
    const json_t *surface = json_object_get(evaluation, "surface_distance"), *shape;
    size_t i;
    json_array_foreach(json_object_get(surface, "per_shape"), i, shape)
    {
        fprintf(f, "%s,%s,%.5f,%.5f,%.5f\n", run, json_string_value(json_object_get(shape, "name")),
                number(shape, "mean"), number(shape, "p95"), number(shape, "max"));
    }
}

static void write_modes(FILE *f, const char *run, const json_t *evaluation)
{
    const size_t n = json_array_size(json_object_get(evaluation, "generalization"));
    for (size_t m = 0; m < n; m++) {
        fprintf(f, "%s,%zu,%.5f,%.5f,%.5f\n", run, m + 1, entry(evaluation, "compactness", m),
                entry(evaluation, "generalization", m), entry(evaluation, "specificity", m));
    }
}

static void collect(const char *out, const char *name, const tables *t)
{
    char folder[4096], run[1024];
    snprintf(folder, sizeof folder, "%s/runs/%s", out, name);
    snprintf(run, sizeof run, "%s", name);
    for (char *c = run; *c; c++)
        if (*c == '/') *c = ',';
    json_t *manifest = load(folder, "manifest.json");
    json_t *evaluation = load(folder, "evaluation.json");
    json_t *certificate = load(folder, "certificate.json");
    write_result(t->results, run, manifest, evaluation, certificate);
    write_shapes(t->shapes, run, evaluation);
    write_modes(t->modes, run, evaluation);
    json_decref(manifest);
    json_decref(evaluation);
    json_decref(certificate);
}

int main(int argc, char **argv)
{
    if (argc < 2) give_up("usage", "paper_collect OUT_DIR COHORT/SETTING/SEED...");
    const tables t = { create(argv[1], "results.csv"), create(argv[1], "shapes.csv"),
                       create(argv[1], "modes.csv") };
    fprintf(t.results, "cohort,setting,seed,method,particles,adaptivity,shapes,surface_mean,"
                       "surface_mean_max,surface_max,compactness_1,generalization_1,"
                       "specificity_1,certified,mismatched,cpu_seconds,peak_mb,"
                       "other_mean,other_mean_max\n");
    fprintf(t.shapes, "cohort,setting,seed,name,mean,p95,max\n");
    fprintf(t.modes, "cohort,setting,seed,modes,compactness,generalization,specificity\n");
    for (int i = 2; i < argc; i++) collect(argv[1], argv[i], &t);
    if (fclose(t.results) || fclose(t.shapes) || fclose(t.modes)) give_up(argv[1], "disk full?");
    return 0;
}
