/* "tibia=_tib,talus=_tal" or "tibia=1,talus=2+3": what the parts are. */
#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "assemble/job.h"
#include "files/files.h"
#include "files/project.h"

enum { PARTS_MOST = 64, NAME_MOST = 40 };

static apsm_status refuse(const joint_job *job, const char *why)
{
    return apsm_fail(
        job->ctx, APSM_ERR_ARG,
        "--parts '%s': %s; write --parts tibia=_tibia,talus=_talus (part=what its file "
        "names have) or tibia=1,talus=2 (part=label)",
        job->settings->parts, why);
}

static bool good_name(const char *name)
{
    const size_t length = strlen(name);
    if (length == 0 || length > NAME_MOST) return false;
    for (const char *c = name; *c; c++)
        if (!isalnum((unsigned char)*c) && *c != '_' && *c != '-') return false;
    return true;
}

static bool is_labels(const char *what)
{
    bool digit = false;
    for (const char *c = what; *c; c++) {
        if (*c == '+' && !digit) return false;
        if (*c != '+' && !isdigit((unsigned char)*c)) return false;
        digit = *c != '+';
    }
    return digit;
}

/* "2+3" to "2,3", as --label has it. */
static void plus_to_comma(char *what)
{
    for (char *c = what; *c; c++)
        if (*c == '+') *c = ',';
}

apsm_status joint_add_part(joint_job *job, const char *name, const char *what)
{
    if (job->n == PARTS_MOST)
        return apsm_fail(job->ctx, APSM_ERR_ARG, "more than 64 parts a subject");
    if (!good_name(name))
        return apsm_fail(job->ctx, APSM_ERR_ARG,
                         "'%s' is no name of a part: letters, digits, _ and -, 40 at most", name);
    joint_part *part = &job->part[job->n++];
    APSM_TRY(apsm_text_set(&part->name, name));
    APSM_TRY(apsm_text_set(&part->what, what));
    char *parts = apsm_path_join(job->settings->run.folder, "parts");
    part->folder = parts ? apsm_path_join(parts, name) : NULL;
    free(parts);
    return part->folder ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status add_part(joint_job *job, char *text)
{
    char *equals = strchr(text, '=');
    if (!equals || !equals[1]) return refuse(job, "a part without '='");
    *equals = '\0';
    for (size_t d = 0; d < job->n; d++)
        if (strcasecmp(job->part[d].name, text) == 0) return refuse(job, "two parts of one name");
    return joint_add_part(job, text, equals + 1);
}

static apsm_status split(joint_job *job, char *text)
{
    char *rest = NULL;
    for (char *one = strtok_r(text, ",", &rest); one; one = strtok_r(NULL, ",", &rest))
        APSM_TRY(add_part(job, one));
    if (job->n < 2 && !job->fits) return refuse(job, "fewer than two parts");
    size_t labels = 0;
    for (size_t d = 0; d < job->n; d++) labels += is_labels(job->part[d].what);
    if (labels > 0 && labels < job->n) return refuse(job, "labels and names of files are mixed");
    job->by_label = labels > 0;
    for (size_t d = 0; d < job->n && job->by_label; d++) plus_to_comma(job->part[d].what);
    if (job->by_label && joint_setting(job, "labels"))
        return refuse(job, "--label is given too, though the parts are labels");
    return APSM_OK;
}

static apsm_status parse_align(joint_job *job)
{
    const char *align = job->settings->align;
    job->alignment = APSM_JOINT_GLOBAL;
    if (!align || strcmp(align, "global") == 0) return APSM_OK;
    job->alignment = APSM_JOINT_APART;
    if (strcmp(align, "apart") == 0) return APSM_OK;
    job->alignment = APSM_JOINT_BY;
    for (job->align_by = 0; job->align_by < job->n; job->align_by++)
        if (strcmp(job->part[job->align_by].name, align) == 0) return APSM_OK;
    return apsm_fail(job->ctx, APSM_ERR_ARG,
                     "--align-parts '%s': give global, apart, or the name of a part", align);
}

/* Without --parts: the domains of a project. */
static apsm_status take_domains(joint_job *job)
{
    const apsm_run_settings *s = &job->settings->run;
    apsm_project project = { 0 };
    if (s->n_inputs != 1 || !apsm_is_project_file(s->inputs[0]))
        return apsm_fail(job->ctx, APSM_ERR_ARG, "no parts given; say --parts NAME=WHAT,NAME=WHAT");
    APSM_TRY(apsm_project_read(job->ctx, s->inputs[0], &project));
    job->by_project = true;
    apsm_status status = APSM_OK;
    const char *domain;
    for (size_t d = 0; status == APSM_OK && (domain = apsm_project_domain_name(&project, d)); d++)
        status = joint_add_part(job, domain, domain);
    apsm_project_free(&project);
    return status;
}

static apsm_status take_parts(joint_job *job)
{
    char *text = strdup(job->settings->parts);
    const apsm_status status = text ? split(job, text) : APSM_ERR_MEMORY;
    free(text);
    return status;
}

apsm_status joint_parse(joint_job *job)
{
    job->part = calloc(PARTS_MOST, sizeof *job->part);
    if (!job->part) return APSM_ERR_MEMORY;
    APSM_TRY(job->settings->parts ? take_parts(job) : take_domains(job));
    return parse_align(job);
}

const char *joint_setting(const joint_job *job, const char *key)
{
    const apsm_run_settings *s = &job->settings->run;
    const char *value = NULL;
    for (size_t k = 0; k < s->n_set; k++)
        if (strcmp(s->set[k][0], key) == 0) value = s->set[k][1];
    return value;
}
