/* viewer.h -- the page without its data: report/viewer/dist/viewer.html, compiled in. */
#ifndef APSM_REPORT_VIEWER_H
#define APSM_REPORT_VIEWER_H

#include <stddef.h>

extern const unsigned char apsm_viewer_html[];
extern const size_t apsm_viewer_html_size;

#endif
