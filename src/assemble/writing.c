/* What the writers of a joint's files share. */
#include "assemble/writing.h"

#include <stdlib.h>

#include "files/files.h"

char *writing_path(writing *w, const char *format, ...)
{
    char name[1024];
    va_list args;
    va_start(args, format);
    const int length = vsnprintf(name, sizeof name, format, args);
    va_end(args);
    if (length < 0 || length >= (int)sizeof name) return NULL;
    if (json_array_append_new(w->files, json_string(name)) != 0) return NULL;
    return apsm_path_join(w->job->settings->run.folder, name);
}

apsm_status writing_json(writing *w, const char *name, json_t *root)
{
    char *path = writing_path(w, "%s", name);
    const apsm_status status = path ? apsm_json_write(w->job->ctx, path, root) : APSM_ERR_MEMORY;
    json_decref(root);
    free(path);
    return status;
}

const char *writing_subject(const writing *w, size_t i)
{
    return w->job->subject[i].name;
}

const char *writing_part(const writing *w, size_t d)
{
    return w->job->part[d].name;
}

size_t writing_particles(const writing *w, size_t d)
{
    return w->c->first[d + 1] - w->c->first[d];
}

json_t *writing_parts(const writing *w)
{
    json_t *parts = json_array();
    for (size_t d = 0; d < w->c->n; d++)
        json_array_append_new(parts, json_pack("{s:s, s:I, s:I, s:s}", "name", writing_part(w, d),
                                               "first", (json_int_t)w->c->first[d], "particles",
                                               (json_int_t)writing_particles(w, d), "template",
                                               writing_subject(w, w->f->like[d])));
    return parts;
}
