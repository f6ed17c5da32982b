/* icp.h -- what the other files of alignment share. */
#ifndef APSM_GROOM_ICP_H
#define APSM_GROOM_ICP_H

#include "apsm/align.h"

/* Inverse of a similarity, proper or not. */
void apsm_similarity_invert(const double M[16], double inverse[16]);

/* As apsm_icp, but with closest cloud points for closest points: rough and fast, for clouds of
 * about a hundred points. */
void apsm_icp_coarse(const apsm_surface *moving, const apsm_surface *fixed,
                     const apsm_icp_options *opt, double M[16], double *residual, double *work);

#endif
