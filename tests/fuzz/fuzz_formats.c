/* Any bytes through any reader, for libFuzzer: the first byte chooses the format, the rest is the
 * file.  `make fuzz` builds and runs it; tests/data/cases is where it begins. */
#include <stdint.h>
#include <stdlib.h>

#include "formats/dicom.h"
#include "formats/image.h"
#include "formats/mesh_io.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void read_dicom(apsm_context *ctx, const char *bytes, size_t size)
{
    dicom d;
    scan s = { .ctx = ctx, .path = "f.dcm", .bytes = bytes, .size = size };
    if (!is_dicom((const unsigned char *)bytes, size)) return;
    dicom_parse(&s, &d);
    if (scan_ok(&s) && d.rows > 0 && d.columns > 0 && d.rows <= 256 && d.columns <= 256) {
        int32_t *const label = malloc((size_t)(d.rows * d.columns) * sizeof *label);
        if (label) dicom_frame_labels(&s, &d, 0, label);
        free(label);
    }
    dicom_free(&d);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const names[] = { "f.ply", "f.stl",  "f.obj",   "f.vtk", "f.vtp",
                                         "f.nii", "f.nrrd", "f.mha",   "f.dcm", "f.tif",
                                         "f.off", "f.gii",  "f.white", "f.mgh", "f.vtk" };
    enum { DICOM = 8, VTK_IMAGE = 14, FORMATS = 15 };
    if (size < 2) return 0;
    const unsigned kind = data[0] % FORMATS;
    const char *const bytes = (const char *)data + 1;
    apsm_context *const ctx = apsm_context_new();
    apsm_mesh mesh = { 0 };
    apsm_volume volume = { 0 };
    if (!ctx) return 0;
    if (kind == DICOM)
        read_dicom(ctx, bytes, size - 1);
    else if (mesh_is_known(names[kind]) && kind != VTK_IMAGE
                 ? mesh_from_bytes(ctx, names[kind], bytes, size - 1, &mesh)
                 : volume_from_bytes(ctx, names[kind], bytes, size - 1, &volume))
        if (!apsm_error_text(ctx)[0]) abort(); /* a failure has a line */
    apsm_mesh_free(&mesh);
    apsm_volume_free(&volume);
    apsm_context_free(ctx);
    return 0;
}
