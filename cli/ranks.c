#include "ranks.h"

#ifdef APSM_MPI

#include <mpi.h>
#include <stdbool.h>
#include <stdint.h>
#include <time.h>

void cli_ranks_begin(int *argc, char ***argv)
{
    int given; /* threads compute, but only the one that calls the verbs talks to others */
    MPI_Init_thread(argc, argv, MPI_THREAD_SERIALIZED, &given);
}

cli_ranks cli_ranks_get(void)
{
    int rank, size;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    return (cli_ranks){ (size_t)rank, (size_t)size };
}

/* MPI's own waiting takes a processor that others could use. */
static void await(MPI_Request *request)
{
    const struct timespec nap = { .tv_nsec = 2000000 };
    for (int done = 0;;) {
        MPI_Test(request, &done, MPI_STATUS_IGNORE);
        if (done) return;
        nanosleep(&nap, NULL);
    }
}

static size_t meet(void *user, size_t value)
{
    uint64_t mine = value, most = 0;
    MPI_Request request;
    (void)user;
    MPI_Iallreduce(&mine, &most, 1, MPI_UINT64_T, MPI_MAX, MPI_COMM_WORLD, &request);
    await(&request);
    return (size_t)most;
}

static void gather(void *user, size_t bytes, const void *own, void *all)
{
    MPI_Request request;
    (void)user;
    MPI_Iallgather(own, (int)bytes, MPI_BYTE, all, (int)bytes, MPI_BYTE, MPI_COMM_WORLD, &request);
    await(&request);
}

const apsm_company *cli_ranks_company(void)
{
    static const apsm_company company = { NULL, meet, gather };
    return cli_ranks_get().size > 1 ? &company : NULL;
}

int cli_ranks_end(int code)
{
    MPI_Request request;
    if (code != 0 && cli_ranks_get().size > 1) MPI_Abort(MPI_COMM_WORLD, code);
    MPI_Ibarrier(MPI_COMM_WORLD, &request);
    await(&request);
    MPI_Finalize();
    return code;
}

#else

void cli_ranks_begin(int *argc, char ***argv)
{
    (void)argc, (void)argv;
}

cli_ranks cli_ranks_get(void)
{
    return (cli_ranks){ 0, 1 };
}

const apsm_company *cli_ranks_company(void)
{
    return NULL;
}

int cli_ranks_end(int code)
{
    return code;
}

#endif
