/* One DICOM series of a folder as a volume: GDCM sorts the slices by position along the normal
 * of the stack, whatever the files are called. */
#include "dicom_plugin.h"

#include <cstdio>
#include <mutex>

#include <itkGDCMImageIO.h>
#include <itkGDCMSeriesFileNames.h>
#include <itkImageSeriesReader.h>

#include "labels.h"

using namespace apsm;

namespace
{

/* float holds every 16-bit value, and DICOM has no wider stored labels. */
using image = itk::Image<float, 3>;

std::vector<std::string> slices_of(const std::string &folder)
{
    const auto names = itk::GDCMSeriesFileNames::New();
    names->SetUseSeriesDetails(true);
    names->SetDirectory(folder);
    const auto series = names->GetSeriesUIDs();
    if (series.empty()) damaged("holds no DICOM image; give a folder with one series");
    if (series.size() > 1)
        damaged("holds " + std::to_string(series.size()) +
                " DICOM series; put each into a folder of its own");
    return names->GetFileNames(series.front());
}

void read_series(const std::string &folder, apsm_volume *volume)
{
    const auto reader = itk::ImageSeriesReader<image>::New();
    reader->SetImageIO(itk::GDCMImageIO::New());
    reader->SetFileNames(slices_of(folder));
    reader->Update();
    const image *const stack = reader->GetOutput();
    /* Set by the reader when the gaps between slices differ. */
    if (stack->GetMetaDataDictionary().HasKey("ITK_non_uniform_sampling_deviation"))
        damaged("its slices are not evenly spaced; is one missing?");
    apsm_volume v{};
    for (unsigned c = 0; c < 3; c++) {
        v.n[c] = stack->GetLargestPossibleRegion().GetSize(c);
        v.spacing[c] = stack->GetSpacing()[c];
        v.origin[c] = stack->GetOrigin()[c];
        for (unsigned r = 0; r < 3; r++) v.direction[3 * r + c] = stack->GetDirection()(r, c);
    }
    if (v.n[2] < 2) damaged("holds a single slice; give the whole stack");
    check_grid(&v);
    label_array labels = allocate_labels(v.n[0] * v.n[1] * v.n[2]);
    copy_labels<float>(stack->GetBufferPointer(), v.n, labels.get());
    v.label = labels.release();
    *volume = v;
}

std::mutex gdcm_lock; /* GDCM's dictionaries are global */

} // namespace

extern "C" __attribute__((visibility("default"))) apsm_status
apsm_dicom_plugin_read(const char *folder, apsm_volume *volume, char *line, size_t size)
{
    const std::lock_guard<std::mutex> lock(gdcm_lock);
    try {
        itk::Object::SetGlobalWarningDisplay(false);
        read_series(folder, volume);
        return APSM_OK;
    } catch (const failure &f) {
        std::snprintf(line, size, "%s", f.text.c_str());
        return f.status;
    } catch (const std::bad_alloc &) {
        std::snprintf(line, size, "out of memory; close other programs");
        return APSM_ERR_MEMORY;
    } catch (const itk::ExceptionObject &e) {
        std::snprintf(line, size, "%s; is it damaged? export it again",
                      one_line(e.GetDescription()).c_str());
    } catch (const std::exception &e) {
        std::snprintf(line, size, "%s; is it damaged? export it again", one_line(e.what()).c_str());
    } catch (...) {
        std::snprintf(line, size, "cannot be read as DICOM; export it again");
    }
    return APSM_ERR_FORMAT;
}
