/* What the parts' own folders say of landmarks and fields, put together for the joint: distances
 * and scalars do not change when parts are moved as rigid bodies. */
#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "assemble/job.h"
#include "files/files.h"
#include "folder/features_csv.h"
#include "folder/names.h"

/* ---- landmarks ---- */

static const json_t *landmarks_of(const joint_cohort *c, size_t d)
{
    return json_object_get(c->folder[d].evaluation, "landmarks");
}

/* "part landmark" of all parts; NULL if out of memory. */
static json_t *json_names(const joint_job *job, const joint_cohort *c)
{
    json_t *names = json_array();
    size_t k, wanted = 0;
    const json_t *name;
    for (size_t d = 0; d < c->n; d++)
        json_array_foreach(json_object_get(landmarks_of(c, d), "names"), k, name)
        {
            wanted++;
            json_array_append_new(
                names, json_sprintf("%s %s", job->part[d].name, json_string_value(name)));
        }
    if (json_array_size(names) == wanted) return names;
    json_decref(names);
    return NULL;
}

/* The errors of subject i on all parts, in the order of the names; null where there is none. */
static json_t *json_errors(const joint_cohort *c, size_t i)
{
    json_t *errors = json_array();
    for (size_t d = 0; d < c->n; d++) {
        const json_t *l = landmarks_of(c, d);
        const size_t n = json_array_size(json_object_get(l, "names"));
        const json_t *shape = json_array_get(json_object_get(l, "per_shape"), c->row[i * c->n + d]);
        for (size_t k = 0; k < n; k++) {
            json_t *x = json_array_get(json_object_get(shape, "errors"), k);
            if (x)
                json_array_append(errors, x);
            else
                json_array_append_new(errors, json_null());
        }
    }
    return errors;
}

/* The mean of the numbers at place `at` of lists (SIZE_MAX: of all), and how many there are. */
static double mean_of(const json_t *lists, size_t at, size_t *n)
{
    double sum = 0;
    *n = 0;
    for (size_t i = 0; i < json_array_size(lists); i++) {
        const json_t *list = json_array_get(lists, i);
        for (size_t k = 0; k < json_array_size(list); k++) {
            const json_t *x = json_array_get(list, k);
            if ((at != SIZE_MAX && k != at) || !json_is_number(x)) continue;
            sum += json_number_value(x);
            ++*n;
        }
    }
    return *n > 0 ? sum / (double)*n : 0;
}

static json_t *json_mean(const json_t *lists, size_t at)
{
    size_t n;
    const double mean = mean_of(lists, at, &n);
    return n > 0 ? json_real(mean) : json_null();
}

static json_t *json_per_shape(const joint_job *job, const joint_cohort *c, const json_t *lists)
{
    json_t *shapes = json_array();
    for (size_t i = 0; i < c->I; i++) {
        json_t *errors = json_array_get(lists, i), *one = json_pack("[O]", errors);
        json_array_append_new(shapes,
                              json_pack("{s:s, s:o, s:O}", "name", job->subject[i].name, "mean",
                                        json_mean(one, SIZE_MAX), "errors", errors));
        json_decref(one);
    }
    return shapes;
}

/* The first part that has landmarks says how they were used: an option of the whole job. */
static const char *use_of(const joint_cohort *c)
{
    const char *use = NULL;
    for (size_t d = 0; d < c->n && !use; d++)
        use = json_string_value(json_object_get(landmarks_of(c, d), "use"));
    return use;
}

json_t *joint_landmarks(const joint_job *job, const joint_cohort *c)
{
    const char *use = use_of(c);
    if (!use) return json_null();
    json_t *names = json_names(job, c), *lists = json_array(), *means = json_array();
    size_t judged;
    for (size_t i = 0; i < c->I; i++) json_array_append_new(lists, json_errors(c, i));
    for (size_t k = 0; k < json_array_size(names); k++)
        json_array_append_new(means, json_mean(lists, k));
    mean_of(lists, SIZE_MAX, &judged);
    json_t *root = json_pack("{s:s, s:o, s:I, s:o, s:o, s:o}", "use", use, "mean",
                             json_mean(lists, SIZE_MAX), "judged", (json_int_t)judged, "names",
                             names, "means", means, "per_shape", json_per_shape(job, c, lists));
    json_decref(lists);
    return root;
}

/* ---- fields ---- */

/* The values of part d go to their places among those of all. */
static apsm_status take_fields(const joint_job *job, const joint_cohort *c, size_t d,
                               const char *path, sampled_fields *all)
{
    const size_t J = c->first[d + 1] - c->first[d];
    sampled_fields part = { 0 };
    APSM_TRY(features_csv_read(job->ctx, path, c->folder[d].I, c->folder[d].names, J, &part));
    if (d == 0) {
        all->S = part.S;
        all->name = part.name;
        all->value = malloc((all->I * all->J * all->S + 1) * sizeof *all->value);
        part.name = NULL;
    }
    apsm_status status = !all->value        ? APSM_ERR_MEMORY
                         : part.S != all->S ? APSM_ERR_STATE
                                            : APSM_OK;
    for (size_t i = 0; i < c->I && status == APSM_OK; i++)
        memcpy(all->value + (i * all->J + c->first[d]) * all->S,
               part.value + c->row[i * c->n + d] * J * all->S, J * all->S * sizeof *part.value);
    if (!part.name) part.S = 0;
    sampled_fields_free(&part);
    return status;
}

static apsm_status write_fields(const joint_job *job, const joint_cohort *c, const char *path,
                                const sampled_fields *all)
{
    const char **names = malloc((c->I + 1) * sizeof *names);
    if (!names) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < c->I; i++) names[i] = job->subject[i].name;
    const apsm_status status = features_csv_write(job->ctx, path, names, all);
    free(names);
    return status;
}

apsm_status joint_write_fields(const joint_job *job, const joint_cohort *c, const char *path,
                               bool *wrote)
{
    sampled_fields all = { .I = c->I, .J = c->J };
    apsm_status status = APSM_OK;
    *wrote = true;
    for (size_t d = 0; d < c->n && status == APSM_OK && *wrote; d++) {
        char *part = model_folder_path(&c->folder[d], FOLDER_FEATURES);
        *wrote = part && apsm_file_exists(part);
        if (*wrote) status = take_fields(job, c, d, part, &all);
        if (!part) status = APSM_ERR_MEMORY;
        free(part);
    }
    if (status == APSM_OK && *wrote) status = write_fields(job, c, path, &all);
    sampled_fields_free(&all);
    return status;
}
