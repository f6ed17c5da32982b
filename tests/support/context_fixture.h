/* context_fixture.h -- the one context of a group of tests. */
#ifndef APSM_TEST_CONTEXT_FIXTURE_H
#define APSM_TEST_CONTEXT_FIXTURE_H

#include "apsm/context.h"

static apsm_context *ctx;

static int set_up(void **state)
{
    (void)state;
    ctx = apsm_context_new();
    return ctx ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    apsm_context_free(ctx);
    return 0;
}

#endif
