/* Has moved; include "apsm/particles.h". */
#include "apsm/particles.h"
