/* DICOM SEG: the frames of each segment, those without voxels left out.  Segments that overlap go
 * to different layers.  A fractional one is a function between 0 and 1, of one segment. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "formats/dicom_stack.h"

enum { MOST_LAYERS = 16, MOST_ABSENT = 64 }; /* absent: empty slices for each frame that is there */

/* The gap: as given, or the least between frames; *slices <- how many. */
static apsm_status find_gap(apsm_context *ctx, const dicom_stack *k, double *gap, size_t *slices)
{
    const double span = k->slice[k->n - 1].height - k->slice[0].height;
    double least = INFINITY;
    for (size_t i = 1; i < k->n; i++) {
        const double d = k->slice[i].height - k->slice[i - 1].height;
        if (d > 1e-4 * span && d < least) least = d;
    }
    *gap = k->shared.gap > 0.0 ? k->shared.gap : least;
    if (!isfinite(*gap))
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: holds a single slice; give the folder of the whole stack", k->folder);
    const double n = floor(span / *gap + 0.5) + 1.0;
    if (n > MOST_ABSENT * (double)k->n || n < 2.0)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: its frames are %.6g mm apart, which does not fit the %.6g mm between "
                         "slices of its header; export it again",
                         k->folder, least, *gap);
    *slices = (size_t)n;
    return APSM_OK;
}

/* Which slice of the volume each frame is: in frame order, place[i]. */
static apsm_status find_places(apsm_context *ctx, const dicom_stack *k, size_t slices, double gap,
                               const double step[3], size_t *place)
{
    for (size_t i = 0; i < k->n; i++) {
        const double at = floor((k->slice[i].height - k->slice[0].height) / gap + 0.5);
        if (at >= (double)slices ||
            !dicom_on_line(k->slice[0].position, step, at, gap, k->slice[i].position))
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s: frame %zu does not lie on the grid of the others (%.6g mm "
                             "between slices); export it again",
                             k->folder, k->slice[i].frame + 1, gap);
        place[i] = (size_t)at;
    }
    return APSM_OK;
}

typedef struct painting {
    apsm_volume *volume;
    const size_t *place;
    int32_t *frame; /* scratch: one frame */
    size_t *layer;  /* of each segment */
} painting;

static size_t segment_index(const dicom *d, int64_t number)
{
    size_t k = 0;
    while (k < d->segments && d->segment[k].number != number) k++;
    return k;
}

static bool add_layer(apsm_volume *v, size_t voxels)
{
    if (v->layers == MOST_LAYERS) return false;
    int32_t *const larger = realloc(v->label, (v->layers + 1) * voxels * sizeof *larger);
    if (!larger) return false;
    memset(larger + v->layers * voxels, 0, voxels * sizeof *larger);
    v->label = larger;
    v->layers++;
    return true;
}

/* Takes the segment's voxels painted so far to another layer, where they are alone. */
static bool move_up(painting *p, size_t voxels, size_t from, int32_t label)
{
    apsm_volume *const v = p->volume;
    if (!add_layer(v, voxels)) return false;
    int32_t *const old = v->label + from * voxels, *const new = v->label + (v->layers - 1) * voxels;
    for (size_t i = 0; i < voxels; i++)
        if (old[i] == label) {
            new[i] = label;
            old[i] = 0;
        }
    return true;
}

/* A frame of 0 and 1, or of labels (LABELMAP). */
static void paint(scan *s, const dicom *d, const dicom_stack *k, size_t i, void *user)
{
    painting *const p = user;
    const size_t pixels = (size_t)d->rows * (size_t)d->columns;
    const size_t voxels = pixels * p->volume->n[2];
    const int32_t number = (int32_t)k->slice[i].segment;
    const size_t g = segment_index(&k->shared, number);
    dicom_frame_labels(s, d, k->slice[i].frame, p->frame);
    size_t layer = number ? p->layer[g] : 0;
    int32_t *out = p->volume->label + layer * voxels + p->place[i] * pixels;
    bool overlaps = false;
    for (size_t x = 0; x < pixels && number; x++)
        overlaps = overlaps || (p->frame[x] && out[x] && out[x] != number);
    if (overlaps && scan_ok(s)) {
        if (!move_up(p, voxels, layer, number))
            scan_refuse(s, APSM_ERR_UNSUPPORTED,
                        "its segments overlap in more than %d layers, or memory is short; export "
                        "them one by one",
                        MOST_LAYERS);
        else
            layer = p->layer[g] = p->volume->layers - 1;
        out = p->volume->label + layer * voxels + p->place[i] * pixels;
    }
    for (size_t x = 0; x < pixels && scan_ok(s); x++)
        if (p->frame[x]) out[x] = number ? number : p->frame[x];
}

static bool is_fractional(const dicom *d)
{
    return strcmp(d->kind, "FRACTIONAL") == 0;
}

static void paint_fraction(scan *s, const dicom *d, const dicom_stack *k, size_t i, void *user)
{
    painting *const p = user;
    const size_t pixels = (size_t)d->rows * (size_t)d->columns;
    float *const out = p->volume->value + p->place[i] * pixels;
    dicom_frame_labels(s, d, k->slice[i].frame, p->frame);
    for (size_t x = 0; x < pixels && scan_ok(s); x++)
        out[x] = (float)((double)p->frame[x] / (double)d->most);
}

static apsm_status name_segments(apsm_context *ctx, const dicom_stack *k, const size_t *layer,
                                 apsm_volume *v)
{
    const dicom *const d = &k->shared;
    v->segment = calloc(d->segments + 1, sizeof *v->segment);
    bool good = v->segment != NULL;
    for (size_t g = 0; good && g < d->segments; g++) {
        v->segment[g] = (apsm_segment){ .name = strdup(d->segment[g].label),
                                        .label = (int32_t)d->segment[g].number,
                                        .layer = layer[g] };
        v->segments++;
        good = v->segment[g].name != NULL;
    }
    return good ? APSM_OK : apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", k->folder);
}

static apsm_status check_kind(apsm_context *ctx, const dicom_stack *k)
{
    const dicom *const d = &k->shared;
    if (k->images > 1)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: holds several DICOM segmentations; put each into a folder of its own",
                         k->folder);
    if (is_fractional(d) && (d->segments != 1 || d->most < 1))
        return apsm_fail(
            ctx, APSM_ERR_UNSUPPORTED,
            "%s: is a fractional segmentation of %zu segments; export them one by one, "
            "or as BINARY",
            k->folder, d->segments);
    if (strcmp(d->kind, "BINARY") != 0 && strcmp(d->kind, "LABELMAP") != 0 && !is_fractional(d))
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "%s: is a %s segmentation, which is not read here; export it as BINARY or "
                         "LABELMAP",
                         k->folder, d->kind);
    for (size_t i = 0; i < k->n && strcmp(d->kind, "BINARY") == 0; i++)
        if (segment_index(d, k->slice[i].segment) == d->segments || k->slice[i].segment <= 0)
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s: frame %zu is of segment %lld, which the file does not describe; "
                             "export it again",
                             k->folder, k->slice[i].frame + 1, (long long)k->slice[i].segment);
    return APSM_OK;
}

static apsm_status fill(apsm_context *ctx, const dicom_stack *k, image *m, painting *p)
{
    const size_t pixels = m->n[0] * m->n[1];
    const bool fractional = is_fractional(&k->shared);
    p->frame = malloc(pixels * sizeof *p->frame);
    p->layer = calloc(k->shared.segments + 1, sizeof *p->layer);
    if (fractional) p->volume->value = calloc(pixels * m->n[2], sizeof *p->volume->value);
    if (!p->frame || !p->layer ||
        !(fractional ? p->volume->value != NULL : add_layer(p->volume, pixels * m->n[2])))
        return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", k->folder);
    APSM_TRY(dicom_read_slices(ctx, k, fractional ? paint_fraction : paint, p));
    return name_segments(ctx, k, p->layer, p->volume);
}

apsm_status dicom_read_segments(apsm_context *ctx, dicom_stack *k, image *m)
{
    double gap, step[3];
    APSM_TRY(check_kind(ctx, k));
    APSM_TRY(find_gap(ctx, k, &gap, &m->n[2]));
    const double *const first = k->slice[0].position, *const last = k->slice[k->n - 1].position;
    for (int c = 0; c < 3; c++) step[c] = (last[c] - first[c]) / (double)(m->n[2] - 1);
    size_t *const place = malloc(k->n * sizeof *place);
    if (!place) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", k->folder);
    painting p = { .volume = &m->volume, .place = place };
    apsm_status status = find_places(ctx, k, m->n[2], gap, step, place);
    dicom_grid(ctx, k, step, m);
    if (status == APSM_OK) status = image_place(ctx, k->folder, m);
    if (status == APSM_OK) status = fill(ctx, k, m, &p);
    free(p.frame);
    free(p.layer);
    free(place);
    return status;
}
