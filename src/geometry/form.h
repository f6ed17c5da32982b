/* form.h -- what the surface looks like around a particle, in whatever pose: how high it lies, on
 * average, over the particle's tangent plane, near and farther away.  Where particles correspond,
 * these heights agree from shape to shape (docs/method.md, "Judging"). */
#ifndef APSM_GEOMETRY_FORM_H
#define APSM_GEOMETRY_FORM_H

#include "apsm/mesh.h"

enum { APSM_FORM_SCALES = 3 };

/* Radii in mean neighbour distances: constant, APSM_FORM_SCALES of them. */
extern const double apsm_form_radius[APSM_FORM_SCALES];

/* Doubles that the faces of a mesh of nf take. */
size_t apsm_form_size(size_t nf);
/* faces (apsm_form_size, out): centre, unit normal, area of each face, near ones together. */
void apsm_form_faces(const apsm_mesh *mesh, double *faces);

/* height (J x APSM_FORM_SCALES, out) around points P with unit normals N (J x 3 each): the mean,
 * over the area within the radius times h that looks the same way, of the height over the tangent
 * plane, in units of the radius.  faces: of a mesh of nf.  O(J (nf / 8 + faces within reach)). */
void apsm_form_heights(size_t nf, const double *faces, size_t J, const double *P, const double *N,
                       double h, double *height);

/* How well own heights at the particles agree with usual ones (J x APSM_FORM_SCALES each) at the
 * particles `at` (J; NULL: the same): the mean over the scales of Fisher's z of their correlation,
 * 0 where that is negative.  tanh of it is a correlation again. */
double apsm_form_agreement(size_t J, const double *own, const double *usual, const uint32_t *at);

#endif
