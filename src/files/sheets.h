/* sheets.h -- spreadsheets (.xlsx) as tables of texts, and projects as spreadsheets. */
#ifndef APSM_FILES_SHEETS_H
#define APSM_FILES_SHEETS_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

struct json_t;

/* Owns everything; cells (rows x columns) are NULL where nothing is. */
typedef struct sheet {
    char *name;
    size_t rows, columns;
    char **cell;
} sheet;

typedef struct workbook {
    size_t n;
    sheet *sheets;
} workbook;

/* By its extension, .xlsx in any case. */
bool apsm_is_spreadsheet(const char *path);

/* Of an .xlsx of any program.  Numbers become their shortest text, truth values true and false.
 * Refused with file, sheet and cell: errors in formulas, damaged or encrypted files, more than
 * SHEETS_CELLS cells.  workbook_free leaves {0}. */
enum { SHEETS_CELLS = 4000000 };
apsm_status workbook_read(apsm_context *ctx, const char *path, workbook *w) APSM_NODISCARD;
/* Atomically; every cell is a text, the first row of a sheet stands out.  The bytes depend on the
 * texts alone, not on the time. */
apsm_status workbook_write(apsm_context *ctx, const char *path, const workbook *w) APSM_NODISCARD;
void workbook_free(workbook *w);

/* A sheet of empty cells, added at the end: borrowed; NULL if out of memory. */
sheet *workbook_add(workbook *w, const char *name, size_t rows, size_t columns);
/* False if out of memory.  text NULL: empty. */
bool sheet_set(sheet *s, size_t row, size_t column, const char *text);

/* The root of a project file from its sheets, as ShapeWorks lays them out: "data" (or the first)
 * with a row a shape, options as columns key and value, options of domains as key and value_DOMAIN,
 * anything else as a table.  Blank cells are no values, blank rows no shapes. */
apsm_status project_from_sheets(apsm_context *ctx, const char *path, const workbook *w,
                                struct json_t **root) APSM_NODISCARD;
/* The way back.  What cannot stand in a table is left out with a warning. */
apsm_status sheets_from_project(apsm_context *ctx, const char *path, const struct json_t *root,
                                workbook *w) APSM_NODISCARD;

#endif
