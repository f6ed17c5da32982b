/* notes.h -- what groom has to say of its shapes that touches whether the model can be trusted:
 * kept in manifest.json, and repeated in the certificate. "notes": [ { "shape": NAME, "aspect": of
 * judge/verdict.h or "input", "text": ... }, ... ];
 * beside these, "undecided": a hand that neither image speaks for, "sought": a pose that only the
 * surface tells, which is a doubt if it turns out that it does not. */
#ifndef APSM_NOTES_H
#define APSM_NOTES_H

#include "align/align.h"

struct json_t;

/* Of poses and hands; a new reference, NULL if out of memory. */
struct json_t *notes_of_alignment(const apsm_alignment *alignment, const char *const *names,
                                  const apsm_align_options *options);

#endif
