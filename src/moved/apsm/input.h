/* Has moved; include "input/input.h". */
#include "input/input.h"
