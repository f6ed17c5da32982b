/* scene.mrml: the exported meshes as a scene of 3D Slicer, with names and colours; the mean is
 * shown, modes and shapes wait to be switched on. */
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "exchange/exporting.h"

/* In an attribute of XML. */
static void put_text(apsm_writer *w, const char *text)
{
    for (const char *c = text; *c; c++) {
        const char *word = *c == '<'   ? "&lt;"
                           : *c == '>' ? "&gt;"
                           : *c == '&' ? "&amp;"
                           : *c == '"' ? "&quot;"
                                       : NULL;
        apsm_writer_write(w, word ? word : c, word ? strlen(word) : 1);
    }
}

/* Bone for the mean, blue and orange for the two sides of a mode, grey for shapes. */
static const char *colour_of(const char *file)
{
    if (strncmp(file, "mean", 4) == 0) return "0.86 0.83 0.75";
    if (strstr(file, "_minus")) return "0.16 0.47 0.71";
    return strncmp(file, "modes/", 6) == 0 ? "0.79 0.42 0.11" : "0.7 0.7 0.7";
}

static void put_model(apsm_writer *w, size_t k, const char *file)
{
    const char *name = apsm_path_last(file);
    const size_t length = strlen(name) - strlen(strrchr(name, '.'));
    char stem[256];
    snprintf(stem, sizeof stem, "%.*s", (int)length, name);
    apsm_writer_printf(w, "<ModelStorage id=\"vtkMRMLModelStorageNode%zu\" name=\"", k);
    put_text(w, stem);
    apsm_writer_printf(w, "\" fileName=\"");
    put_text(w, file);
    apsm_writer_printf(w,
                       "\" useCompression=\"1\" coordinateSystem=\"LPS\"></ModelStorage>\n"
                       "<ModelDisplay id=\"vtkMRMLModelDisplayNode%zu\" name=\"display %zu\" "
                       "color=\"%s\" visibility=\"%s\" opacity=\"1\"></ModelDisplay>\n"
                       "<Model id=\"vtkMRMLModelNode%zu\" name=\"",
                       k, k, colour_of(file), strncmp(file, "mean", 4) == 0 ? "true" : "false", k);
    put_text(w, stem);
    apsm_writer_printf(w,
                       "\" displayNodeRef=\"vtkMRMLModelDisplayNode%zu\" "
                       "storageNodeRef=\"vtkMRMLModelStorageNode%zu\"></Model>\n",
                       k, k);
}

apsm_status export_scene(exporting *e)
{
    char *path = NULL;
    apsm_writer *w = NULL;
    const json_t *files = e->folder.files;
    const size_t n = json_array_size(files);
    apsm_status status = exporting_file(e, &path, "scene.mrml");
    if (status == APSM_OK) status = apsm_writer_open(e->ctx, path, &w);
    free(path);
    APSM_TRY(status);
    apsm_writer_printf(w, "<MRML version=\"Slicer4.4.0\" userTags=\"\">\n");
    for (size_t k = 0; k < n; k++) put_model(w, k + 1, json_string_value(json_array_get(files, k)));
    apsm_writer_printf(w, "</MRML>\n");
    return apsm_writer_commit(w);
}
