#include "report/page.h"

#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "report/viewer.h"

/* Where the data go in the viewer. */
static const char mark[] = "APSM-DATA-GOES-HERE";

char *page_title(const char *folder)
{
    char *parent = apsm_path_join(folder, "..");
    char *title = parent ? apsm_path_relative(parent, folder) : NULL;
    free(parent);
    return title;
}

static const char *find_mark(void)
{
    const char *html = (const char *)apsm_viewer_html;
    const size_t n = sizeof mark - 1;
    for (size_t k = 0; k + n <= apsm_viewer_html_size; k++)
        if (memcmp(html + k, mark, n) == 0) return html + k;
    return NULL;
}

static apsm_status put_page(apsm_context *ctx, const struct json_t *root, pack *bytes,
                            apsm_writer *out)
{
    const char *html = (const char *)apsm_viewer_html, *at = find_mark();
    if (!at) return apsm_fail(ctx, APSM_ERR_UNSUPPORTED, "this build has no viewer");
    const char *rest = at + sizeof mark - 1;
    apsm_writer_write(out, html, (size_t)(at - html));
    APSM_TRY(pack_write(ctx, bytes, root, out));
    apsm_writer_write(out, rest, (size_t)(html + apsm_viewer_html_size - rest));
    return APSM_OK;
}

apsm_status page_write(apsm_context *ctx, const char *path, const struct json_t *root, pack *bytes)
{
    apsm_writer *out = NULL;
    APSM_TRY(apsm_writer_open(ctx, path, &out));
    const apsm_status status = put_page(ctx, root, bytes, out);
    if (status == APSM_OK) return apsm_writer_commit(out);
    apsm_writer_abort(out);
    return status;
}
