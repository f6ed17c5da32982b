#include "session/notes.h"

#include <jansson.h>

#include "judge/verdict.h"

static int add(json_t *notes, const char *shape, apsm_aspect aspect, const char *text)
{
    return json_array_append_new(notes, json_pack("{s:s, s:s, s:s}", "shape", shape, "aspect",
                                                  apsm_aspect_name(aspect), "text", text));
}

/* A note that says more than its text. */
static int add_as(json_t *notes, const char *shape, apsm_aspect aspect, const char *text,
                  const char *what)
{
    if (add(notes, shape, aspect, text)) return -1;
    return json_object_set_new(json_array_get(notes, json_array_size(notes) - 1), what,
                               json_true());
}

static int add_shape(json_t *notes, const apsm_alignment *a, size_t i, const char *name,
                     const apsm_align_options *options)
{
    int failed = 0;
    if (a->mirrored[i] && options->mirror_check != APSM_MIRROR_FIX)
        failed |= add(notes, name, APSM_ASPECT_HAND, "fits better as its mirror image");
    if (a->unclear_hand[i])
        failed |= add_as(notes, name, APSM_ASPECT_HAND, "fits about as well as its mirror image",
                         "undecided");
    if (a->ambiguous[i])
        failed |= add(notes, name, APSM_ASPECT_POSE, "another pose fits about as well");
    else if (a->sought[i] && a->oriented)
        failed |= add_as(notes, name, APSM_ASPECT_POSE,
                         "was turned, although the others share the orientation in which they came",
                         "against");
    else if (a->sought[i])
        failed |= add_as(notes, name, APSM_ASPECT_POSE, "laid as its surface says", "sought");
    if (a->stranger[i])
        failed |= add(notes, name, APSM_ASPECT_BELONGING,
                      "is unlike the others in size or form, and was not considered as template");
    return failed;
}

json_t *notes_of_alignment(const apsm_alignment *alignment, const char *const *names,
                           const apsm_align_options *options)
{
    json_t *notes = json_array();
    int failed = !notes;
    for (size_t i = 0; i < alignment->n && !failed; i++)
        failed = add_shape(notes, alignment, i, names[i], options);
    if (!failed) return notes;
    json_decref(notes);
    return NULL;
}
