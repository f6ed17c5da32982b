/* Has moved; include "files/project.h". */
#include "files/project.h"
