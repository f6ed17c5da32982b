/* turns.h -- would a shape's particles suit the others better if it were turned, or the mirror
 * image? */
#ifndef APSM_JUDGE_TURNS_H
#define APSM_JUDGE_TURNS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A shape and what is usual in the others; all borrowed, J particles, one pose and size. */
typedef struct apsm_turns_input {
    size_t J;
    double h;                  /* mean neighbour distance */
    const double *P, *N;       /* J x 3: the shape's particles and unit normals */
    const double *X, *XN;      /* J x 3: usual ones */
    const double *own, *usual; /* J x APSM_FORM_SCALES: heights, see form.h */
    const double *spread;      /* J x APSM_FORM_SCALES: how far others are from usual ones */
} apsm_turns_input;

/* The best of the other ways to lay the shape on the usual one. */
typedef struct apsm_turn {
    double agreement; /* of form, apsm_form_agreement; -INFINITY: there is no other way */
    double fit;       /* root mean square distance of the particles from usual ones, in h */
    double M[16];     /* how P would have to be moved; det < 0: mirrored */
    bool mirrored;
    double staying;  /* mirrored: the same of ways that leave the particles about where they are, as
                        they do of a shape that is thinner than they are apart */
    double evidence; /* least of all other ways: that the heights are as usual where they are and
                        not as usual there (J2a); INFINITY: there is no other way */
} apsm_turn;

/* Scratch in doubles. */
size_t apsm_turns_work_size(size_t J);

/* Looks for turns (and, mirrored, turns of the mirror image) that lay the particles on usual ones,
 * from the 24 turns of a cube between their principal frames; those that put less than a tenth of
 * the particles farther than two spacings from where they are now are none.  own_fit (out): as fit,
 * for the particles as they are.  at: scratch, J.  O(J) for J over 128. */
void apsm_turns_search(const apsm_turns_input *in, bool mirrored, apsm_turn *best, double *own_fit,
                       double *work, uint32_t *at);

#endif
