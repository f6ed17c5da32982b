/* table.h -- what is known of the subjects: columns of numbers or of categories, one row a shape of
 * the model, in its order. */
#ifndef APSM_STATISTICS_TABLE_H
#define APSM_STATISTICS_TABLE_H

#include <stdbool.h>

#include "apsm/context.h"
#include "files/files.h"
#include "files/project.h"

/* A category's value is the index of its level; NAN where nothing is known.  Numbers keep their
 * texts: 007 is not 7 where numbers say who, and large ones are more than a double holds. */
typedef struct apsm_column {
    char *name;
    bool category;
    double *value;  /* I */
    size_t levels;  /* 0 for numbers */
    char **level;   /* in the order of their bytes */
    size_t *shapes; /* levels: how many shapes have it */
    char **text;    /* of numbers read from texts (I, NULL: unknown), or NULL */
} apsm_column;

/* Owns everything; zero-initialise with {0}, apsm_table_free leaves it so. */
typedef struct apsm_table {
    size_t I, n;
    apsm_column *column;
} apsm_table;

/* The project's columns beside those that apsm and ShapeWorks keep for themselves ("group_sex"
 * under that name and as "sex"). */
apsm_status apsm_table_from_project(apsm_context *ctx, const apsm_project *project,
                                    apsm_table *table) APSM_NODISCARD;

/* Adds the columns of a .csv or .tsv file: a header, then a line a subject, whose first field is
 * the name of a shape (lines of empty fields are passed over, and a first line "sep=;" followed;
 * else the separator is that which header and first line agree on).
 * A column of numbers only is one of numbers; empty fields and "NA" are unknown. A column of the
 * table that has the same name is replaced.  Refused, with file and line: a name that is none of
 * the I shapes (the nearest is named), a name twice, a line with another number of fields, a column
 * without a name or named twice; and a file that is no UTF-8, which results could not name.  Shapes
 * without a line are logged. */
apsm_status apsm_table_read(apsm_context *ctx, const char *path, size_t I, const char *const *names,
                            apsm_table *table) APSM_NODISCARD;

/* The table that an earlier test or measurement was given, or nothing: statistics/subjects.csv of a
 * model folder, which this reads and the next writes.  Shapes that have left the model since may be
 * in it. */
apsm_status apsm_table_read_kept(apsm_context *ctx, const char *folder, size_t I,
                                 const char *const *names, apsm_table *table) APSM_NODISCARD;
/* Keeps the columns that the file `subjects` has, for the report and the next test. */
apsm_status apsm_table_keep(apsm_context *ctx, const char *folder, const char *subjects, size_t I,
                            const char *const *names) APSM_NODISCARD;
/* All columns as a .csv, a line a shape. */
apsm_status apsm_table_write(apsm_context *ctx, const char *path, const char *const *names,
                             const apsm_table *table) APSM_NODISCARD;
/* What commands do: the project's columns, and those of the file, or of the one that was kept. */
apsm_status apsm_table_gather(apsm_context *ctx, const char *folder, const char *subjects,
                              const apsm_project *project, const char *const *names,
                              apsm_table *table) APSM_NODISCARD;

/* What is known of shape i as a field of a .csv: as it was read, nothing where nothing is known. */
void apsm_column_write(apsm_writer *csv, const apsm_column *c, size_t i);

/* Adds a column of numbers (I, copied); one of that name is replaced. */
apsm_status apsm_table_add(apsm_table *table, const char *name, const double *value) APSM_NODISCARD;

/* Makes room for more shapes (I in all), of which nothing is known. */
apsm_status apsm_table_widen(apsm_table *table, size_t I) APSM_NODISCARD;

/* Of a category that most shapes have a number or a date in, what keeps it from being a column of
 * numbers: a decimal comma, a percent sign, a date, a unit or a remark; else NULL.  Numbers with a
 * word behind them count only where most differ: 1.5T and 3T are groups. */
const char *apsm_column_spoilt_by(const apsm_column *c);
/* Refuses such a column, of I shapes, and one of numbers beyond all reckoning. */
apsm_status apsm_column_check(apsm_context *ctx, size_t I, const apsm_column *c) APSM_NODISCARD;
/* Makes a column of numbers that were read, if there is one of that name, one of categories by
 * their texts: numbers that say who or which. */
apsm_status apsm_table_categorize(apsm_table *table, const char *name) APSM_NODISCARD;

/* The column of that name, or NULL. */
const apsm_column *apsm_table_find(const apsm_table *table, const char *name);
void apsm_table_free(apsm_table *table);

#endif
