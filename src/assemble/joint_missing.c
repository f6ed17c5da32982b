/* A subject without some part: where its other parts are in the world is not known, since the world
 * was laid by all parts.  So the pose is as many modes more of the model, and so wide that the
 * parts that are there decide: three of moving, three of turning about the mean's centre c, and
 * with size removed one of growing, x_j + t,   x_j + w x (x_j - c),   x_j + s (x_j - c), each of
 * length 1 and of the variance of moving all particles by the joint's radius. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "assemble/joint_fit.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"

enum { POSE_MODES = 7 };

bool joint_pose_is_free(const joint_model *m, const bool *there)
{
    bool missing = false;
    for (size_t d = 0; d < m->n; d++) missing = missing || !there[d];
    if (!m->aligned || !missing || m->alignment == APSM_JOINT_APART) return false;
    return m->alignment == APSM_JOINT_GLOBAL || !there[m->align_by];
}

/* Row k of the pose: what moves x (of n particles) about c. */
static void pose_row(size_t k, size_t n, const double *x, const double c[3], double *row)
{
    double length2 = 0, axis[3] = { 0 };
    axis[k % 3] = 1;
    for (size_t j = 0; j < n; j++) {
        double from[3], *to = row + 3 * j;
        vec3_sub(x + 3 * j, c, from);
        if (k < 3)
            memcpy(to, axis, sizeof axis);
        else if (k < 6)
            vec3_cross(axis, from, to);
        else
            memcpy(to, from, sizeof from);
        length2 += vec3_dot(to, to);
    }
    for (size_t a = 0; a < 3 * n && length2 > 0; a++) row[a] /= sqrt(length2);
}

apsm_status joint_with_pose(const joint_model *m, bool free, const posterior_model *q,
                            joint_posterior *p)
{
    const size_t more = !free ? 0 : m->scale ? POSE_MODES : POSE_MODES - 1, J = q->D / 3;
    p->q = *q;
    p->q.M += more;
    p->rows = malloc((p->q.M * (q->D + 1) + 1) * sizeof *p->rows);
    if (!p->rows) return APSM_ERR_MEMORY;
    double *variance = p->rows + p->q.M * q->D, c[3] = { 0 };
    memcpy(p->rows, q->mode, q->M * q->D * sizeof *p->rows);
    memcpy(variance, q->variance, q->M * sizeof *variance);
    for (size_t j = 0; j < J; j++) vec3_add_scaled(c, 1.0 / (double)J, q->mean + 3 * j);
    for (size_t k = 0; k < more; k++) {
        pose_row(k, J, q->mean, c, p->rows + (q->M + k) * q->D);
        variance[q->M + k] = (double)J * m->radius * m->radius;
    }
    p->q.mode = p->rows;
    p->q.variance = variance;
    return APSM_OK;
}

/* expected (D, out) <- the model's particles by the scores b, its pose left out. */
static void expect(const posterior_model *q, size_t modes, const double *b, double *expected)
{
    memcpy(expected, q->mean, q->D * sizeof *expected);
    for (size_t k = 0; k < modes; k++)
        for (size_t a = 0; a < q->D; a++) expected[a] += b[k] * q->mode[k * q->D + a];
}

/* The map that lays the parts that are there on what is expected of them; they and the subject's
 * maps follow. */
static void follow(const joint_model *m, const double *expected, double *packed,
                   joint_subject_fit *s)
{
    size_t n = 0;
    double T[16], *from = packed, *to = packed + 3 * m->folder.J;
    for (size_t d = 0; d < m->n; d++) {
        const model_part *p = &m->folder.part[d];
        if (!s->fitted[d]) continue;
        memcpy(from + 3 * n, s->world + 3 * p->first, 3 * p->J * sizeof *from);
        memcpy(to + 3 * n, expected + 3 * p->first, 3 * p->J * sizeof *to);
        n += p->J;
    }
    apsm_affine_fit(n, from, to, NULL, m->scale, T);
    for (size_t d = 0; d < m->n; d++) {
        double *x = s->world + 3 * m->folder.part[d].first;
        apsm_affine_multiply(T, s->M + 16 * d, s->M + 16 * d);
        if (s->fitted[d]) apsm_affine_apply(T, m->folder.part[d].J, x, x);
    }
}

apsm_status joint_find_pose(const joint_model *m, const joint_posterior *p, size_t modes,
                            const double *error, joint_subject_fit *s)
{
    enum { TURNS = 4 }; /* turning is not linear */
    const size_t D = p->q.D, M = p->q.M;
    double *b = malloc((M + M * M + 3 * D + posterior_particles_work_size(&p->q)) * sizeof *b);
    if (!b) return APSM_ERR_MEMORY;
    double *expected = b + M + M * M, *packed = expected + D, *work = packed + 2 * D;
    posterior_scores scores = { .b = b, .B = b + M };
    apsm_status status = APSM_OK;
    for (int k = 0; k < TURNS && status == APSM_OK; k++) {
        status = posterior_of_particles(&p->q, s->world, error, &scores, NULL, NULL, work);
        if (status != APSM_OK) break;
        expect(&p->q, modes, b, expected);
        follow(m, expected, packed, s);
    }
    free(b);
    return status;
}
