/* dicom_plugin.h -- what libapsm and its DICOM plug-in agree on.  The plug-in is a file of its
 * own, since GDCM's libraries take longer to load than all others together. */
#ifndef APSM_ADAPTERS_ITK_DICOM_PLUGIN_H
#define APSM_ADAPTERS_ITK_DICOM_PLUGIN_H

#include "apsm/volume.h"

#define APSM_DICOM_PLUGIN_FILE   "apsm-dicom.so"
#define APSM_DICOM_PLUGIN_SYMBOL "apsm_dicom_plugin_read"

/* volume->label is malloc'ed; on failure line (size bytes) says why. */
extern "C" typedef apsm_status (*apsm_dicom_plugin_fn)(const char *folder, apsm_volume *volume,
                                                       char *line, size_t size);

#endif
