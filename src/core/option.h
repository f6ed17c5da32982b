/* option.h -- the machine of the options: a step declares its own beside its kernel, in one list
 * that is also the struct its kernel takes; src/options puts the lists together.
 *
 *   #define APSM_X_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED) rows
 *
 *   INT(S, name, default, least, most, doc)      long
 *   REAL(S, name, default, least, most, doc)     double
 *   BOOL(S, name, default, doc)                  bool
 *   ENUM(S, name, "first|second|...", doc)       int, index of the word; the first is the default
 *   FIXED(S, type, name, default, doc)           a constant of the kernel that no option reaches
 *
 * S is handed through to the macros that read the list.  h is the template's mean neighbour
 * distance (docs/method.md, "Notation"): lengths given in h make the result independent of the
 * unit.  Numbers in brackets are equations of docs/method.md. */
#ifndef APSM_CORE_OPTION_H
#define APSM_CORE_OPTION_H

#include "apsm/options.h"

/* The fields of a step's struct. */
#define APSM_OPTION_FIELDS(LIST)                                                                   \
    LIST(, APSM_FIELD_INT, APSM_FIELD_REAL, APSM_FIELD_BOOL, APSM_FIELD_ENUM, APSM_FIELD_FIXED)
#define APSM_FIELD_INT(S, name, dflt, lo, hi, doc)  long name;
#define APSM_FIELD_REAL(S, name, dflt, lo, hi, doc) double name;
#define APSM_FIELD_BOOL(S, name, dflt, doc)         bool name;
#define APSM_FIELD_ENUM(S, name, words, doc)        int name;
#define APSM_FIELD_FIXED(S, type, name, dflt, doc)  type name;

/* Their defaults, as designated initialisers. */
#define APSM_OPTION_DEFAULTS(LIST)                                                                 \
    LIST(, APSM_DFLT_NUMBER, APSM_DFLT_NUMBER, APSM_DFLT_BOOL, APSM_DFLT_ENUM, APSM_DFLT_FIXED)
#define APSM_DFLT_NUMBER(S, name, dflt, lo, hi, doc) .name = dflt,
#define APSM_DFLT_BOOL(S, name, dflt, doc)           .name = dflt,
#define APSM_DFLT_ENUM(S, name, words, doc)          .name = 0,
#define APSM_DFLT_FIXED(S, type, name, dflt, doc)    .name = dflt,

/* Text to the value at `at` (long, double, bool or int, by the row's kind), with a line if it does
 * not parse or is out of range; and back, 64 bytes, so that it reads back exactly.  Numbers are
 * those of the C locale. */
apsm_status apsm_option_parse(apsm_context *ctx, const apsm_option_info *row, const char *value,
                              void *at) APSM_NODISCARD;
void apsm_option_print(const apsm_option_info *row, const void *at, char text[64]);

#endif
