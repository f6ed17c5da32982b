/* regions.h -- constraints: the part of every shape that counts, and all after it sees. */
#ifndef APSM_RUN_REGIONS_H
#define APSM_RUN_REGIONS_H

#include "align/align.h"
#include "run/groom_inputs.h"

/* Reads the constraints of the shapes listed: option constraints, a file or a folder, goes before
 * the project's columns (source, or NULL). */
apsm_status regions_list(apsm_run *run, groom_inputs *in, const apsm_project *source);

/* Cuts every shape to its region; shapes without constraints get those of the template, or of the
 * first that has some, by registration (docs/method.md, "Open surfaces and regions").  The whole
 * surfaces are kept in in->whole.  *cut: whether there are constraints. */
apsm_status groom_cut_regions(apsm_run *run, groom_inputs *in, const apsm_alignment *alignment,
                              bool *cut);

#endif
