/* Options as the project of a model folder holds them. */
#include "options/options.h"

apsm_status apsm_options_of_project(apsm_context *ctx, const apsm_project *project,
                                    apsm_options *options)
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    *options = apsm_options_defaults();
    for (size_t k = 0; k < n; k++) {
        const char *value = apsm_project_get(project, "apsm", table[k].name);
        if (value) APSM_TRY(apsm_options_set(ctx, options, table[k].name, value));
    }
    return APSM_OK;
}
