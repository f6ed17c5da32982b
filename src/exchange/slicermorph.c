/* slicermorph: the folder that SlicerMorph's GPA module writes and reads, and SlicerMorphR parses:
 * particles are its landmarks.  Size is kept, which it calls Boas coordinates. */
#include <jansson.h>
#include <math.h>
#include <stdlib.h>

#include "apsm/particles.h"
#include "exchange/exporting.h"
#include "geometry/vec3.h"

static void put_cell(apsm_writer *w, double x)
{
    apsm_writer_printf(w, ",");
    apsm_writer_number(w, x);
}

static apsm_status write_mean(exporting *e)
{
    const apsm_shape_model *m = &e->dense.folder.model;
    apsm_writer *w;
    APSM_TRY(exporting_table(e, "meanShape.csv", &w));
    apsm_writer_printf(w, ",X,Y,Z\n");
    for (size_t j = 0; j < m->J; j++) {
        apsm_writer_printf(w, "LM %zu", j + 1);
        for (size_t c = 0; c < 3; c++) put_cell(w, m->mean[3 * j + c]);
        apsm_writer_printf(w, "\n");
    }
    return apsm_writer_commit(w);
}

static apsm_status write_values(exporting *e)
{
    apsm_writer *w;
    APSM_TRY(exporting_table(e, "eigenvalues.csv", &w));
    for (size_t k = 0; k < e->modes; k++) {
        apsm_writer_printf(w, "PC %zu", k + 1);
        put_cell(w, e->dense.folder.model.variance[k]);
        apsm_writer_printf(w, "\n");
    }
    return apsm_writer_commit(w);
}

static void put_header(apsm_writer *w, const char *first, size_t modes)
{
    apsm_writer_printf(w, "%s", first);
    for (size_t k = 0; k < modes; k++) apsm_writer_printf(w, ",PC %zu", k + 1);
    apsm_writer_printf(w, "\n");
}

static apsm_status write_vectors(exporting *e)
{
    const apsm_shape_model *m = &e->dense.folder.model;
    apsm_writer *w;
    APSM_TRY(exporting_table(e, "eigenvector.csv", &w));
    put_header(w, "", e->modes);
    for (size_t x = 0; x < 3 * m->J; x++) {
        apsm_writer_printf(w, "LM %zu_%c", x / 3 + 1, "XYZ"[x % 3]);
        for (size_t k = 0; k < e->modes; k++) put_cell(w, m->mode[k * 3 * m->J + x]);
        apsm_writer_printf(w, "\n");
    }
    return apsm_writer_commit(w);
}

static apsm_status write_scores(exporting *e)
{
    const model_folder *m = &e->dense.folder;
    apsm_writer *w;
    APSM_TRY(exporting_table(e, "pcScores.csv", &w));
    put_header(w, "Sample_name", e->modes);
    for (size_t i = 0; i < m->I; i++) {
        apsm_writer_csv(w, m->names[i]);
        for (size_t k = 0; k < e->modes; k++) put_cell(w, m->model.score[i * m->model.modes + k]);
        apsm_writer_printf(w, "\n");
    }
    return apsm_writer_commit(w);
}

static double centroid_size(size_t J, const double *p)
{
    double c[3] = { 0 }, sum = 0;
    for (size_t j = 0; j < J; j++) vec3_add_scaled(c, 1 / (double)J, p + 3 * j);
    for (size_t j = 0; j < J; j++) sum += vec3_distance2(p + 3 * j, c);
    return sqrt(sum);
}

static double distance(size_t n, const double *p, const double *q)
{
    double sum = 0;
    for (size_t x = 0; x < n; x++) sum += (p[x] - q[x]) * (p[x] - q[x]);
    return sqrt(sum);
}

static apsm_status write_shapes(exporting *e)
{
    const model_folder *m = &e->dense.folder;
    apsm_writer *w;
    APSM_TRY(exporting_table(e, "outputData.csv", &w));
    apsm_writer_printf(w, "Sample_name,proc_dist,centroid");
    for (size_t x = 0; x < 3 * m->J; x++)
        apsm_writer_printf(w, ",LM %zu_%c", x / 3 + 1, "XYZ"[x % 3]);
    apsm_writer_printf(w, "\n");
    for (size_t i = 0; i < m->I; i++) {
        const double *p = m->P + i * 3 * m->J;
        apsm_writer_csv(w, m->names[i]);
        put_cell(w, distance(3 * m->J, p, m->model.mean));
        put_cell(w, centroid_size(m->J, p));
        for (size_t x = 0; x < 3 * m->J; x++) put_cell(w, p[x]);
        apsm_writer_printf(w, "\n");
    }
    return apsm_writer_commit(w);
}

/* What GPA was run on: the particles as markups.  Names go into `files`. */
static apsm_status write_landmarks(exporting *e, json_t *files)
{
    const model_folder *m = &e->dense.folder;
    for (size_t i = 0; i < m->I; i++) {
        char *path = NULL;
        apsm_status status = exporting_file(e, &path, "landmarks/%s.mrk.json", m->names[i]);
        if (status == APSM_OK) status = apsm_points_write(e->ctx, path, m->J, m->P + i * 3 * m->J);
        free(path);
        APSM_TRY(status);
        json_array_append_new(files, json_sprintf("%s.mrk.json", m->names[i]));
    }
    return APSM_OK;
}

/* No date, and paths from the folder on: the same model gives the same bytes. */
static apsm_status write_log(exporting *e, json_t *files)
{
    json_t *log = json_pack("{s:s, s:s, s:s, s:s, s:O, s:s, s:I, s:[], s:[], s:b}", "Date", "",
                            "Time", "", "InputPath", "landmarks", "OutputPath", ".", "Files", files,
                            "LMFormat", ".mrk.json", "NumberLM", (json_int_t)e->dense.folder.J,
                            "ExcludedLM", "SemiLandmarks", "Boas", 1);
    json_t *names =
        json_pack("{s:s, s:s, s:s, s:s, s:s, s:s}", "MeanShape", "meanShape.csv", "Eigenvalues",
                  "eigenvalues.csv", "Eigenvectors", "eigenvector.csv", "OutputData",
                  "outputData.csv", "PCScores", "pcScores.csv", "Covariates", "");
    json_object_update(log, names);
    json_decref(names);
    json_t *root = json_pack("{s:s, s:[o]}", "@schema",
                             "https://raw.githubusercontent.com/slicermorph/slicermorph/master/GPA/"
                             "Resources/Schema/GPALog-schema-v1.0.0.json#",
                             "GPALog", log);
    return exporting_json(e, "analysis.json", root);
}

apsm_status export_slicermorph(exporting *e)
{
    APSM_TRY(write_mean(e));
    APSM_TRY(write_values(e));
    APSM_TRY(write_vectors(e));
    APSM_TRY(write_shapes(e));
    APSM_TRY(write_scores(e));
    json_t *files = json_array();
    apsm_status status = files ? write_landmarks(e, files) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = write_log(e, files);
    json_decref(files);
    return status;
}
