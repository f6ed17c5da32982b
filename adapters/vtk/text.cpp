/* One line of text as an image, in the font that VTK brings along: the same on every machine, and
 * no fonts need be installed. */
#include <cstdlib>
#include <cstring>

#include <vtkAutoInit.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkStdString.h>
#include <vtkTextProperty.h>
#include <vtkTextRenderer.h>

#include "../guard.h"
#include "apsm/adapters.h"

VTK_MODULE_INIT(vtkRenderingFreeType)

using namespace apsm;

namespace
{

enum { POINTS_A_PIXEL = 72 }; /* dots an inch at which a point is a pixel */

void draw(const char *text, size_t pixels, bool bold, vtkImageData *image)
{
    vtkNew<vtkTextProperty> style;
    int size[2];
    style->SetFontFamilyToArial();
    style->SetFontSize(static_cast<int>(pixels));
    style->SetColor(1.0, 1.0, 1.0);
    style->SetBold(bold);
    vtkTextRenderer *renderer = vtkTextRenderer::GetInstance();
    if (!renderer) throw failure{ APSM_ERR_UNSUPPORTED, "this VTK cannot draw text" };
    renderer->SetScaleToPowerOfTwo(false);
    if (!renderer->RenderString(style, vtkStdString(text), image, size, POINTS_A_PIXEL,
                                vtkTextRenderer::FreeType))
        throw failure{ APSM_ERR_UNSUPPORTED, "cannot be drawn as text" };
}

/* The alpha channel, rows from the top. */
unsigned char *coverage_of(vtkImageData *image, size_t *width, size_t *height)
{
    const int *e = image->GetExtent();
    if (e[1] < e[0] || e[3] < e[2]) return nullptr;
    const size_t w = static_cast<size_t>(e[1] - e[0]) + 1, h = static_cast<size_t>(e[3] - e[2]) + 1;
    auto *out = static_cast<unsigned char *>(std::malloc(w * h));
    if (!out) throw std::bad_alloc();
    for (size_t y = 0; y < h; y++)
        for (size_t x = 0; x < w; x++)
            out[y * w + x] = static_cast<const unsigned char *>(image->GetScalarPointer(
                e[0] + static_cast<int>(x), e[3] - static_cast<int>(y), e[4]))[3];
    *width = w;
    *height = h;
    return out;
}

} // namespace

apsm_status apsm_vtk_text(apsm_context *ctx, const char *text, size_t pixels, bool bold,
                          size_t *width, size_t *height, unsigned char **coverage)
{
    *width = *height = 0;
    *coverage = nullptr;
    return guarded(ctx, text, [&] {
        vtkNew<vtkImageData> image;
        if (!*text) return;
        draw(text, pixels, bold, image);
        *coverage = coverage_of(image, width, height);
    });
}
