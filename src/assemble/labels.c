/* Parts that are labels of one segmentation: which subjects have which. */
#include <stdlib.h>

#include "apsm/formats.h"
#include "assemble/job.h"

static bool has(const apsm_labels *labels, int32_t value)
{
    for (size_t k = 0; k < labels->n; k++)
        if (labels->label[k] == value) return true;
    return false;
}

/* Whether a voxel of any layer has one of the labels; an image of a function has all there are. */
static bool shows(const apsm_volume *v, const apsm_labels *labels)
{
    const size_t voxels = v->n[0] * v->n[1] * v->n[2] * (v->layers > 1 ? v->layers : 1);
    int32_t last = 0; /* runs of one value are looked up once */
    if (!v->label) return true;
    for (size_t k = 0; k < voxels; k++) {
        if (v->label[k] == last) continue;
        last = v->label[k];
        if (has(labels, last)) return true;
    }
    return false;
}

static apsm_status read(const joint_job *job, const apsm_input_case *c, apsm_volume *volume)
{
    return c->kind == APSM_INPUT_DICOM ? apsm_read_dicom(job->ctx, c->path, volume)
                                       : apsm_read_volume(job->ctx, c->path, volume);
}

static void labels_free(size_t n, apsm_labels *labels)
{
    for (size_t d = 0; d < n; d++) apsm_labels_free(&labels[d]);
    free(labels);
}

/* No label may be two parts'. */
static apsm_status parse_all(const joint_job *job, apsm_labels *labels)
{
    for (size_t d = 0; d < job->n; d++) {
        APSM_TRY(apsm_labels_parse(job->ctx, job->part[d].what, &labels[d]));
        for (size_t e = 0; e < d; e++)
            for (size_t k = 0; k < labels[e].n; k++)
                if (has(&labels[d], labels[e].label[k]))
                    return apsm_fail(job->ctx, APSM_ERR_ARG,
                                     "--parts '%s': label %d is both %s and %s; give every part "
                                     "labels of its own",
                                     job->settings->parts, (int)labels[e].label[k],
                                     job->part[e].name, job->part[d].name);
    }
    return APSM_OK;
}

/* Of new subjects an image that cannot be read, or has no part at all, is left to its fit to tell
 * of. */
static apsm_status look_for_parts(joint_job *job, size_t i, const apsm_labels *labels)
{
    joint_subject *s = &job->subject[i];
    const size_t k = s->input[0];
    size_t shown = 0;
    apsm_volume volume;
    const apsm_status status = read(job, &job->list.cases[k], &volume);
    if (status != APSM_OK && job->fits && status != APSM_ERR_MEMORY) return APSM_OK;
    APSM_TRY(status);
    for (size_t d = 0; d < job->n; d++) {
        const bool there = shows(&volume, &labels[d]);
        shown += there;
        if (!there) s->input[d] = APSM_NO_CASE;
    }
    apsm_volume_free(&volume);
    for (size_t d = 0; d < job->n && job->fits && shown == 0; d++) s->input[d] = k;
    return APSM_OK;
}

apsm_status joint_find_labels(joint_job *job)
{
    apsm_labels *labels = calloc(job->n, sizeof *labels);
    apsm_status status = labels ? parse_all(job, labels) : APSM_ERR_MEMORY;
    for (size_t i = 0; i < job->subjects && status == APSM_OK; i++)
        status = look_for_parts(job, i, labels);
    if (labels) labels_free(job->n, labels);
    return status;
}
