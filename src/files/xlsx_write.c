/* Workbooks in memory, and to .xlsx by libxlsxwriter.  The library writes the time into the file
 * unless it is told one: ours is always the same, so that a project has always the same bytes. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#ifndef APSM_NO_XLSXWRITER
#include <xlsxwriter.h>
#endif

#include "files/io.h"
#include "files/sheets.h"

sheet *workbook_add(workbook *w, const char *name, size_t rows, size_t columns)
{
    sheet *longer = realloc(w->sheets, (w->n + 1) * sizeof *longer);
    if (!longer) return NULL;
    w->sheets = longer;
    sheet *s = &longer[w->n];
    *s = (sheet){ strdup(name), rows, columns, calloc(rows * columns + 1, sizeof *s->cell) };
    if (s->name && s->cell) return w->n++, s;
    free(s->name);
    free(s->cell);
    return NULL;
}

bool sheet_set(sheet *s, size_t row, size_t column, const char *text)
{
    char **slot = &s->cell[row * s->columns + column];
    free(*slot);
    *slot = text ? strdup(text) : NULL;
    return !text || *slot;
}

void workbook_free(workbook *w)
{
    for (size_t k = 0; k < w->n; k++) {
        sheet *s = &w->sheets[k];
        for (size_t i = 0; i < s->rows * s->columns; i++) free(s->cell[i]);
        free(s->cell);
        free(s->name);
    }
    free(w->sheets);
    *w = (workbook){ 0 };
}

#ifdef APSM_NO_XLSXWRITER
apsm_status workbook_write(apsm_context *ctx, const char *path, const workbook *w)
{
    (void)w;
    return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                     "%s: this build writes no .xlsx (it is one static program); write a .swproj",
                     path);
}
#else
enum { CREATED = 315532800 }; /* 1980-01-01, where ZIP's time begins */

/* Width of a column in letters: its longest text, within reason. */
static double width_of(const sheet *s, size_t column)
{
    size_t longest = 8;
    for (size_t row = 0; row < s->rows; row++) {
        const char *text = s->cell[row * s->columns + column];
        if (text && strlen(text) > longest) longest = strlen(text);
    }
    return (double)(longest > 60 ? 60 : longest + 1);
}

static lxw_error put_sheet(lxw_workbook *book, const sheet *s, lxw_format *bold)
{
    lxw_worksheet *out = workbook_add_worksheet(book, s->name);
    if (!out) return LXW_ERROR_PARAMETER_VALIDATION;
    lxw_error error = LXW_NO_ERROR;
    for (size_t k = 0; error == LXW_NO_ERROR && k < s->rows * s->columns; k++)
        if (s->cell[k])
            error = worksheet_write_string(out, (lxw_row_t)(k / s->columns),
                                           (lxw_col_t)(k % s->columns), s->cell[k],
                                           k < s->columns ? bold : NULL);
    for (size_t c = 0; c < s->columns; c++)
        worksheet_set_column(out, (lxw_col_t)c, (lxw_col_t)c, width_of(s, c), NULL);
    worksheet_freeze_panes(out, 1, 0);
    return error;
}

/* Closes book, which frees it, whatever happens. */
static lxw_error put_sheets(lxw_workbook *book, const workbook *w)
{
    lxw_doc_properties properties = { .created = CREATED };
    lxw_format *bold = workbook_add_format(book);
    lxw_error error = bold ? LXW_NO_ERROR : LXW_ERROR_MEMORY_MALLOC_FAILED;
    if (bold) format_set_bold(bold);
    workbook_set_properties(book, &properties);
    for (size_t k = 0; error == LXW_NO_ERROR && k < w->n; k++)
        error = put_sheet(book, &w->sheets[k], bold);
    const lxw_error closed = workbook_close(book);
    return error != LXW_NO_ERROR ? error : closed;
}

apsm_status workbook_write(apsm_context *ctx, const char *path, const workbook *w)
{
    const size_t length = strlen(path) + 32;
    apsm_writer *probe; /* the library tells standard error what it cannot create: we ask first */
    APSM_TRY(apsm_writer_open(ctx, path, &probe));
    apsm_writer_abort(probe);
    char *temp = malloc(length);
    if (!temp) return apsm_fail_errno(ctx, path, "cannot be written", ENOMEM);
    snprintf(temp, length, "%s.%ld.tmp", path, (long)getpid());
    lxw_workbook *book = workbook_new(temp);
    const lxw_error error = book ? put_sheets(book, w) : LXW_ERROR_MEMORY_MALLOC_FAILED;
    apsm_status status = APSM_OK;
    if (error == LXW_NO_ERROR)
        status = apsm_replace_file(ctx, temp, path);
    else if (error == LXW_ERROR_CREATING_XLSX_FILE)
        status = apsm_fail_errno(ctx, path, "cannot be written", errno);
    else
        status = apsm_fail(ctx, APSM_ERR_IO, "%s: not written: %s", path, lxw_strerror(error));
    if (status != APSM_OK) unlink(temp);
    free(temp);
    return status;
}
#endif
