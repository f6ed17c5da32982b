#include "apsm/status.h"

#include "apsm/version.h"

#define TEXT(name, text) text,
static const char *const texts[] = { APSM_STATUS_LIST(TEXT) };
#undef TEXT

const char *apsm_status_text(apsm_status status)
{
    return (unsigned)status < APSM_STATUS_COUNT ? texts[status] : "unknown status";
}

#define TEXT_OF(x) #x
#define TEXT(x)    TEXT_OF(x)
const char *apsm_version(void)
{
    return TEXT(APSM_VERSION_MAJOR) "." TEXT(APSM_VERSION_MINOR) "." TEXT(APSM_VERSION_PATCH);
}
