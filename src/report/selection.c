#include "report/selection.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Of the places that are not for even ones, this share is for the largest distances. */
enum { SHARE_OF_FARTHEST = 8 };

/* The entry of shape i in an array in the shapes' order, or NULL. */
static const json_t *entry_of(const json_t *per_shape, const model_folder *m, size_t i)
{
    const json_t *entry = json_array_get(per_shape, i);
    const char *name = json_string_value(json_object_get(entry, "name"));
    return name && strcmp(name, m->names[i]) == 0 ? entry : NULL;
}

static bool is_certified(const model_folder *m, size_t i)
{
    const json_t *entry = entry_of(json_object_get(m->certificate, "per_shape"), m, i);
    const char *verdict = json_string_value(json_object_get(entry, "verdict"));
    return verdict && strcmp(verdict, "certified") == 0;
}

static double distance_of(const model_folder *m, size_t i)
{
    const json_t *surface = json_object_get(m->evaluation, "surface_distance");
    const json_t *entry = entry_of(json_object_get(surface, "per_shape"), m, i);
    const double mean = json_number_value(json_object_get(entry, "mean"));
    return isfinite(mean) ? mean : 0.0;
}

typedef struct ranked {
    double distance;
    size_t shape;
} ranked;

static int farthest_first(const void *a, const void *b)
{
    const ranked *x = a, *y = b;
    if (x->distance != y->distance) return x->distance > y->distance ? -1 : 1;
    return (x->shape > y->shape) - (x->shape < y->shape);
}

/* Marks shape i, if that is new; returns how many are marked now. */
static size_t mark(bool *shown, size_t i, size_t marked)
{
    const bool is_new = !shown[i];
    shown[i] = true;
    return marked + is_new;
}

/* list: scratch (I). */
static void choose(size_t most, const model_folder *m, ranked *list, bool *shown)
{
    const size_t outliers = most - most / 4, farthest = most / SHARE_OF_FARTHEST;
    size_t marked = mark(shown, m->template_index, 0);
    for (size_t d = 0; d < m->parts; d++) marked = mark(shown, m->part[d].template_index, marked);
    for (size_t i = 0; i < m->I; i++) list[i] = (ranked){ distance_of(m, i), i };
    qsort(list, m->I, sizeof *list, farthest_first);
    for (size_t k = 0; k < farthest && list[k].distance > 0.0; k++)
        marked = mark(shown, list[k].shape, marked);
    for (size_t i = 0; i < m->I && marked < outliers; i++)
        if (!is_certified(m, i)) marked = mark(shown, i, marked);
    const size_t rest = most - marked;
    for (size_t k = 0; k < rest; k++) marked = mark(shown, k * m->I / rest, marked);
    for (size_t i = 0; i < m->I && marked < most; i++) marked = mark(shown, i, marked);
}

/* Shapes that are shown move to the front, the others to the project's end and away. */
static void keep(const bool *shown, model_folder *m)
{
    const size_t n = 3 * m->J;
    size_t to = 0;
    for (size_t i = 0; i < m->I; i++) {
        if (!shown[i]) continue;
        const apsm_subject subject = m->project.subjects[to];
        m->project.subjects[to] = m->project.subjects[i];
        m->project.subjects[i] = subject;
        m->names[to] = m->names[i];
        memmove(m->P + to * n, m->P + i * n, n * sizeof *m->P);
        if (i == m->template_index) m->template_index = to;
        for (size_t d = 0; d < m->parts; d++)
            if (i == m->part[d].template_index) m->part[d].template_index = to;
        to++;
    }
    while (m->project.n > to) apsm_project_remove(&m->project, m->project.n - 1);
    m->I = to;
}

apsm_status selection_make(size_t most, model_folder *m, size_t *all)
{
    *all = m->I;
    if (m->I <= most) return APSM_OK;
    bool *shown = calloc(m->I, sizeof *shown);
    ranked *list = malloc(m->I * sizeof *list);
    const apsm_status status = shown && list ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        choose(most, m, list, shown);
        keep(shown, m);
    }
    free(shown);
    free(list);
    return status;
}
