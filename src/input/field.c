/* An image that is a function, a distance or a probability, to the surface at one of its values. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/isosurface.h"
#include "input/input.h"

/* What the values look like. */
typedef struct survey {
    double least, largest;
    double steep; /* share of neighbours that differ by more than they are apart */
    size_t border, below, border_below; /* voxels of the border; negative ones, of all and there */
} survey;

static const double tolerance = 1.02, most_steep = 1e-2; /* of the distance; of neighbours */

static survey look_at(const apsm_volume *v)
{
    survey s = { .least = INFINITY, .largest = -INFINITY };
    size_t steep = 0, pairs = 0, i = 0, x[3];
    for (x[2] = 0; x[2] < v->n[2]; x[2]++)
        for (x[1] = 0; x[1] < v->n[1]; x[1]++)
            for (x[0] = 0; x[0] < v->n[0]; x[0]++, i++) {
                const double value = (double)v->value[i];
                bool border = false;
                size_t stride = 1;
                for (int c = 0; c < 3; stride *= v->n[c++]) {
                    border = border || x[c] == 0 || x[c] + 1 == v->n[c];
                    if (x[c] + 1 == v->n[c]) continue;
                    const double step = fabs((double)v->value[i + stride] - value);
                    steep += step > tolerance * v->spacing[c];
                    pairs++;
                }
                s.least = fmin(s.least, value);
                s.largest = fmax(s.largest, value);
                s.below += value < 0.0;
                s.border += border;
                s.border_below += border && value < 0.0;
            }
    s.steep = pairs ? (double)steep / (double)pairs : 0.0;
    return s;
}

/* The side of 0 that most of the border is on is outside. */
static apsm_status find_side(apsm_context *ctx, const char *path, apsm_volume *v, char *side)
{
    const survey s = look_at(v);
    if (s.least >= 0.0 && s.largest <= 1.0)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: its values lie between 0 and 1 and are not whole: a probability? "
                         "choose where the shape begins, --label '>0.5'",
                         path);
    if (s.least >= 0.0 || s.largest <= 0.0 || s.steep > most_steep)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: its values (%g to %g) are neither labels nor distances; give a "
                         "segmentation, or a bound such as --label '>0'",
                         path, s.least, s.largest);
    const double outside = (double)s.border_below / (double)s.border;
    if (outside > 0.4 && outside < 0.6)
        return apsm_fail(
            ctx, APSM_ERR_FORMAT,
            "%s: a distance transform whose inside cannot be told; choose with --label "
            "'<0' or '>0'",
            path);
    *side = outside > 0.5 ? '>' : '<';
    return apsm_volume_note(ctx, path, v, "is a distance transform; taken to be %s inside",
                            *side == '>' ? "positive" : "negative");
}

/* The values less the level, negative inside, with one more node all round, which closes the
 * surface half a voxel outside the border. */
static float *padded(const apsm_volume *v, char side, double level, const size_t n[3])
{
    float *const out = malloc(n[0] * n[1] * n[2] * sizeof *out);
    size_t i = 0;
    for (size_t z = 0; out && z < n[2]; z++)
        for (size_t y = 0; y < n[1]; y++)
            for (size_t x = 0; x < n[0]; x++, i++) {
                const size_t at[3] = { x, y, z };
                size_t from = 0, stride = 1;
                bool rim = false;
                for (int c = 0; c < 3; stride *= v->n[c++]) {
                    const size_t last = v->n[c] - 1, inner = at[c] ? at[c] - 1 : 0;
                    rim = rim || at[c] == 0 || inner > last;
                    from += stride * (inner > last ? last : inner);
                }
                const double d = ((double)v->value[from] - level) * (side == '<' ? 1.0 : -1.0);
                out[i] = (float)(rim ? fabs(d) : d);
            }
    return out;
}

static void to_lps(const apsm_volume *v, apsm_mesh *mesh)
{
    double M[16];
    apsm_volume_index_to_lps(v, M);
    for (int r = 0; r < 3; r++) /* the first node is one before the first voxel */
        M[4 * r + 3] -= M[4 * r] + M[4 * r + 1] + M[4 * r + 2];
    apsm_mesh_transform(mesh, M);
}

apsm_status apsm_field_surface(apsm_context *ctx, const char *path, const apsm_labels *labels,
                               apsm_volume *volume, apsm_mesh *mesh)
{
    char side = labels->side;
    const double level = side ? labels->level : 0.0;
    const size_t n[3] = { volume->n[0] + 2, volume->n[1] + 2, volume->n[2] + 2 };
    *mesh = (apsm_mesh){ 0 };
    if (!side) APSM_TRY(find_side(ctx, path, volume, &side));
    float *const values = padded(volume, side, level, n);
    if (!values) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    const apsm_status status = apsm_isosurface(ctx, n, values, 0.0, mesh);
    free(values);
    if (status == APSM_OK) to_lps(volume, mesh);
    if (status != APSM_ERR_GEOMETRY) return status;
    return apsm_fail(ctx, status, "%s: no value is %s %g; choose another bound with --label", path,
                     side == '<' ? "below" : "above", level);
}
