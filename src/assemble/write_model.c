/* model.json, pose_shape.json and the tables of a joint. */
#include "assemble/writing.h"

#include <math.h>
#include <stdlib.h>

#include "files/files.h"
#include "folder/model_json.h"
#include "folder/names.h"

static json_t *json_rows(size_t n, size_t width, const double *x)
{
    json_t *rows = json_array();
    for (size_t k = 0; k < n; k++)
        json_array_append_new(rows, apsm_json_matrix(width / 3, 3, x + k * width));
    if (json_array_size(rows) == n) return rows;
    json_decref(rows);
    return NULL;
}

static json_t *json_model(const apsm_shape_model *m)
{
    return json_pack("{s:o, s:o, s:o}", "variances", apsm_json_vector(m->modes, m->variance),
                     "mean", apsm_json_matrix(m->J, 3, m->mean), "modes",
                     json_rows(m->modes, 3 * m->J, m->mode));
}

static apsm_status write_model(writing *w)
{
    const apsm_shape_model *m = &w->f->model;
    json_t *root = json_pack("{s:s, s:i, s:I, s:I, s:o}", "format", FORMAT_MODEL, "version",
                             MODEL_VERSION, "shapes", (json_int_t)m->I, "particles",
                             (json_int_t)m->J, "parts", writing_parts(w));
    json_t *model = json_model(m);
    if (!root || !model || json_object_update(root, model) != 0) {
        json_decref(root);
        root = NULL;
    }
    json_decref(model);
    return writing_json(w, FOLDER_MODEL, root);
}

static json_t *json_poses_of_part(const writing *w, size_t d)
{
    const apsm_pose_shape *ps = &w->f->poses;
    return json_pack("{s:s, s:o, s:o}", "name", writing_part(w, d), "mean_pose",
                     apsm_json_matrix(4, 4, ps->mean_pose + 16 * d), "moments",
                     apsm_json_matrix(3, 3, ps->gyration + 9 * d));
}

static apsm_status write_pose_shape(writing *w)
{
    const apsm_pose_shape *ps = &w->f->poses;
    json_t *parts = json_array();
    for (size_t d = 0; d < w->c->n; d++) json_array_append_new(parts, json_poses_of_part(w, d));
    json_t *root =
        json_pack("{s:s, s:i, s:o, s:f, s:o, s:o, s:o}", "format", "apsm-pose-shape", "version", 1,
                  "parts", parts, "not_explained", ps->leak, "pose", json_model(&ps->poses),
                  "shape", json_model(&ps->shapes), "both", json_model(&ps->both));
    return writing_json(w, FOLDER_POSE_SHAPE, root);
}

static apsm_status open_csv(writing *w, const char *name, apsm_writer **csv)
{
    char *path = writing_path(w, "%s", name);
    const apsm_status status = path ? apsm_writer_open(w->job->ctx, path, csv) : APSM_ERR_MEMORY;
    free(path);
    return status;
}

static void cell(apsm_writer *csv, double x)
{
    apsm_writer_printf(csv, ",");
    if (isfinite(x)) apsm_writer_number(csv, x);
}

static apsm_status write_scores(writing *w, const char *name, const char *column,
                                const apsm_shape_model *m)
{
    char *path = writing_path(w, "%s", name);
    const char **names = malloc((m->I + 1) * sizeof *names);
    for (size_t i = 0; names && i < m->I; i++) names[i] = writing_subject(w, i);
    const apsm_status status =
        path && names ? scores_csv_write(w->job->ctx, path, names, column, m) : APSM_ERR_MEMORY;
    free(names);
    free(path);
    return status;
}

/* Rotations in degrees about the axes of the part's mean frame, translations in the input's unit.
 */
static apsm_status write_poses(writing *w)
{
    static const char *const axis[] = { "rx", "ry", "rz", "tx", "ty", "tz" };
    const double degrees = 180 / acos(-1);
    apsm_writer *csv = NULL;
    APSM_TRY(open_csv(w, "poses.csv", &csv));
    apsm_writer_printf(csv, "name");
    for (size_t d = 0; d < w->c->n; d++)
        for (size_t k = 0; k < 6; k++)
            apsm_writer_printf(csv, ",%s_%s", writing_part(w, d), axis[k]);
    for (size_t i = 0; i < w->c->I; i++) {
        apsm_writer_printf(csv, "\n");
        apsm_writer_csv(csv, writing_subject(w, i));
        for (size_t k = 0; k < 6 * w->c->n; k++)
            cell(csv, w->f->poses.pose[6 * i * w->c->n + k] * (k % 6 < 3 ? degrees : 1));
    }
    apsm_writer_printf(csv, "\n");
    return apsm_writer_commit(csv);
}

static void contact_row(apsm_writer *csv, const apsm_contact *own, const apsm_contact *rebuilt)
{
    const apsm_contact none = { NAN, NAN, NAN };
    if (!own) own = &none;
    const double cells[] = { own->gap,     own->depth,     own->overlap,
                             rebuilt->gap, rebuilt->depth, rebuilt->overlap };
    for (size_t k = 0; k < sizeof cells / sizeof *cells; k++) cell(csv, cells[k]);
    apsm_writer_printf(csv, "\n");
}

static apsm_status write_contacts(writing *w)
{
    const size_t n = w->c->n, pairs = w->f->pairs;
    apsm_writer *csv = NULL;
    APSM_TRY(open_csv(w, "contacts.csv", &csv));
    apsm_writer_printf(csv, "name,part,other,gap,depth,overlap,rebuilt_gap,rebuilt_depth,"
                            "rebuilt_overlap\n");
    for (size_t i = 0; i < w->c->I + w->f->made; i++) { /* the mean and modes come last */
        size_t pair = 0;
        for (size_t a = 0; a < n; a++)
            for (size_t b = a + 1; b < n; b++, pair++) {
                char name[JOINT_MADE_LENGTH];
                const joint_contact *k = i < w->c->I ? &w->f->contact[i * pairs + pair] : NULL;
                const size_t made = k ? 0 : i - w->c->I;
                if (k)
                    apsm_writer_csv(csv, writing_subject(w, i));
                else
                    joint_made_name(w->f, made, name), apsm_writer_printf(csv, "%s", name);
                apsm_writer_printf(csv, ",%s,%s", writing_part(w, a), writing_part(w, b));
                contact_row(csv, k ? &k->own : NULL,
                            k ? &k->rebuilt : &w->f->spaces[made * pairs + pair]);
            }
    }
    return apsm_writer_commit(csv);
}

apsm_status joint_write_model(writing *w)
{
    APSM_TRY(write_model(w));
    APSM_TRY(write_pose_shape(w));
    APSM_TRY(write_scores(w, FOLDER_SCORES_CSV, "mode", &w->f->model));
    APSM_TRY(write_scores(w, "pose_scores.csv", "pose_mode", &w->f->poses.poses));
    APSM_TRY(write_scores(w, "shape_scores.csv", "shape_mode", &w->f->poses.shapes));
    APSM_TRY(write_poses(w));
    return write_contacts(w);
}
