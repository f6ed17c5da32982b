/* vtk_text.h -- what all kinds of legacy VTK files have in common.  Binary values are big-endian.
 */
#ifndef APSM_FORMATS_VTK_TEXT_H
#define APSM_FORMATS_VTK_TEXT_H

#include "formats/scan.h"

typedef struct vtk_text {
    bool ascii;
    bool offsets; /* version 5: cells as OFFSETS and CONNECTIVITY */
} vtk_text;

/* *set: the word behind DATASET. */
void vtk_read_header(scan *s, vtk_text *f, word *set);
/* "float", "unsigned_char" ... */
scalar vtk_type(scan *s, word name);
/* Bytes that a value takes at least. */
size_t vtk_least_size(const vtk_text *f, scalar type);
/* The line with the section's keyword ends; in a binary file values follow at once. */
void vtk_begin_values(scan *s, const vtk_text *f);
/* What is said of values before they begin. */
typedef struct vtk_array {
    word name;
    size_t components, tuples;
    scalar type;
} vtk_array;

/* Of an array of a FIELD: name components tuples type. */
vtk_array vtk_read_array(scan *s);
/* Behind its first word, of an attribute of so many: name type [components], LOOKUP_TABLE name of
 * SCALARS (components 1); name type of others. */
vtk_array vtk_read_attribute(scan *s, size_t components, size_t tuples);
/* FIELD name n, then n arrays: name components tuples type, values. */
void vtk_skip_field(scan *s, const vtk_text *f);
/* What follows CELL_DATA: its number of cells, and attributes up to POINT_DATA or the end. */
void vtk_skip_cell_data(scan *s, const vtk_text *f);
/* Ends with an empty line. */
void vtk_skip_metadata(scan *s);

#endif
