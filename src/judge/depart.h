/* depart.h -- parts of a surface that lie where no other shape's does: missing, grown, or joined to
 * it, and too small for any particle to stand for them (docs/method.md, "Judging", (J4)). */
#ifndef APSM_JUDGE_DEPART_H
#define APSM_JUDGE_DEPART_H

#include "initialize/cohort.h"
#include "model/warp.h"

/* By the warp to the shape's own particles, by that to where the others say, and by what of the
 * surface lies beyond the warped points. */
enum { APSM_DEPART_LOOKS = 3 };

/* A part by one look. */
typedef struct apsm_departure {
    double times, excess; /* how many times the others' worst parts, and in standard deviations */
    double size;          /* how far beyond what is usual there, in h */
    uint32_t at;          /* the particle nearest to it */
} apsm_departure;

/* Points of the template's surface and what is found there of I shapes.  Owns its arrays. */
typedef struct apsm_departs {
    size_t n, I, J;                      /* points, shapes, particles */
    apsm_warp warp;                      /* of the points */
    uint32_t *nearest;                   /* n: the template's particle */
    double *distance[APSM_DEPART_LOOKS]; /* I x n, in h */
    double *usual, *spread;              /* I x n: of one look */
    double *most;                        /* I: of one look */
    apsm_departure *found;               /* I: by one look */
    double *scratch;                     /* 3 I */
} apsm_departs;

/* n 0: particles P (I x J x 3, world) are too few or too flat to warp anything by. */
apsm_status apsm_departs_make(apsm_context *ctx, const apsm_cohort *cohort, size_t J,
                              const double *P, apsm_departs *d);
void apsm_departs_free(apsm_departs *d);

/* Doubles that are needed to look at a shape. */
size_t apsm_depart_work_size(const apsm_departs *d);
/* The distances of shape i with own particles P and those that the others predict (J x 3, world); h
 * is its spacing there. */
void apsm_depart_look(const apsm_departs *d, size_t i, const apsm_shape *shape, const double *P,
                      const double *predicted, double h, double *work);

/* found <- that of each shape by look k; where (I x J) <- how many times what is usual there around
 * each particle, or more by an earlier look.  The distances become those from what is usual. */
void apsm_depart_compare(apsm_departs *d, size_t k, double *where);

#endif
