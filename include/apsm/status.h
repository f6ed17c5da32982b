/* status.h -- what every fallible function of apsm returns. */
#ifndef APSM_STATUS_H
#define APSM_STATUS_H

#ifdef __cplusplus
extern "C" {
#endif

/* Functions of the public face; all others are hidden in the shared library. */
#if defined(__GNUC__)
#define APSM_API __attribute__((visibility("default")))
#else
#define APSM_API
#endif

/* One list makes the enum and the texts.  Append only: the values are part of the ABI. */
#define APSM_STATUS_LIST(X)                                                                        \
    X(APSM_OK, "success")                                                                          \
    X(APSM_ERR_ARG, "argument missing or out of range")                                            \
    X(APSM_ERR_MEMORY, "out of memory")                                                            \
    X(APSM_ERR_IO, "file could not be read or written")                                            \
    X(APSM_ERR_FORMAT, "file is damaged or of an unknown format")                                  \
    X(APSM_ERR_GEOMETRY, "shape cannot be used")                                                   \
    X(APSM_ERR_SINGULAR, "system of equations is singular")                                        \
    X(APSM_ERR_NONFINITE, "computation left the finite numbers")                                   \
    X(APSM_ERR_INTERRUPTED, "interrupted")                                                         \
    X(APSM_ERR_UNSUPPORTED, "not supported by this build")                                         \
    X(APSM_ERR_STATE, "project is not in the state this step needs")

#define APSM_STATUS_ENUM(name, text) name,
typedef enum apsm_status { APSM_STATUS_LIST(APSM_STATUS_ENUM) APSM_STATUS_COUNT } apsm_status;
#undef APSM_STATUS_ENUM

/* The text of a status; a constant string, never NULL. */
APSM_API const char *apsm_status_text(apsm_status status);

#if defined(__GNUC__)
#define APSM_NODISCARD         __attribute__((warn_unused_result))
#define APSM_PRINTF(fmt, args) __attribute__((format(printf, fmt, args)))
#else
#define APSM_NODISCARD
#define APSM_PRINTF(fmt, args)
#endif

/* Return from the calling function with the status of EXPR if it is not APSM_OK. */
#define APSM_TRY(EXPR)                                                                             \
    do {                                                                                           \
        const apsm_status apsm_try_ = (EXPR);                                                      \
        if (apsm_try_ != APSM_OK) return apsm_try_;                                                \
    } while (0)

#ifdef __cplusplus
}
#endif
#endif
