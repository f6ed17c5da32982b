/* scratch_fixture.h -- a test's context and a folder that is gone when the test ends. */
#ifndef APSM_TEST_SCRATCH_FIXTURE_H
#define APSM_TEST_SCRATCH_FIXTURE_H

#include <stdlib.h>

#include "apsm/context.h"
#include "scratch.h"

typedef struct fixture {
    apsm_context *ctx;
    char folder[SCRATCH_LENGTH];
} fixture;

static int setup(void **state)
{
    fixture *const f = calloc(1, sizeof *f);
    if (!f) return -1;
    f->ctx = apsm_context_new();
    scratch_make(f->folder);
    *state = f;
    return f->ctx ? 0 : -1;
}

static int teardown(void **state)
{
    fixture *const f = *state;
    scratch_remove(f->folder);
    apsm_context_free(f->ctx);
    free(f);
    return 0;
}

#endif
