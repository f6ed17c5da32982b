/* Has moved; include "evaluate/metrics.h". */
#include "evaluate/metrics.h"
