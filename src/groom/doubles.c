/* Faces that degenerate or occur twice.
 *
 * Of equal faces that face the same way one stays.  A pair back to back encloses nothing, as in a
 * fin, or in the wall where two bodies meet: it goes altogether.  But where it closes a gap that
 * the other faces leave, a surface was written on both sides: one of the two stays.  Pairs that
 * share edges are decided together, as a patch, by the edges at which it ends:
 *
 *   closing   one face beside the patch: without it there would be a hole
 *   others    none (the patch ends in the open), or two and more (the surface passes by)
 *
 * It stays if more of its edges are closing; and where all faces are paired, all stay once. */
#include <stdlib.h>
#include <string.h>

#include "groom/repair.h"

/* A face by its corners in ascending order. */
typedef struct named_face {
    uint32_t corner[3], face;
    int even; /* 1 if the corners were an even permutation of the ascending order, else -1 */
} named_face;

static named_face name_face(const uint32_t *F, uint32_t f)
{
    named_face n = { { F[3 * f], F[3 * f + 1], F[3 * f + 2] }, f, 1 };
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < 2; k++)
            if (n.corner[k] > n.corner[k + 1]) {
                const uint32_t t = n.corner[k];
                n.corner[k] = n.corner[k + 1];
                n.corner[k + 1] = t;
                n.even = -n.even;
            }
    return n;
}

static int by_corners(const void *a, const void *b)
{
    const named_face *p = a, *q = b;
    for (int k = 0; k < 3; k++)
        if (p->corner[k] != q->corner[k]) return p->corner[k] < q->corner[k] ? -1 : 1;
    return p->face < q->face ? -1 : p->face > q->face;
}

/* What becomes of a face; of a pair back to back the first is PAIRED until its patch is decided. */
enum { STAYS, GOES, PAIRED };

static void mark_duplicates(const named_face *list, size_t n, unsigned char *fate)
{
    for (size_t i = 0, end; i < n; i = end) {
        int balance = 0;
        for (end = i; end < n && !memcmp(list[end].corner, list[i].corner, sizeof list[i].corner);
             end++)
            balance += list[end].even;
        bool kept = false;
        for (size_t k = i; k < end; k++) {
            const bool faces_so = balance == 0 || (balance > 0) == (list[k].even > 0);
            fate[list[k].face] = kept || !faces_so ? GOES : balance == 0 ? PAIRED : STAYS;
            kept |= faces_so;
        }
    }
}

/* An edge of a face by its ends in ascending order. */
typedef struct face_edge {
    uint32_t lo, hi, face;
} face_edge;

static int by_ends(const void *a, const void *b)
{
    const face_edge *p = a, *q = b;
    if (p->lo != q->lo) return p->lo < q->lo ? -1 : 1;
    if (p->hi != q->hi) return p->hi < q->hi ? -1 : 1;
    return p->face < q->face ? -1 : p->face > q->face;
}

static size_t list_edges(const apsm_mesh *m, const unsigned char *fate, face_edge *edge)
{
    size_t n = 0;
    for (uint32_t h = 0; h < 3 * m->nf; h++) {
        const uint32_t a = m->F[h], b = m->F[h % 3 == 2 ? h - 2 : h + 1];
        if (fate[h / 3] != GOES) edge[n++] = (face_edge){ a < b ? a : b, a < b ? b : a, h / 3 };
    }
    qsort(edge, n, sizeof *edge, by_ends);
    return n;
}

static size_t edge_end(const face_edge *edge, size_t n, size_t i)
{
    size_t end = i + 1;
    while (end < n && edge[end].lo == edge[i].lo && edge[end].hi == edge[i].hi) end++;
    return end;
}

/* patch (nf): disjoint sets of paired faces; balance (nf): at their roots, closing edges less
 * others. */
static void weigh_patches(const face_edge *edge, size_t n, const unsigned char *fate,
                          uint32_t *patch, long *balance)
{
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0, end; i < n; i = end) {
            size_t paired = 0, others = 0;
            uint32_t first = APSM_NONE;
            end = edge_end(edge, n, i);
            for (size_t k = i; k < end; k++) {
                others += fate[edge[k].face] == STAYS;
                if (fate[edge[k].face] != PAIRED) continue;
                if (paired++ == 0) first = edge[k].face;
                if (pass == 0) sets_join(patch, first, edge[k].face);
            }
            if (pass == 1 && paired == 1) balance[sets_root(patch, first)] += others == 1 ? 1 : -1;
        }
}

static apsm_status decide_pairs(const apsm_mesh *m, unsigned char *fate)
{
    bool any = false, all = true;
    for (size_t f = 0; f < m->nf; f++) {
        any |= fate[f] == PAIRED;
        all &= fate[f] != STAYS;
    }
    if (!any) return APSM_OK;
    face_edge *edge = malloc(3 * m->nf * sizeof *edge);
    uint32_t *patch = malloc(m->nf * sizeof *patch);
    long *balance = calloc(m->nf, sizeof *balance);
    const bool ok = edge && patch && balance;
    if (ok) {
        sets_init(patch, m->nf);
        weigh_patches(edge, list_edges(m, fate, edge), fate, patch, balance);
        for (uint32_t f = 0; f < m->nf; f++)
            if (fate[f] == PAIRED) fate[f] = all || balance[sets_root(patch, f)] > 0 ? STAYS : GOES;
    }
    free(edge);
    free(patch);
    free(balance);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}

apsm_status repair_faces(repair *r)
{
    apsm_mesh *m = &r->mesh;
    const size_t nv = m->nv, nf = m->nf;
    unsigned char *fate = calloc(nf, 1);
    named_face *list = malloc(nf * sizeof *list);
    apsm_status status = fate && list ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        size_t n = 0;
        for (uint32_t f = 0; f < nf; f++) {
            list[n] = name_face(m->F, f);
            const uint32_t *c = list[n].corner;
            if (c[0] == c[1] || c[1] == c[2])
                fate[f] = GOES;
            else
                n++;
        }
        r->report->degenerate_faces += nf - n;
        qsort(list, n, sizeof *list, by_corners);
        mark_duplicates(list, n, fate);
        status = decide_pairs(m, fate);
        if (status == APSM_OK) status = repair_drop(m, fate);
        r->report->duplicate_faces += n - m->nf;
        r->report->unused_vertices += nv - m->nv - r->report->merged_vertices;
    }
    free(fate);
    free(list);
    return status;
}
