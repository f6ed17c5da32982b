/* Has moved; include "files/files.h". */
#include "files/files.h"
