/* Has moved; include "geometry/topology.h". */
#include "geometry/topology.h"
