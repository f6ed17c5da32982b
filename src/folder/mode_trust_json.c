#include "folder/mode_trust_json.h"

#include <jansson.h>

#include "core/number.h"

json_t *mode_trust_json(size_t modes, const apsm_mode_trust *trust)
{
    json_t *list = json_array();
    for (size_t k = 0; k < modes; k++) {
        const apsm_mode_trust *t = &trust[k];
        json_array_append_new(
            list, json_pack("{s:f, s:f, s:f, s:f, s:f, s:b, s:s}", "share", t->share, "chance",
                            t->chance, "cosine", t->cosine, "direction", t->direction, "same_sign",
                            t->same_sign, "trusted", t->trusted, "text", apsm_mode_trust_text(t)));
    }
    if (json_array_size(list) == modes) return list;
    json_decref(list);
    return NULL;
}

static double number(const json_t *mode, const char *key)
{
    return json_number_value(json_object_get(mode, key));
}

bool mode_trust_line(const json_t *modes, size_t k, char *line, size_t size)
{
    const json_t *mode = json_array_get(modes, k);
    const char *text = json_string_value(json_object_get(mode, "text"));
    if (!text) return false;
    apsm_print(line, size,
               "mode %zu: %.1f %% of the variance (by chance %.1f %%), cosine %.2f when shapes are "
               "drawn again: %s",
               k + 1, 100 * number(mode, "share"), 100 * number(mode, "chance"),
               number(mode, "cosine"), text);
    return true;
}
