/* input.h -- from the INPUT arguments of a user to cases, and from a case to its shape. */
#ifndef APSM_INPUT_INPUT_H
#define APSM_INPUT_INPUT_H

#include <stdbool.h>

#include "apsm/mesh.h"
#include "apsm/volume.h"
#include "files/files.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum apsm_input_kind {
    APSM_INPUT_MESH,   /* .ply .stl .obj .vtk .vtp */
    APSM_INPUT_VOLUME, /* .nrrd .nhdr .nii .nii.gz .mha .mhd .tif .tiff, .vtk of an image */
    APSM_INPUT_DICOM   /* a folder holding one series, or a file with frames */
} apsm_input_kind;

typedef struct apsm_input_case {
    char *name; /* unique in its list: the file's without extension or, where these are not all
                   different, what differs in the paths, joined by _ */
    char *path; /* as given, or folder/file */
    apsm_input_kind kind;
    bool reflect; /* its file name matches reflect_match */
} apsm_input_case;

/* Owns everything; zero-initialise with {0}. */
typedef struct apsm_input_list {
    size_t n;
    apsm_input_case *cases; /* ascending by name, byte by byte */
    size_t excluded;        /* files left out because of `exclude` */
    size_t skipped;         /* files in folders that are not shapes */
} apsm_input_list;

/* Which cases.  All borrowed; texts may be NULL or "". */
typedef struct apsm_input_choice {
    size_t n;
    const char *const *inputs;
    const char *const *names;  /* n of them, and each input is one case of that name; or NULL */
    const char *exclude;       /* expression: cases to be left out */
    const char *reflect_match; /* expression: cases to be mirrored */
    const char *pattern;       /* which shapes of folders and all folders below: a glob, in which
                                  a component ** is any number of folders */
} apsm_input_choice;

/* The cases of n inputs: files, and folders, which stand for all shape files in them or, if there
 * are none (or with pattern), in all folders below.  A folder without shape files but with DICOM
 * files is one case.  Hidden files, what operating systems leave behind and model folders do not
 * count; shapes in folders below that are left out are named in a warning.
 *
 * exclude and reflect_match are POSIX extended regular expressions, searched in the path below the
 * folder that was given (of a file that was given, in its name).  One that matches nothing is
 * logged as a warning.
 *
 * Refused, with a line: no case left; a folder without shapes; a path that is missing,
 * unreadable or (given by name) of an unknown extension; two cases of one name; a name that is
 * longer than 200 bytes, not UTF-8 or has a control character; an invalid expression.  Files in
 * folders that hold no shape are logged by name.  list is overwritten, and {0} on failure.  O(m log
 * m) for m files. */
apsm_status apsm_input_choose(apsm_context *ctx, const apsm_input_choice *choice,
                              apsm_input_list *list) APSM_NODISCARD;
/* The same without names and pattern. */
apsm_status apsm_input_expand(apsm_context *ctx, size_t n, const char *const *inputs,
                              const char *exclude, const char *reflect_match,
                              apsm_input_list *list) APSM_NODISCARD;
/* Refused, with a line: a case whose path, seen from the folder, no file of a model can hold since
 * it is not UTF-8. */
apsm_status apsm_input_check_stored(apsm_context *ctx, const char *folder,
                                    const apsm_input_list *list) APSM_NODISCARD;
void apsm_input_list_free(apsm_input_list *list);

/* The kind of a file by its extension, in any case, of .vtk by what it holds; false if it is none
 * of them. */
bool apsm_input_kind_of(const char *path, apsm_input_kind *kind);

/* *files <- those that hold the voxels of a header of its own (.mhd, .nhdr, also .mha and .nrrd,
 * .hdr), in their order; none if path is no such header. */
apsm_status apsm_input_data_files(const char *path, apsm_file_list *files) APSM_NODISCARD;
/* SHA-256 of a file, with those behind it that hold its voxels, or of a folder. */
apsm_status apsm_input_hash(apsm_context *ctx, const char *path, char hex[65]) APSM_NODISCARD;

/* Which labels of a segmentation are the shape.  {0}: the only one there is. */
typedef struct apsm_labels {
    bool all; /* every label but 0 */
    size_t n;
    int32_t *label; /* ascending; owned */
    size_t names;
    char **name; /* of segments, as the file has them; owned */
    char side;   /* '<' or '>': the shape is where values are below or above the level; else 0 */
    double level;
    bool if_several; /* labels of other inputs: a mask whose only label is none of them is taken */
} apsm_labels;

/* From text: "" , "all", non-zero integers and names of segments with commas, "1,2" or "talus", or
 * a bound on the values of an image that is a function, ">0.5".  APSM_ERR_ARG with a line. */
apsm_status apsm_labels_parse(apsm_context *ctx, const char *text,
                              apsm_labels *labels) APSM_NODISCARD;
void apsm_labels_free(apsm_labels *labels);

/* In place: 1 where the voxel has one of the labels in any layer, else 0; one layer is left.
 * Refused (APSM_ERR_GEOMETRY): none chosen and several there (the line lists them), nothing chosen
 * is there, a number that means different segments in different layers.  A chosen label that is
 * not there is logged.  path is for messages.  O(voxels). */
apsm_status apsm_label_union(apsm_context *ctx, const char *path, const apsm_labels *labels,
                             apsm_volume *volume) APSM_NODISCARD;

/* Warns if the same label has different names in different shapes: picked[i] is of shape i (see
 * apsm_volume), NULL where there are no names. */
void apsm_labels_compare(apsm_context *ctx, size_t n, const char *const *names,
                         const char *const *picked);

/* The surface of an image that is a function, in LPS.  Without a bound in labels it must be a
 * distance transform: the side that most voxels of the image's border are on is outside, and the
 * volume's notes say so.  The surface is closed at the image's border. */
apsm_status apsm_field_surface(apsm_context *ctx, const char *path, const apsm_labels *labels,
                               apsm_volume *volume, apsm_mesh *mesh) APSM_NODISCARD;

/* What a case holds: a mesh as it is in the file, a mask of 0 and 1, or the surface of a function
 * (with volume.notes and nothing else in volume). */
typedef struct apsm_input_shape {
    bool is_mesh;
    apsm_mesh mesh;     /* owned; {0} if not is_mesh */
    apsm_volume volume; /* owned */
} apsm_input_shape;

/* Reads a case.  labels is borrowed and does not matter to meshes.  shape is overwritten, and
 * {0} on failure.  May run in several threads at once. */
apsm_status apsm_input_read(apsm_context *ctx, const apsm_input_case *one,
                            const apsm_labels *labels, apsm_input_shape *shape) APSM_NODISCARD;
/* The rest of it for a volume that is in the shape: the chosen labels, or the surface of a
 * function. shape is {0} on failure. */
apsm_status apsm_input_finish(apsm_context *ctx, const char *path, const apsm_labels *labels,
                              apsm_input_shape *shape) APSM_NODISCARD;
void apsm_input_shape_free(apsm_input_shape *shape);

#ifdef __cplusplus
}
#endif
#endif
