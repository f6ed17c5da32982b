/* golden.h -- reads tests/golden/NAME.json into arrays of doubles and compares with them.
 * Include after cmocka.h.  APSM_GOLDEN is the folder. */
#ifndef APSM_TEST_GOLDEN_H
#define APSM_TEST_GOLDEN_H

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* The whole file; json_decref by the caller. */
static inline json_t *golden_load(const char *name)
{
    char path[4096];
    json_error_t error;
    snprintf(path, sizeof path, "%s/%s.json", APSM_GOLDEN, name);
    json_t *root = json_load_file(path, 0, &error);
    if (!root) fail_msg("%s:%d: %s", path, error.line, error.text);
    return root;
}

/* Member of an object, which must be there (borrowed). */
static inline json_t *golden_get(const json_t *object, const char *key)
{
    json_t *value = json_object_get(object, key);
    if (!value) fail_msg("golden file has no \"%s\" here", key);
    return value;
}

static inline double golden_number(const json_t *object, const char *key)
{
    return json_number_value(golden_get(object, key));
}

/* Numbers (null: NAN) of an arbitrarily nested list, depth first. */
static inline size_t golden_count(const json_t *list)
{
    if (!json_is_array(list)) return 1;
    size_t count = 0;
    for (size_t i = 0; i < json_array_size(list); i++)
        count += golden_count(json_array_get(list, i));
    return count;
}

static inline double *golden_fill(const json_t *list, double *out)
{
    if (!json_is_array(list)) {
        *out = json_is_number(list)    ? json_number_value(list)
               : json_is_boolean(list) ? (double)json_is_true(list)
                                       : NAN;
        return out + 1;
    }
    for (size_t i = 0; i < json_array_size(list); i++)
        out = golden_fill(json_array_get(list, i), out);
    return out;
}

/* A nested list as one row-major array, freed by the caller.  expected: how many numbers there
 * must be; 0: any. */
static inline double *golden_array(const json_t *list, size_t expected)
{
    const size_t count = golden_count(list);
    if (expected && count != expected)
        fail_msg("golden list has %zu numbers, expected %zu", count, expected);
    double *out = malloc((count ? count : 1) * sizeof *out);
    if (!out) fail_msg("out of memory");
    golden_fill(list, out);
    return out;
}

/* The same for a member of an object. */
static inline double *golden_member(const json_t *object, const char *key, size_t expected)
{
    return golden_array(golden_get(object, key), expected);
}

/* |got - want| <= tol (1 + |want|) for each of n; says where it fails. */
static inline void golden_close(const char *what, size_t n, const double *got, const double *want,
                                double tol)
{
    for (size_t i = 0; i < n; i++)
        if (!(fabs(got[i] - want[i]) <= tol * (1.0 + fabs(want[i]))))
            fail_msg("%s[%zu] = %.17g, expected %.17g (tolerance %g)", what, i, got[i], want[i],
                     tol);
}

/* |got - want| <= tol * (largest |want|): for vectors whose small entries carry the error of the
 * large ones. */
static inline void golden_close_max(const char *what, size_t n, const double *got,
                                    const double *want, double tol)
{
    double largest = 0.0;
    for (size_t i = 0; i < n; i++) largest = fmax(largest, fabs(want[i]));
    for (size_t i = 0; i < n; i++)
        if (!(fabs(got[i] - want[i]) <= tol * largest))
            fail_msg("%s[%zu] = %.17g, expected %.17g (tolerance %g of %g)", what, i, got[i],
                     want[i], tol, largest);
}

#endif
