/* fan.h -- geometry of the faces around a vertex or an edge, for the decisions of remeshing. */
#ifndef APSM_GROOM_FAN_H
#define APSM_GROOM_FAN_H

#include "groom/surgery.h"

/* Area vector (twice the area times the normal) of h's face. */
void fan_face_normal(const surgery *s, uint32_t h, double n[3]);

/* If v were at x: whether every face around it (but skip1, skip2) still faces its way and has
 * not become a needle. */
bool fan_keeps_facing(const surgery *s, uint32_t v, const double x[3], uint32_t skip1,
                      uint32_t skip2);
/* If v were at x: whether its old place would be no farther than `away` from the faces around it
 * (but skip1, skip2). */
bool fan_stays(const surgery *s, uint32_t v, const double x[3], double away, uint32_t skip1,
               uint32_t skip2);

/* Quality of h's face: 1 equilateral, 0 without area. */
double fan_face_quality(const surgery *s, uint32_t h);
/* If v were at x: lowest quality of the faces around it. */
double fan_quality(const surgery *s, uint32_t v, const double x[3]);

/* Middle g of v's fan (area-weighted, areas counted in local edges) and its unit normal n; false
 * if the fan has no area. */
bool fan_middle(const surgery *s, uint32_t v, double g[3], double n[3]);

/* Whether the smaller quality of the two faces after a flip is more than `factor` times that
 * before. */
bool fan_flip_gains(const surgery *s, uint32_t h, double factor);
/* Whether the edge's two diagonals pass within `away` and the new faces keep facing the way of
 * the old ones. */
bool fan_flip_is_flat(const surgery *s, uint32_t h, double away);

#endif
