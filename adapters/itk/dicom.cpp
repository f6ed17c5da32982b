/* Loads the DICOM plug-in on first use: from beside libapsm (a build folder) or from the folder
 * apsm/ beside it (an installation).  It is never unloaded; ITK does not survive that. */
#include <dlfcn.h>
#include <unistd.h>

#include <string>

#include "../guard.h"
#include "apsm/adapters.h"
#include "dicom_plugin.h"

using namespace apsm;

namespace
{

[[noreturn]] void not_there(const std::string &why)
{
    throw failure{ APSM_ERR_UNSUPPORTED, "DICOM needs the plug-in " APSM_DICOM_PLUGIN_FILE
                                         ", which " +
                                             why + "; convert the series to NRRD or NIfTI" };
}

apsm_dicom_plugin_fn load_plugin()
{
    Dl_info here;
    if (!dladdr(reinterpret_cast<void *>(&apsm_dicom_read_volume), &here) || !here.dli_fname)
        not_there("cannot be searched for");
    const std::string file = here.dli_fname;
    const size_t slash = file.rfind('/');
    const std::string folder = slash == std::string::npos ? "./" : file.substr(0, slash + 1);
    for (const char *below : { "", "apsm/" }) {
        const std::string path = folder + below + APSM_DICOM_PLUGIN_FILE;
        if (access(path.c_str(), R_OK)) continue;
        void *const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
        void *const read = library ? dlsym(library, APSM_DICOM_PLUGIN_SYMBOL) : nullptr;
        if (!read) not_there(one_line("cannot be loaded (" + std::string(dlerror()) + ")"));
        return reinterpret_cast<apsm_dicom_plugin_fn>(read);
    }
    not_there("is not installed");
}

} // namespace

extern "C" apsm_status apsm_dicom_read_volume(apsm_context *ctx, const char *folder,
                                              apsm_volume *volume)
{
    return guarded(ctx, folder, [&] {
        const apsm_dicom_plugin_fn read = load_plugin();
        char line[512] = "";
        const apsm_status status = read(folder, volume, line, sizeof line);
        if (status != APSM_OK) throw failure{ status, line };
    });
}
