/* The slices of a folder with one DICOM series, or the frames of its one file, as a volume: sorted
 * by their positions along the normal of the stack, whatever the files are called.
 *
 * The grid goes straight from the first slice to the last, so that a tilted gantry comes out as the
 * shear that it is.  Each slice has to lie within a tenth of the gap from its place on that line:
 * the size of a deviation counts, not its presence, as positions are written in decimals. */
#include <math.h>
#include <stdlib.h>

#include "apsm/formats.h"
#include "formats/dicom_stack.h"
#include "formats/input_file.h"

static const double largest_deviation = 0.1; /* of the gap between slices */
/* Of products of directions that are written with three decimals: 2 sqrt(3) half units. */
static const double plane_rounding = 2e-3;
static const double coarse_rounding = 2e-2; /* with two decimals */

/* ---- slices ---- */

void dicom_stack_free(dicom_stack *k)
{
    apsm_file_list_free(&k->files);
    dicom_free(&k->shared);
    free(k->slice);
}

static apsm_status add_slices(apsm_context *ctx, dicom_stack *k, size_t file, const char *path,
                              const dicom *d)
{
    const size_t more = (size_t)d->frames;
    dicom_slice *const larger = realloc(k->slice, (k->n + more) * sizeof *larger);
    if (!larger) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    k->slice = larger;
    for (size_t f = 0; f < more; f++) {
        const dicom_frame *const frame = f < d->frame_room ? &d->frame[f] : NULL;
        if (!frame || !frame->has_position)
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s: frame %zu has no position (0020,0032), so that slices cannot be "
                             "put in order; convert the series to NRRD or NIfTI",
                             path, f + 1);
        dicom_slice *const slice = &k->slice[k->n++];
        *slice = (dicom_slice){ .file = file, .frame = f, .segment = frame->segment };
        memcpy(slice->position, frame->position, sizeof slice->position);
    }
    return APSM_OK;
}

static bool same_grid(const dicom *a, const dicom *b)
{
    bool same = a->rows == b->rows && a->columns == b->columns;
    for (int c = 0; c < 6; c++) same = same && fabs(a->orientation[c] - b->orientation[c]) <= 1e-3;
    for (int c = 0; c < 2; c++)
        same = same && fabs(a->between[c] - b->between[c]) <= 1e-3 * fabs(a->between[c]);
    return same;
}

static void normal_of(const double o[6], double n[3])
{
    for (int c = 0; c < 3; c++) {
        const int u = (c + 1) % 3, v = (c + 2) % 3;
        n[c] = o[u] * o[3 + v] - o[v] * o[3 + u];
    }
}

/* Directions of rows and columns, but for their rounding. */
static bool is_plane(const double o[6], double rounding)
{
    double product[3] = { 0 }; /* rows, columns, and rows with columns */
    for (int c = 0; c < 3; c++) {
        product[0] += o[c] * o[c];
        product[1] += o[3 + c] * o[3 + c];
        product[2] += o[c] * o[3 + c];
    }
    return fabs(product[0] - 1.0) <= rounding && fabs(product[1] - 1.0) <= rounding &&
           fabs(product[2]) <= rounding;
}

/* What two decimals, and no more, leave of such directions. */
static bool is_coarse_plane(const double o[6])
{
    for (int c = 0; c < 6; c++)
        if (fabs(100.0 * o[c] - round(100.0 * o[c])) > 1e-9) return false;
    return is_plane(o, coarse_rounding);
}

static void bisect(const double u[3], double sign, const double v[3], double half[3])
{
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        half[c] = u[c] + sign * v[c];
        square += half[c] * half[c];
    }
    for (int c = 0; c < 3; c++) half[c] /= sqrt(2.0 * square);
}

/* o <- two directions of length 1 at right angles, as far from the row's as from the column's. */
static void straighten(double o[6])
{
    double length[2] = { 0 }, unit[6], between[3], across[3];
    for (int c = 0; c < 6; c++) length[c / 3] += o[c] * o[c];
    for (int c = 0; c < 6; c++) unit[c] = o[c] / sqrt(length[c / 3]);
    bisect(unit, 1.0, unit + 3, between);
    bisect(unit, -1.0, unit + 3, across);
    for (int c = 0; c < 3; c++) {
        o[c] = between[c] + across[c];
        o[3 + c] = between[c] - across[c];
    }
}

/* Of rows and columns with two decimals: their plane becomes that at right angles to the step
 * between slices, whose positions have more of them, where the two differ by no more than the
 * rounding.  More is a tilted gantry. */
static void level(double o[6], const double step[3])
{
    double along[2] = { 0 }, square = 0.0;
    for (int c = 0; c < 3; c++) square += step[c] * step[c];
    for (int c = 0; c < 6; c++) along[c / 3] += o[c] * step[c % 3] / sqrt(square);
    if (!(fmax(fabs(along[0]), fabs(along[1])) <= 0.5 * coarse_rounding)) return;
    for (int c = 0; c < 6; c++) o[c] -= along[c / 3] * step[c % 3] / sqrt(square);
    straighten(o);
}

static apsm_status check_image(apsm_context *ctx, const char *path, const dicom *d)
{
    if (d->rows < 1 || d->columns < 1 || d->rows > 65535 || d->columns > 65535)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: has %lld x %lld pixels; export it again", path,
                         (long long)d->columns, (long long)d->rows);
    const double bits = (double)d->rows * (double)d->columns * (double)d->frames *
                        (double)(d->allocated > 0 ? d->allocated : 1);
    if (bits > (d->rle ? 64.0 : 1.0) * 8.0 * (double)d->pixel_size)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: its pixels are cut short or damaged; copy or export it again", path);
    if (d->samples != 1)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: has colours, %lld components per pixel; give labels", path,
                         (long long)d->samples);
    if (!d->has_orientation || !d->has_between)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: has no %s, so that its place is not known; convert the series to "
                         "NRRD or NIfTI",
                         path,
                         d->has_orientation ? "PixelSpacing (0028,0030)"
                                            : "ImageOrientationPatient (0020,0037)");
    if (!is_plane(d->orientation, plane_rounding) && !is_coarse_plane(d->orientation))
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: its ImageOrientationPatient (0020,0037) is not two directions at "
                         "right angles, of length 1; convert the series to NRRD or NIfTI",
                         path);
    return APSM_OK;
}

/* The first image of the folder is what others are compared with. */
static apsm_status add_image(apsm_context *ctx, dicom_stack *k, size_t file, const char *path,
                             dicom *d)
{
    APSM_TRY(check_image(ctx, path, d));
    if (k->images == 0) {
        k->images = 1;
        APSM_TRY(add_slices(ctx, k, file, path, d));
        k->shared = *d;
        *d = (dicom){ 0 };
        return APSM_OK;
    }
    if (strcmp(k->shared.series, d->series) != 0)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: holds 2 DICOM series or more; put each into a folder of its own",
                         k->folder);
    if (!same_grid(&k->shared, d))
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: has another orientation, size or spacing than the slices before it; "
                         "give one stack of slices",
                         path);
    k->images++;
    return add_slices(ctx, k, file, path, d);
}

/* Files that are not DICOM, and DICOM files without pixels, are passed over. */
static apsm_status look_at_file(apsm_context *ctx, dicom_stack *k, size_t file)
{
    const char *const path = k->files.path[file];
    char *bytes;
    size_t size;
    dicom d;
    if (!apsm_file_exists(path)) return APSM_OK;
    APSM_TRY(apsm_read_file(ctx, path, SIZE_MAX / 2, &bytes, &size));
    apsm_status status = APSM_OK;
    if (is_dicom((const unsigned char *)bytes, size)) {
        scan s = { .ctx = ctx, .path = path, .bytes = bytes, .size = size };
        dicom_parse(&s, &d);
        status = s.status;
        if (status == APSM_OK && d.pixels) status = add_image(ctx, k, file, path, &d);
        dicom_free(&d);
    }
    k->shared.pixels = NULL; /* they go with the file's bytes */
    free(k->shared.inflated);
    k->shared.inflated = NULL;
    free(bytes);
    return status;
}

/* The files of the folder, or the one that was given. */
static apsm_status list_files(apsm_context *ctx, dicom_stack *k)
{
    if (!apsm_is_folder(k->folder)) {
        k->files.path = calloc(1, sizeof *k->files.path);
        if (k->files.path) k->files.path[0] = strdup(k->folder);
        if (!k->files.path || !k->files.path[0])
            return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", k->folder);
        k->files.n = 1;
        return APSM_OK;
    }
    APSM_TRY(apsm_list_files(ctx, k->folder, false, &k->files));
    for (size_t f = 0; f < k->files.n; f++) {
        char *const path = apsm_path_join(k->folder, k->files.path[f]);
        if (!path) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", k->folder);
        free(k->files.path[f]);
        k->files.path[f] = path;
    }
    return APSM_OK;
}

static apsm_status find_slices(apsm_context *ctx, dicom_stack *k)
{
    APSM_TRY(list_files(ctx, k));
    for (size_t f = 0; f < k->files.n; f++) APSM_TRY(look_at_file(ctx, k, f));
    if (k->images == 0)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: holds no DICOM image; give a folder with one series", k->folder);
    return APSM_OK;
}

/* ---- order ---- */

static int by_height(const void *a, const void *b)
{
    const dicom_slice *const x = a, *const y = b;
    if (x->height < y->height || x->height > y->height) return x->height < y->height ? -1 : 1;
    return x->file != y->file ? (x->file < y->file ? -1 : 1)
                              : (x->frame > y->frame) - (x->frame < y->frame);
}

static void sort_slices(dicom_stack *k)
{
    double normal[3];
    normal_of(k->shared.orientation, normal);
    for (size_t i = 0; i < k->n; i++) {
        k->slice[i].height = 0.0;
        for (int c = 0; c < 3; c++) k->slice[i].height += normal[c] * k->slice[i].position[c];
    }
    qsort(k->slice, k->n, sizeof *k->slice, by_height);
}

const char *dicom_slice_name(const dicom_stack *k, size_t i)
{
    return apsm_path_last(k->files.path[k->slice[i].file]);
}

/* Which two slices do not follow each other as the others do. */
static apsm_status refuse_gap(apsm_context *ctx, const dicom_stack *k, double usual)
{
    size_t worst = 1;
    double most = -1.0;
    for (size_t i = 1; i < k->n; i++) {
        const double off = fabs(k->slice[i].height - k->slice[i - 1].height - usual);
        if (off > most) most = off, worst = i;
    }
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: its slices are not evenly spaced: %.6g mm between %s and %s, elsewhere "
                     "%.6g; is one missing?",
                     k->folder, k->slice[worst].height - k->slice[worst - 1].height,
                     dicom_slice_name(k, worst - 1), dicom_slice_name(k, worst), usual);
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The median gap; 0 if out of memory or there is none. */
static double usual_gap(const dicom_stack *k)
{
    double *const gap = malloc(k->n * sizeof *gap);
    double median = 0.0;
    for (size_t i = 1; gap && i < k->n; i++)
        gap[i - 1] = k->slice[i].height - k->slice[i - 1].height;
    if (gap && k->n > 1) {
        qsort(gap, k->n - 1, sizeof *gap, by_size);
        median = gap[(k->n - 1) / 2];
    }
    free(gap);
    return median;
}

bool dicom_on_line(const double first[3], const double step[3], double i, double gap,
                   const double position[3])
{
    double off = 0.0;
    for (int c = 0; c < 3; c++) {
        const double d = position[c] - first[c] - i * step[c];
        off += d * d;
    }
    return sqrt(off) <= largest_deviation * gap;
}

static apsm_status check_stack(apsm_context *ctx, const dicom_stack *k, double step[3])
{
    const double usual = usual_gap(k);
    const double *const first = k->slice[0].position, *const last = k->slice[k->n - 1].position;
    for (size_t i = 1; i < k->n; i++)
        if (!(k->slice[i].height - k->slice[i - 1].height > 1e-3 * usual))
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s: %s and %s lie at the same place; give one stack of slices",
                             k->folder, dicom_slice_name(k, i - 1), dicom_slice_name(k, i));
    for (int c = 0; c < 3; c++) step[c] = (last[c] - first[c]) / (double)(k->n - 1);
    for (size_t i = 1; i < k->n; i++)
        if (!dicom_on_line(first, step, (double)i, usual, k->slice[i].position))
            return refuse_gap(ctx, k, usual);
    return APSM_OK;
}

/* ---- the volume ---- */

void dicom_grid(apsm_context *ctx, const dicom_stack *k, const double step[3], image *m)
{
    const dicom *const d = &k->shared;
    double o[6];
    memcpy(o, d->orientation, sizeof o);
    if (!is_plane(o, plane_rounding)) {
        scan s = { .ctx = ctx, .path = k->folder };
        straighten(o);
        level(o, step);
        image_note(&s, m,
                   "its ImageOrientationPatient (0020,0037) has two decimals; brought to right "
                   "angles and length 1, it may be off by half a degree");
    }
    m->n[0] = (size_t)d->columns;
    m->n[1] = (size_t)d->rows;
    for (int r = 0; r < 3; r++) {
        m->step[3 * r] = o[r] * d->between[1];
        m->step[3 * r + 1] = o[3 + r] * d->between[0];
        m->step[3 * r + 2] = step[r];
        m->origin[r] = k->slice[0].position[r];
    }
}

apsm_status dicom_read_slices(apsm_context *ctx, const dicom_stack *k, dicom_slice_fn fn,
                              void *user)
{
    for (size_t i = 0; i < k->n;) {
        const size_t file = k->slice[i].file;
        const char *const path = k->files.path[file];
        char *bytes;
        size_t size;
        dicom d;
        APSM_TRY(apsm_read_file(ctx, path, SIZE_MAX / 2, &bytes, &size));
        scan s = { .ctx = ctx, .path = path, .bytes = bytes, .size = size };
        if (is_dicom((const unsigned char *)bytes, size))
            dicom_parse(&s, &d);
        else
            scan_refuse(&s, APSM_ERR_IO, "has changed while it was read"), d = (dicom){ 0 };
        if (scan_ok(&s) && !same_grid(&k->shared, &d))
            scan_refuse(&s, APSM_ERR_IO, "has changed while it was read");
        for (; i < k->n && k->slice[i].file == file && scan_ok(&s); i++) fn(&s, &d, k, i, user);
        dicom_free(&d);
        free(bytes);
        if (!scan_ok(&s)) return s.status;
    }
    return APSM_OK;
}

static void read_slice(scan *s, const dicom *d, const dicom_stack *k, size_t i, void *user)
{
    int32_t *const label = user;
    dicom_frame_labels(s, d, k->slice[i].frame,
                       label + i * (size_t)k->shared.rows * (size_t)k->shared.columns);
}

static apsm_status read_images(apsm_context *ctx, dicom_stack *k, image *m)
{
    double step[3];
    if (k->n < 2)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: holds a single slice; give the folder of the whole stack", k->folder);
    APSM_TRY(check_stack(ctx, k, step));
    dicom_grid(ctx, k, step, m);
    m->n[2] = k->n;
    APSM_TRY(image_place(ctx, k->folder, m));
    m->volume.layers = 1;
    m->volume.label = malloc(m->n[0] * m->n[1] * m->n[2] * sizeof *m->volume.label);
    if (!m->volume.label) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", k->folder);
    return dicom_read_slices(ctx, k, read_slice, m->volume.label);
}

apsm_status apsm_read_dicom(apsm_context *ctx, const char *folder, apsm_volume *volume)
{
    dicom_stack k = { .folder = folder };
    image m = { .layers = 1 };
    *volume = (apsm_volume){ 0 };
    apsm_status status = find_slices(ctx, &k);
    if (status == APSM_OK) {
        sort_slices(&k);
        status = k.shared.kind[0] ? dicom_read_segments(ctx, &k, &m) : read_images(ctx, &k, &m);
    }
    if (status == APSM_OK)
        *volume = m.volume;
    else
        apsm_volume_free(&m.volume);
    dicom_stack_free(&k);
    return status;
}
