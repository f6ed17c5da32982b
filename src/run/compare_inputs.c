#include "run/compare_inputs.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/number.h"

enum { LEAST_MASKS = 5 };

/* No organ varies by so much: a unit does. */
static const double other_unit = 5, other_voxels = 4;
/* Images that all have the same slices but for one: of which share, and from which factor on. */
static const double same_slices = 0.8, equal = 1.01, unequal = 1.05;

typedef struct comparing {
    const groom_inputs *in;
    unlike_shape tell;
    void *user;
    double *value;  /* n: of each shape, 0: unknown */
    double *sorted; /* n */
} comparing;

/* ---- the same file ---- */

typedef struct content {
    const char *sha256;
    size_t i;
} content;

static int by_content(const void *a, const void *b)
{
    const content *x = a, *y = b;
    const int order = strcmp(x->sha256, y->sha256);
    return order ? order : (x->i > y->i) - (x->i < y->i);
}

apsm_status compare_files(const groom_inputs *in, same_file tell, void *user)
{
    size_t n = 0;
    content *all = malloc((in->list.n + 1) * sizeof *all);
    if (!all) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < in->list.n; i++)
        if (in->sha256[i][0]) all[n++] = (content){ in->sha256[i], i };
    if (n > 0) qsort(all, n, sizeof *all, by_content);
    for (size_t k = 1; k < n; k++)
        if (strcmp(all[k - 1].sha256, all[k].sha256) == 0)
            tell(user, &in->list.cases[all[k - 1].i], &in->list.cases[all[k].i]);
    free(all);
    return APSM_OK;
}

/* Whom a line is told. */
typedef struct listener {
    void (*tell)(void *user, const char *line);
    void *user;
} listener;

static void tell_same(void *user, const apsm_input_case *first, const apsm_input_case *again)
{
    const listener *c = user;
    char line[1024];
    snprintf(line, sizeof line, "%s: the same file as %s, byte for byte (%.400s); a shape twice?",
             again->name, first->name, again->path);
    c->tell(c->user, line);
}

/* ---- sizes ---- */

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The lower one of those that are known; 0: fewer than two are. */
static double median(const comparing *c)
{
    size_t n = 0;
    for (size_t i = 0; i < c->in->list.n; i++)
        if (c->value[i] > 0) c->sorted[n++] = c->value[i];
    if (n < 2) return 0;
    qsort(c->sorted, n, sizeof *c->sorted, by_value);
    return c->sorted[(n - 1) / 2];
}

/* A ratio of units that is near, else the ratio itself with two digits. */
static double rounded(double ratio)
{
    static const double known[] = { 10, 25.4, 100, 1000, 10000, 1e6 };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (fabs(log(ratio / known[k])) < log(1.4)) return known[k];
    return ratio;
}

/* Tells the values that are `limit` times the median's or more, and how. */
static void compare_values(const comparing *c, double limit, const char *larger,
                           const char *smaller, const char *remark)
{
    const double middle = median(c);
    for (size_t i = 0; middle > 0 && i < c->in->list.n; i++) {
        char line[512];
        const double ratio = c->value[i] / middle;
        if (!(c->value[i] > 0) || (ratio < limit && ratio > 1 / limit)) continue;
        const double factor = rounded(ratio > 1 ? ratio : 1 / ratio);
        apsm_print(line, sizeof line, "about %.*f times %s than the others%s", factor < 100 ? 1 : 0,
                   factor, ratio > 1 ? larger : smaller, remark);
        c->tell(c->user, c->in->list.cases[i].name, line);
    }
}

/* Where nearly all images have the same slices, one that has others may have a wrong header. */
static void compare_slices(const comparing *c)
{
    const double middle = median(c);
    size_t masks = 0, same = 0;
    for (size_t i = 0; i < c->in->list.n; i++) {
        masks += c->value[i] > 0;
        same += c->value[i] > 0 && fabs(log(c->value[i] / middle)) < log(equal);
    }
    if (masks < LEAST_MASKS || (double)same < same_slices * (double)masks) return;
    for (size_t i = 0; i < c->in->list.n; i++) {
        char line[256];
        if (!(c->value[i] > 0) || fabs(log(c->value[i] / middle)) < log(unequal)) continue;
        apsm_print(line, sizeof line,
                   "its slices are %.3g pixels apart, those of the others %.3g: is the spacing in "
                   "its header right?",
                   c->value[i], middle);
        c->tell(c->user, c->in->list.cases[i].name, line);
    }
}

static void compare_all_sizes(const comparing *c)
{
    for (size_t i = 0; i < c->in->list.n; i++) {
        const bool good = c->in->status[i] == APSM_OK && c->in->mesh[i].nv > 0;
        const double size = good ? cbrt(fabs(apsm_mesh_volume(&c->in->mesh[i]))) : 0;
        c->value[i] = isfinite(size) ? size : 0;
    }
    compare_values(c, other_unit, "larger", "smaller", ": another unit?");
    for (size_t i = 0; i < c->in->list.n; i++) c->value[i] = c->in->voxel[i];
    compare_values(c, other_voxels, "coarser in its voxels", "finer in its voxels", "");
    for (size_t i = 0; i < c->in->list.n; i++) c->value[i] = c->in->slices[i];
    compare_slices(c);
}

apsm_status compare_sizes(const groom_inputs *in, unlike_shape tell, void *user)
{
    comparing c = { .in = in, .tell = tell, .user = user };
    c.value = calloc(2 * in->list.n + 1, sizeof *c.value);
    if (!c.value) return APSM_ERR_MEMORY;
    c.sorted = c.value + in->list.n;
    compare_all_sizes(&c);
    free(c.value);
    return APSM_OK;
}

static void tell_unlike(void *user, const char *shape, const char *text)
{
    const listener *l = user;
    char line[1024];
    snprintf(line, sizeof line, "%s: %s", shape, text);
    l->tell(l->user, line);
}

apsm_status compare_inputs(const groom_inputs *in, void (*tell)(void *user, const char *line),
                           void *user)
{
    listener l = { tell, user };
    APSM_TRY(compare_files(in, tell_same, &l));
    return compare_sizes(in, tell_unlike, &l);
}
