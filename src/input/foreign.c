#include "input/foreign.h"

#include <stddef.h>
#include <string.h>
#include <strings.h>

static const char *const slices =
    "a flat picture; give the whole stack as one file: .nrrd, .nii.gz, .mha";

const char *foreign_remedy(const char *path)
{
    const struct {
        const char *extension, *text;
    } known[] = {
        { ".mgz", "FreeSurfer's image; run `mri_convert IN.mgz OUT.nii.gz`" },
        { ".mgh", "FreeSurfer's image; run `mri_convert IN.mgh OUT.nii.gz`" },
        { ".gii", "a GIFTI surface; run `mris_convert IN.gii OUT.vtk`, or save it as .ply" },
        { ".pial", "FreeSurfer's surface; run `mris_convert IN OUT.vtk`" },
        { ".white", "FreeSurfer's surface; run `mris_convert IN OUT.vtk`" },
        { ".mnc", "a MINC image; run `mnc2nii IN.mnc OUT.nii`" },
        { ".am", "Amira's own format; save it there as .stl or .nrrd" },
        { ".surf", "Amira's own format; save it there as .stl or .ply" },
        { ".mrb", "a bundle of 3D Slicer; save the segmentation or the model in it by itself" },
        { ".mrml", "a scene of 3D Slicer; give the files that it names" },
        { ".vti", "VTK's image; save it as .nrrd or .nii.gz" },
        { ".vtu", "an unstructured grid; extract its surface and save it as .vtp" },
        { ".vtm", "several blocks of VTK; save each surface as .vtp" },
        { ".off", "an OFF mesh; save it as .ply or .obj" },
        { ".3mf", "a 3MF print; save it as .stl or .ply" },
        { ".glb", "a glTF scene; save its mesh as .ply or .obj" },
        { ".gltf", "a glTF scene; save its mesh as .ply or .obj" },
        { ".fbx", "a scene; save its mesh as .ply or .obj" },
        { ".dae", "a scene; save its mesh as .ply or .obj" },
        { ".step", "a CAD solid; export it as .stl" },
        { ".stp", "a CAD solid; export it as .stl" },
        { ".iges", "a CAD solid; export it as .stl" },
        { ".igs", "a CAD solid; export it as .stl" },
        { ".img", "the voxels of a header; give its .hdr" },
        { ".raw", "voxels without a header; give its .mhd or .nhdr" },
        { ".zraw", "voxels without a header; give its .mhd" },
        { ".png", slices },
        { ".jpg", slices },
        { ".jpeg", slices },
        { ".bmp", slices },
        { ".npy", "an array without spacing; save it as .nrrd or .nii.gz" },
        { ".mat", "Matlab's own format; save the shape as .stl or .nrrd" },
        { ".zip", "an archive; unpack it and give the folder" },
        { ".tar", "an archive; unpack it and give the folder" },
        { ".gz", "packed; unpack it first (only .nii.gz is read as it is)" },
        { ".xls", "an old spreadsheet; save it as .xlsx or .swproj" },
    };
    const size_t length = strlen(path);
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        const size_t end = strlen(known[k].extension);
        if (length > end && strcasecmp(path + length - end, known[k].extension) == 0)
            return known[k].text;
    }
    return "not a shape format; use .ply, .stl, .obj, .vtk, .vtp, .nrrd, .nii, .nii.gz, .mha, "
           ".mhd, .tif or a DICOM file or folder";
}
