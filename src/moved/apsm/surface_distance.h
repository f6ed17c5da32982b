/* Has moved; include "evaluate/surface_distance.h". */
#include "evaluate/surface_distance.h"
