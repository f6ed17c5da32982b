/* The other parts of a subject, as they lie around one of them: what its rebuilt surface must not
 * go into.  They are known once all parts are groomed. */
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "assemble/job.h"
#include "files/files.h"
#include "folder/names.h"
#include "geometry/affine.h"

static apsm_status read_part(joint_around *a, size_t d)
{
    char *path = apsm_path_join(a->job->part[d].folder, FOLDER_PROJECT);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = apsm_project_read(a->job->ctx, path, &a->project[d]);
    free(path);
    if (status == APSM_OK) status = joint_paths_of_project(&a->project[d], &a->row[d]);
    if (status == APSM_OK) status = joint_paths_of_subjects(a->job, d, &a->subject[d]);
    return status;
}

apsm_status joint_around_read(const joint_job *job, joint_around *a)
{
    *a = (joint_around){ .job = job };
    a->project = calloc(job->n, sizeof *a->project);
    a->row = calloc(job->n, sizeof *a->row);
    a->subject = calloc(job->n, sizeof *a->subject);
    apsm_status status = a->project && a->row && a->subject ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t d = 0; d < job->n && status == APSM_OK; d++) status = read_part(a, d);
    return status;
}

void joint_around_free(joint_around *a)
{
    for (size_t d = 0; a->project && a->row && a->subject && d < a->job->n; d++) {
        apsm_project_free(&a->project[d]);
        joint_paths_free(&a->row[d]);
        joint_paths_free(&a->subject[d]);
    }
    free(a->project);
    free(a->row);
    free(a->subject);
    free(a->turn);
    free(a->told);
    *a = (joint_around){ 0 };
}

const apsm_subject *joint_around_part(const joint_around *a, size_t i, size_t d)
{
    const size_t k = a->job->subject[i].input[d];
    const size_t row =
        k == APSM_NO_CASE ? SIZE_MAX : joint_paths_find(&a->row[d], a->job->list.cases[k].path);
    return row == SIZE_MAX ? NULL : &a->project[d].subjects[row];
}

/* The groomed mesh of another part, in the frame of own's groomed mesh. */
static apsm_status bring(apsm_context *ctx, const apsm_project *project, const apsm_subject *own,
                         const apsm_subject *other, apsm_mesh *mesh)
{
    double to[16], from[16];
    char *path = apsm_project_path(project, other->groomed);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = joint_place(ctx, own, to);
    if (status == APSM_OK) status = joint_place(ctx, other, from);
    if (status == APSM_OK) status = apsm_affine_invert(to, to);
    if (status == APSM_OK) status = apsm_read_mesh(ctx, path, mesh);
    free(path);
    APSM_TRY(status);
    apsm_affine_multiply(to, from, to);
    apsm_mesh_transform(mesh, to);
    return APSM_OK;
}

apsm_status joint_around_of(void *user, apsm_context *ctx, const char *path, size_t *n,
                            apsm_mesh **meshes)
{
    const joint_around *a = user;
    const size_t i = joint_paths_find(&a->subject[a->of], path);
    const apsm_subject *own = i == SIZE_MAX ? NULL : joint_around_part(a, i, a->of);
    *n = 0;
    *meshes = calloc(a->job->n, sizeof **meshes);
    if (!*meshes) return APSM_ERR_MEMORY;
    for (size_t d = 0; own && d < a->job->n; d++) {
        const apsm_subject *other = d == a->of ? NULL : joint_around_part(a, i, d);
        /* of another side: told when the parts are put together */
        if (!other || !other->groomed || other->mirrored != own->mirrored) continue;
        APSM_TRY(bring(ctx, &a->project[d], own, other, &(*meshes)[*n]));
        ++*n;
    }
    return APSM_OK;
}
