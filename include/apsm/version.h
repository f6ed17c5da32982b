/* version.h -- of the headers, and of the library that is there at run time. */
#ifndef APSM_VERSION_H
#define APSM_VERSION_H

#include "apsm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define APSM_VERSION_MAJOR 0
#define APSM_VERSION_MINOR 1
#define APSM_VERSION_PATCH 0

/* "MAJOR.MINOR.PATCH" of the library; a constant text. */
APSM_API const char *apsm_version(void);

#ifdef __cplusplus
}
#endif
#endif
