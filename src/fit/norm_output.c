/* Files and log of `apsm norm`. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "apsm/version.h"
#include "files/files.h"
#include "fit/norm_job.h"
#include "folder/manifest_json.h"
#include "statistics/results.h"

static const double alpha = 0.05;

static json_t *json_values(const norm_job *w, size_t k)
{
    json_t *all = json_array();
    for (size_t v = 0; v < w->values; v++) {
        const norm_value *x = &w->value[v];
        if (isnan(x->t[k])) continue;
        json_array_append_new(all, json_pack("{s:s, s:I, s:f, s:f, s:f, s:f}", "name", x->name,
                                             "shapes", (json_int_t)x->N, "value", x->value[k],
                                             "expected", x->expected[k], "z", x->t[k], "percentile",
                                             100 * norm_student(x->t[k], x->nu[k])));
    }
    return all;
}

/* What the page shows: particles, where they are expected, and t along the normal. */
static int add_particles(const norm_job *w, size_t k, json_t *shape)
{
    const size_t J = w->m.J, V = 3 * J;
    const double *along = w->result[k].along;
    double *expected = malloc((V + 1) * sizeof *expected);
    if (!expected) return -1;
    for (size_t v = 0; v < V; v++) expected[v] = w->files.P[k * V + v] - w->model.E0[k * V + v];
    const int failed = json_object_update_new(
        shape, json_pack("{s:o, s:o, s:o}", "world", apsm_json_matrix(J, 3, w->files.P + k * V),
                         "expected", apsm_json_matrix(J, 3, expected), "particle_z",
                         along ? apsm_json_vector(J, along) : json_null()));
    free(expected);
    return failed;
}

static json_t *json_shape(const norm_job *w, size_t k)
{
    const norm_result *r = &w->result[k];
    const double nu = (double)(w->N - w->q);
    json_t *modes = json_array();
    for (size_t v = 0; v < w->modes; v++)
        json_array_append_new(modes, json_pack("{s:f, s:f}", "z", r->t[v], "percentile",
                                               100 * norm_student(r->t[v], nu)));
    json_t *shape = json_pack(
        "{s:s, s:O?, s:f, s:f, s:[f, f], s:[o, o], s:f, s:f, s:f, s:o, s:o, s:o, s:o}", "name",
        w->files.name[k], "note", w->files.note[k], "distance", r->distance, "percentile",
        100 * r->percentile, "percentile_interval", 100 * r->low, 100 * r->high,
        "percentile_of_halves", apsm_json_number_or_null(100 * r->halves_low),
        apsm_json_number_or_null(100 * r->halves_high), "p", r->p, "z", r->z, "p_particles",
        r->p_particles, "modes", modes, "particle_p", apsm_json_vector(w->m.J, r->p_of),
        "particle_q", apsm_json_vector(w->m.J, r->q_of), "values", json_values(w, k));
    if (shape && add_particles(w, k, shape) == 0) return shape;
    json_decref(shape);
    return NULL;
}

static json_t *json_result(const norm_job *w)
{
    json_t *shapes = json_array(), *uncertified = json_array();
    for (size_t k = 0; k < w->n; k++) json_array_append_new(shapes, json_shape(w, k));
    for (size_t i = 0; i < w->N; i++)
        if (!model_folder_is_certified(&w->m, w->row[i]))
            json_array_append_new(uncertified, json_string(w->names[w->row[i]]));
    const char *unit = manifest_unit(w->m.manifest);
    return json_pack("{s:s, s:i, s:s, s:o, s:o, s:I, s:I, s:o, s:o, s:O, s:o}", "format",
                     FORMAT_NORM, "version", NORM_VERSION, "apsm", APSM_VERSION, "unit",
                     unit ? json_string(unit) : json_null(), "formula",
                     w->s->formula ? json_string(w->s->formula) : json_null(), "shapes",
                     (json_int_t)w->N, "coefficients", (json_int_t)w->q, "normals",
                     w->normal ? apsm_json_matrix(w->m.J, 3, w->normal) : json_null(),
                     "not_certified", uncertified, "notes", w->notes, "new", shapes);
}

static void write_table(const norm_job *w, apsm_writer *csv)
{
    apsm_writer_printf(csv, "name,distance,percentile,percentile_low,percentile_high,halves_low,"
                            "halves_high,p,z,p_particles,unusual_particles");
    for (size_t v = 0; v < w->modes; v++) apsm_writer_printf(csv, ",mode_%zu_z", v + 1);
    apsm_writer_printf(csv, ",note\n");
    for (size_t k = 0; k < w->n; k++) {
        const norm_result *r = &w->result[k];
        size_t unusual = 0;
        for (size_t j = 0; j < w->m.J; j++) unusual += r->q_of[j] <= alpha;
        const double cells[] = {
            r->distance,         100 * r->percentile,  100 * r->low, 100 * r->high,
            100 * r->halves_low, 100 * r->halves_high, r->p,         r->z,
            r->p_particles,      (double)unusual
        };
        apsm_writer_csv(csv, w->files.name[k]);
        for (size_t c = 0; c < sizeof cells / sizeof *cells; c++) {
            apsm_writer_printf(csv, ",");
            if (isfinite(cells[c])) apsm_writer_number(csv, cells[c]);
        }
        for (size_t v = 0; v < w->modes; v++) {
            apsm_writer_printf(csv, ",");
            apsm_writer_number(csv, r->t[v]);
        }
        apsm_writer_printf(csv, ",");
        apsm_writer_csv(csv, particle_files_note_text(&w->files, k));
        apsm_writer_printf(csv, "\n");
    }
}

/* Of one shape: where it should be, how far off it is. */
static void write_particles(const norm_job *w, size_t k, apsm_writer *csv)
{
    const norm_result *r = &w->result[k];
    const double *p = w->files.P + k * w->model.V, *e = w->model.E0 + k * w->model.V;
    apsm_writer_printf(csv, "particle,x,y,z,dx,dy,dz,standardised,p,q\n");
    for (size_t j = 0; j < w->m.J; j++) {
        const double cells[] = { p[3 * j],       p[3 * j + 1], p[3 * j + 2],
                                 e[3 * j],       e[3 * j + 1], e[3 * j + 2],
                                 sqrt(r->T2[j]), r->p_of[j],   r->q_of[j] };
        apsm_writer_printf(csv, "%zu", j);
        for (size_t c = 0; c < sizeof cells / sizeof *cells; c++) {
            apsm_writer_printf(csv, ",");
            if (isfinite(cells[c])) apsm_writer_number(csv, cells[c]);
        }
        apsm_writer_printf(csv, "\n");
    }
}

/* File f: the results, their table, and of every shape. */
static apsm_status write_file(const norm_job *w, const char *folder, size_t f)
{
    char name[512];
    snprintf(name, sizeof name,
             f > 1 ? "%.400s_norm.csv"
             : f   ? "norm.csv"
                   : "norm.json",
             f > 1 ? w->files.name[f - 2] : "");
    char *path = apsm_path_join(folder, name);
    apsm_writer *csv = NULL;
    json_t *root = f == 0 ? json_result(w) : NULL;
    apsm_status status = !path    ? APSM_ERR_MEMORY
                         : f == 0 ? apsm_json_write(w->ctx, path, root)
                                  : apsm_writer_open(w->ctx, path, &csv);
    if (status == APSM_OK && csv) {
        if (f == 1)
            write_table(w, csv);
        else
            write_particles(w, f - 2, csv);
        status = apsm_writer_commit(csv);
    }
    if (status == APSM_OK && f < 2) apsm_log(w->ctx, APSM_LOG_INFO, "written: %s", path);
    json_decref(root);
    free(path);
    return status;
}

apsm_status norm_write_results(const norm_job *w)
{
    char *folder = results_folder(w->s->folder, w->s->out);
    apsm_status status = folder ? apsm_make_folder(w->ctx, folder) : APSM_ERR_MEMORY;
    for (size_t f = 0; f < w->n + 2 && status == APSM_OK; f++) status = write_file(w, folder, f);
    free(folder);
    return status;
}

void norm_tell(const norm_job *w)
{
    size_t uncertain = 0;
    for (size_t i = 0; i < w->N; i++) uncertain += !model_folder_is_certified(&w->m, w->row[i]);
    for (size_t k = 0; k < w->n; k++) {
        const norm_result *r = &w->result[k];
        apsm_log(w->ctx, APSM_LOG_INFO,
                 "%s: as a whole farther from what is expected than %.0f %% of %zu shapes (95 %%: "
                 "%.0f to %.0f), z %.2f; most unusual particle p = %.3g",
                 w->files.name[k], 100 * r->percentile, w->N, 100 * r->low, 100 * r->high, r->z,
                 r->p_particles);
    }
    if (uncertain > 0)
        apsm_log(w->ctx, APSM_LOG_WARNING,
                 "%zu of the %zu shapes of the norm are not certified: look at them before you "
                 "trust this",
                 uncertain, w->N);
}
