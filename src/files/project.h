/* project.h -- the project file of a model folder: ShapeWorks' .swproj (JSON) or .xlsx, read and
 * written so that both programs can work on one project.  What apsm does not know is kept. */
#ifndef APSM_FILES_PROJECT_H
#define APSM_FILES_PROJECT_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

struct json_t;

/* One shape.  Texts are owned (malloc), NULL where the project has none.  Paths are as in the file:
 * absolute or relative to the project's folder; apsm_project_path resolves them. */
typedef struct apsm_subject {
    char *name;            /* unique in the project, fit for a file name */
    char *shape;           /* input: mesh or segmentation */
    char *groomed;         /* groomed mesh */
    char *local_particles; /* in the coordinates of the groomed mesh */
    char *world_particles; /* aligned: procrustes * alignment * local */
    bool has_alignment, has_procrustes;
    double alignment[16], procrustes[16]; /* row-major 4 x 4; identity if there is none */
    bool mirrored;      /* column "mirrored": the groomed mesh is a mirror image */
    struct json_t *row; /* all columns as read; owned */
} apsm_subject;

typedef struct apsm_project {
    char *folder; /* of the project file; owned */
    char *domain; /* of the columns we use ("1"); owned */
    size_t n, capacity;
    apsm_subject *subjects;
    struct json_t *root;  /* all groups as read; owned */
    struct json_t *aside; /* shapes with excluded = yes, which are no subjects: [[place in the data,
                             row], ...]; owned, or NULL */
} apsm_project;

/* Whether a text says yes, as ShapeWorks understands it: yes, true or 1, in any case.  NULL: no. */
bool apsm_says_yes(const char *text);

/* Whether path ends in .swproj, .xlsx or .xml (of ShapeWorks before version 6, read only), in any
 * case. */
bool apsm_is_project_file(const char *path);

/* An empty project for the given folder.  apsm_project_free leaves {0}. */
apsm_status apsm_project_init(apsm_context *ctx, const char *folder,
                              apsm_project *project) APSM_NODISCARD;
void apsm_project_free(apsm_project *project);

/* Reads a .swproj or .xlsx of ours or ShapeWorks' (also with segmentation_, mesh_ columns,
 * 12-number transforms, numbers instead of strings).  The domain is that of apsm.domain, else the
 * first of the first subject; others are kept.  Shapes with excluded = yes are set aside with a
 * line in the log, and written in their place again.  A `mirrored` of another program's groomed
 * mesh is forgotten with a warning. Empty names become the stem of the first file given, equal
 * names get _2, _3 ... in their order.  Errors name the file and line:column or data[i].key.  Any
 * project is first zeroed; on failure it stays so. */
apsm_status apsm_project_read(apsm_context *ctx, const char *path,
                              apsm_project *project) APSM_NODISCARD;
/* Writes atomically, as .xlsx if path ends so (what cannot stand in a table is left out with a
 * warning), else as .swproj.  Known columns come from the structs, others from row. */
apsm_status apsm_project_write(apsm_context *ctx, const char *path,
                               const apsm_project *project) APSM_NODISCARD;

/* Adds a subject with the given name and shape path (copied; shape may be NULL) and identity
 * transforms; *added (may be NULL) is valid until the next call. */
apsm_status apsm_project_add(apsm_project *project, const char *name, const char *shape,
                             apsm_subject **added) APSM_NODISCARD;
/* Removes subject i; the order of the others stays. */
void apsm_project_remove(apsm_project *project, size_t i);
/* Makes names unique and fit for file names, as when reading; a changed one is logged. */
apsm_status apsm_project_fix_names(apsm_context *ctx, apsm_project *project) APSM_NODISCARD;
/* The same for a domain that is named; NULL: as above. */
apsm_status apsm_project_read_domain(apsm_context *ctx, const char *path, const char *domain,
                                     apsm_project *project) APSM_NODISCARD;
/* How many domains there are inputs of: those of the first of the subjects that have most. */
size_t apsm_project_domains(const apsm_project *project);
/* The name of the k-th of them (borrowed), in the order of the columns; NULL beyond the last. */
const char *apsm_project_domain_name(const apsm_project *project, size_t k);
/* Index of the subject of that name, or n. */
size_t apsm_project_find(const apsm_project *project, const char *name);

/* Replaces an owned text of a subject: *slot <- copy of value (NULL: none). */
apsm_status apsm_text_set(char **slot, const char *value) APSM_NODISCARD;
/* Any further column of a subject ("group_sex", "fixed"): borrowed text or NULL; value NULL
 * removes it.  Not for the columns that the struct holds. */
const char *apsm_subject_column(const apsm_subject *subject, const char *key);
apsm_status apsm_subject_set_column(apsm_subject *subject, const char *key,
                                    const char *value) APSM_NODISCARD;

/* Groups of options, "apsm" for our own, "optimize" for ShapeWorks': texts are borrowed.  get
 * returns NULL if there is none; pair i of 0..count-1 in file order. */
const char *apsm_project_get(const apsm_project *project, const char *group, const char *key);
apsm_status apsm_project_set(apsm_project *project, const char *group, const char *key,
                             const char *value) APSM_NODISCARD;
void apsm_project_clear(apsm_project *project, const char *group);
size_t apsm_project_count(const apsm_project *project, const char *group);
void apsm_project_pair(const apsm_project *project, const char *group, size_t i, const char **key,
                       const char **value);

/* Absolute or cwd-relative path of a path of the project; malloc'ed, NULL if stored is NULL or
 * out of memory. */
char *apsm_project_path(const apsm_project *project, const char *stored);
/* Moves the project to another folder: every path column is rewritten to reach the same file. */
apsm_status apsm_project_rebase(apsm_project *project, const char *folder) APSM_NODISCARD;

/* Tells through report, one line each, everything that is wrong with the project's files: missing
 * ones, particle files that cannot be read or differ in count, subjects with particles but no
 * groomed mesh, transforms that are no similarity.  Returns how many lines. */
typedef void (*apsm_problem_fn)(void *user, const char *line);
size_t apsm_project_check(apsm_context *ctx, const apsm_project *project, apsm_problem_fn report,
                          void *user);
/* The missing files alone that its rows name, of whatever column, but for those that a run makes.
 */
size_t apsm_project_check_inputs(apsm_context *ctx, const apsm_project *project,
                                 apsm_problem_fn report, void *user);

#ifdef __cplusplus
}
#endif
#endif
