/* FreeSurfer's images: .mgh, and .mgz, which is the same in gzip.  The highest byte comes first;
 * the header has the directions of the axes and the place of the volume's centre, in the scanner's
 * right, anterior, superior. */
#include <math.h>

#include "formats/image.h"
#include "formats/inflate.h"

enum { HEAD = 284, VERSION = 1, USED = 90 /* bytes of the header */ };

static int64_t whole_at(const unsigned char *head, size_t at)
{
    return scalar_integer(SCALAR_I32, head + at, true);
}

static double real_at(const unsigned char *head, size_t at)
{
    return scalar_real(SCALAR_F32, head + at, true);
}

static void read_sizes(scan *s, const unsigned char *head, image *m)
{
    for (size_t c = 0; c < 3; c++) {
        const int64_t n = whole_at(head, 4 + 4 * c);
        if (n < 1)
            scan_refuse(s, APSM_ERR_FORMAT, "has %lld voxels along an axis; export it again",
                        (long long)n);
        m->n[c] = n < 1 ? 1 : (size_t)n;
    }
    if (whole_at(head, 16) != 1)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "is not 3-D but has %lld frames; extract one (`mri_convert -nth 0 IN OUT`)",
                    (long long)whole_at(head, 16));
    image_simple(m);
}

static void read_type(scan *s, const unsigned char *head, image *m)
{
    switch (whole_at(head, 20)) {
    case 0:
        m->type = SCALAR_U8;
        break;
    case 1:
        m->type = SCALAR_I32;
        break;
    case 3:
        m->type = SCALAR_F32;
        break;
    case 4:
        m->type = SCALAR_I16;
        break;
    case 10:
        m->type = SCALAR_U16;
        break;
    default:
        scan_refuse(s, APSM_ERR_FORMAT,
                    "voxels are of type %lld of FreeSurfer; save them as "
                    "integers (`mri_convert -odt int IN OUT`)",
                    (long long)whole_at(head, 20));
    }
    m->big_endian = true;
}

/* step <- column c: direction of axis c times its spacing, in RAS; centre <- c_ras.  Without a
 * place in the header, slices are coronal, as FreeSurfer has it. */
static void read_grid(scan *s, const unsigned char *head, image *m, double step[9],
                      double centre[3])
{
    static const double coronal[9] = { -1, 0, 0, 0, 0, 1, 0, -1, 0 };
    const bool placed = scalar_integer(SCALAR_I16, head + 28, true) > 0;
    for (size_t c = 0; c < 3; c++) {
        const double spacing = placed ? real_at(head, 30 + 4 * c) : 1.0;
        if (!(spacing > 0.0) || !isfinite(spacing))
            scan_refuse(s, APSM_ERR_FORMAT,
                        "spacing %g along axis %zu is not a positive number; correct it in the "
                        "file's header",
                        spacing, c);
        for (size_t r = 0; r < 3; r++)
            step[3 * r + c] =
                spacing * (placed ? real_at(head, 42 + 12 * c + 4 * r) : coronal[3 * r + c]);
        centre[c] = placed ? real_at(head, 78 + 4 * c) : 0.0;
    }
    if (!placed)
        image_note(s, m,
                   "its header does not say where it lies; voxels of 1 mm and coronal slices were "
                   "taken: check left and right");
}

/* The centre of the volume is half its voxels along each axis from the first. */
static void place(scan *s, const unsigned char *head, image *m)
{
    double step[9] = { 0 }, centre[3] = { 0, 0, 0 };
    read_grid(s, head, m, step, centre);
    for (int r = 0; r < 3; r++) {
        const double sign = r < 2 ? -1.0 : 1.0; /* RAS to LPS */
        m->origin[r] = sign * centre[r];
        for (int c = 0; c < 3; c++) {
            m->step[3 * r + c] = sign * step[3 * r + c];
            m->origin[r] -= m->step[3 * r + c] * 0.5 * (double)m->n[c];
        }
    }
}

void read_mgh(scan *s, image *m)
{
    unsigned char unpacked[HEAD] = { 0 };
    const unsigned char *head = (const unsigned char *)s->bytes;
    size_t held = s->size;
    m->data = head;
    m->size = s->size;
    m->lead = HEAD;
    m->packing = is_gzip(m->data, m->size) ? PACKED : PLAIN;
    if (m->packing == PACKED) {
        held = inflate_head(m->data, m->size, HEAD, unpacked);
        head = unpacked;
    }
    if (held < USED || whole_at(head, 0) != VERSION) {
        scan_refuse(s, APSM_ERR_FORMAT,
                    "is no image of FreeSurfer, whatever its name says, or is cut short; copy or "
                    "export it again");
        return;
    }
    read_sizes(s, head, m);
    read_type(s, head, m);
    if (scan_ok(s)) place(s, head, m);
}
