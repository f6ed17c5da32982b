/* Has moved; include "geometry/bvh.h". */
#include "geometry/bvh.h"
