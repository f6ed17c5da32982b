#include "folder/evaluation_json.h"

json_t *evaluation_json_distance(const apsm_distance_summary *d)
{
    return json_pack("{s:f, s:f, s:f, s:f, s:f}", "mean", d->mean, "median", d->median, "p95",
                     d->p95, "p99", d->p99, "max", d->max);
}
