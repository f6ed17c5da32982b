/* Which input is which part of which subject.  By labels every input is a subject with all parts;
 * by names, what is left of a name when the part's expression is taken out is the subject's. */
#include <regex.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "assemble/job.h"
#include "files/files.h"
#include "files/project.h"
#include "run/source.h"

static bool is_separator(char c)
{
    return c != '\0' && strchr("_-. ", c) != NULL;
}

/* name without the bytes from..to, and without the separators that then stand at an end or doubled.
 */
static char *without(const char *name, size_t from, size_t to)
{
    const size_t length = strlen(name);
    char *rest = malloc(length + 1), *at = rest;
    if (!rest) return NULL;
    memcpy(rest, name, from);
    at += from;
    while (at > rest && is_separator(at[-1]) && (to == length || is_separator(name[to]))) at--;
    if (at == rest)
        while (is_separator(name[to])) to++;
    strcpy(at, name + to);
    return rest;
}

/* One case, as a part of a subject. */
typedef struct membership {
    char *name; /* of the subject; owned */
    size_t part, input;
} membership;

static int by_subject(const void *a, const void *b)
{
    const membership *x = a, *y = b;
    const int order = strcmp(x->name, y->name);
    if (order != 0) return order;
    if (x->part != y->part) return x->part < y->part ? -1 : 1;
    return x->input < y->input ? -1 : x->input > y->input;
}

static apsm_status add_subject(joint_job *job, const char *name, joint_subject **subject)
{
    *subject = &job->subject[job->subjects++];
    **subject = (joint_subject){ strdup(name), malloc(job->n * sizeof(size_t)) };
    if (!(*subject)->name || !(*subject)->input) return APSM_ERR_MEMORY;
    for (size_t d = 0; d < job->n; d++) (*subject)->input[d] = APSM_NO_CASE;
    return APSM_OK;
}

/* Sorted memberships to subjects. */
static apsm_status collect(joint_job *job, const membership *m, size_t n)
{
    joint_subject *subject = NULL;
    job->subject = calloc(n + 1, sizeof *job->subject);
    if (!job->subject) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < n; k++) {
        if (k == 0 || strcmp(m[k - 1].name, m[k].name) != 0)
            APSM_TRY(add_subject(job, m[k].name, &subject));
        else if (m[k - 1].part == m[k].part)
            return apsm_fail(job->ctx, APSM_ERR_ARG,
                             "%s and %s are both the %s of subject %s; rename one, or leave it out "
                             "by --exclude",
                             job->list.cases[m[k - 1].input].path, job->list.cases[m[k].input].path,
                             job->part[m[k].part].name, m[k].name);
        subject->input[m[k].part] = m[k].input;
    }
    return APSM_OK;
}

/* The one part whose expression a case's name has, and the subject that is left of the name. */
static apsm_status place_case(const joint_job *job, const regex_t *regex, size_t k, membership *m)
{
    const apsm_input_case *c = &job->list.cases[k];
    regmatch_t where = { 0 };
    *m = (membership){ .part = job->n, .input = k };
    for (size_t d = 0; d < job->n; d++) {
        regmatch_t at;
        if (regexec(&regex[d], c->name, 1, &at, 0) != 0 || at.rm_eo == at.rm_so) continue;
        if (m->part < job->n)
            return apsm_fail(job->ctx, APSM_ERR_ARG,
                             "%s: is both %s='%s' and %s='%s'; make one expression narrower",
                             c->path, job->part[m->part].name, job->part[m->part].what,
                             job->part[d].name, job->part[d].what);
        m->part = d;
        where = at;
    }
    if (m->part == job->n)
        return apsm_fail(job->ctx, APSM_ERR_ARG,
                         "%s: is none of the parts of --parts; widen an expression, or leave the "
                         "file out by --exclude",
                         c->path);
    m->name = without(c->name, (size_t)where.rm_so, (size_t)where.rm_eo);
    if (!m->name) return APSM_ERR_MEMORY;
    if (*m->name) return APSM_OK;
    return apsm_fail(job->ctx, APSM_ERR_ARG,
                     "%s: part %s='%s' leaves nothing of its name for the subject; make the "
                     "expression narrower",
                     c->path, job->part[m->part].name, job->part[m->part].what);
}

static apsm_status compile(joint_job *job, regex_t *regex, size_t *done)
{
    for (*done = 0; *done < job->n; ++*done) {
        const joint_part *part = &job->part[*done];
        char why[160];
        const int error = regcomp(&regex[*done], part->what, REG_EXTENDED);
        if (error == 0) continue;
        regerror(error, &regex[*done], why, sizeof why);
        return apsm_fail(job->ctx, APSM_ERR_ARG,
                         "--parts %s='%s': %s; give a POSIX extended regular expression",
                         part->name, part->what, why);
    }
    return APSM_OK;
}

static apsm_status place_all(joint_job *job, const regex_t *regex)
{
    const size_t n = job->list.n;
    membership *m = calloc(n + 1, sizeof *m);
    if (!m) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < n && status == APSM_OK; k++) status = place_case(job, regex, k, &m[k]);
    if (status == APSM_OK) {
        qsort(m, n, sizeof *m, by_subject);
        status = collect(job, m, n);
    }
    for (size_t k = 0; k < n; k++) free(m[k].name);
    free(m);
    return status;
}

static apsm_status group_by_name(joint_job *job)
{
    regex_t *regex = calloc(job->n, sizeof *regex);
    size_t compiled = 0;
    if (!regex) return APSM_ERR_MEMORY;
    apsm_status status = compile(job, regex, &compiled);
    if (status == APSM_OK) status = place_all(job, regex);
    for (size_t d = 0; d < compiled; d++) regfree(&regex[d]);
    free(regex);
    return status;
}

static apsm_status group_by_label(joint_job *job)
{
    job->subject = calloc(job->list.n + 1, sizeof *job->subject);
    if (!job->subject) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < job->list.n; k++) {
        joint_subject *subject;
        if (job->list.cases[k].kind == APSM_INPUT_MESH)
            return apsm_fail(job->ctx, APSM_ERR_ARG,
                             "%s: is a mesh, which has no labels; name the parts by their files, "
                             "--parts tibia=_tibia,...",
                             job->list.cases[k].path);
        APSM_TRY(add_subject(job, job->list.cases[k].name, &subject));
        for (size_t d = 0; d < job->n; d++) subject->input[d] = k;
    }
    return joint_find_labels(job);
}

static size_t missing(const joint_job *job, const joint_subject *s)
{
    size_t n = 0;
    for (size_t d = 0; d < job->n; d++) n += s->input[d] == APSM_NO_CASE;
    return n;
}

/* Complete subjects first; either are in the order of their names already. */
static apsm_status complete_first(joint_job *job)
{
    joint_subject *sorted = malloc((job->subjects + 1) * sizeof *sorted);
    if (!sorted) return APSM_ERR_MEMORY;
    size_t n = 0;
    for (size_t i = 0; i < job->subjects; i++)
        if (missing(job, &job->subject[i]) == 0) sorted[n++] = job->subject[i];
    job->complete = n;
    for (size_t i = 0; i < job->subjects; i++)
        if (missing(job, &job->subject[i]) > 0) sorted[n++] = job->subject[i];
    free(job->subject);
    job->subject = sorted;
    return APSM_OK;
}

static void tell_incomplete(const joint_job *job)
{
    for (size_t i = job->complete; i < job->subjects; i++) {
        char parts[256] = "";
        for (size_t d = 0; d < job->n; d++)
            if (job->subject[i].input[d] == APSM_NO_CASE)
                snprintf(parts + strlen(parts), sizeof parts - strlen(parts), "%s%.*s",
                         *parts ? ", " : "", 40, job->part[d].name);
        apsm_log(job->ctx, APSM_LOG_WARNING,
                 "%s: has no %s; it is in the models of its parts, not in that of the joint",
                 job->subject[i].name, parts);
    }
}

static apsm_status check_counts(joint_job *job)
{
    enum { LEAST = 3 };
    for (size_t d = 0; d < job->n; d++) {
        size_t n = 0;
        for (size_t i = 0; i < job->subjects; i++) n += job->subject[i].input[d] != APSM_NO_CASE;
        if (n == 0)
            return apsm_fail(job->ctx, APSM_ERR_ARG,
                             "--parts %s='%s' matches none of the %zu inputs", job->part[d].name,
                             job->part[d].what, job->list.n);
    }
    if (job->complete >= LEAST) return APSM_OK;
    return apsm_fail(
        job->ctx, APSM_ERR_ARG,
        "only %zu subjects have all %zu parts, too few for a model; look at the names: "
        "subject %s of %s",
        job->complete, job->n, job->subject[0].name, job->list.cases[0].path);
}

/* ---- by the domains of a project ---- */

static apsm_status add_input(joint_job *job, const apsm_project *p, size_t i, size_t d)
{
    static const char *const prefixes[] = { "shape_", "segmentation_", "mesh_" };
    const char *stored = NULL;
    for (size_t k = 0; k < 3 && !stored; k++) {
        char key[256];
        snprintf(key, sizeof key, "%s%s", prefixes[k], job->part[d].name);
        stored = apsm_subject_column(&p->subjects[i], key);
    }
    if (!stored || !*stored) return APSM_OK;
    apsm_input_case *c = &job->list.cases[job->list.n];
    *c = (apsm_input_case){ .name = strdup(p->subjects[i].name),
                            .path = apsm_project_path(p, stored) };
    if (!c->name || !c->path) return APSM_ERR_MEMORY;
    job->subject[i].input[d] = job->list.n++;
    return APSM_OK;
}

static apsm_status group_by_domain(joint_job *job)
{
    apsm_project p = { 0 };
    APSM_TRY(apsm_project_read(job->ctx, job->settings->run.inputs[0], &p));
    apsm_status status = APSM_OK;
    job->subject = calloc(p.n + 1, sizeof *job->subject);
    job->list.cases = calloc(p.n * job->n + 1, sizeof *job->list.cases);
    if (status == APSM_OK && (!job->subject || !job->list.cases)) status = APSM_ERR_MEMORY;
    for (size_t i = 0; i < p.n && status == APSM_OK; i++) {
        joint_subject *subject;
        status = add_subject(job, p.subjects[i].name, &subject);
        for (size_t d = 0; d < job->n && status == APSM_OK; d++) status = add_input(job, &p, i, d);
    }
    apsm_project_free(&p);
    return status;
}

static apsm_status group_inputs(joint_job *job)
{
    const apsm_run_settings *s = &job->settings->run;
    const apsm_input_choice choice = { .n = s->n_inputs,
                                       .inputs = s->inputs,
                                       .exclude = joint_setting(job, "exclude"),
                                       .reflect_match = joint_setting(job, "reflect_match"),
                                       .pattern = joint_setting(job, "pattern") };
    APSM_TRY(apsm_input_choose(job->ctx, &choice, &job->list));
    return job->by_label ? group_by_label(job) : group_by_name(job);
}

apsm_status joint_group(joint_job *job)
{
    APSM_TRY(job->by_project ? group_by_domain(job) : group_inputs(job));
    APSM_TRY(complete_first(job));
    if (job->fits) return APSM_OK;
    APSM_TRY(check_counts(job));
    tell_incomplete(job);
    return APSM_OK;
}

void joint_job_free(joint_job *job)
{
    for (size_t d = 0; job->part && d < job->n; d++) {
        free(job->part[d].name);
        free(job->part[d].what);
        free(job->part[d].folder);
    }
    for (size_t i = 0; i < job->subjects; i++) {
        free(job->subject[i].name);
        free(job->subject[i].input);
    }
    free(job->part);
    free(job->subject);
    apsm_input_list_free(&job->list);
}
