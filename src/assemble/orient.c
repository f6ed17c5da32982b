/* How subjects are turned, told by all their parts together.  A part that is nearly symmetric does
 * not show its pose; where it lies to the others does.  Where grooming doubts a part's poses, the
 * subjects are aligned as wholes, and that part is aligned again with every shape turned as its
 * subject is.
 *
 * A whole is one surface of all parts, each made smaller or larger about its centroid c_d, so that
 * it shows how parts lie and not how large they are, and no part can be taken for another:
 *   radius_d = L (1 - d / (2 (n - 1))),  L the root mean square distance of the c_d from their mean
 * (where all have one centre, the parts stay as they are).  Turning a subject turns its whole. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "apsm/formats.h"
#include "assemble/job.h"
#include "files/files.h"
#include "folder/manifest_json.h"
#include "folder/names.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"

/* Whether grooming doubts a pose of the part, and nothing has been made of these poses yet. */
static apsm_status doubts_poses(const joint_job *job, size_t d, bool *doubts)
{
    json_t *root = NULL, *note;
    size_t k;
    bool intact;
    char *path = apsm_path_join(job->part[d].folder, FOLDER_MANIFEST);
    *doubts = false;
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = manifest_json_read(job->ctx, path, &root, &intact);
    free(path);
    APSM_TRY(status);
    json_array_foreach(json_object_get(root, "notes"), k, note)
    {
        const char *aspect = json_string_value(json_object_get(note, "aspect"));
        const bool sought = json_is_true(json_object_get(note, "sought")); /* no doubt yet */
        if (aspect && strcmp(aspect, "pose") == 0 && !sought) *doubts = true;
    }
    if (json_object_get(json_object_get(root, "stages"), "initialize")) *doubts = false;
    json_decref(root);
    return APSM_OK;
}

/* ---- subjects as a whole ---- */

typedef struct wholes {
    size_t n;
    apsm_mesh *mesh; /* n */
    const apsm_mesh **meshes;
    char **name;
    size_t *end; /* parts: scratch */
} wholes;

static void wholes_free(wholes *w)
{
    for (size_t i = 0; w->mesh && w->name && i < w->n; i++) {
        apsm_mesh_free(&w->mesh[i]);
        free(w->name[i]);
    }
    free(w->mesh);
    free(w->meshes);
    free(w->name);
    free(w->end);
}

/* Part d of subject i, in the frame that its parts share; its vertices end before *end. */
static apsm_status add_part(const joint_around *a, size_t i, size_t d, apsm_mesh *whole,
                            size_t *end)
{
    const apsm_subject *s = joint_around_part(a, i, d);
    apsm_mesh mesh = { 0 };
    double place[16];
    if (!s || !s->groomed)
        return apsm_fail(a->job->ctx, APSM_ERR_STATE, "%s: has lost its %s; groom again",
                         a->job->subject[i].name, a->job->part[d].name);
    char *path = apsm_project_path(&a->project[d], s->groomed);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = joint_place(a->job->ctx, s, place);
    if (status == APSM_OK) status = apsm_read_mesh(a->job->ctx, path, &mesh);
    free(path);
    if (status == APSM_OK) {
        apsm_mesh_transform(&mesh, place);
        status = apsm_mesh_append(whole, &mesh);
        *end = whole->nv;
    }
    apsm_mesh_free(&mesh);
    return status;
}

/* Centre of the vertices first .. end - 1, and their root mean square distance from it. */
static double centre_of(const apsm_mesh *mesh, size_t first, size_t end, double c[3])
{
    double sum = 0;
    memset(c, 0, 3 * sizeof *c);
    for (size_t v = first; v < end; v++)
        vec3_add_scaled(c, 1.0 / (double)(end - first), mesh->V + 3 * v);
    for (size_t v = first; v < end; v++) sum += vec3_distance2(mesh->V + 3 * v, c);
    return sqrt(sum / (double)(end - first));
}

/* L: parts d are the vertices end[d - 1] .. end[d] - 1. */
static double spread_of_centres(const apsm_mesh *mesh, size_t n, const size_t *end)
{
    double mean[3] = { 0 }, c[3], sum = 0;
    for (size_t d = 0; d < n; d++) {
        (void)centre_of(mesh, d ? end[d - 1] : 0, end[d], c);
        vec3_add_scaled(mean, 1.0 / (double)n, c);
    }
    for (size_t d = 0; d < n; d++) {
        (void)centre_of(mesh, d ? end[d - 1] : 0, end[d], c);
        sum += vec3_distance2(c, mean) / (double)n;
    }
    return sqrt(sum);
}

static void tell_parts_apart(apsm_mesh *mesh, size_t n, const size_t *end)
{
    const double L = spread_of_centres(mesh, n, end);
    for (size_t d = 0; d < n && L > 0; d++) {
        const size_t first = d ? end[d - 1] : 0;
        double c[3], radius = centre_of(mesh, first, end[d], c);
        const double wanted = L * (1 - 0.5 * (double)d / (double)(n - 1));
        for (size_t v = first; v < end[d] && radius > 0; v++)
            for (size_t k = 0; k < 3; k++)
                mesh->V[3 * v + k] = c[k] + wanted / radius * (mesh->V[3 * v + k] - c[k]);
    }
}

static apsm_status wholes_make(const joint_around *a, wholes *w)
{
    const joint_job *job = a->job;
    w->n = job->complete;
    w->mesh = calloc(w->n + 1, sizeof *w->mesh);
    w->meshes = calloc(w->n + 1, sizeof *w->meshes);
    w->name = calloc(w->n + 1, sizeof *w->name);
    w->end = calloc(job->n, sizeof *w->end);
    if (!w->mesh || !w->meshes || !w->name || !w->end) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < w->n; i++) {
        const size_t room = strlen(job->subject[i].name) + 32;
        w->meshes[i] = &w->mesh[i];
        w->name[i] = malloc(room);
        if (!w->name[i]) return APSM_ERR_MEMORY;
        snprintf(w->name[i], room, "%s, all parts", job->subject[i].name);
        for (size_t d = 0; d < job->n; d++) APSM_TRY(add_part(a, i, d, &w->mesh[i], &w->end[d]));
        tell_parts_apart(&w->mesh[i], job->n, w->end);
    }
    return APSM_OK;
}

/* a->turn and a->told of the subjects whose own pose is clear; returns of how many. */
static size_t take_turns(const apsm_alignment *alignment, joint_around *a)
{
    size_t told = 0;
    for (size_t i = 0; i < alignment->n; i++) {
        a->told[i] = !alignment->ambiguous[i];
        told += a->told[i];
        for (size_t k = 0; k < 9; k++)
            a->turn[9 * i + k] = alignment->M[16 * i + 4 * (k / 3) + k % 3];
    }
    return told;
}

static apsm_status align_wholes(joint_around *a, size_t *told)
{
    const joint_job *job = a->job;
    wholes w = { 0 };
    apsm_alignment alignment = { 0 };
    apsm_align_options options = apsm_align_defaults();
    options.mirror_check = APSM_MIRROR_OFF;
    a->turn = malloc((9 * job->subjects + 1) * sizeof *a->turn);
    a->told = calloc(job->subjects + 1, sizeof *a->told);
    apsm_status status = a->turn && a->told ? wholes_make(a, &w) : APSM_ERR_MEMORY;
    if (status == APSM_OK)
        status = apsm_align_cohort(job->ctx, w.n, w.meshes, (const char *const *)w.name, &options,
                                   &alignment);
    if (status == APSM_OK) *told = take_turns(&alignment, a);
    apsm_alignment_free(&alignment);
    wholes_free(&w);
    return status;
}

apsm_status joint_orient(joint_around *a, bool *again)
{
    const joint_job *job = a->job;
    const char *align = joint_setting(job, "align");
    size_t doubtful = 0, told = 0;
    for (size_t d = 0; d < job->n; d++) {
        again[d] = false;
        if (align && strcmp(align, "none") == 0) continue;
        APSM_TRY(doubts_poses(job, d, &again[d]));
        doubtful += again[d];
    }
    if (doubtful == 0 || job->complete < 2) return APSM_OK;
    APSM_TRY(align_wholes(a, &told));
    apsm_log(job->ctx, APSM_LOG_INFO,
             "poses of %zu of %zu parts are in doubt: all parts together tell how %zu of %zu "
             "subjects are turned",
             doubtful, job->n, told, job->complete);
    for (size_t d = 0; d < job->n; d++) again[d] = again[d] && told > 0;
    return APSM_OK;
}

bool joint_around_turn(void *user, const char *path, double R[9])
{
    const joint_around *a = user;
    double place[16];
    const size_t i = joint_paths_find(&a->subject[a->of], path);
    const apsm_subject *own = i < a->job->complete ? joint_around_part(a, i, a->of) : NULL;
    if (!a->turn || !own || !a->told[i] || joint_place(NULL, own, place) != APSM_OK) return false;
    for (size_t r = 0; r < 3; r++)
        for (size_t c = 0; c < 3; c++) {
            R[3 * r + c] = 0;
            for (size_t k = 0; k < 3; k++)
                R[3 * r + c] += a->turn[9 * i + 3 * r + k] * place[4 * k + c];
        }
    return true;
}
