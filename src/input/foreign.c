#include "input/foreign.h"

#include <stdbool.h>
#include <stddef.h>
#include <string.h>
#include <strings.h>

static const struct {
    const char *extensions; /* with single spaces between */
    const char *text;
} known[] = {
    { ".inflated .sphere", "FreeSurfer's surface, pulled apart; give lh.white or lh.pial" },
    { ".curv .thickness .annot",
      "values on a surface of FreeSurfer, not the surface; give lh.white or lh.pial" },
    { ".asc", "a surface as text; run `mris_convert IN.asc OUT.gii`" },
    { ".mnc", "a MINC image; run `mnc2nii IN.mnc OUT.nii`" },
    { ".am", "Amira's own format; save it there as .stl or .nrrd" },
    { ".mcs .mimics", "a project of Mimics; export the part from it as .stl" },
    { ".blend", "a scene of Blender; export its mesh as .ply or .obj" },
    { ".itksnap", "a workspace of ITK-SNAP; give the segmentation that it names" },
    { ".mrb", "a bundle of 3D Slicer; save the segmentation or the model in it by itself" },
    { ".mrml", "a scene of 3D Slicer; give the files that it names" },
    { ".vti", "VTK's image; save it as .nrrd or .nii.gz" },
    { ".vtu", "an unstructured grid; extract its surface and save it as .vtp" },
    { ".vtm", "several blocks of VTK; save each surface as .vtp" },
    { ".wrl .x3d", "a scene; save its mesh as .ply or .obj (MeshLab does)" },
    { ".msh .mesh", "a mesh of solid elements; save its surface as .ply or .stl (Gmsh does)" },
    { ".3mf", "a 3MF print; save it as .stl or .ply" },
    { ".glb .gltf", "a glTF scene; save its mesh as .ply or .obj" },
    { ".fbx .dae", "a scene; save its mesh as .ply or .obj" },
    { ".step .stp .iges .igs", "a CAD solid; export it as .stl" },
    { ".img", "the voxels of a header; give its .hdr" },
    { ".raw", "voxels without a header; give its .mhd or .nhdr" },
    { ".zraw", "voxels without a header; give its .mhd" },
    { ".gipl", "an image without the patient's axes; save it as .nrrd (ITK-SNAP does)" },
    { ".lsm .czi", "a stack of a microscope; save it as .tif (Fiji does)" },
    { ".h5 .hdf5", "HDF5, which may hold anything; save the shape as .nrrd or .ply" },
    { ".png .jpg .jpeg .bmp",
      "a flat picture; give the whole stack as one file: .nrrd, .nii.gz, .mha" },
    { ".npy", "an array without spacing; save it as .nrrd or .nii.gz" },
    { ".mat", "Matlab's own format; save the shape as .stl or .nrrd" },
    { ".zip .tar .tgz .7z .rar", "an archive; unpack it and give the folder" },
    { ".gz .bz2 .xz .zst", "packed; unpack it first (only .nii.gz and .mgz are read as they are)" },
    { ".xls", "an old spreadsheet; save it as .xlsx or .swproj" },
};

/* Whether path ends in one of the extensions, in any case of letters. */
static bool ends_in_one(const char *path, const char *extensions)
{
    const size_t length = strlen(path);
    while (*extensions) {
        const size_t end = strcspn(extensions, " ");
        if (length > end && strncasecmp(path + length - end, extensions, end) == 0) return true;
        extensions += end + (extensions[end] == ' ');
    }
    return false;
}

const char *foreign_remedy(const char *path)
{
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (ends_in_one(path, known[k].extensions)) return known[k].text;
    return "not a shape format; use .ply, .stl, .obj, .vtk, .vtp, .off, .gii, .nrrd, .nii, "
           ".nii.gz, .mha, .mhd, .mgz, .tif or a DICOM file or folder";
}
