/* The named definitions of the metrics. */
#include <stdint.h>

#include "evaluate/metrics.h"

typedef struct definition {
    const char *name, *text, *warning;
    size_t samples, modes;
} definition;

static const definition *look_up(apsm_definition d)
{
    static const definition table[] = {
        [APSM_DEFINITION_STANDARD] = { "standard",
                                       "specificity: Gaussian samples with the modes' variances "
                                       "(divisor N-1)",
                                       NULL, 1000, SIZE_MAX },
        [APSM_DEFINITION_PAPER] = { "paper",
                                    "specificity: samples uniform in +-3 standard deviations of "
                                    "every mode",
                                    NULL, 25000, 20 },
        [APSM_DEFINITION_SHAPEWORKS] = { "shapeworks-compat",
                                         "specificity: Gaussian samples whose variance is the "
                                         "singular value, as in ShapeWorks",
                                         "shapeworks-compat: this specificity samples with the "
                                         "singular value where the variance belongs, so it depends "
                                         "on the unit of the input; compare it only with "
                                         "ShapeWorks "
                                         "in the same unit",
                                         1000, SIZE_MAX },
    };
    return &table[d];
}

const char *apsm_definition_name(apsm_definition d)
{
    return look_up(d)->name;
}
const char *apsm_definition_text(apsm_definition d)
{
    return look_up(d)->text;
}
const char *apsm_definition_warning(apsm_definition d)
{
    return look_up(d)->warning;
}
size_t apsm_definition_samples(apsm_definition d)
{
    return look_up(d)->samples;
}
size_t apsm_definition_modes(apsm_definition d)
{
    return look_up(d)->modes;
}
