/* Subjects of several parts in the optimisation loop. */
#include "optimize/correspondence_loss.h"
#include "optimize/workspace.h"

optimizer *part_of(optimizer *op, size_t d, part_view *view)
{
    const apsm_cohort *c = op->cohort;
    if (!c->part) return op;
    const size_t first = c->first[d];
    optimizer *p = &view->op;
    *p = *op;
    view->state = *op->state;
    view->state.h = op->state->part[d].h;
    view->state.doubt = op->state->part[d].doubt;
    view->state.mean += 3 * first;
    p->state = &view->state;
    p->cohort = &c->part[d];
    p->J = c->first[d + 1] - first;
    p->R = points_of(op->o, p->J);
    p->d = d;
    p->first = first;
    p->tP += 3 * first;
    p->tN += 3 * first;
    p->h_j += first;
    p->N6 += first * APSM_NEIGHBOURS;
    p->on_rim += first;
    p->mean += 3 * first;
    p->anchors += d;
    p->fresh += d * op->I;
    p->record += d * op->I;
    if (p->kept) p->kept += d * op->I;
    return p;
}

void add_part(const optimizer *op, size_t d, double x, double *sum)
{
    const size_t from = cohort_first(op->cohort, d, op->J),
                 to = cohort_first(op->cohort, d + 1, op->J);
    *sum = d == 0 ? x : *sum + (x - *sum) * (double)(to - from) / (double)to;
}

double *part_rows(const optimizer *op)
{
    size_t most = 0;
    if (!op->cohort->part) return NULL;
    for (size_t d = 0; d < op->cohort->parts; d++) {
        const size_t J = op->cohort->first[d + 1] - op->cohort->first[d];
        most = J > most ? J : most;
    }
    return optimizer_doubles(op->I * most * 3);
}
