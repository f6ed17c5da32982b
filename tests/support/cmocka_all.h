/* cmocka_all.h -- cmocka with what it needs before it, and the helpers every test uses. */
#ifndef APSM_TEST_CMOCKA_ALL_H
#define APSM_TEST_CMOCKA_ALL_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#define assert_ok(EXPR) assert_int_equal(EXPR, APSM_OK)

/* |got - want| <= tol, or the test fails with both numbers. */
#define assert_near(GOT, WANT, TOL)                                                                \
    do {                                                                                           \
        const double got_ = (GOT), want_ = (WANT), tol_ = (TOL);                                   \
        if (!(fabs(got_ - want_) <= tol_))                                                         \
            fail_msg("%s = %.17g, expected %.17g (tolerance %g)", #GOT, got_, want_, tol_);        \
    } while (0)

#endif
