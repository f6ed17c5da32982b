/* Loads the DICOM plug-in on first use: from beside libapsm (a build folder) or from the folder
 * apsm/ beside it (an installation).  It is never unloaded; ITK does not survive that. */
#include <dlfcn.h>

#include <string>

#include "../guard.h"
#include "apsm/adapters.h"
#include "dicom_plugin.h"

using namespace apsm;

namespace
{

apsm_dicom_plugin_fn load_plugin()
{
    Dl_info here;
    if (!dladdr(reinterpret_cast<void *>(&apsm_dicom_read_volume), &here) || !here.dli_fname)
        return nullptr;
    const std::string file = here.dli_fname;
    const size_t slash = file.rfind('/');
    const std::string folder = slash == std::string::npos ? "./" : file.substr(0, slash + 1);
    void *library = dlopen((folder + APSM_DICOM_PLUGIN_FILE).c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!library)
        library = dlopen((folder + "apsm/" APSM_DICOM_PLUGIN_FILE).c_str(), RTLD_NOW | RTLD_LOCAL);
    return library
               ? reinterpret_cast<apsm_dicom_plugin_fn>(dlsym(library, APSM_DICOM_PLUGIN_SYMBOL))
               : nullptr;
}

} // namespace

extern "C" apsm_status apsm_dicom_read_volume(apsm_context *ctx, const char *folder,
                                              apsm_volume *volume)
{
    return guarded(ctx, folder, [&] {
        const apsm_dicom_plugin_fn read = load_plugin();
        if (!read)
            throw failure{ APSM_ERR_UNSUPPORTED,
                           "DICOM needs the plug-in " APSM_DICOM_PLUGIN_FILE
                           ", which is not installed; convert the series to NRRD or NIfTI" };
        char line[512] = "";
        const apsm_status status = read(folder, volume, line, sizeof line);
        if (status != APSM_OK) throw failure{ status, line };
    });
}
