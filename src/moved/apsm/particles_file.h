/* Has moved; include "files/particles_file.h". */
#include "files/particles_file.h"
