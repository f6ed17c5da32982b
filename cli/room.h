/* room.h -- limits that a shell may have set (ulimit). */
#ifndef APSM_CLI_ROOM_H
#define APSM_CLI_ROOM_H

#include "apsm/context.h"

/* Calls job(argc, argv) where there is stack enough: in a thread of its own if ulimit -s leaves the
 * program less than a megabyte, and then the threads that it starts have as much. */
int cli_with_stack(int (*job)(int argc, char **argv), int argc, char **argv);

/* Refuses a limit of address space (ulimit -v) under which OpenBLAS, which takes its buffers when
 * it is first called and waits for ever if it cannot have them, would not come back. */
apsm_status cli_check_room(apsm_context *ctx, int threads) APSM_NODISCARD;

#endif
