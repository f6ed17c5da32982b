/* apsm.h -- all of the library's public face.  docs/library.md says how to use it. */
#ifndef APSM_H
#define APSM_H

#include "apsm/certify.h"
#include "apsm/compare.h"
#include "apsm/context.h"
#include "apsm/contour.h"
#include "apsm/evaluate.h"
#include "apsm/exchange.h"
#include "apsm/fit.h"
#include "apsm/formats.h"
#include "apsm/joint.h"
#include "apsm/mesh.h"
#include "apsm/model.h"
#include "apsm/options.h"
#include "apsm/particles.h"
#include "apsm/render.h"
#include "apsm/report.h"
#include "apsm/run.h"
#include "apsm/statistics.h"
#include "apsm/status.h"
#include "apsm/version.h"
#include "apsm/volume.h"

#endif
