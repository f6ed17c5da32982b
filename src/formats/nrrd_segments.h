/* nrrd_segments.h -- the names that Slicer gives the labels of a .seg.nrrd. */
#ifndef APSM_FORMATS_NRRD_SEGMENTS_H
#define APSM_FORMATS_NRRD_SEGMENTS_H

#include "apsm/volume.h"
#include "formats/header_line.h"

/* Takes up SegmentN_Name, SegmentN_LabelValue and SegmentN_Layer; passes over other keys. */
void read_segment_line(scan *s, const header_line *l, apsm_volume *volume);

#endif
