/* Makes the bundled cohort data/talus: make_talus OUT_FOLDER FILE.ply ...
 *
 * Each file (Amira PLY of about 40,000 faces) goes through apsm_groom_mesh with the defaults, in
 * its own frame, unmirrored, and is written as binary PLY under the same name.  One JSON line a
 * file tells how far the result is from the original.  `scripts/make-talus-data` builds and runs
 * it. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "apsm/formats.h"
#include "groom/groom.h"

static void print_line(void *user, apsm_log_level level, const char *text)
{
    (void)user;
    (void)level;
    fprintf(stderr, "%s\n", text);
}

static const char *base_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

static void print_report(const char *name, const apsm_mesh *original, const apsm_remesh_report *r)
{
    double lo[3], hi[3], d2 = 0.0;
    apsm_mesh_bounds(original, lo, hi);
    for (int c = 0; c < 3; c++) d2 += (hi[c] - lo[c]) * (hi[c] - lo[c]);
    printf("{\"file\":\"%s\",\"faces_before\":%zu,\"faces\":%zu,\"diagonal\":%.3f,"
           "\"to_original_mean\":%.4f,\"to_original_max\":%.4f,\"from_original_mean\":%.4f,"
           "\"from_original_max\":%.4f,\"volume_change\":%.5f,\"min_angle\":%.1f,"
           "\"below_30\":%zu}\n",
           name, r->faces_before, r->faces_after, sqrt(d2), r->forward_mean, r->forward_max,
           r->backward_mean, r->backward_max, r->volume_change, r->min_angle, r->below_30);
}

static apsm_status make(apsm_context *ctx, const char *folder, const char *path)
{
    apsm_mesh original = { 0 }, mesh = { 0 };
    apsm_groom_report report;
    char out[4096];
    snprintf(out, sizeof out, "%s/%s", folder, base_name(path));
    apsm_status status = apsm_read_mesh(ctx, path, &original);
    if (status == APSM_OK)
        status = apsm_groom_mesh(ctx, base_name(path), &original, NULL, &mesh, &report);
    if (status == APSM_OK) status = apsm_write_mesh(ctx, out, &mesh);
    if (status == APSM_OK) print_report(base_name(path), &original, &report.remesh);
    apsm_mesh_free(&original);
    apsm_mesh_free(&mesh);
    return status;
}

int main(int argc, char **argv)
{
    apsm_context *ctx = apsm_context_new();
    if (!ctx || argc < 3) {
        fprintf(stderr, "usage: make_talus OUT_FOLDER FILE.ply ...\n");
        return 2;
    }
    int failed = 0;
    apsm_context_set_log(ctx, print_line, NULL);
    for (int i = 2; i < argc; i++)
        if (make(ctx, argv[1], argv[i]) != APSM_OK) {
            fprintf(stderr, "%s\n", apsm_error_text(ctx));
            failed = 1;
        }
    apsm_context_free(ctx);
    return failed;
}
