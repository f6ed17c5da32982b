/* Has moved; include "core/number.h". */
#include "core/number.h"
