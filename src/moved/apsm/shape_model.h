/* Has moved; include "model/shape_model.h". */
#include "model/shape_model.h"
