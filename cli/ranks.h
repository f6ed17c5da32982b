/* ranks.h -- the processes that mpirun or srun has started, if this build knows of MPI and there
 * are several; else one. */
#ifndef APSM_CLI_RANKS_H
#define APSM_CLI_RANKS_H

#include <stddef.h>

#include "apsm/run.h"

typedef struct cli_ranks {
    size_t rank, size; /* 0 of 1, if nobody else is there */
} cli_ranks;

/* First of all in main; argc and argv may lose what is MPI's. */
void cli_ranks_begin(int *argc, char ***argv);
cli_ranks cli_ranks_get(void);
/* How they wait for each other; only if there are several. */
const apsm_company *cli_ranks_company(void);
/* Last of all: with a code other than 0 all processes end.  Returns the code for main. */
int cli_ranks_end(int code);

#endif
