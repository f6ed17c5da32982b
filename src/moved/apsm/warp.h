/* Has moved; include "model/warp.h". */
#include "model/warp.h"
