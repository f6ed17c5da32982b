/* Has moved; include "linalg/polyharmonic.h". */
#include "linalg/polyharmonic.h"
