/* Has moved; include "geometry/affine.h". */
#include "geometry/affine.h"
