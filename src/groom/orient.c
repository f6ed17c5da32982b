/* Consistent orientation and connected parts of a surface whose edges have one or two faces. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"
#include "groom/repair.h"

/* Neighbours across edges, whichever way these run: twin (3 nf).  At most two faces an edge. */
static apsm_status neighbours(const apsm_mesh *m, uint32_t *twin)
{
    /* Half-edges of each lower end in a list; valences are small. */
    uint32_t *head = malloc(m->nv * sizeof *head), *next = malloc(3 * m->nf * sizeof *next);
    const bool ok = head && next;
    if (ok) {
        memset(head, 0xff, m->nv * sizeof *head);
        memset(twin, 0xff, 3 * m->nf * sizeof *twin);
        for (uint32_t h = 0; h < 3 * m->nf; h++) {
            const uint32_t a = m->F[h], b = m->F[h % 3 == 2 ? h - 2 : h + 1];
            const uint32_t lo = a < b ? a : b, hi = a < b ? b : a;
            uint32_t g = head[lo];
            for (; g != APSM_NONE; g = next[g]) {
                const uint32_t p = m->F[g], q = m->F[g % 3 == 2 ? g - 2 : g + 1];
                if ((p < q ? q : p) == hi) break;
            }
            if (g != APSM_NONE) {
                twin[h] = g;
                twin[g] = h;
            } else {
                next[h] = head[lo];
                head[lo] = h;
            }
        }
    }
    free(head);
    free(next);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}

static bool runs_against(const apsm_mesh *m, uint32_t h, uint32_t g)
{
    return m->F[h] != m->F[g];
}

static apsm_status refuse_one_sided(const repair *r, uint32_t h)
{
    const double *x = r->mesh.V + 3 * r->mesh.F[h];
    return apsm_fail(r->ctx, APSM_ERR_GEOMETRY,
                     "%s: the surface has one side only (like a Moebius band), seen near %.6g %.6g "
                     "%.6g; mend it there by hand",
                     r->name, x[0], x[1], x[2]);
}

/* Walks the part of face `seed`: turn[f] = 1 or 2 (as it is, or turned).  queue (nf) scratch;
 * *n faces are left in it. */
static apsm_status walk(const repair *r, const uint32_t *twin, uint32_t seed, unsigned char *turn,
                        uint32_t *queue, size_t *n)
{
    *n = 0;
    queue[(*n)++] = seed;
    turn[seed] = 1;
    for (size_t i = 0; i < *n; i++)
        for (uint32_t h = 3 * queue[i]; h < 3 * queue[i] + 3; h++) {
            const uint32_t g = twin[h];
            if (g == APSM_NONE) continue;
            const unsigned char want =
                runs_against(&r->mesh, h, g) ? turn[queue[i]] : (unsigned char)(3 - turn[queue[i]]);
            if (turn[g / 3] == 0) {
                turn[g / 3] = want;
                queue[(*n)++] = g / 3;
            } else if (turn[g / 3] != want) {
                return refuse_one_sided(r, h);
            }
        }
    return APSM_OK;
}

/* Turns the smaller area of the part over. */
static void turn_minority(repair *r, const unsigned char *turn, const uint32_t *queue, size_t n)
{
    double area[3] = { 0.0, 0.0, 0.0 };
    for (size_t i = 0; i < n; i++) area[turn[queue[i]]] += face_area(&r->mesh, queue[i]);
    const unsigned char minority = area[2] <= area[1] ? 2 : 1;
    for (size_t i = 0; i < n; i++) {
        if (turn[queue[i]] != minority) continue;
        uint32_t *F = r->mesh.F + 3 * queue[i];
        const uint32_t t = F[1];
        F[1] = F[2];
        F[2] = t;
        r->report->flipped_faces++;
    }
}

apsm_status repair_orient(repair *r)
{
    apsm_mesh *m = &r->mesh;
    uint32_t *twin = malloc(3 * m->nf * sizeof *twin), *queue = malloc(m->nf * sizeof *queue);
    unsigned char *turn = calloc(m->nf, 1);
    apsm_status status = twin && queue && turn ? neighbours(m, twin) : APSM_ERR_MEMORY;
    for (uint32_t f = 0; f < m->nf && status == APSM_OK; f++) {
        size_t n;
        if (turn[f]) continue;
        status = walk(r, twin, f, turn, queue, &n);
        if (status == APSM_OK) turn_minority(r, turn, queue, n);
    }
    free(twin);
    free(queue);
    free(turn);
    return status;
}

/* A connected part. */
typedef struct part {
    uint32_t root;
    double area, volume; /* volume: six times, about the mesh's first vertex */
    double lo[3], hi[3];
} part;

static void add_face(const apsm_mesh *m, uint32_t f, part *p)
{
    double n[3], x[3];
    face_vector(m, f, n);
    vec3_sub(m->V + 3 * m->F[3 * f], m->V, x);
    p->area += 0.5 * vec3_norm(n);
    p->volume += vec3_dot(n, x);
    for (size_t k = 0; k < 3; k++)
        for (size_t c = 0; c < 3; c++) {
            const double y = m->V[3 * m->F[3 * f + k] + c];
            p->lo[c] = fmin(p->lo[c], y);
            p->hi[c] = fmax(p->hi[c], y);
        }
}

static bool inside_box(const part *p, const part *q)
{
    for (int c = 0; c < 3; c++)
        if (p->lo[c] < q->lo[c] || p->hi[c] > q->hi[c]) return false;
    return true;
}

/* The part kept: the one of largest area, unless it lies within the box of another of more volume
 * (the wall of a cavity can have more area than the body around it). */
static size_t main_part(const part *list, size_t n)
{
    size_t best = 0;
    for (size_t i = 1; i < n; i++)
        if (list[i].area > list[best].area) best = i;
    for (size_t i = 0; i < n; i++)
        if (i != best && inside_box(&list[best], &list[i]) &&
            fabs(list[i].volume) > fabs(list[best].volume))
            best = i;
    return best;
}

/* Notes what is dropped; parts inside the main one are cavities and lose nothing of it. */
static apsm_status judge_parts(repair *r, const part *list, size_t n, size_t best)
{
    double total = 0.0, lost = 0.0, dropped = 0.0;
    size_t second = best;
    for (size_t i = 0; i < n; i++) {
        total += list[i].area;
        if (i == best) continue;
        dropped += list[i].area;
        if (inside_box(&list[i], &list[best]) && list[i].volume < 0.0) continue;
        lost += list[i].area;
        if (second == best || list[i].area > list[second].area) second = i;
    }
    r->report->dropped_components += n - 1;
    r->report->dropped_area = dropped / total;
    if (n > 1 && (!r->opt->largest_component || lost > r->opt->max_drop_share * total)) {
        const double *at = r->mesh.V + 3 * r->mesh.F[3 * list[second].root];
        return apsm_fail(r->ctx, APSM_ERR_GEOMETRY,
                         "%s: %zu separate parts; those beside the largest have %.1f %% of the "
                         "area (the next one near %.6g %.6g %.6g); keep one part, or make a domain "
                         "of each",
                         r->name, n, 100.0 * lost / total, at[0], at[1], at[2]);
    }
    return APSM_OK;
}

/* Fills list with the parts, set of faces each, in the order of their first faces. */
static size_t gather_parts(const apsm_mesh *m, uint32_t *set, const uint32_t *twin, uint32_t *index,
                           part *list)
{
    size_t n = 0;
    sets_init(set, m->nf);
    for (uint32_t h = 0; h < 3 * m->nf; h++)
        if (twin[h] != APSM_NONE) sets_join(set, h / 3, twin[h] / 3);
    for (uint32_t f = 0; f < m->nf; f++) {
        if (sets_root(set, f) == f) {
            index[f] = (uint32_t)n;
            list[n++] = (part){ .root = f,
                                .lo = { INFINITY, INFINITY, INFINITY },
                                .hi = { -INFINITY, -INFINITY, -INFINITY } };
        }
        add_face(m, f, &list[index[sets_root(set, f)]]);
    }
    return n;
}

apsm_status repair_parts(repair *r)
{
    apsm_mesh *m = &r->mesh;
    uint32_t *twin = malloc(3 * m->nf * sizeof *twin), *set = malloc(m->nf * sizeof *set);
    uint32_t *index = malloc(m->nf * sizeof *index);
    part *list = malloc(m->nf * sizeof *list);
    unsigned char *drop = calloc(m->nf, 1);
    apsm_status status =
        twin && set && index && list && drop ? neighbours(m, twin) : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        const size_t n = gather_parts(m, set, twin, index, list);
        const size_t best = main_part(list, n);
        status = judge_parts(r, list, n, best);
        if (n > 1 && status == APSM_OK) {
            for (uint32_t f = 0; f < m->nf; f++)
                if (sets_root(set, f) != list[best].root) {
                    drop[f] = 1;
                    r->report->dropped_faces++;
                }
            status = repair_drop(m, drop);
        }
    }
    free(twin);
    free(set);
    free(index);
    free(list);
    free(drop);
    return status;
}
