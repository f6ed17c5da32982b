#include "apsm/status.h"

#define TEXT(name, text) text,
static const char *const texts[] = { APSM_STATUS_LIST(TEXT) };
#undef TEXT

const char *apsm_status_text(apsm_status status)
{
    return (unsigned)status < APSM_STATUS_COUNT ? texts[status] : "unknown status";
}
