#include "run/groomed.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/number.h"
#include "run/compare_inputs.h"
#include "run/turned.h"
#include "session/session.h"

enum { SIDES = 6 };

static void find_borders(const groom_inputs *in, apsm_borders *borders)
{
    for (size_t i = 0; i < in->list.n; i++) {
        apsm_borders *b = &borders[i];
        *b = (apsm_borders){ .known = in->is_mask[i] };
        for (int s = 0; s < SIDES; s++) {
            if (!(in->report[i].border & (1u << s))) continue;
            double *n = b->normal[b->n++];
            memcpy(n, in->report[i].border_normal[s], 3 * sizeof *n);
            if (in->reflected[i]) n[0] = -n[0]; /* apsm_reflect mirrors x */
        }
    }
}

void groomed_cohort_free(groomed_cohort *c)
{
    free(c->meshes);
    free(c->names);
    free(c->borders);
    *c = (groomed_cohort){ 0 };
}

apsm_status groomed_align(apsm_run *run, const groom_inputs *in, groomed_cohort *c,
                          apsm_alignment *alignment)
{
    const size_t n = in->list.n;
    c->meshes = calloc(n, sizeof *c->meshes);
    c->names = calloc(n, sizeof *c->names);
    c->borders = calloc(n, sizeof *c->borders);
    if (!c->meshes || !c->names || !c->borders) return APSM_ERR_MEMORY;
    c->options = run->options.align;
    APSM_TRY(groom_inputs_template(run, in, &c->options.template_index));
    for (size_t i = 0; i < n; i++) {
        c->meshes[i] = &in->mesh[i];
        c->names[i] = in->list.cases[i].name;
    }
    find_borders(in, c->borders);
    /* Asked to crop, all that looks cut off is, wherever the image ended. */
    if (run->options.cuts.cuts != APSM_CUTS_CROP) c->options.borders = c->borders;
    if (in->turn) return turned_align(run, in, c, alignment);
    return apsm_align_cohort(run->ctx, n, c->meshes, c->names, &c->options, alignment);
}

static json_t *border_json(unsigned border)
{
    static const char *const sides[SIDES] = { "-i", "+i", "-j", "+j", "-k", "+k" };
    json_t *list = json_array();
    for (int s = 0; s < SIDES; s++)
        if (border & (1u << s)) json_array_append_new(list, json_string(sides[s]));
    return list;
}

static int set_count(json_t *o, const char *key, size_t value)
{
    return json_object_set_new(o, key, json_integer((json_int_t)value));
}

/* What masks have and meshes have not. */
static int set_mask(json_t *o, const apsm_groom_report *r)
{
    int failed = set_count(o, "voxels", r->voxels);
    failed |= json_object_set_new(o, "mask_volume", json_real(r->mask_volume));
    failed |= json_object_set_new(o, "dice", json_real(r->dice));
    failed |= json_object_set_new(o, "departure", json_real(r->departure));
    failed |= json_object_set_new(o, "border", border_json(r->border));
    failed |= json_object_set_new(o, "closing", json_real(r->closing));
    failed |= json_object_set_new(o, "opening", json_real(r->opening));
    failed |= set_count(o, "opened_voxels", r->opened_voxels);
    failed |= set_count(o, "closed_voxels", r->closed_voxels);
    failed |= set_count(o, "cut_voxels", r->cut_voxels);
    failed |=
        set_count(o, "handles_before", (size_t)(r->closing > 0 ? r->handles_before : r->genus));
    failed |= set_count(o, "dropped_parts", r->dropped_parts);
    failed |= set_count(o, "dropped_voxels", r->dropped_voxels);
    return failed | set_count(o, "filled_voxels", r->filled_voxels);
}

static int set_mesh(json_t *o, const apsm_groom_report *r)
{
    int failed = set_count(o, "dropped_parts", r->dropped_components);
    failed |= json_object_set_new(o, "dropped_area", json_real(r->dropped_area));
    failed |= set_count(o, "holes", r->holes);
    failed |= set_count(o, "openings", r->openings);
    return failed | json_object_set_new(o, "largest_cap", json_real(r->largest_cap));
}

static json_t *shape_json(const groom_inputs *in, size_t i)
{
    const apsm_groom_report *r = &in->report[i];
    json_t *o =
        json_pack("{s:s, s:s, s:f, s:I, s:f}", "name", in->list.cases[i].name, "kind",
                  in->is_mask[i] ? "mask" : "mesh", "volume", apsm_mesh_volume(&in->mesh[i]),
                  "genus", (json_int_t)r->genus, "cropped", in->cropped[i]);
    if (!o) return NULL;
    if (in->kept) json_object_set_new(o, "kept", json_real(in->kept[i]));
    if (in->limits && in->limits[i])
        json_object_set_new(o, "constraints", json_string(in->limits[i]));
    if (!(in->is_mask[i] ? set_mask(o, r) : set_mesh(o, r))) return o;
    json_decref(o);
    return NULL;
}

json_t *groomed_json(const groom_inputs *in)
{
    json_t *list = json_array();
    int failed = !list;
    for (size_t i = 0; i < in->list.n && !failed; i++)
        failed = json_array_append_new(list, shape_json(in, i));
    if (!failed) return list;
    json_decref(list);
    return NULL;
}

static int add_note(json_t *notes, const char *shape, const char *text)
{
    return json_array_append_new(
        notes, json_pack("{s:s, s:s, s:s}", "shape", shape, "aspect", "input", "text", text));
}

/* What of a header had to be decided, a line each. */
static int add_lines(json_t *notes, const char *shape, const char *lines)
{
    int failed = 0;
    while (lines && *lines && !failed) {
        const size_t length = strcspn(lines, "\n");
        failed = json_array_append_new(notes, json_pack("{s:s, s:s, s:s%}", "shape", shape,
                                                        "aspect", "input", "text", lines, length));
        lines += length + (lines[length] == '\n');
    }
    return failed;
}

/* What grooming took away from a mask, or put to it. */
static int add_mask_notes(json_t *notes, const char *name, const apsm_groom_report *r)
{
    char text[160];
    int failed = 0;
    const double voxels = (double)r->voxels, given = voxels + (double)r->dropped_voxels;
    if (r->border)
        failed |= add_note(notes, name, "its mask touches the image's border and was closed there");
    if ((double)r->dropped_voxels > 0.01 * given) {
        apsm_print(text, sizeof text,
                   "%zu smaller part%s of its mask dropped, %.2g %% of its voxels",
                   r->dropped_parts, r->dropped_parts == 1 ? "" : "s",
                   100.0 * (double)r->dropped_voxels / given);
        failed |= add_note(notes, name, text);
    }
    if ((double)r->filled_voxels > 0.01 * voxels) {
        apsm_print(text, sizeof text, "cavities filled, %.2g %% of its voxels",
                   100.0 * (double)r->filled_voxels / voxels);
        failed |= add_note(notes, name, text);
    }
    if (r->opened_voxels > 0) {
        apsm_print(text, sizeof text, "opened by a radius of %.4g: %.2g %% of its voxels cut off",
                   r->opening, 100.0 * (double)r->opened_voxels / voxels);
        failed |= add_note(notes, name, text);
    }
    if (r->closed_voxels + r->cut_voxels > 0) {
        apsm_print(
            text, sizeof text,
            "handles or gaps narrower than %.4g closed: %.2g %% of its voxels filled, %.2g %% "
            "cut",
            2.0 * r->closing, 100.0 * (double)r->closed_voxels / voxels,
            100.0 * (double)r->cut_voxels / voxels);
        failed |= add_note(notes, name, text);
    }
    return failed;
}

typedef struct noting {
    json_t *notes;
    int failed;
} noting;

static void note_same(void *user, const apsm_input_case *first, const apsm_input_case *again)
{
    noting *n = user;
    n->failed |= groomed_note_same(n->notes, again->name, first->name);
}

static void note_unlike(void *user, const char *shape, const char *text)
{
    noting *n = user;
    n->failed |= add_note(n->notes, shape, text);
}

int groomed_note_same(json_t *notes, const char *shape, const char *as)
{
    json_t *text = json_sprintf("the same file as %s, byte for byte; a shape twice?", as);
    return json_array_append_new(
        notes, json_pack("{s:s, s:s, s:o}", "shape", shape, "aspect", "input", "text", text));
}

int groomed_add_notes(const groom_inputs *in, json_t *notes)
{
    noting same = { notes, 0 };
    if (compare_files(in, note_same, &same) != APSM_OK) return -1;
    if (compare_sizes(in, note_unlike, &same) != APSM_OK) return -1;
    int failed = same.failed;
    for (size_t i = 0; i < in->list.n && !failed; i++) {
        char text[160];
        const char *name = in->list.cases[i].name;
        failed |= add_lines(notes, name, in->notes[i]);
        failed |= add_mask_notes(notes, name, &in->report[i]);
        if (in->report[i].largest_cap > 0.01) {
            apsm_print(text, sizeof text,
                       "an opening was closed with a lid of %.2g %% of the surface",
                       100.0 * in->report[i].largest_cap);
            failed |= add_note(notes, name, text);
        }
        if (!(in->cropped[i] > 0.0)) continue;
        apsm_print(text, sizeof text,
                   "cropped to what all shapes hold: %.2g %% of its surface taken away",
                   100.0 * in->cropped[i]);
        failed |= add_note(notes, name, text);
    }
    return failed;
}
