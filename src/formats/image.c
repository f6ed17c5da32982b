#include "formats/image.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/number.h"
#include "formats/inflate.h"
#include "formats/input_file.h"
#include "formats/labels_of.h"

void image_simple(image *m)
{
    m->layers = 1;
    m->stride[0] = 1;
    m->stride[1] = m->n[0];
    m->stride[2] = m->n[0] * m->n[1];
}

void image_note(scan *s, image *m, const char *format, ...)
{
    char text[512];
    va_list args;
    if (!scan_ok(s)) return;
    va_start(args, format);
    apsm_vprint(text, sizeof text, format, args);
    va_end(args);
    s->status = apsm_volume_note(s->ctx, s->path, &m->volume, "%s", text);
}

double unit_in_mm(word name)
{
    static const struct {
        const char *name;
        double mm;
    } known[] = { { "mm", 1 },           { "millimeter", 1 },    { "millimeters", 1 },
                  { "millimetre", 1 },   { "um", 1e-3 },         { "micron", 1e-3 },
                  { "microns", 1e-3 },   { "micrometer", 1e-3 }, { "micrometers", 1e-3 },
                  { "\xc2\xb5m", 1e-3 }, { "\xce\xbcm", 1e-3 },  { "cm", 10 },
                  { "m", 1e3 },          { "meter", 1e3 },       { "meters", 1e3 },
                  { "nm", 1e-6 } };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (word_is_any_case(name, known[k].name)) return known[k].mm;
    return 0.0;
}

/* With the header's name before the line of the last failure. */
static void refuse_data(scan *s)
{
    char line[400];
    snprintf(line, sizeof line, "%s", apsm_error_text(s->ctx));
    scan_refuse(s, APSM_ERR_FORMAT, "its data file %s", line);
}

void image_load_data(scan *s, image *m, const char *name)
{
    char *const folder = apsm_path_folder(s->path);
    char *const path = folder ? apsm_path_join(folder, name) : NULL;
    char shown[WORD_SHOWN];
    if (!path)
        scan_no_memory(s);
    else if (!apsm_file_exists(path))
        scan_refuse(s, APSM_ERR_FORMAT, "its data file '%s' is not there; copy both files",
                    word_show((word){ name, strlen(name) }, shown));
    else if (input_file_read(s->ctx, path, &m->detached, &m->size) != APSM_OK)
        refuse_data(s);
    m->data = (const unsigned char *)m->detached;
    free(folder);
    free(path);
}

void image_load_word(scan *s, image *m, word name)
{
    enum { LONGEST = 1023 };
    char text[LONGEST + 1];
    if (name.length > LONGEST) {
        scan_refuse(s, APSM_ERR_FORMAT, "names a data file of more than %d bytes; rename it",
                    LONGEST);
        return;
    }
    snprintf(text, sizeof text, "%.*s", (int)name.length, name.text);
    image_load_data(s, m, text);
}

/* ---- the grid ---- */

static void check_size(scan *s, const image *m)
{
    const double most = 4e18;
    double voxels = (double)m->layers;
    for (int c = 0; c < 3; c++) {
        if (m->n[c] == 0) scan_refuse(s, APSM_ERR_FORMAT, "has no voxels; export it again");
        voxels *= (double)m->n[c];
    }
    const double bytes = voxels * (double)scalar_size(m->type), held = (double)m->size;
    const double lead = (double)m->lead;
    const bool fits = m->packing == PLAIN    ? lead + bytes <= held
                      : m->packing == PACKED ? lead + bytes <= 1040.0 * held + 64.0
                                             : 2.0 * voxels - 1.0 <= held;
    if (bytes > most || !fits)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "its header promises more voxels than the file holds; it is cut short or "
                    "damaged: copy or export it again");
}

/* Spacing, unit directions; refuses a grid that no segmentation can have. */
static void place_grid(scan *s, image *m)
{
    apsm_volume *const v = &m->volume;
    double *const D = v->direction;
    for (int c = 0; c < 3; c++) {
        const double x = m->step[c], y = m->step[3 + c], z = m->step[6 + c];
        const double length = sqrt(x * x + y * y + z * z);
        if (!(length > 0.0) || !isfinite(length))
            scan_refuse(s, APSM_ERR_FORMAT,
                        "spacing %g along axis %d is not a positive number, or the grid's "
                        "directions are not independent; correct them in the file's header",
                        length, c);
        if (!isfinite(m->origin[c]))
            scan_refuse(s, APSM_ERR_FORMAT,
                        "the origin is not finite; correct it in the file's header");
        for (int r = 0; r < 3; r++) D[3 * r + c] = m->step[3 * r + c] / length;
        v->spacing[c] = length;
        v->origin[c] = m->origin[c];
        v->n[c] = m->n[c];
    }
    const double det = D[0] * (D[4] * D[8] - D[5] * D[7]) - D[1] * (D[3] * D[8] - D[5] * D[6]) +
                       D[2] * (D[3] * D[7] - D[4] * D[6]);
    if (!(fabs(det) > 0.1))
        scan_refuse(s, APSM_ERR_FORMAT,
                    "the grid's directions are not independent; correct them in the file's header");
}

/* Axes that are not at right angles are kept; people should know. */
static void tell_shear(scan *s, image *m)
{
    static const double noticeable = 2e-3; /* cosine: a tenth of a degree */
    const double *const D = m->volume.direction;
    double largest = 0.0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < a; b++)
            largest = fmax(largest, fabs(D[a] * D[b] + D[3 + a] * D[3 + b] + D[6 + a] * D[6 + b]));
    if (largest > noticeable)
        image_note(s, m, "its axes are sheared by %.1f degrees (a tilted gantry?); read as such",
                   asin(fmin(largest, 1.0)) * 57.29578);
}

apsm_status image_place(apsm_context *ctx, const char *path, image *m)
{
    scan s = { .ctx = ctx, .path = path };
    place_grid(&s, m);
    if (scan_ok(&s)) tell_shear(&s, m);
    return s.status;
}

/* ---- values ---- */

static void unpack(scan *s, image *m, size_t wanted, unsigned char **out)
{
    switch (inflate_bytes(m->data, m->size, m->lead + wanted, out)) {
    case INFLATED:
        m->data = *out + m->lead;
        break;
    case INFLATE_SHORT:
        scan_refuse(s, APSM_ERR_FORMAT, "ends before its last voxel; copy or export it again");
        break;
    case INFLATE_DAMAGED:
        scan_refuse(s, APSM_ERR_FORMAT,
                    "its compressed data are cut short or wrong; copy or export it again");
        break;
    default:
        scan_no_memory(s);
    }
}

/* Numbers in text become doubles in this machine's order. */
static void parse(scan *s, image *m, size_t values, unsigned char **out)
{
    static const union {
        uint16_t word;
        unsigned char low;
    } order = { 1 };
    scan text = scan_begin(s->ctx, s->path, (const char *)m->data, m->size);
    double *const x = malloc(values * sizeof *x);
    *out = (unsigned char *)x;
    if (!x) scan_no_memory(s);
    for (size_t k = 0; k < values && x && scan_ok(&text); k++) {
        if (!scan_skip_blanks(&text, true))
            scan_refuse(&text, APSM_ERR_FORMAT,
                        "ends before its last voxel; copy or export it again");
        x[k] = scan_number(&text, "a voxel's value");
    }
    if (scan_ok(s)) s->status = text.status;
    m->data = *out;
    m->size = values * sizeof *x;
    m->type = SCALAR_F64;
    m->big_endian = order.low == 0;
}

apsm_status image_finish(scan *s, image *m, apsm_volume *volume)
{
    unsigned char *owned = NULL;
    *volume = (apsm_volume){ 0 };
    if (scan_ok(s)) check_size(s, m);
    if (scan_ok(s)) s->status = image_place(s->ctx, s->path, m);
    const size_t values = m->layers * m->n[0] * m->n[1] * m->n[2];
    const size_t wanted = values * scalar_size(m->type);
    if (scan_ok(s) && m->packing == PACKED) unpack(s, m, wanted, &owned);
    if (scan_ok(s) && m->packing == WRITTEN) parse(s, m, values, &owned);
    if (scan_ok(s) && m->packing == PLAIN) m->data += m->lead; /* checked to be there */
    if (scan_ok(s)) s->status = labels_of(s->ctx, s->path, m, &m->volume);
    free(owned);
    free(m->detached);
    if (scan_ok(s)) {
        *volume = m->volume;
        return APSM_OK;
    }
    apsm_volume_free(&m->volume);
    return s->status;
}

/* ---- formats ---- */

typedef void (*reader)(scan *, image *);

static reader reader_of(const char *path, bool *binary)
{
    static const struct {
        const char *extension;
        reader read;
        bool binary;
    } known[] = { { ".nrrd", read_nrrd, false },     { ".nhdr", read_nrrd, false },
                  { ".mha", read_metaimage, false }, { ".mhd", read_metaimage, false },
                  { ".nii", read_nifti, true },      { ".nii.gz", read_nifti, true },
                  { ".hdr", read_nifti, true },      { ".tif", read_tiff, true },
                  { ".tiff", read_tiff, true },      { ".mgh", read_mgh, true },
                  { ".mgz", read_mgh, true },        { ".mgh.gz", read_mgh, true },
                  { ".vtk", read_vtk_image, false } };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (path_ends_in(path, known[k].extension)) {
            *binary = known[k].binary;
            return known[k].read;
        }
    return NULL;
}

bool volume_is_known(const char *path)
{
    bool binary;
    return reader_of(path, &binary) != NULL;
}

static apsm_status refuse_extension(apsm_context *ctx, const char *path)
{
    return apsm_fail(
        ctx, APSM_ERR_UNSUPPORTED,
        "%s: not an image format known here; use .nrrd, .nii, .nii.gz, .mha, .mgz or .tif", path);
}

static apsm_status from_bytes(apsm_context *ctx, const char *path, const char *bytes, size_t size,
                              bool foreground, apsm_volume *volume)
{
    bool binary = true;
    const reader read = reader_of(path, &binary);
    image m = { .layers = 1, .slope = 1.0, .foreground = foreground };
    scan s = binary
                 ? (scan){ .ctx = ctx, .path = path, .bytes = bytes, .size = size, .binary = true }
                 : scan_begin(ctx, path, bytes, size);
    *volume = (apsm_volume){ 0 };
    if (!read) return refuse_extension(ctx, path);
    read(&s, &m);
    return image_finish(&s, &m, volume);
}

apsm_status volume_from_bytes(apsm_context *ctx, const char *path, const char *bytes, size_t size,
                              apsm_volume *volume)
{
    return from_bytes(ctx, path, bytes, size, false, volume);
}

static apsm_status read_volume(apsm_context *ctx, const char *path, bool foreground,
                               apsm_volume *volume)
{
    char *bytes;
    size_t size;
    *volume = (apsm_volume){ 0 };
    if (!volume_is_known(path)) return refuse_extension(ctx, path);
    APSM_TRY(input_file_read(ctx, path, &bytes, &size));
    const apsm_status status = from_bytes(ctx, path, bytes, size, foreground, volume);
    free(bytes);
    return status;
}

apsm_status apsm_read_volume(apsm_context *ctx, const char *path, apsm_volume *volume)
{
    return read_volume(ctx, path, false, volume);
}

apsm_status volume_read_foreground(apsm_context *ctx, const char *path, apsm_volume *volume)
{
    return read_volume(ctx, path, true, volume);
}
