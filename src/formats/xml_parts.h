/* xml_parts.h -- what the readers of XML formats share: attributes, and text that comes in pieces.
 */
#ifndef APSM_FORMATS_XML_PARTS_H
#define APSM_FORMATS_XML_PARTS_H

#include <expat.h>
#include <stdlib.h>

#include "formats/scan.h"

/* The value of an attribute, or NULL. */
static inline const char *xml_attribute(const XML_Char **attributes, const char *name)
{
    for (; *attributes; attributes += 2)
        if (strcmp(attributes[0], name) == 0) return attributes[1];
    return NULL;
}

static inline bool xml_is(const char *text, const char *wanted)
{
    return text && strcmp(text, wanted) == 0;
}

static inline word xml_word(const char *text)
{
    return text ? (word){ text, strlen(text) } : (word){ "", 0 };
}

/* Owns its text; zero-initialise. */
typedef struct xml_text {
    char *text;
    size_t length, room;
} xml_text;

static inline void xml_text_add(scan *s, xml_text *t, const char *piece, size_t length)
{
    const size_t wanted = t->length + length;
    if (wanted > t->room) {
        const size_t room = 2 * t->room > wanted ? 2 * t->room : wanted + 4096;
        char *const larger = realloc(t->text, room);
        if (!larger) {
            scan_no_memory(s);
            return;
        }
        t->text = larger;
        t->room = room;
    }
    memcpy(t->text + t->length, piece, length);
    t->length = wanted;
}

/* The parser gets n bytes, the last of the document or not. */
static inline enum XML_Status xml_feed(XML_Parser parser, const char *bytes, size_t n, bool last)
{
    enum { PIECE = 1 << 20 };
    enum XML_Status status = XML_STATUS_OK;
    for (size_t at = 0; status == XML_STATUS_OK && at < n;) {
        const size_t piece = n - at < PIECE ? n - at : PIECE;
        status = XML_Parse(parser, bytes + at, (int)piece, last && at + piece == n);
        at += piece;
    }
    return status;
}

/* Tells why the parser stopped, unless a handler has. */
static inline void xml_refuse(scan *s, XML_Parser parser)
{
    if (XML_GetErrorCode(parser) == XML_ERROR_NO_MEMORY)
        scan_no_memory(s);
    else
        scan_refuse(s, APSM_ERR_FORMAT,
                    "line %lu: its XML is wrong or cut short (%s); copy or export it again",
                    (unsigned long)XML_GetCurrentLineNumber(parser),
                    XML_ErrorString(XML_GetErrorCode(parser)));
}

#endif
