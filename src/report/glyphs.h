/* glyphs.h -- the letters of text in pictures, drawn for apsm as strokes of a round pen.
 *
 * Lengths are quarters of a unit, of which the letter size has ten; capitals are 7 units high.  A
 * glyph is a text: 'l' begins a line through the points that follow, 's' a smooth one that
 * begins at the first and ends at the last, 'o' a smooth one that is closed; a point is two
 * letters, '5' for 0. */
#ifndef APSM_REPORT_GLYPHS_H
#define APSM_REPORT_GLYPHS_H

typedef struct glyph {
    unsigned char advance;
    const char *strokes;
} glyph;

enum { GLYPH_FIRST = ' ', GLYPH_LAST = '~', GLYPH_ZERO = '5', GLYPH_UNITS = 40 };

/* clang-format off */
static const glyph glyphs[] = {
    { 10, "" }, /*   */
    { 8, "l9Q9>l9695" }, /* ! */
    { 12, "l8Q8Il>Q>I" }, /* " */
    { 22, "l<Q95lFQC5l6HJHl5>I>" }, /* # */
    { 20, "sGKGP?P7P7J7D?CHBH<H6?6666<l?T?2" }, /* $ */
    { 30, "o6QAQAD6DoGBRBR5G5lLQ<5" }, /* % */
    { 25, "sM5?C8J8Q>QDQDJAF6B6;65>5G5JA" }, /* & */
    { 6, "l8Q8I" }, /* ' */
    { 10, "s=S7M7@73=-" }, /* ( */
    { 10, "s7S=M=@=37-" }, /* ) */
    { 14, "l<Q<Gl8O@Il8I@O" }, /* * */
    { 22, "l@J@8l7AIA" }, /* + */
    { 8, "s:6:27/" }, /* , */
    { 13, "l7?@?" }, /* - */
    { 8, "l9695" }, /* . */
    { 11, "l63?R" }, /* / */
    { 20, "s?Q6Q6C65?5s?5H5HCHQ?Q" }, /* 0 */
    { 20, "l9K@Q@5" }, /* 1 */
    { 20, "s7I7Q?QGQGIGC?<65l65H5" }, /* 2 */
    { 20, "s7K8Q?QGQGJGD=Ds=DHDH<H5?5756<" }, /* 3 */
    { 20, "lD5DQ6>I>" }, /* 4 */
    { 20, "lFQ9Q7Cs7C:G?GHGH>H5?5756;" }, /* 5 */
    { 20, "sGLEQ@Q6Q6A65?5s?5H5H>HG?G7G6?" }, /* 6 */
    { 20, "l6QHQsHQ=E=5" }, /* 7 */
    { 20, "o7QGQGD7Do6DHDH565" }, /* 8 */
    { 20, "s7:95>5H5HEHQ?Qs?Q6Q6H6???G?HG" }, /* 9 */
    { 8, "l9I9Hl9695" }, /* : */
    { 8, "l9I9Hs:6:27/" }, /* ; */
    { 22, "lIK8AI7" }, /* < */
    { 22, "l7EIEl7=I=" }, /* = */
    { 22, "l7KHA77" }, /* > */
    { 20, "s7J7Q?QGQGJGE?B?=l?6?5" }, /* ? */
    { 36, "sNHKKGK?K?A?9E9M9OJsOJL9Q9X;XEXQIQ6Q6?6.H.O.S1" }, /* @ */
    { 24, "l55AQM5l9?I?" }, /* A */
    { 24, "l858Qs8QCQIQIKIDBD8Ds8DCDKDK=K5C585" }, /* B */
    { 26, "sMIJQCQ7Q7C75C5K5M>" }, /* C */
    { 26, "l858Qs8QAQMQMCM5A585" }, /* D */
    { 24, "lKQ8Q85K5l8DID" }, /* E */
    { 22, "lJQ8Q85l8CGC" }, /* F */
    { 28, "sMJKQCQ7Q7C75C5J5N:lN:NBDB" }, /* G */
    { 26, "l858QlL5LQl8DLD" }, /* H */
    { 8, "l959Q" }, /* I */
    { 18, "sDQD=D5=5656=" }, /* J */
    { 24, "l858QlKQ8?l?EL5" }, /* K */
    { 20, "l8Q85I5" }, /* L */
    { 30, "l858QD7PQP5" }, /* M */
    { 26, "l858QL5LQ" }, /* N */
    { 28, "o7QOQO575" }, /* O */
    { 23, "l858Qs8QBQKQKIKABA8A" }, /* P */
    { 28, "o7QOQO575lE=O3" }, /* Q */
    { 26, "l858Qs8QBQKQKIKBBB8BlCBM5" }, /* R */
    { 24, "sJIJQAQ7Q7J7EACKAK<K5A5757>" }, /* S */
    { 22, "l5QKQl@Q@5" }, /* T */
    { 26, "s8Q8?85B5L5L?LQ" }, /* U */
    { 24, "l5QA5MQ" }, /* V */
    { 34, "l5Q=5FPO5WQ" }, /* W */
    { 24, "l65LQl6QL5" }, /* X */
    { 24, "l5QAAMQlAAA5" }, /* Y */
    { 22, "l7QIQ65J5" }, /* Z */
    { 11, "l>S8S8.>." }, /* [ */
    { 11, "l?36R" }, /* backslash */
    { 11, "l7S=S=.7." }, /* ] */
    { 18, "l7D>QED" }, /* ^ */
    { 20, "l5/I/" }, /* _ */
    { 12, "l8R=M" }, /* ` */
    { 20, "s7E8I?IFIFCF5sFA=@7@7;75=5E5F=" }, /* a */
    { 20, "l8Q85o8IGIG585" }, /* b */
    { 18, "sFCEI?I7I7?75?5E5F<" }, /* c */
    { 20, "lFQF5o7IFIF575" }, /* d */
    { 20, "l7?G?sG?GI?I7I7?75?5E5G;" }, /* e */
    { 11, "s@Q:R:K:5l5I?I" }, /* f */
    { 20, "o7IFIF575sFIF7F-?-8-71" }, /* g */
    { 20, "l8Q85s8?8I?IFIFAF5" }, /* h */
    { 8, "l9I95l9Q9P" }, /* i */
    { 8, "s9I939-4-l9Q9P" }, /* j */
    { 18, "l8Q85lEI8<l=AG5" }, /* k */
    { 8, "l9Q95" }, /* l */
    { 30, "l8I85s8@8I?IDIDBD5sD@DIKIPIPBP5" }, /* m */
    { 20, "l8I85s8?8I?IFIFAF5" }, /* n */
    { 20, "o7IGIG575" }, /* o */
    { 20, "l8I8-o8IGIG585" }, /* p */
    { 20, "lFIF-o7IFIF575" }, /* q */
    { 13, "l8I85s8@9I>IAI" }, /* r */
    { 18, "sECEI>I7I7D7@>?F>F:F5>5756;" }, /* s */
    { 11, "s:O:;:5?5l5I?I" }, /* t */
    { 20, "s8I8=85?5F5F?lFIF5" }, /* u */
    { 18, "l6I>5FI" }, /* v */
    { 26, "l6I<5BHH5NI" }, /* w */
    { 18, "l75EIl7IE5" }, /* x */
    { 18, "l6I>5sFI>5<-7-" }, /* y */
    { 18, "l7IEI75E5" }, /* z */
    { 12, "s?S:S:M:A6@s6@:?:5:.?." }, /* { */
    { 8, "l9S9-" }, /* | */
    { 12, "s7S<S<M<A@@s@@<?<5<.7." }, /* } */
    { 22, "s7?:E@AF=IC" }, /* ~ */
};
/* clang-format on */

/* U+00C0 to U+00FF: the letter, and what stands over it; a point for none. */
static const char latin_letter[] =
    "AAAAAA.CEEEEIIII.NOOOOOxOUUUUY..aaaaaa.ceeeeiiii.nooooo.ouuuuy.y";
static const char latin_accent[] =
    "`'^~:o..`'^:`'^:.~`'^~:..`'^:'..`'^~:o..`'^:`'^:.~`'^~:..`'^:'.:";

/* Strokes about the middle of the letter, upward from its top. */
static inline const char *accent_strokes(char accent)
{
    switch (accent) {
    case '`':
        return "l2:66";
    case '\'':
        return "l8:46";
    case '^':
        return "l165:96";
    case '~':
        return "s173:7699";
    case ':':
        return "l2828l8888";
    case 'o':
        return "o3;7;7636";
    default:
        return "";
    }
}

#endif
